"""Directions and projections of moves of the stress, by the formulas of the compiled kernels."""

import numpy as np


def feasible(direction, stress):
    """A direction with the mean zero, and zero where it would make a stress of zero tensile."""
    direction = direction - direction.mean()
    moving = (stress > 0) | (direction > 0)
    return np.where(moving, direction - direction[moving].mean(), 0.0)


def new_direction(z, last, stress, force):
    """The feasible direction of z + last, or of z alone where that raises the energy."""
    direction = feasible(z + last, stress)
    return direction if direction @ force > 0 else feasible(z, stress)


def projected(stress, total):
    """The nearest stresses >= 0 with this sum, by bisection of the shift."""
    low, high = stress.min() - total, stress.max()
    for _ in range(200):
        middle = 0.5 * (low + high)
        too_low = np.maximum(stress - middle, 0.0).sum() > total
        low, high = (middle, high) if too_low else (low, middle)
    return np.maximum(stress - low, 0.0)
