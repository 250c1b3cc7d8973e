"""What the results of a study mean: comparison with Persson theory, tables, figures, export."""
