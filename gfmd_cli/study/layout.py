"""The layout of a study file: its columns, and which of them `export` prints."""

from collections.abc import Callable
from math import nan
from typing import Any, NamedTuple

from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.observables import (
    QUANTITIES,
    geometric_middles,
    linear_edges,
    logarithmic_edges,
)
from gfmd_cli.physics.patches import area_edges

LAYOUT = 2
"""Raised whenever a reader of the old layout would misread the new one."""
LAYOUTS = (1, 2)
"""Layouts that can be read. In 1 text was of variable length, without a checksum."""
MISSING = "missing"
"""Status of a task that is not solved yet."""
BENCH = "bench_layout"
"""Attribute that a bench has in the place of a study's `layout`."""


class Column(NamedTuple):
    """One value a task."""

    name: str
    kind: type
    units: str
    meaning: str


CONTRACT = (
    Column("surface", str, "", "surface, with what differs from its defaults"),
    Column("seed", int, "1", "seed of the random phases, -1 where there is none"),
    Column("elastomer", str, "", "elastic body, with what differs from its defaults"),
    Column("n", float, "1", "exponent of the stiffness k ~ q^n, NaN where it is no single power"),
    Column("thickness", float, "1", "thickness of a slab, t / L"),
    Column("points", int, "1", "grid points per side"),
    Column("p_star", float, "1", "reduced pressure p / Delta_sigma"),
    Column("a_r", float, "1", "relative contact area"),
    Column("a_r_error", float, "1", "estimated distance to the continuum value"),
    Column("sigma_p", float, "1", "standard deviation of the stress / Delta_sigma"),
    Column("sigma_p_error", float, "1", "estimated distance to the continuum value"),
    Column("u_g", float, "1", "mean gap / h_std"),
    Column("u_g_error", float, "1", "estimated distance to the continuum value"),
    Column("residual", float, "1", "natural residual of the stored solution"),
    Column("solver", str, "", "solver"),
    Column("transforms", float, "1", "real Fourier transforms of the solved size"),
    Column("seconds", float, "s", "wall time"),
    Column("status", str, "", "converged, or why not"),
)
"""The columns that every `export` begins with, in this order."""

FURTHER = (
    Column("pressure", float, "Pa", "nominal pressure"),
    Column("delta_sigma", float, "Pa", "unit of pressure: rms stress in full contact"),
    Column("h_std", float, "m", "root-mean-square height"),
    Column("mean_height", float, "m", "mean height of the indenter"),
    Column("length", float, "m", "side of the cell"),
    Column("mean_gap", float, "m", "mean gap"),
    Column("perimeter", float, "1", "contact line per area times L; for a line scene the edges"),
    Column("energy", float, "1", "elastic energy per area / (h_std Delta_sigma)"),
    Column("work", float, "1", "(<sigma h> - p <u>) / (h_std Delta_sigma): twice the energy"),
    Column("steps", int, "1", "steps on the finest grid"),
    Column("tolerance", float, "1", "natural residual asked for"),
    Column("load", str, "", "what was given: p_star, pressure, contact_area or mean_gap"),
    Column("asked", float, "", "its value, [Pa] for a pressure"),
    Column("preparation", str, "", "what was read from a file and what was done to it"),
    Column("grid", str, "", "auto where the grid was chosen by the accuracy asked for"),
    *(
        column
        for name in QUANTITIES
        for column in (
            Column(f"{name}_continuum", float, "1", "estimate of the continuum value"),
            Column(f"{name}_continuum_error", float, "1", "its estimated error"),
            Column(f"{name}_verdict", str, "", "how the value behaves as grids get finer"),
            Column(f"{name}_algebraic", float, "1", "error of the solution on its grid, estimated"),
        )
    ),
    Column("sigma_p_bound", float, "1", "proven bound of the error of sigma_p on its grid"),
    Column("u_g_bound", float, "1", "proven bound of the error of u_g on its grid"),
    *(
        Column(name, float, "1", f"{what} / Delta_sigma")
        for name, what in (
            ("deviation_c", "standard deviation of the full-contact stress over the true contact"),
            ("quadrature_c", "rms of its quadrature over the true contact"),
            ("deviation_bearing", "the same deviation over the highest points, as many as carry p"),
        )
    ),
    Column("patches", int, "1", "number of contact patches"),
    Column("patch_area_mean", float, "1", "mean area of a patch / L^2; of a line scene, / L"),
    Column("patch_area_largest", float, "1", "area of the largest patch, likewise"),
    Column("stiffness", float, "1", "contact stiffness -dp/du_g / (Delta_sigma / h_std)"),
    Column("leaks_x", int, "1", "1 where the gap percolates along x, 0 where it does not"),
    Column("leaks_y", int, "1", "likewise along y; -1 on a line scene"),
)
COLUMNS = (*CONTRACT, *FURTHER)


