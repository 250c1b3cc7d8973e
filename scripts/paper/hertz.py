"""Figs. 1 to 3: a ridge, and a paraboloid on every body."""

FIGURES = ()
