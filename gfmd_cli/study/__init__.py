"""Studies: the run spec, its tasks, the store, checkpoints and the runner."""
