"""Scenes: a surface and an elastomer on a grid, in the units of the surface."""

from dataclasses import replace
from itertools import starmap
from math import sqrt

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field, Mask, aligned, dot, row_blocks
from gfmd_cli.grid.fft_grid import Grid, Shape
from gfmd_cli.grid.ranks import Ranks
from gfmd_cli.physics.contact import Scene
from gfmd_cli.physics.indenters import RigidSurface
from gfmd_cli.physics.linear_elastomer import LinearElastomer
from gfmd_cli.physics.persson import shells
from gfmd_cli.physics.surfaces import sample
from gfmd_cli.physics.waves import mirrored_power, radial_power
from gfmd_cli.units import SCALE_RANGE


def build_scene(
    surface: RigidSurface,
    elastomer: LinearElastomer,
    points: int,
    threads: int = 1,
    ranks: Ranks | None = None,
    *,
    points_y: int = 0,
) -> Scene:
    """Sample the surface and reduce heights and stiffness to the scales of the resolved surface.

    Raises InputError where the grid does not resolve the surface, the surface is flat, or a scale
    is out of range.

    Parameters
    ----------
    points, points_y : numbers of grid points along x and y; by default the pixels are square
    threads : threads of the transforms and kernels
    ranks : the processes that share large grids
    """
    grid, height = sample(surface, points, points_y, ranks)
    if threads > 1:
        grid = replace(grid, threads=threads)
    scene = reduce_scene(grid, height, elastomer, _shape_with_all_waves(surface, grid))
    return replace(scene, may_touch=touchable(surface.void(scene.grid), scene.grid))


def _shape_with_all_waves(surface: RigidSurface, grid: Grid) -> Shape:
    """Shape of the coarsest grid of every 2nd, 4th, ... point that resolves all waves of a surface.

    That of the grid itself where the shortest wave is not known, or processes share the grid.
    """
    if not grid.whole:
        return grid.whole_shape
    least = (surface.smallest_grid_y(), surface.smallest_grid())[-grid.dimension :]
    shape = tuple(starmap(_coarsest, zip(grid.whole_shape, least, strict=True)))
    # `band_limited` of a map may need a transform: asked only where the answer matters
    return shape if shape == grid.whole_shape or surface.band_limited else grid.whole_shape


def _coarsest(points: int, least: int) -> int:
    """The smallest of points, points / 2, points / 4, ... above `least`, if it is a whole number.

    On `least` points, the shortest wave is that of the Nyquist wavenumber, whose phase is lost.
    """
    while points % 2 == 0 and points // 2 > least:
        points //= 2
    return points


def touchable(void: Mask | None, grid: Grid) -> Mask | None:
    """The points of a grid that can touch, where some cannot; None where all can.

    Raises InputError where no point can.
    """
    if void is None:
        return None
    if not grid.any(~void):
        raise InputError('surface.missing: "void" leaves no point that can touch')
    return ~void


def reduce_scene(
    grid: Grid,
    height: Field,
    elastomer: LinearElastomer,
    shape: Shape | None = None,
    *,
    is_mirrored: bool = False,
) -> Scene:
    """Reduce heights [m], which are overwritten, and stiffness to the scales of the surface.

    Parameters
    ----------
    shape : of a grid of every 2nd, 4th, ... point that has all waves of the surface, too
    is_mirrored : whether the waves are those of the heights mirrored to twice the sides of the cell
    """
    blocks = [height[rows] for rows in row_blocks(height)]
    sums, highest, lowest = zip(*((b.sum(), b.max(), b.min()) for b in blocks), strict=True)
    mean = grid.total(float(sum(sums))) / grid.size
    largest = grid.max(float(max(max(highest) - mean, mean - min(lowest))))
    squares = 0.0
    for block in blocks:
        block -= mean
        block /= largest  # squares of heights of 1e-200 m would vanish
        squares += dot(block, block)
    rms = sqrt(grid.total(squares) / grid.size)
    for block in blocks:
        block *= 1 / rms
    stiffness, stiffest = _stiffness(grid, elastomer)
    if is_mirrored:
        m, power, modes = mirrored_power(grid, height)
    else:
        m, power, modes = radial_power(*_thinned(grid, height, shape or grid.whole_shape))
    q = m * (2 * np.pi / grid.length)
    k = elastomer.stiffness(q, grid.length)
    unit = elastomer.unit_stiffness(q, grid.length)
    with np.errstate(over="ignore"):  # refused below
        reduced = float(np.sqrt(np.sum(power * (unit / stiffest) ** 2)))  # Eq. (23)
    h_std = largest * rms
    delta_sigma = reduced * stiffest * h_std
    scales = {
        "L": max(grid.sides),
        "the spacing of the grid": min(grid.spacings),
        "h_std": h_std,
        "h_std times the largest k(q)": stiffest * h_std,
        "Delta_sigma": delta_sigma,
    }
    for name, scale in scales.items():
        if not SCALE_RANGE[0] <= scale <= SCALE_RANGE[1]:
            raise InputError(
                f"surface, elastomer: {name} = {scale:g} is out of range, "
                f"{SCALE_RANGE[0]:g} to {SCALE_RANGE[1]:g}: choose other units"
            )
    stiffness /= reduced
    return Scene(
        grid=grid,
        height=height,
        stiffness=stiffness,
        mean_height=mean,
        h_std=h_std,
        delta_sigma=delta_sigma,
        shells=shells(q, power * h_std**2, k, elastomer.gamma(q, grid.length), modes),
    )


def _thinned(grid: Grid, height: Field, shape: Shape) -> tuple[Grid, Field]:
    """A coarser grid of this shape, and the heights at its points."""
    if shape == grid.whole_shape:
        return grid, height
    every = zip(grid.whole_shape, shape, strict=True)
    return grid.coarser(shape), height[tuple(slice(None, None, n // m) for n, m in every)]


def _stiffness(grid: Grid, elastomer: LinearElastomer) -> tuple[Field, float]:
    """k(q) over the half-spectrum in units of its largest value, and that value."""
    k = aligned(grid.spectral_shape, np.float64)
    count = len(k) // 2 + 1 if grid.dimension == 2 else len(k)  # the rows q_y >= 0
    with np.errstate(over="ignore"):  # refused below
        for rows in row_blocks(k[:count]):
            k[rows] = elastomer.stiffness(grid.wavenumber(rows), grid.length)
    half = k[:count]
    stiffest = grid.max(float(half.max()))
    if not (np.isfinite(stiffest) and stiffest > 0):
        raise InputError(f"elastomer: stiffness {stiffest} at the shortest wave is out of range")
    half /= stiffest
    waves = half.ravel()[1:] if grid.ends[0] else half  # the first is q = 0
    softest = grid.min(float(waves.min()))
    if not softest >= SCALE_RANGE[0]:
        raise InputError(f"elastomer: stiffness falls to {softest:g} of its largest value")
    k[count:] = k[len(k) - count : 0 : -1]
    return k, stiffest
