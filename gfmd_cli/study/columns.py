"""The layout of a study file: its columns, and which of them `export` prints."""

from typing import Any, NamedTuple

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.observables import (
    LINEAR_EDGES,
    LOGARITHMIC_EDGES,
    MAIN_OBSERVABLES,
    geometric_middles,
)
from gfmd_cli.physics.patches import AREA_EDGES
from gfmd_cli.study.column import Column
from gfmd_cli.study.observables import OPTIONAL_OBSERVABLES
from gfmd_cli.study.parameters import parameters

LAYOUT = 4
"""Raised whenever a reader of the old layout would misread the new one."""
BENCH_ATTRIBUTE = "bench_layout"
"""Attribute that a bench has in the place of a study's `layout`."""


STATUS = Column("status", "converged, or the reason why not", "", str)
MAIN_COLUMNS = (
    Column("surface", "kind of surface, and the keys that the spec gives", "", str),
    Column("seed", "seed of the random phases; -1 if the surface has none", kind=int),
    Column("elastomer", "kind of elastomer, and the keys that the spec gives", "", str),
    Column("n", "exponent of the stiffness k ~ q^n; NaN if k is not a power law"),
    Column("thickness", "elastomer.thickness: of a slab t / L, of a plate or layer t [m]", ""),
    Column("points", "grid points along x", kind=int),
    Column("p_star", "reduced pressure p / Delta_sigma"),
    Column("a_r", "relative contact area"),
    Column("a_r_error", "estimated distance of a_r from its continuum value"),
    Column("sigma_p", "standard deviation of the contact pressure / Delta_sigma"),
    Column("sigma_p_error", "estimated distance of sigma_p from its continuum value"),
    Column("u_g", "mean gap / h_std"),
    Column("u_g_error", "estimated distance of u_g from its continuum value"),
    Column("residual", "natural residual of the stored solution"),
    Column("solver", "kind of the solver that was used", "", str),
    Column("transforms", "real Fourier transforms, in units of one on the final grid"),
    Column("seconds", "wall time", "s"),
    STATUS,
)
"""The columns that every `export` begins with, in this order."""

