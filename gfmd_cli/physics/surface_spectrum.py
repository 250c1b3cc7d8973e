"""Power spectral density of a surface in bands of wavenumber, with the self-affine fit."""

from dataclasses import dataclass
from math import nan, pi, prod

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.files.file_cache import file_cache
from gfmd_cli.grid.arrays import Field, row_blocks
from gfmd_cli.grid.modes import multiplicity
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.indenters import RigidSurface
from gfmd_cli.physics.linear_elastomer import LinearElastomer
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.scenes import reduce_scene
from gfmd_cli.physics.spectrum_fit import SelfAffineFit, fit
from gfmd_cli.physics.surfaces import sample

BANDS_PER_DECADE = 10  # a choice
ROUNDING = 1e-9  # of a wavenumber, and of the power of a map, relative


@dataclass(frozen=True)
class Spectrum:
    """A <|h(q)|^2>, which figures call C(q): the mean over a band, times the area A of the cell.

    Modes that the surface lacks are left out: of equal tiles, it is too large by their number. In a
    line contact, the length of the cell takes the place of its area.
    """

    q: Field
    """Mean wavenumber of each band, weighted by |h(q)|^2 [1/m]."""
    density: Field
    """C(q) [m^4], of a line contact [m^3]."""
    modes: Field
    """Number of modes of each band that the surface has."""
    fitted: Field
    """C(q) of the fit in the bands, zero beyond its cut-off and without a fit."""
    fit: SelfAffineFit | None
    """The nearest self-affine surface; None where there is none."""
    no_fit: str = ""
    """Why there is none, where that is known."""


def spectrum(shells: Shells, sides: tuple[float, ...], points: tuple[int, ...]) -> Spectrum:
    """The spectrum of a surface from the sums over its shells.

    Waves shorter than two grid points along a side are left out.

    Parameters
    ----------
    sides, points : of the cell and of its grid, along y and x or along x alone
    """
    # the largest wavenumber of which the grid has the waves of all directions [1/m]
    nyquist = pi / max(side / count for side, count in zip(sides, points, strict=True))
    nearest, no_fit = None, "a line has no fit"
    if len(sides) == 2:
        try:
            nearest, no_fit = fit(shells, nyquist), ""
        except InputError as error:
            no_fit = str(error)
    edges = _edges(shells.q, nyquist)
    place = np.searchsorted(edges, shells.q)  # 0 and edges.size are outside
    fitted = nearest.density(shells.q) * shells.modes if nearest else np.zeros_like(shells.q)
    weights = (shells.height, shells.height * shells.q, shells.modes, fitted)
    sums = np.array([np.bincount(place, each, edges.size + 1)[1:-1] for each in weights])
    total, moment, modes, fitted = sums[:, sums[0] > 0]
    per_mode = prod(sides) / modes
    return Spectrum(moment / total, total * per_mode, modes, fitted * per_mode, nearest, no_fit)


@file_cache(maxsize=4)
def map_spectrum(surface: RigidSurface) -> Spectrum | None:
    """The spectrum of a map with borders, tapered towards them; None for any other surface.

    A mirrored map has kinks, whose spectrum hides that of short waves. Cached: all contacts of a
    surface have the same.
    """
    tapered = surface.tapered_map()
    if tapered is None:
        return None
    grid, heights = sample(tapered, tapered.smallest_grid(), is_temporary=True)
    scene = reduce_scene(grid, heights, HalfSpace())
    return spectrum(scene.shells, scene.grid.sides, scene.grid.whole_shape)


@file_cache(maxsize=4)
def short_wave_factor(surface: RigidSurface, elastomer: LinearElastomer) -> float:
    """Factor by which the shortest waves of a map increase Delta_sigma, Eq. (23).

    These are the waves from two points or, if it is longer, the lateral period limit to twice this
    length; shorter ones are left out. 1 if the map has no such waves; NaN if it has no longer ones,
    and for any other surface. A map with borders is tapered.
    """
    if not surface.is_map:
        return nan
    used = surface.tapered_map() or surface
    heights = np.atleast_2d(used.resolved_heights())
    modes = np.fft.rfft2(heights)
    steps = [side / n for side, n in zip(used.sides[::-1], heights.shape[::-1], strict=False)]
    x = 2 * pi * np.fft.rfftfreq(heights.shape[1], steps[0])
    y = 2 * pi * np.fft.fftfreq(heights.shape[0], steps[-1])[:, None]
    shortest = surface.period_limit() or 2 * max(steps)
    ends = np.array([1.0, 0.5]) * (1 + ROUNDING) * 2 * pi / shortest
    sums = np.zeros(2)
    for block in row_blocks(modes):
        q = np.hypot(y[block], x)
        power = np.square(modes[block].real) + np.square(modes[block].imag)
        power *= multiplicity(heights.shape[1]) * elastomer.stiffness(q, surface.sides[-1]) ** 2
        sums += [power[q <= end].sum() for end in ends]
    return float(np.sqrt(sums[0] / sums[1])) if sums[1] > ROUNDING * sums[0] else nan


def _edges(q: Field, nyquist: float) -> Field:
    """Edges of bands half-way between shells, about BANDS_PER_DECADE in a decade [1/m]."""
    between = np.sqrt(q[1:] * q[:-1])
    ends = np.concatenate([[0.5 * q[0]], between, [q[-1] * (1 + 1e-6)]])
    within = ends[ends < nyquist]  # on it, opposite modes are one
    chosen = [ends[0]]
    for edge in within[1:]:
        if edge >= chosen[-1] * 10 ** (1 / BANDS_PER_DECADE):
            chosen.append(edge)
    if len(chosen) > 1:
        chosen[-1] = within[-1]  # the last band is wider rather than that a shell is lost
    return np.array(chosen)