class Distribution(NamedTuple):
    """Densities in bins that all tasks share, one row of them a task."""

    option: str
    """Key of [output] that asks for it."""
    name: str
    axis: str
    """Name of its bins."""
    labels: str
    """What the middles of the bins are."""
    meaning: str
    edges: Callable[[], Field]
    logarithmic: bool = True

    def middles(self) -> Field:
        """Middles of the bins, geometric in logarithmic ones."""
        edges = self.edges()
        return geometric_middles(edges) if self.logarithmic else 0.5 * (edges[:-1] + edges[1:])


PR_LINEAR, PR_LOGARITHMIC = "pr_sigma", "pr_sigma_log"
_STRESS = ("middle of the stress bin / Delta_sigma", "Pr(sigma) Delta_sigma")
_GAP = ("middle of the gap bin / h_std", "Pr(g) h_std")
_AREA = ("middle of the area bin / L^2; of a line scene, / L", "Pr(A) L^2, by number of patches")
DISTRIBUTIONS = (
    Distribution("histogram", PR_LINEAR, "sigma", *_STRESS, linear_edges, logarithmic=False),
    Distribution("histogram", PR_LOGARITHMIC, "sigma_log", *_STRESS, logarithmic_edges),
    Distribution("gap_distribution", "pr_gap", "gap", *_GAP, linear_edges, logarithmic=False),
    Distribution("gap_distribution", "pr_gap_log", "gap_log", *_GAP, logarithmic_edges),
    Distribution("patches", "pr_patch_area", "patch_area", *_AREA, area_edges),
)
BINS = {made.name: made for made in DISTRIBUTIONS}
WEIGHTS = {
    "histogram": (
        Column("pr_zero", float, "1", "weight of the delta function of Pr(sigma) at zero"),
        Column("pr_beyond", float, "1", "share of points above the last linear bin of Pr(sigma)"),
    ),
    "gap_distribution": (
        Column("pr_gap_zero", float, "1", "weight of the delta function of Pr(g) at zero"),
        Column("pr_gap_beyond", float, "1", "share of points above the last linear bin of Pr(g)"),
        Column("pr_gap_below", float, "1", "share of points below the first logarithmic bin"),
    ),
}
"""What of a distribution is in no bin, by the key of [output] that asks for it."""
DISTRIBUTION = tuple(column for columns in WEIGHTS.values() for column in columns)
SHELLS = (
    Column("q", float, "m-1", "mean wavenumber of the shell"),
    Column("height", float, "m2", "sum of C(q) over the shell"),
    Column("energy", float, "Pa m", "sum of k(q) C(q)"),
    Column("variance", float, "Pa2", "sum of k(q)^2 C(q)"),
    Column("gamma", float, "1", "weight gamma of the elastic energy in Persson theory"),
    Column("modes", float, "1", "how many modes the shell holds"),
)
FIELDS = (
    Column("u", float, "m", "displacement"),
    Column("sigma", float, "Pa", "compressive stress"),
    Column("height", float, "m", "height of the indenter"),
)
SPECTRA = (
    Column("q", float, "m-1", "mean wavenumber of the shell"),
    Column("waves", float, "1", "number of waves q in the shell"),
    Column("height", float, "m2", "sum of |h(q)|^2 over the shell"),
    Column("u", float, "m2", "sum of |u(q)|^2 over the shell"),
    Column("sigma", float, "Pa2", "sum of |sigma(q)|^2 over the shell"),
)
AUTOCORRELATIONS = (
    Column("r", float, "m", "mean distance in the ring"),
    Column("height", float, "1", "mean of C(r) / C(0) of the height over the ring"),
    Column("u", float, "1", "the same of the displacement"),
    Column("sigma", float, "1", "the same of the stress"),
)
CURVES = {"spectra": ("shell", SPECTRA), "autocorrelations": ("ring", AUTOCORRELATIONS)}
"""Groups with one group of curves a task: their axis and their columns."""


def empty_row() -> dict[str, Any]:
    """A row that says nothing yet."""
    blank: dict[type, Any] = {str: "", int: -1, float: nan}
    return {column.name: blank[column.kind] for column in (*COLUMNS, *DISTRIBUTION)}
