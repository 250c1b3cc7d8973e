"""Compiled kernels of the start on tiles; see `local_start` and `grid.rows`."""

import numpy as np

from gfmd_cli.grid.compilation import kernel, part_of_kernel
from gfmd_cli.solvers.tiles import SIDE

BATCH_SIZE = 8  # tiles that are convolved at once: the 8 numbers of a point lie next to each other
WINDOW_WIDTH = 3 * SIDE * BATCH_SIZE  # numbers of a row of points in the 3 x 3 tiles around each
TILE_WIDTH = SIDE * BATCH_SIZE  # numbers between points of neighbouring tiles


@kernel
def mark_penetrated(w, level, h, used, penetrated, sums, a, b):
    """Mark the tiles that are not used in which w - level is below h somewhere.

    `sums` receives the sum of w^2 of each row.
    """
    below = np.empty(h.shape[1], np.bool_)
    for i in range(a, b):
        squares = 0.0
        for j in range(h.shape[1]):
            below[j] = w[i, j] - level < h[i, j]
            squares += w[i, j] * w[i, j]
        sums[i, 0] = squares
        for block in range(used.shape[1]):
            somewhere = False
            for j in range(SIDE * block, SIDE * block + SIDE):
                somewhere |= below[j]
            if somewhere and not used[i // SIDE, block]:
                penetrated[i // SIDE, block] = True


@kernel
def convolve(values, neighbours, quadrant, out, a, b):
    """Convolve values on the tiles [a, b) with a kernel that is even along both axes.

    `values` has the shape (tiles + 1, 64), zero in the last row; `neighbours` and `out` are as in
    `Tiles`. `quadrant` holds the kernel at distances from 0 to 8, shape (9, 9), halved for each
    distance of 0: values at opposite distances are added before they are multiplied.
    """
    window = np.empty((3 * SIDE, WINDOW_WIDTH), np.float32)
    pairs = np.empty(WINDOW_WIDTH, np.float32)
    row = np.empty(TILE_WIDTH, np.float32)
    for first in range(a, b, BATCH_SIZE):
        count = min(BATCH_SIZE, b - first)
        for t in range(count):
            for n in range(9):
                tile = values[neighbours[first + t, n]]
                for i in range(SIDE):
                    for j in range(SIDE):
                        column = SIDE * (n % 3) + j
                        window[SIDE * (n // 3) + i, BATCH_SIZE * column + t] = tile[SIDE * i + j]
        for i in range(SIDE):
            row[:] = 0.0
            for y in range(SIDE + 1):
                above, below = window[SIDE + i - y], window[SIDE + i + y]
                for j in range(WINDOW_WIDTH):
                    pairs[j] = above[j] + below[j]
                for x in range(0, SIDE + 1, 3):  # three at a time, which saves loads and stores
                    k0, k1, k2 = quadrant[y, x], quadrant[y, x + 1], quadrant[y, x + 2]
                    left = pairs[TILE_WIDTH - BATCH_SIZE * (x + 2) :]
                    right = pairs[TILE_WIDTH + BATCH_SIZE * x :]
                    for j in range(TILE_WIDTH):
                        row[j] += (
                            k0 * (left[j + 2 * BATCH_SIZE] + right[j])
                            + k1 * (left[j + BATCH_SIZE] + right[j + BATCH_SIZE])
                            + k2 * (left[j] + right[j + 2 * BATCH_SIZE])
                        )
            for j in range(SIDE):
                for t in range(count):
                    out[first + t, SIDE * i + j] = row[BATCH_SIZE * j + t]


@kernel
def balance(s, gap, active, force):
    """Subtract the mean gap under pressure from the gap; return the sum of min(gap, s)^2.

    Active are the points with s > 0 or a negative gap. The force on them is minus the gap, with
    the mean zero.
    """
    s, gap, active, force = s.ravel(), gap.ravel(), active.ravel(), force.ravel()
    total, count = 0.0, 0
    for i in range(s.size):
        if s[i] > 0:
            total += gap[i]
            count += 1
    level = total / count
    total, count, squares = 0.0, 0, 0.0
    for i in range(s.size):
        gap[i] -= level
        active[i] = s[i] > 0 or gap[i] < 0
        if active[i]:
            squares += min(gap[i], s[i]) ** 2
            total += gap[i]
            count += 1
    mean = total / count
    for i in range(s.size):
        force[i] = mean - gap[i] if active[i] else 0.0
    return squares


@kernel
def find_move(z, s, active, force, last_force, last, direction, move, old_slope, length, total):
    """The direction from the preconditioned force z, and the projected move of this length.

    Points that are not active do not move. `last` is the last direction, `old_slope` the product
    z force of that step. `total` is the sum of s. Returns z force, and whether the projection clips
    a stress. The formulas are those of `projected_move`.
    """
    z, s, active, move = z.ravel(), s.ravel(), active.ravel(), move.ravel()
    force, last_force = force.ravel(), last_force.ravel()
    last, direction = last.ravel(), direction.ravel()
    slope, last_slope = _products(z, active, force, last_force)
    beta = max(0.0, (slope - last_slope) / old_slope) if old_slope > 0 else 0.0
    if _find_direction(z, beta, last, s, active, force, direction) <= 0:
        _find_direction(z, 0.0, last, s, active, force, direction)
    return slope, _project(s, direction, length, active, total, move)


@part_of_kernel
def _products(z, active, force, last_force):
    """Balance z on the active points, with zeros elsewhere; return z force and z last_force."""
    total, count = 0.0, 0
    for i in range(z.size):
        if active[i]:
            total += z[i]
            count += 1
    mean = np.float32(total / count)
    product, last_product = 0.0, 0.0
    for i in range(z.size):
        z[i] = z[i] - mean if active[i] else 0.0
        product += z[i] * force[i]
        last_product += z[i] * last_force[i]
    return product, last_product


@part_of_kernel
def _find_direction(z, beta, last, s, active, force, direction):
    """`direction` <- the feasible direction of z + beta last; return its product with the force."""
    total, count = 0.0, 0
    for i in range(s.size):
        direction[i] = z[i] + beta * last[i]
        if active[i]:
            total += direction[i]
            count += 1
    mean = total / count
    total, count = 0.0, 0
    for i in range(s.size):
        if active[i] and (s[i] > 0 or direction[i] > mean):
            total += direction[i]
            count += 1
    mean_of_moving = total / count
    descent = 0.0
    for i in range(s.size):
        is_moving = active[i] and (s[i] > 0 or direction[i] > mean)
        direction[i] = direction[i] - mean_of_moving if is_moving else 0.0
        descent += direction[i] * force[i]
    return descent


@part_of_kernel
def _project(s, direction, length, active, total, move):
    """`move` <- that to s + length direction, projected on stresses >= 0 with this sum.

    Until the end, the first numbers of `move` are the targets of the points that are kept.
    """
    count, highest, is_clipped = 0, -np.inf, False
    for i in range(s.size):
        if active[i]:
            target = s[i] + length * direction[i]
            move[count] = target
            count += 1
            highest = max(highest, target)
            is_clipped |= target < 0
    last_count = s.size + 1
    while count < last_count:
        last_count, count, kept_sum = count, 0, 0.0
        for i in range(last_count):
            kept_sum += move[i] - highest
        shift = (kept_sum - total) / last_count
        for i in range(last_count):
            if move[i] - highest > shift:  # one is always kept
                move[count] = move[i]
                count += 1
    for i in range(s.size):
        target = s[i] + length * direction[i]
        move[i] = max(target - highest - shift, 0.0) - s[i] if active[i] else 0.0
    return is_clipped
