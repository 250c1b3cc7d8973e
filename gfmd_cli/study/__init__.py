"""Studies: tasks, runs, workers, checkpoints, the study file, Slurm."""
