"""Work-precision runs: speed against error of the solvers."""
