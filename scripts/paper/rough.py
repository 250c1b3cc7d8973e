"""Figs. 4 to 13: random roughness."""

FIGURES = ()
