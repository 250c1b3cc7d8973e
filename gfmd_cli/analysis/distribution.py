"""Pr(sigma) in the continuum, extrapolated over grids bin by bin, as for the paper's Fig. 7.

On a grid, the edge of a contact is displaced by a fraction of the grid spacing. The effect on the
stress decreases with the distance from the edge in spacings, and is about of first order in the
spacing. Densities at the stresses next to an edge do not converge: there, for n < 2, Pr decreases
to zero as spacing^(n/2). The bins of these stresses are found by counting: the fraction of points
below a stress (above it, for n > 2) is the length of the contact line per area times the distance
from the edge at which the stress occurs.

Stresses are in units of Delta_sigma and densities in 1 / Delta_sigma, in the logarithmic bins of
`observables`. A relative error is one of ln Pr.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import log2
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Comparison, Curve, of_study, solver_of
from gfmd_cli.analysis.wording import contact_and_boundary
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.observables import LOGARITHMIC_EDGES, estimated_patches, geometric_middles
from gfmd_cli.study.column import Row
from gfmd_cli.study.columns import HISTOGRAMS_BY_NAME, PR_LOGARITHMIC

MAX_CHANGE = 0.35  # of ln Pr between grids; a bin with more is not resolved; a choice
NEIGHBOURS = 2  # bins to each side in the mean of the change between grids; a choice
PRIOR_SEEDS = 4.0  # weight of the expected spread beside the measured one; a choice
MIN_DEPTH = 0.75  # spacings from the edge below which a bin is not resolved; a choice
PATCH_SCATTER = 0.2  # of ln stress between patches; `scripts/seed_coverage.py`, seeds 0 to 39


def has_histogram(row: Row, name: str = PR_LOGARITHMIC) -> bool:
    """Whether Pr(sigma) of a row is stored; otherwise its bins are NaN where other rows have it."""
    return name in row and bool(np.isfinite(row[name]).all())


def bin_counts(row: Row, name: str = PR_LOGARITHMIC) -> Field:
    """Grid points in each bin of Pr(sigma): density times width times the points of the cell."""
    return row[name] * np.diff(HISTOGRAMS_BY_NAME[name].edges) * row["points"] * row["points_y"]


@dataclass(frozen=True)
class Extrapolated:
    """Pr(sigma) in the continuum, arrays over the bins, NaN where the grids do not resolve it."""

    log_density: Field
    """ln Pr."""
    discretisation: Field
    """What extrapolation has added to ln Pr or, where the change between grids is irregular and
    nothing was added, this change: taken as a standard error that all bins share, with its sign."""
    counting: Field
    """Standard error of ln Pr by the number of points in the bins, as if drawn independently.

    Counts on grids of one surface scatter less where the grids resolve the stress."""


def extrapolate(counts: Field, point_counts: Sequence[int]) -> Extrapolated:
    """Richardson extrapolation of ln Pr on grids N/2 and N to zero spacing, at first order.

    Bins that change by more than MAX_CHANGE are not resolved. A third grid tells where the change
    is irregular, growing or turning: there, the finest grid is the best guess.

    Parameters
    ----------
    counts : points in the bins of `LOGARITHMIC_EDGES`, shape (grids, bins), each grid with twice
        the points of the one before
    point_counts : points counted on each grid, times the seeds if these are added
    """
    widths = np.diff(LOGARITHMIC_EDGES)
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(counts / (widths * np.asarray(point_counts, dtype=np.float64)[:, None]))
        noise = 1 / counts
        steps = [
            _averaged(fine - coarse, a + b)
            for (coarse, fine), (b, a) in zip(pairwise(log), pairwise(noise), strict=True)
        ]
        share = noise[-1] / (noise[-1] + noise[-2])
    change, error = steps[-1]
    change = np.where(np.abs(change) < MAX_CHANGE, change, np.nan)
    correction, discretisation = change, change
    if len(steps) > 1:
        before, unsure = (np.nan_to_num(part) for part in steps[-2])
        larger = np.maximum(np.abs(change), np.abs(before))
        turns = (change * before < 0) & (np.abs(change) > 2 * np.hypot(error, unsure))
        grows = np.abs(change) > np.abs(before) + 2 * np.hypot(error, unsure)
        correction = np.where(turns | grows, 0.0, change)
        discretisation = np.where(turns | grows, np.copysign(larger, change), change)
    # var(f + D) = var f + var D + 2 cov(f, D), with the weight error^2 / var(f - c) of f - c in D
    counting = np.sqrt(noise[-1] + error**2 * (1 + 2 * share))
    return Extrapolated(log[-1] + correction, discretisation, counting)


def _averaged(values: Field, variance: Field) -> tuple[Field, Field]:
    """Mean over neighbouring bins, weighted by 1 / variance, and its standard error."""
    known = np.isfinite(values) & np.isfinite(variance)
    weight = np.where(known, 1 / np.where(known, variance, 1.0), 0.0)
    window = np.ones(2 * NEIGHBOURS + 1)
    total = np.convolve(weight, window, "same")
    mean = np.convolve(weight * np.where(known, values, 0.0), window, "same")
    total = np.where(known, total, np.nan)
    return mean / total, 1 / np.sqrt(total)


@dataclass(frozen=True)
class StressDistribution:
    """One contact at one pressure on several grids, for one seed or more."""

    curve: Curve
    """Curve of the finest grid of the first seed."""
    seeds: list[list[Row]]
    """Rows of each seed, grids rising."""

    @cached_property
    def counts(self) -> Field:
        """Points in the bins, shape (seeds, grids, bins)."""
        return np.array([[bin_counts(row) for row in rows] for rows in self.seeds])

    @property
    def finest(self) -> Row:
        """The row of the first seed's finest grid."""
        return self.seeds[0][-1]

    @property
    def points(self) -> list[int]:
        """Points along x of the grids, rising."""
        return [int(row["points"]) for row in self.seeds[0]]

    @property
    def a_r(self) -> float:
        """Relative contact area on the finest grid, mean over the seeds."""
        return float(np.mean([rows[-1]["a_r"] for rows in self.seeds]))

    @property
    def title(self) -> str:
        """Elastomer and surface, without its seed where there are several."""
        title = contact_and_boundary(self.finest, of_seeds=len(self.seeds) > 1)
        return of_study(self.curve.study, title)

    @cached_property
    def point_counts(self) -> list[int]:
        """Points of the cells of all seeds, on each grid."""
        return [len(self.seeds) * row["points"] * row["points_y"] for row in self.seeds[0]]

    @cached_property
    def grid_densities(self) -> Field:
        """Density on each grid, mean over the seeds, shape (grids, bins)."""
        widths = np.diff(LOGARITHMIC_EDGES)
        return self.counts.sum(axis=0) / (np.array(self.point_counts)[:, None] * widths)

    @cached_property
    def extrapolated(self) -> Extrapolated:
        """In the continuum, the points of all seeds together."""
        extrapolated = extrapolate(self.counts.sum(axis=0), self.point_counts)
        known = self.depth > MIN_DEPTH
        return replace(extrapolated, log_density=np.where(known, extrapolated.log_density, np.nan))

    @cached_property
    def depth(self) -> Field:
        """Distance of each bin's stress from the edge of a contact, in spacings of the finest grid.

        Share of the points up to the middle of the bin over contact line times spacing; for n > 2
        the share of the points above it, if less. The line is pi / 4 of its switches along rows and
        columns, which is right for the mean over all directions.
        """
        counts = self.counts[:, -1].sum(axis=0)
        line = float(np.mean([rows[-1]["perimeter"] for rows in self.seeds]))
        line *= self.point_counts[-1] / self.points[-1]
        if self.finest["dimension"] == 2:
            line *= np.pi / 4
        below = np.cumsum(counts) - 0.5 * counts
        above = counts.sum() - below
        nearest: Field = np.minimum(below, above) if self.curve.n > 2 else below
        return nearest / line if line else np.full(counts.size, np.inf)

    @cached_property
    def sampling(self) -> Field:
        """Relative standard error of the mean over surfaces, for the few patches that one holds.

        All points of a bin in one patch are one draw. If the stress of patches differs by a factor
        whose logarithm is normal with the standard deviation s, and the counts are as sigma^g,
        N patches count as N exp(-g^2 s^2). This expected variance is averaged with that over the
        seeds, with the weight of PRIOR_SEEDS further seeds.
        """
        count, fine = len(self.seeds), self.counts[:, -1]
        if self.finest["seed"] < 0:  # nothing random
            return np.zeros(fine.shape[-1])
        points = fine.sum(axis=0)
        slope = np.gradient(
            np.log(np.maximum(points, 1.0)), np.log(geometric_middles(LOGARITHMIC_EDGES))
        )
        weight = np.exp(-((slope * PATCH_SCATTER) ** 2))
        patches = weight * sum(_patches(rows[-1]) for rows in self.seeds)
        expected = 1 / np.maximum(np.minimum(patches, points), 1.0)
        if count == 1:
            return np.sqrt(expected)
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.var(fine, axis=0, ddof=1) / np.mean(fine, axis=0) ** 2 / count
        weighed = (count - 1) * variance + PRIOR_SEEDS * expected
        return np.sqrt(weighed / (count - 1 + PRIOR_SEEDS))

    @property
    def density(self) -> Field:
        """Pr(sigma) in the continuum, mean over the seeds."""
        return np.exp(self.extrapolated.log_density)

    @property
    def error(self) -> Field:
        """Relative standard error of `density`: discretisation, counting, sampling."""
        part = self.extrapolated
        return np.sqrt(part.discretisation**2 + part.counting**2 + self.sampling**2)


