"""The layout of a study file: its columns, and which of them `export` prints."""

from collections.abc import Callable
from typing import Any, NamedTuple

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.observables import (
    QUANTITIES,
    geometric_middles,
    linear_edges,
    logarithmic_edges,
)
from gfmd_cli.physics.patches import area_edges
from gfmd_cli.study.column import Column
from gfmd_cli.study.observables import OBSERVABLES
from gfmd_cli.study.parameters import parameters

LAYOUT = 4
"""Raised whenever a reader of the old layout would misread the new one."""
BENCH = "bench_layout"
"""Attribute that a bench has in the place of a study's `layout`."""


STATUS = Column("status", str, "", "converged, or the reason why not")
CONTRACT = (
    Column("surface", str, "", "kind of surface, and the keys that the spec gives"),
    Column("seed", int, "1", "seed of the random phases; -1 if the surface has none"),
    Column("elastomer", str, "", "kind of elastomer, and the keys that the spec gives"),
    Column("n", float, "1", "exponent of the stiffness k ~ q^n; NaN if k is not a power law"),
    Column(
        "thickness", float, "", "elastomer.thickness: of a slab t / L, of a plate or layer t [m]"
    ),
    Column("points", int, "1", "grid points along x"),
    Column("p_star", float, "1", "reduced pressure p / Delta_sigma"),
    Column("a_r", float, "1", "relative contact area"),
    Column("a_r_error", float, "1", "estimated distance of a_r from its continuum value"),
    Column("sigma_p", float, "1", "standard deviation of the contact pressure / Delta_sigma"),
    Column("sigma_p_error", float, "1", "estimated distance of sigma_p from its continuum value"),
    Column("u_g", float, "1", "mean gap / h_std"),
    Column("u_g_error", float, "1", "estimated distance of u_g from its continuum value"),
    Column("residual", float, "1", "natural residual of the stored solution"),
    Column("solver", str, "", "kind of the solver that was used"),
    Column("transforms", float, "1", "real Fourier transforms, in units of one on the final grid"),
    Column("seconds", float, "s", "wall time"),
    STATUS,
)
"""The columns that every `export` begins with, in this order."""

DETAILS = (
    Column("pressure", float, "Pa", "nominal pressure"),
    Column("delta_sigma", float, "Pa", "unit of pressure: rms stress in full contact"),
    Column("h_std", float, "m", "root-mean-square height"),
    Column("mean_height", float, "m", "mean height of the indenter"),
    Column("length", float, "m", "side of the cell along x, L"),
    Column("length_y", float, "m", "side of the cell along y; NaN for a line contact"),
    Column("points_y", int, "1", "grid points along y; 1 for a line contact"),
    Column("dimension", int, "1", "1 for a line contact, otherwise 2"),
    Column("rough", int, "1", "1 for random and measured roughness, 0 for a single indenter"),
    Column("warnings", str, "", "reasons to doubt the result"),
    Column(
        "x_first",
        float,
        "1",
        "x / L of the first grid point; -0.5 if x = 0 is the crest of an indenter",
    ),
    Column("ensemble", str, "", "the column surface without the seed, the same for all seeds"),
    Column("surface_sha256", str, "", "SHA-256 checksum of the file of the surface"),
    Column("mean_gap", float, "m", "mean gap"),
    Column("displacement", float, "m", "that of the indenter from first touch; NaN if not defined"),
    Column(
        "perimeter",
        float,
        "1",
        "length of the contact line per area times L; in a line contact, number of contact edges",
    ),
    Column("energy", float, "1", "elastic energy per area / (h_std Delta_sigma)"),
    Column("work", float, "1", "(<sigma h> - p <u>) / (h_std Delta_sigma): twice the energy"),
    Column("steps", int, "1", "solver steps on the finest grid"),
    Column("tolerance", float, "1", "requested natural residual, solver.tolerance"),
    Column("load", str, "", "prescribed quantity, a key of [load]"),
    Column(
        "load_value", float, "", "prescribed value, [Pa] for a pressure, [m] for a displacement"
    ),
    Column("preparation", str, "", "how the map was read from its file and prepared"),
    Column("grid", str, "", "auto if the program chose the grid by the requested accuracy"),
    *(
        column
        for name in QUANTITIES
        for column in (
            Column(f"{name}_continuum", float, "1", "estimate of the continuum value"),
            Column(f"{name}_continuum_error", float, "1", "its estimated error"),
            Column(
                f"{name}_verdict",
                str,
                "",
                "regular, exact or why there is no number (docs/accuracy.md)",
            ),
            Column(f"{name}_algebraic", float, "1", "estimated error due to the residual"),
        )
    ),
    Column("sigma_p_bound", float, "1", "proven bound of the error of sigma_p due to the residual"),
    Column("u_g_bound", float, "1", "proven bound of the error of u_g due to the residual"),
    Column("edge_contact", float, "1", "fraction of the contact in the tapered zone at the edges"),
    Column("edge_load", float, "1", "fraction of the load there; NaN without a window"),
    *(observable.column for observable in OBSERVABLES),
)
PARAMETERS = parameters((*CONTRACT, *DETAILS))
"""Every key of [surface], [elastomer], [grid] and [solver], with its column."""
PARAMETER_COLUMNS = tuple(
    each.column for each in PARAMETERS if each.column not in (*CONTRACT, *DETAILS)
)
"""Columns of parameters after those above; a study file has those that some task has."""
COLUMNS = (*CONTRACT, *DETAILS, *PARAMETER_COLUMNS)


