"""Height maps: the files that contain them, their preparation, interpolation and parameters."""
