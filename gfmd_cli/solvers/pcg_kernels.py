"""Compiled kernels of projected conjugate gradients; see `pcg`.

`padded` is the array `Grid.padded`: its rows have two values more than the grid has points.
"""

from gfmd_cli.grid.compilation import kernel, part_of_kernel
from gfmd_cli.solvers.contact_state import FREE, PRESSED, TENSILE


@part_of_kernel
def _assess_point(gap, s):
    """Squares of violation, free force and tension of a point, and its contact state."""
    smaller, square = min(gap, s), s * s
    free, tense = gap != 0.0, s < 0.0
    return (
        smaller * smaller,
        square if free else 0.0,
        square if tense and not free else 0.0,
        FREE if free else (TENSILE if tense else PRESSED),
    )


@kernel
def classify(h, u, sigma, contact_state, out, a, b):
    """Compute the contact state; sums of squares of violation, free force and tension."""
    for i in range(a, b):
        violation = free = tension = 0.0
        for j in range(h.shape[1]):
            v, f, t, contact_state[i, j] = _assess_point(u[i, j] - h[i, j], sigma[i, j])
            violation, free, tension = violation + v, free + f, tension + t
        out[i, 0], out[i, 1], out[i, 2] = violation, free, tension


@kernel
def update_direction(
    h, u, sigma, state, threshold, beta, direction, is_kept, length, padded, out, a, b
):
    """Set the direction d to z + beta d on the free points, and compute the move along it.

    z is in `padded`, where the move max(u + length d, h) - u takes its place. The direction stays
    where it `is_kept`. Returns the sums of direction times force, of move times force and of the
    squares of the move, and the number of points stopped at h.
    """
    for i in range(a, b):
        descent = fall = square = 0.0
        stopped = 0
        # Two loops, because the compiler does not vectorise one loop over as many arrays.
        if not is_kept:
            for j in range(h.shape[1]):
                d = padded[i, j] + beta * direction[i, j]
                direction[i, j] = 0.0 if state[i, j] >= threshold else d
        for j in range(h.shape[1]):
            d = direction[i, j]  # as rounded
            step, room = length * d, h[i, j] - u[i, j]
            move = max(step, room)
            stopped += step < room
            descent -= d * sigma[i, j]
            fall -= move * sigma[i, j]
            square += move * move
            padded[i, j] = move
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = descent, fall, square, stopped


@kernel
def crossing(h, u, direction, length, out, a, b):
    """Number of points at which u + length d is below h."""
    for i in range(a, b):
        count = 0
        for j in range(h.shape[1]):
            count += length * direction[i, j] < h[i, j] - u[i, j]
        out[i, 0] = count


@kernel
def advance(h, u, sigma, direction, length, fraction, padded, change, contact_state, out, a, b):
    """Take a fraction of the move; `padded` is K times the move. Returns the sums of `classify`.

    u += fraction move, sigma += change, change = fraction K move.
    """
    for i in range(a, b):
        violation = free = tension = 0.0
        for j in range(h.shape[1]):
            floor, old = h[i, j], u[i, j]
            move = max(length * direction[i, j], floor - old)
            new = max(old + fraction * move, floor)
            if fraction == 1.0:
                new = max(old + length * direction[i, j], floor)
            moved = fraction * padded[i, j]
            u[i, j], sigma[i, j], change[i, j] = new, sigma[i, j] + moved, moved
            v, f, t, contact_state[i, j] = _assess_point(u[i, j] - floor, sigma[i, j])  # as rounded
            violation, free, tension = violation + v, free + f, tension + t
        out[i, 0], out[i, 1], out[i, 2] = violation, free, tension
