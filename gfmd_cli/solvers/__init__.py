"""Solvers of the contact problem and the one loop that drives them."""
