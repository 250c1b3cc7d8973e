"""Single paraboloids in contact: fields along the diagonal of the cell, and fits to them."""

from dataclasses import dataclass
from itertools import product

import exact_solutions as reference
import numpy as np
from scipy.optimize import curve_fit

from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from paper.claims import Value
from paper.studies import StoredStudies

INSIDE = (0.8, 0.9, 0.95)  # shares of the contact radius up to which stress is fitted
BEGINS, ENDS = (3, 4, 6), (0.3, 0.4, 0.5)  # gap: from so many points to so many radii off the edge


def spread(values: list[float]) -> Value:
    """Median, and half of the distance between the extremes."""
    return Value(float(np.median(values)), float(np.ptp(values) / 2))


@dataclass(frozen=True)
class Tip:
    """A contact from its axis to the corner of the cell, in units of k, R and L."""

    n: float
    points: int
    force: float
    area: float
    r: np.ndarray
    sigma: np.ndarray
    u: np.ndarray
    """Displacement less its mean over the cell."""
    gap: np.ndarray

    @property
    def spacing(self) -> float:
        """Distance of points along the diagonal."""
        return float(np.sqrt(2) / self.points)

    @property
    def curvature(self) -> float:
        """1 / R of the tip plus the contribution of the periodic images."""
        return 1 + reference.hertz_cell_curvature(self.n, 1.0, self.force)

    def point(self, n: float | None = None) -> np.ndarray:
        """Displacement by a point force in the same cell, of another exponent if given."""
        along = self.r / np.sqrt(2)
        with np.errstate(invalid="ignore"):
            return self.force * reference.periodic_point_force(
                self.n if n is None else n, along, along
            )

    def far(self, a: float) -> np.ndarray:
        """As `point`, plus the second moment a^2 / (3 - n/2) of the stress; 0 < n < 4."""
        moment = a**2 / (3 - self.n / 2)
        return self.point() - moment / 4 * self.point(self.n - 2)


def tips(studies: StoredStudies, name: str) -> list[Tip]:
    """The contacts of a study, by n, force and grid."""
    contacts = []
    for row in studies.rows(name):
        section = studies.section(name, row)
        half = slice(row["points"] // 2, None)
        u, height = section["u"][half], section["height"][half]
        place = np.arange(u.size) / row["points"] * np.sqrt(2)
        mean = row["mean_height"] + row["mean_gap"]
        sigma, gap = section["sigma"][half], np.maximum(u - height, 0.0)
        about = (row["n"], row["points"], row["pressure"], row["a_r"])
        contacts.append(Tip(*about, place, sigma, u - mean, gap))
    return sorted(contacts, key=lambda tip: (tip.n, tip.force, tip.points))


def style_of(n: float, exponents: list[float]) -> CurveStyle:
    """The colour and symbol of an exponent among others."""
    place = exponents.index(n)
    return CurveStyle(colours(len(exponents))[place], MARKERS[place % len(MARKERS)], f"n = {n:g}")


def stress_fit(tip: Tip, exponent: float | None = None) -> tuple[Value, Value]:
    """Contact radius and exponent nu of (1 - r^2/a^2)^nu, which may be given."""
    start = np.sqrt(tip.area / np.pi)
    fits = []
    for inside in INSIDE:
        m = tip.r < inside * start
        m[0] = True

        def shape(r, peak, a, nu=exponent):
            return peak * np.maximum(1 - (r / a) ** 2, 1e-9) ** nu

        first = [tip.sigma[0], 1.005 * start] + [1 - tip.n / 2] * (exponent is None)
        parameters, _ = curve_fit(shape, tip.r[m], tip.sigma[m], p0=first, maxfev=20000)
        fits.append((parameters[1], parameters[2] if exponent is None else exponent))
    radii, exponents = np.transpose(fits).tolist()
    return spread(radii), spread(exponents)


def gap_fit(tip: Tip) -> tuple[Value, Value]:
    """Contact radius a and exponent of the gap: (r - a)^beta times exp of a parabola in r - a."""
    start = np.sqrt(tip.area / np.pi)
    if tip.n == 4:  # the line force is carried by a ragged ring; where the gap opens counts
        start = tip.r[np.flatnonzero(tip.gap < 1e-5 * tip.gap[-1])[-1]]
    fits = []
    for begin, end in product(BEGINS, ENDS):
        m = (tip.r - start > begin * tip.spacing) & (tip.r - start < end * start)
        if m.sum() < 8:
            continue

        def shape(r, scale, beta, first, second, a):
            d = np.maximum(r - a, 1e-6)
            return scale + beta * np.log(d) + first * d + second * d**2

        p0 = (0.0, 1 + tip.n / 2, 0.0, 0.0, start)
        parameters, _ = curve_fit(shape, tip.r[m], np.log(tip.gap[m]), p0=p0, maxfev=20000)
        fits.append((parameters[4], parameters[1]))
    radii, exponents = np.transpose(fits).tolist()
    return spread(radii), spread(exponents)