class HistogramColumn(NamedTuple):
    """A histogram of each task: densities in bins that all tasks share."""

    option: str
    """Key of [output] that turns it on."""
    name: str
    axis: str
    """Name of the axis of its bins."""
    axis_meaning: str
    meaning: str
    edges: Callable[[], Field]
    logarithmic: bool = True

    @property
    def column(self) -> Column:
        """Name, type and meaning of the densities."""
        return Column(self.name, float, "1", self.meaning)

    def middles(self) -> Field:
        """Middles of the bins, geometric in logarithmic ones."""
        edges = self.edges()
        return geometric_middles(edges) if self.logarithmic else 0.5 * (edges[:-1] + edges[1:])


PR_LINEAR, PR_LOGARITHMIC = "pr_sigma", "pr_sigma_log"
_STRESS = ("middle of the stress bin / Delta_sigma", "Pr(sigma) Delta_sigma")
_GAP = ("middle of the gap bin / h_std", "Pr(g) h_std")
_AREA = ("middle of the area bin / L^2; for a line contact, / L", "Pr(A) L^2, by number of patches")
HISTOGRAMS = (
    HistogramColumn("histogram", PR_LINEAR, "sigma", *_STRESS, linear_edges, logarithmic=False),
    HistogramColumn("histogram", PR_LOGARITHMIC, "sigma_log", *_STRESS, logarithmic_edges),
    HistogramColumn("gap_distribution", "pr_gap", "gap", *_GAP, linear_edges, logarithmic=False),
    HistogramColumn("gap_distribution", "pr_gap_log", "gap_log", *_GAP, logarithmic_edges),
    HistogramColumn("patches", "pr_patch_area", "patch_area", *_AREA, area_edges),
)
BINS = {histogram.name: histogram for histogram in HISTOGRAMS}
WEIGHTS = {
    "histogram": (
        Column("pr_zero", float, "1", "weight of the delta function of Pr(sigma) at zero"),
        Column("pr_beyond", float, "1", "fraction of points beyond the linear bins of Pr(sigma)"),
    ),
    "gap_distribution": (
        Column(
            "pr_gap_zero",
            float,
            "1",
            "weight of the delta function of Pr(g) at zero, of the points with a known height",
        ),
        Column("pr_gap_beyond", float, "1", "fraction of points beyond the linear bins of Pr(g)"),
        Column("pr_gap_below", float, "1", "fraction of points below the logarithmic bins"),
    ),
}
"""Fractions of points in no bin, by the key of [output] that turns the histogram on."""
WEIGHT_COLUMNS = tuple(column for columns in WEIGHTS.values() for column in columns)
ROW_COLUMNS = (*COLUMNS, *WEIGHT_COLUMNS)
"""All columns with one value a task."""
TASK = Column("task", int, "1", "index of the task")
TASK_ID = Column("task_id", str, "", "task by its content")
SCENE_ID = Column("scene_id", str, "", "surface, elastomer and grid by their content")
STORED = Column("stored_output", str, "", "what [output] stored of the task")
SCENE = Column("scene", int, "1", "group of /scenes")
SHELLS = (
    Column("q", float, "m-1", "mean wavenumber of the shell"),
    Column("height", float, "m2", "sum of C(q) over the shell"),
    Column("energy", float, "Pa m", "sum of k(q) C(q) over the shell"),
    Column("variance", float, "Pa2", "sum of k(q)^2 C(q) over the shell"),
    Column("gamma", float, "1", "weight gamma of the elastic energy in Persson theory"),
    Column("modes", float, "1", "number of modes in the shell"),
)
PICTURES = "pictures"
"""Group of a scene that holds pictures of a measured surface, and the sides of each [m]."""
FIELDS = (
    Column("u", float, "m", "displacement"),
    Column(
        "sigma",
        float,
        "Pa",
        "compressive stress K u + p; zero up to the residual outside the contact",
    ),
    Column("height", float, "m", "height of the indenter"),
    Column(
        "contact_pressure",
        float,
        "Pa",
        "stress in contact, exactly zero outside the contact",
    ),
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
    Column("height", float, "1", "mean of C(r) / C(0) over the ring, for the height"),
    Column("u", float, "1", "the same for the displacement"),
    Column("sigma", float, "1", "the same for the stress"),
)


class TaskGroup(NamedTuple):
    """Arrays that each task has of its own, in the group /NAME/TASK of a study."""

    option: str
    """Key of [output] that turns them on."""
    name: str
    columns: tuple[Column, ...]
    axis: str = ""
    """Name of their index; without one they lie on the grid, along x or over (y, x)."""


TASK_GROUPS = (
    TaskGroup("fields", "fields", FIELDS),
    TaskGroup("cross_section", "cross_sections", FIELDS),
    TaskGroup("spectra", "spectra", SPECTRA, "shell"),
    TaskGroup("spectra", "autocorrelations", AUTOCORRELATIONS, "ring"),
)


def empty_row() -> dict[str, Any]:
    """A row of blank values."""
    return {column.name: column.blank for column in ROW_COLUMNS}
