"""Power spectral density C(q) of a surface in bands of wavenumber, with the self-affine fit."""

from dataclasses import dataclass
from math import pi, prod

import numpy as np

from gfmd_cli.analysis.table import TableColumn
from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.spectrum_fit import SelfAffineFit, fit

BANDS_PER_DECADE = 10  # a choice
FIT = (
    TableColumn("H", "hurst", ".2f", error="hurst_error", optional=True),
    TableColumn("lambda_r", "rolloff_wavelength", ".3g", "m", "rolloff_error", "no_rolloff", True),
    TableColumn("lambda_s", "cutoff_wavelength", ".3g", "m", optional=True),
    TableColumn("scatter", "scatter", ".3g", optional=True),
)
"""Columns of the fit, with the keys of `Spectrum.fit_record`."""


@dataclass(frozen=True)
class Spectrum:
    """C(q) = A <|h(q)|^2>: the mean over the modes of a band, times the area of the cell.

    In a line contact, the length of the cell takes the place of its area A.
    """

    dimension: int
    q: Field
    """Mean wavenumber of each band, weighted by |h(q)|^2 [1/m]."""
    density: Field
    """C(q) [m^4], of a line contact [m^3]."""
    modes: Field
    """Number of modes of each band."""
    fit: SelfAffineFit | None
    """The nearest self-affine surface; None where there is none."""
    no_fit: str
    """Why there is none."""
    fitted: Field
    """C(q) of the fit in the bands, zero beyond its cut-off and without a fit."""

    @property
    def fit_record(self) -> dict[str, float | None]:
        """The parameters of the fit [m], as the columns FIT show them; empty without a fit."""
        if self.fit is None:
            return {}
        keys = (key for column in FIT for key in (column.value, column.error) if key)
        return {str(key): getattr(self.fit, str(key)) for key in keys}


def nearest_fit(
    shells: Shells, sides: tuple[float, ...], points: tuple[int, ...]
) -> tuple[SelfAffineFit | None, str]:
    """The nearest self-affine surface, or None and why there is none; arguments of `spectrum`."""
    if len(sides) == 1:
        return None, "a line has no fit"
    try:
        return fit(shells, _nyquist(sides, points)), ""
    except InputError as error:
        return None, str(error)


def spectrum(
    shells: Shells,
    sides: tuple[float, ...],
    points: tuple[int, ...],
    best: tuple[SelfAffineFit | None, str] | None = None,
) -> Spectrum:
    """The spectrum of a surface from the sums over its shells.

    Waves shorter than two grid points along a side are left out.

    Parameters
    ----------
    sides, points : of the cell and of its grid, along y and x or along x alone
    best : what `nearest_fit` returns; by default for the same shells
    """
    nyquist = _nyquist(sides, points)
    nearest, no_fit = nearest_fit(shells, sides, points) if best is None else best
    edges = _edges(shells.q, nyquist)
    place = np.searchsorted(edges, shells.q) - 1
    inside = (place >= 0) & (place < edges.size - 1)
    fitted = nearest.density(shells.q) * shells.modes if nearest else np.zeros_like(shells.q)
    total, moment, modes, fitted = (
        np.bincount(place[inside], weight[inside], edges.size - 1).astype(float)
        for weight in (shells.height, shells.height * shells.q, shells.modes, fitted)
    )
    usable = total > 0
    total, moment, modes, fitted = (x[usable] for x in (total, moment, modes, fitted))
    per_mode, q = prod(sides) / modes, moment / total
    return Spectrum(len(sides), q, total * per_mode, modes, nearest, no_fit, fitted * per_mode)


def _nyquist(sides: tuple[float, ...], points: tuple[int, ...]) -> float:
    """The largest wavenumber of which a grid has the waves of all directions [1/m]."""
    return pi / max(side / count for side, count in zip(sides, points, strict=True))


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
