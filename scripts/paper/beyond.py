"""What the paper leaves open: plates, and what theory makes of the true contact."""

FIGURES = ()