def _patches(row: Row) -> float:
    """Estimated number of contact patches in the cell."""
    if row["dimension"] == 1:
        return float(row["perimeter"]) / 2
    return estimated_patches(row["perimeter"], row["a_r"], row["length_y"] / row["length"])


def distributions(comparison: Comparison) -> list[StressDistribution]:
    """The contacts of a study that were solved on two nested grids or more.

    Rows are one contact where surface, elastomer, boundary, solver, tolerance and pressure are the
    same, and so are the unit of stress and the shape of the pixels; surfaces that differ in their
    seed only are averaged. Contacts that missed only their accuracy or load are included.
    """
    by_contact: dict[tuple[Any, ...], dict[int, dict[int, tuple[Curve, Row]]]] = {}
    for curve in comparison.curves:
        for row in curve.rows:
            if not (has_histogram(row) and row["a_r"] > 0 and row["status"].is_within_tolerance):
                continue
            units = (f"{row['pressure']:.6g}", f"{row['delta_sigma']:.6g}")
            same = row["elastomer"], row["ensemble"], row["boundary"], _pixel_shape(row)
            key = (curve.study, *same, *solver_of(row), *units)
            by_contact.setdefault(key, {}).setdefault(row["seed"], {})[row["points"]] = (curve, row)
    merged = []
    for seeds in by_contact.values():
        grids = _nested(sorted(set.intersection(*(set(grids) for grids in seeds.values()))))
        if len(grids) > 1:
            rows = [[seed[points][1] for points in grids] for seed in seeds.values()]
            merged.append(StressDistribution(next(iter(seeds.values()))[grids[-1]][0], rows))
    return merged


def _pixel_shape(row: Row) -> int:
    """The ratio of the spacings along x and y as a whole number of steps of 7 %; 0 for a line."""
    if row["dimension"] == 1:
        return 0
    spacings = row["length"] / row["points"], row["length_y"] / row["points_y"]
    return round(10 * log2(spacings[0] / spacings[1]))


def _nested(points: list[int]) -> list[int]:
    """The finest grids of which each has twice the points of the one before."""
    chosen = points[-1:]
    while chosen and chosen[0] % 2 == 0 and chosen[0] // 2 in points:
        chosen.insert(0, chosen[0] // 2)
    return chosen
