"""Compiled kernels of conjugate gradients in the stress; see `dual`.

The points that may move are those whose contact state is at least `threshold`; the stress of all
others is zero. The target of a move is s + length d - highest - shift there, or zero if that is
negative, where `highest` is the largest of s + length d. Each kernel computes the targets anew.
"""

import numpy as np

from gfmd_cli.grid.compilation import kernel, part_of_kernel
from gfmd_cli.solvers.contact_state import FREE, PENETRATING, PRESSED


@kernel
def classify(h, obstacle, sigma, gap, contact_state, out, a, b):
    """Compute the contact state; sums of squares of the gap of pressed and penetrating points."""
    for i in range(a, b):
        inside = outside = 0.0
        for j in range(h.shape[1]):
            g = gap[i, j]
            pressed = sigma[i, j] > 0
            penetrating = not pressed and g < 0 and obstacle[i, j] == h[i, j]
            inside += g * g if pressed else 0.0
            outside += g * g if penetrating else 0.0
            contact_state[i, j] = PRESSED if pressed else (PENETRATING if penetrating else FREE)
        out[i, 0], out[i, 1] = inside, outside


@kernel
def products(z, gap, change, last, contact_state, threshold, out, a, b):
    """Sums over the points that may move: z gap, z change, z, gap, change, last direction, 1."""
    for i in range(a, b):
        slope = z_change = z_sum = gap_sum = change_sum = last_sum = 0.0
        count = 0
        for j in range(z.shape[1]):
            moves = contact_state[i, j] >= threshold
            one = z[i, j] if moves else 0.0
            slope += one * gap[i, j]
            z_change += one * change[i, j]
            z_sum += one
            gap_sum += gap[i, j] if moves else 0.0
            change_sum += change[i, j] if moves else 0.0
            last_sum += last[i, j] if moves else 0.0
            count += moves
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = slope, z_change, z_sum, gap_sum
        out[i, 4], out[i, 5], out[i, 6] = change_sum, last_sum, count


@kernel
def combine(z, z_mean, beta, mean, sigma, gap, contact_state, threshold, direction, out, a, b):
    """direction <- z_mean - z + beta direction - mean on the points that may move, else zero.

    Sums, over these points except those without stress whose direction is tensile, of the
    direction, of minus direction times gap, of the gap, and of 1.
    """
    for i in range(a, b):
        total = descent = gap_sum = 0.0
        count = 0
        for j in range(z.shape[1]):
            d = (z_mean - z[i, j]) + beta * direction[i, j] - mean
            d = d if contact_state[i, j] >= threshold else 0.0
            direction[i, j] = d
            d = direction[i, j]  # as rounded
            moving = contact_state[i, j] >= threshold and (sigma[i, j] > 0 or d > 0)
            total += d if moving else 0.0
            descent -= d * gap[i, j] if moving else 0.0
            gap_sum += gap[i, j] if moving else 0.0
            count += moving
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = total, descent, gap_sum, count


@kernel
def subtract_mean(direction, mean, sigma, contact_state, threshold, a, b):
    """Subtract the mean; zero where the direction makes a stress of zero tensile."""
    for i in range(a, b):
        for j in range(direction.shape[1]):
            d = direction[i, j]
            moving = contact_state[i, j] >= threshold and (sigma[i, j] > 0 or d > 0)
            direction[i, j] = d - mean if moving else 0.0


@part_of_kernel
def _distances(s, d, length, highest, row):
    """Write s + length d - highest of a row of points, from which the shift is then subtracted.

    The loops are separate, so that s + length d is rounded as in `highest_target`, and so that the
    compiler does not add highest and shift first, which loses a shift that is far smaller.
    """
    for j in range(s.size):
        row[j] = s[j] + length * d[j]
    for j in range(s.size):
        row[j] -= highest


@kernel
def highest_target(sigma, direction, length, contact_state, threshold, out, a, b):
    """Largest s + length d of each row, and the number of points where it is negative."""
    row = np.empty(sigma.shape[1])
    for i in range(a, b):
        highest, count = out[i, 0], 0
        _distances(sigma[i], direction[i], length, 0.0, row)
        for j in range(sigma.shape[1]):
            target = row[j]
            moves = contact_state[i, j] >= threshold
            highest = max(highest, target) if moves else highest
            count += moves and target < 0
        out[i, 0], out[i, 1] = highest, count


@kernel
def kept_targets(sigma, direction, length, highest, shift, contact_state, threshold, out, a, b):
    """Sum of s + length d - highest over the points where it is above the shift; their number."""
    row = np.empty(sigma.shape[1])
    for i in range(a, b):
        total, count = 0.0, 0
        _distances(sigma[i], direction[i], length, highest, row)
        for j in range(sigma.shape[1]):
            target = row[j]
            kept = contact_state[i, j] >= threshold and target > shift
            total += target if kept else 0.0
            count += kept
        out[i, 0], out[i, 1] = total, count


@kernel
def write_move(
    sigma, direction, length, highest, shift, gap, contact_state, threshold, move, out, a, b
):
    """Write the move to the targets; return the sum of minus move times gap."""
    row = np.empty(sigma.shape[1])
    for i in range(a, b):
        fall = 0.0
        _distances(sigma[i], direction[i], length, highest, row)
        for j in range(sigma.shape[1]):
            target = max(row[j] - shift, 0.0)
            step = target - sigma[i, j] if contact_state[i, j] >= threshold else 0.0
            move[i, j] = step
            fall -= step * gap[i, j]
        out[i, 0] = fall


@kernel
def curvature(move, change, out, a, b):
    """Sums of move times change, of the squares of the change and of those of the move."""
    for i in range(a, b):
        product = changed = moved = 0.0
        for j in range(move.shape[1]):
            m, c = np.float64(move[i, j]), np.float64(change[i, j])
            product, changed, moved = product + m * c, changed + c * c, moved + m * m
        out[i, 0], out[i, 1], out[i, 2] = product, changed, moved


@kernel
def crossing(sigma, direction, length, out, a, b):
    """Number of points at which the stress would become tensile."""
    for i in range(a, b):
        count = 0
        for j in range(sigma.shape[1]):
            count += sigma[i, j] + length * direction[i, j] < 0
        out[i, 0] = count


@kernel
def advance(
    sigma,
    gap,
    direction,
    length,
    highest,
    shift,
    fraction,
    contact_state,
    threshold,
    change,
    out,
    a,
    b,
):
    """Take a fraction of the move and of the change of the gap; the sums of `gap_in_contact`."""
    row = np.empty(sigma.shape[1])
    for i in range(a, b):
        total, count = 0.0, 0
        _distances(sigma[i], direction[i], length, highest, row)
        for j in range(sigma.shape[1]):
            s, target = sigma[i, j], max(row[j] - shift, 0.0)
            new = target if fraction == 1.0 else max(s + fraction * (target - s), 0.0)
            new = new if contact_state[i, j] >= threshold else 0.0
            moved = fraction * change[i, j]
            sigma[i, j], change[i, j], gap[i, j] = new, moved, gap[i, j] + moved
            total += gap[i, j] if new > 0 else 0.0
            count += new > 0
        out[i, 0], out[i, 1] = total, count