DETAIL_COLUMNS = (
    Column("pressure", "nominal pressure", "Pa"),
    Column("delta_sigma", "unit of pressure: rms stress in full contact", "Pa"),
    Column("h_std", "root-mean-square height", "m"),
    Column("mean_height", "mean height of the indenter", "m"),
    Column("length", "side of the cell along x, L", "m"),
    Column("length_y", "side of the cell along y; NaN for a line contact", "m"),
    Column("points_y", "grid points along y; 1 for a line contact", kind=int),
    Column("dimension", "1 for a line contact, otherwise 2", kind=int),
    Column("rough", "1 for random and measured roughness, 0 for a single indenter", kind=int),
    Column("warnings", "reasons to doubt the result", "", str),
    Column("gfmd_version", "version that solved the contact, and its Git commit if known", "", str),
    Column("x_first", "x / L of the first grid point; -0.5 if x = 0 is the crest of an indenter"),
    Column("ensemble", "the column surface without the seed, the same for all seeds", "", str),
    Column("elastomer_short", "short name of the elastomer in figures", "", str),
    Column(
        "stiffness_given",
        "1 if the spec gives the stiffness of the elastomer, 0 if it has the default value 1",
        kind=int,
    ),
    Column("surface_sha256", "SHA-256 checksum of the file of the surface", "", str),
    Column("elastomer_sha256", "SHA-256 checksum of the table of the elastomer", "", str),
    Column(
        "p_star_error",
        "estimated error of p_star where it was searched with [accuracy]; NaN if unknown",
    ),
    Column("mean_gap", "mean gap", "m"),
    Column(
        "displacement", "displacement of the indenter from first touch; NaN if not defined", "m"
    ),
    Column(
        "perimeter",
        "length of the contact line per area times L; in a line contact, number of contact edges",
    ),
    Column("energy", "elastic energy per area / (h_std Delta_sigma)"),
    Column(
        "work",
        "(<sigma h> - p <u>) / (h_std Delta_sigma), twice the energy; with a free boundary the "
        "level c of the undeformed surface takes the place of <u>",
    ),
    Column("steps", "solver steps on the finest grid", kind=int),
    Column("tolerance", "requested natural residual, solver.tolerance"),
    Column("load", "prescribed quantity, a key of [load]", "", str),
    Column("load_value", "prescribed value, [Pa] for a pressure, [m] for a displacement", ""),
    Column("preparation", "how the map was read from its file and prepared", "", str),
    Column("grid", "auto if the program chose the grid by the requested accuracy", "", str),
    *(
        column
        for name in MAIN_OBSERVABLES
        for column in (
            Column(f"{name}_continuum", "estimate of the continuum value"),
            Column(f"{name}_continuum_error", "its estimated error"),
            Column(
                f"{name}_verdict",
                "regular, exact or why there is no number (docs/accuracy.md)",
                "",
                str,
            ),
            Column(f"{name}_algebraic", "estimated error due to the residual"),
        )
    ),
    Column("sigma_p_bound", "proven bound of the error of sigma_p due to the residual"),
    Column("u_g_bound", "proven bound of the error of u_g due to the residual"),
    Column("edge_contact", "fraction of the contact in the tapered zone at the edges"),
    Column("edge_load", "fraction of the load there; NaN without a window"),
    Column("filled_contact", "fraction of the contact at heights that were filled in"),
    Column("filled_load", "fraction of the load there; NaN if no height was filled in"),
    Column(
        "short_wave_factor",
        "factor by which the shortest waves that a map resolves (2 points or lateral_period_limit) "
        "and those of up to twice this length increase Delta_sigma; NaN for other surfaces",
    ),
    *(observable.column for observable in OPTIONAL_OBSERVABLES),
)
PARAMETERS = parameters((*MAIN_COLUMNS, *DETAIL_COLUMNS))
"""Every key of [surface], [elastomer], [grid] and [solver], with its column."""
PARAMETER_COLUMNS = tuple(
    each.column for each in PARAMETERS if each.column not in (*MAIN_COLUMNS, *DETAIL_COLUMNS)
)
"""Columns of parameters after those above; a study file has those that some task has."""
COLUMNS = (*MAIN_COLUMNS, *DETAIL_COLUMNS, *PARAMETER_COLUMNS)


class HistogramColumn(NamedTuple):
    """A histogram of each task: densities in bins that all tasks share."""

    output_key: str
    """Key of [output] that turns it on."""
    name: str
    axis: str
    """Name of the axis of its bins."""
    axis_meaning: str
    meaning: str
    edges: Field
    logarithmic: bool = True

    @property
    def column(self) -> Column:
        """Name, type and meaning of the densities."""
        return Column(self.name, self.meaning)

    def middles(self) -> Field:
        """Middles of the bins, geometric in logarithmic ones."""
        edges = self.edges
        return geometric_middles(edges) if self.logarithmic else 0.5 * (edges[:-1] + edges[1:])


