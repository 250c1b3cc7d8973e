"""Comparison of a study with Persson theory, tables and figures."""