PR_LINEAR, PR_LOGARITHMIC = "pr_sigma", "pr_sigma_log"
_STRESS = ("middle of the stress bin / Delta_sigma", "Pr(sigma) Delta_sigma")
_GAP = ("middle of the gap bin / h_std", "Pr(g) h_std")
_AREA = (
    "middle of the area bin / L^2; for a line contact, / L",
    "Pr(A) L^2, for a line contact Pr(A) L, by number of patches; the last bin includes larger "
    "ones",
)
HISTOGRAMS = (
    HistogramColumn("histogram", PR_LINEAR, "sigma", *_STRESS, LINEAR_EDGES, logarithmic=False),
    HistogramColumn("histogram", PR_LOGARITHMIC, "sigma_log", *_STRESS, LOGARITHMIC_EDGES),
    HistogramColumn("gap_distribution", "pr_gap", "gap", *_GAP, LINEAR_EDGES, logarithmic=False),
    HistogramColumn("gap_distribution", "pr_gap_log", "gap_log", *_GAP, LOGARITHMIC_EDGES),
    HistogramColumn("patches", "pr_patch_area", "patch_area", *_AREA, AREA_EDGES),
)
HISTOGRAMS_BY_NAME = {histogram.name: histogram for histogram in HISTOGRAMS}
WEIGHTS = {
    "histogram": (
        Column("pr_zero", "weight of the delta function of Pr(sigma) at zero"),
        Column("pr_beyond", "fraction of points beyond the linear bins of Pr(sigma)"),
    ),
    "gap_distribution": (
        Column(
            "pr_gap_zero",
            "weight of the delta function of Pr(g) at zero, of the points with a known height",
        ),
        Column("pr_gap_beyond", "fraction of points beyond the linear bins of Pr(g)"),
        Column("pr_gap_below", "fraction of points below the logarithmic bins"),
    ),
}
"""Fractions of points in no bin, by the key of [output] that turns the histogram on."""
ROW_COLUMNS = (*COLUMNS, *(column for columns in WEIGHTS.values() for column in columns))
"""All columns with one value a task."""
TASK = Column("task", "index of the task", kind=int)
TASK_ID = Column("task_id", "task by its content", "", str)
SCENE_ID = Column("scene_id", "surface, elastomer and grid by their content", "", str)
STORED = Column("stored_output", "what [output] stored of the task", "", str)
SCENE = Column("scene", "group of /scenes", kind=int)
SHELLS = (
    Column("q", "mean wavenumber of the shell", "m-1"),
    Column("height", "sum of C(q) over the shell", "m2"),
    Column("energy", "sum of k(q) C(q) over the shell", "Pa m"),
    Column("variance", "sum of k(q)^2 C(q) over the shell", "Pa2"),
    Column("gamma", "weight gamma of the elastic energy in Persson theory"),
    Column("modes", "number of modes in the shell"),
)
MAP_SPECTRUM = "map_spectrum"
"""Group of a scene that holds the spectrum of a map with borders, and its self-affine fit."""
PICTURES = "pictures"
"""Group of a scene that holds pictures of a measured surface, and the sides of each [m]."""
FIELDS = (
    Column("u", "displacement", "m"),
    Column(
        "sigma", "compressive stress K u + p; zero up to the residual outside the contact", "Pa"
    ),
    Column("height", "height of the indenter", "m"),
    Column("contact_pressure", "stress in contact, exactly zero outside the contact", "Pa"),
)
SPECTRA = (
    Column("q", "mean wavenumber of the shell", "m-1"),
    Column("waves", "number of waves q in the shell"),
    Column("height", "sum of |h(q)|^2 over the shell", "m2"),
    Column("u", "sum of |u(q)|^2 over the shell", "m2"),
    Column("sigma", "sum of |sigma(q)|^2 over the shell", "Pa2"),
)
AUTOCORRELATIONS = (
    Column("r", "mean distance in the ring", "m"),
    Column("height", "autocorrelation of the height over its variance, mean over the ring"),
    Column("u", "the same for the displacement"),
    Column("sigma", "the same for the stress"),
)


class TaskGroup(NamedTuple):
    """Arrays that each task has of its own, in the group /NAME/TASK of a study."""

    output_key: str
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


def bands(dimension: int = 2) -> tuple[Column, ...]:
    """The spectrum of a map; C(q) of a line profile, of dimension 1, has another unit."""
    unit = f"m{2 + dimension}"
    return (
        Column("q", "mean wavenumber of the band", "m-1"),
        Column("density", "C(q) of the map with tapered edges", unit),
        Column("modes", "number of modes in the band"),
        Column("fitted", "C(q) of the self-affine fit, zero without a fit", unit),
    )


def empty_row() -> dict[str, Any]:
    """A row of blank values."""
    return {column.name: column.blank for column in ROW_COLUMNS}
