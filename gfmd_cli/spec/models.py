"""The models of the run spec, and its sweeps: a list instead of a scalar makes a sweep."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self, TypeVar, get_args

import numpy as np
from pydantic import Discriminator, StrictStr, Tag, model_validator
from pydantic import Field as Key

from gfmd_cli.errors import InputError
from gfmd_cli.files.checksums import file_digest
from gfmd_cli.physics.contact import PRESSURE_RANGE, is_solved
from gfmd_cli.physics.elastomers import Elastomer
from gfmd_cli.physics.indenters import MAX_POINTS, SMALLEST_GRID, RigidSurface
from gfmd_cli.physics.linear_elastomer import LinearElastomer
from gfmd_cli.physics.surfaces import Surface
from gfmd_cli.solvers.auto import AnySolver
from gfmd_cli.spec_table import Positive, SpecTable

MAX_VALUES = 100_000  # of one list or sequence; upper limit, guards against typing errors
MAX_DECADES = 300.0  # of which a power of ten does not overflow
SEQUENCE_ROUNDINGS = 8  # of a power of ten, by which a value of the sequence may lie above `to`
NO_STUDY = {".csv", ".nc", ".vti", ".html", ".json", ".toml"}
"""Suffixes that a study cannot have: those of other files that commands write or read."""
SWEPT = ("surface", "elastomer", "grid", "solver")
REPEATED = (*SWEPT, "sweep")  # tables that may be given several times


class StudyTable(SpecTable):
    """Table [study]."""

    name: Annotated[StrictStr, Key(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$")] = "study"
    """Name of the study. The study file is NAME.h5 in the working directory."""


def _points_form(value: Any) -> str | None:
    """The form in which points are given: a number or the word "auto"."""
    if isinstance(value, str):
        return "word" if value == "auto" else None
    return "count"


Points = Annotated[
    Annotated[int, Key(ge=SMALLEST_GRID, le=MAX_POINTS), Tag("count")]
    | Annotated[Literal["auto"], Tag("word")],
    Discriminator(
        _points_form,
        custom_error_type="points",
        custom_error_message='must be a whole number of points, or "auto"',
    ),
]


class GridTable(SpecTable):
    """Table [grid]."""

    points: Points
    """Number of grid points along x, or "auto": the coarsest grid that meets [accuracy], with
    p_star or pressure as the load, and without points_y. Numbers with many factors of 2 are
    fastest. The cell of a mirrored map has twice as many points."""
    points_y: Annotated[int, Key(ge=SMALLEST_GRID, le=MAX_POINTS)] | None = None
    """Number of grid points along y. By default the pixels are square, or nearly so; for a map
    the ratio points / points_y is that of the map."""
    boundary: Literal["periodic", "free"] | None = None
    """"periodic": the cell is repeated periodically. "free": the elastomer extends beyond the map
    and carries no load there; this requires an elastomer whose displacement decays with the
    distance from the load. The default is "periodic". For a map that is not periodic, without
    surface.edges, it is "free" if elastomer and solver allow it."""

    def on_cell(self, surface: RigidSurface, points: int) -> tuple[RigidSurface, int]:
        """A surface on its cell, and the points of the cell along y.

        `points` are those of the cell along x; a mirrored map has twice `self.points` there.
        """
        given = self.points_y and surface.copies * self.points_y
        points_y = given or surface.points_y(points)
        return surface.on_cell(points, points_y), points_y


def with_boundary(
    surface: RigidSurface, elastomer: LinearElastomer, grid: GridTable, solver: AnySolver
) -> tuple[RigidSurface, GridTable]:
    """The surface with the treatment of its edges, and the grid with its boundary.

    A map that ends at its borders has a free boundary where elastomer and solver allow it, and is
    mirrored elsewhere. Every other surface is periodic.
    """
    boundary: str = grid.boundary or "periodic"
    if grid.boundary is None and surface.has_borders:
        with suppress(InputError):
            solver.check_boundary("free")
            elastomer.check_free_boundary(surface.dimension)
            boundary = "free"
    return surface.within(boundary), grid.model_copy(update={"boundary": boundary})


class GeometricSequence(SpecTable):
    """The values from * 10^(i / per_decade), i = 0, 1, ..., up to `to`.

    The ratio of neighbouring values is fixed: a larger `to` adds values and changes no others.
    """

    from_: Annotated[float, Key(gt=0, alias="from")]
    """First value."""
    to: Positive
    """Upper limit; it is a value only if it belongs to the sequence, up to rounding."""
    per_decade: Annotated[float, Key(ge=1e-3, le=1000)] = 4
    """Values per decade."""

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if self.to < self.from_:
            raise ValueError(f"to = {self.to:.12g} lies below from = {self.from_:.12g}")
        if (count := int(self._decades * self.per_decade) + 1) > MAX_VALUES:
            raise ValueError(f"a sequence of {count} values; at most {MAX_VALUES} are allowed")
        return self

    def values(self) -> list[float]:
        """The values, rising."""
        steps = int(self._decades * self.per_decade) + 1  # one may be missed by rounding
        values = [self._value(step / self.per_decade) for step in range(steps + 1)]
        rounding = SEQUENCE_ROUNDINGS * np.finfo(float).eps * (1 + np.log(10) * self._decades)
        return [value for value in values if value / self.to - 1 <= rounding]

    @property
    def _decades(self) -> float:
        """Decades from the first value to the upper limit, whose ratio can overflow."""
        return float(np.log10(self.to) - np.log10(self.from_))

    def _value(self, decades: float) -> float:
        """The value so many decades above the first one, at least 0; infinite where too large."""
        times, rest = divmod(decades, MAX_DECADES)
        return prod([10.0**MAX_DECADES] * int(times), start=self.from_) * float(10.0**rest)


def _shape(value: Any) -> str:
    """The form in which values are given: a number, a list or a sequence."""
    if isinstance(value, dict | GeometricSequence):
        return "sequence"
    return "list" if isinstance(value, list) else "number"


T = TypeVar("T")
OneOrMany = (
    Annotated[T, Tag("number")]
    | Annotated[list[T], Key(min_length=1, max_length=MAX_VALUES), Tag("list")]
)
Share = Annotated[float, Key(gt=0, lt=1)]
Values = Annotated[
    OneOrMany[Positive] | Annotated[GeometricSequence, Tag("sequence")], Discriminator(_shape)
]
Areas = Annotated[
    OneOrMany[Share],
    Discriminator(
        _shape,
        custom_error_type="areas",
        custom_error_message="must be a number or a list of numbers, not a geometric sequence",
    ),
]
SHAPES = ("number", "list", "sequence", "count", "word")
"""Tags of the unions above, which no message should name."""


class Load(NamedTuple):
    """A quantity that can be prescribed as the load."""

    symbol: str
    words: str
    searched: str = ""
    """Column that must match if the pressure is searched; empty if the pressure is given."""
    unit: str = ""
    """Its SI unit; empty if it is reduced."""


LOADS = {
    "p_star": Load("p*", "reduced pressure"),
    "pressure": Load("p", "pressure", unit="Pa"),
    "contact_area": Load("a_r", "contact area", "a_r"),
    "mean_gap": Load("u_g", "mean gap", "u_g"),
    "displacement": Load("d", "displacement", "displacement", "m"),
}
"""The quantities by their keys in [load]."""


def load_text(key: str, value: float) -> str:
    """A load with its symbol."""
    return f"{LOADS[key].symbol}={value:.6g}"


class LoadTable(SpecTable):
    """Table [load]: one of the quantities below, as a number, a list or a geometric sequence.

    contact_area takes no sequence.
    """

    p_star: Values | None = None
    """Reduced pressures p / Delta_sigma, from 1e-30 to 1e6."""
    pressure: Values | None = None
    """Pressures [Pa]."""
    contact_area: Areas | None = None
    """Relative contact areas a_r: in the continuum if the spec has a table [accuracy], otherwise
    on the grid. The program searches the pressures."""
    mean_gap: Values | None = None
    """Mean gaps u_g / h_std: in the continuum if the spec has a table [accuracy], otherwise on the
    grid. The program searches the pressures."""
    displacement: Values | None = None
    """Displacements [m] of the indenter from first touch, on the grid; for a free boundary or an
    elastomer whose k(0) is not zero. The program searches the pressures."""
    tolerance: Share = 1e-3
    """Largest relative deviation from contact_area, mean_gap or displacement. If the value lies in
    a jump of the contact area, the result is the nearest contact."""

    @model_validator(mode="after")
    def _one_of_all(self) -> Self:
        loads = [name for name in LOADS if getattr(self, name) is not None]
        if len(loads) != 1:
            raise ValueError(f"give one of {', '.join(LOADS)}")
        if self.p_star is not None:
            low, high = PRESSURE_RANGE
            if beyond := [p for p in self.listed() if not is_solved(p)]:
                raise ValueError(f"p_star must be from {low:g} to {high:g}, got {beyond[0]:.12g}")
        if "tolerance" in self.model_fields_set and not LOADS[loads[0]].searched:
            searched = [name for name, load in LOADS.items() if load.searched]
            raise ValueError(f"tolerance belongs to {' or '.join(searched)}")
        return self

    @property
    def key(self) -> str:
        """The key of the quantity that is prescribed."""
        return next(name for name in LOADS if getattr(self, name) is not None)

    def listed(self) -> list[float]:
        """The prescribed values in the given order."""
        values = getattr(self, self.key)
        if isinstance(values, GeometricSequence):
            return values.values()
        return list(values) if isinstance(values, list) else [values]

    def values(self) -> list[float]:
        """The prescribed values, in the given order, without duplicates."""
        return list(dict.fromkeys(self.listed()))


class AccuracyTable(SpecTable):
    """Table [accuracy]: requested errors relative to the continuum value, at least one."""

    mean_gap: Share | None = None
    """Relative error of the mean gap u_g."""
    contact_area: Share | None = None
    """Relative error of the contact area a_r."""
    stress_deviation: Share | None = None
    """Relative error of the standard deviation sigma_p of the contact pressure."""
    max_points: Annotated[int, Key(ge=SMALLEST_GRID, le=MAX_POINTS)] = MAX_POINTS
    """Largest number of points along x for grid.points = "auto". The available memory may set a
    lower limit."""

    def tolerances(self) -> dict[str, float]:
        """Requested relative errors, by the name of the column."""
        columns = {"mean_gap": "u_g", "contact_area": "a_r", "stress_deviation": "sigma_p"}
        return {columns[key]: share for key, share in self if key in columns and share is not None}


FieldName = Literal["u", "sigma", "height", "contact_pressure"]


class SweepTable(SpecTable):
    """Table [sweep]: lists that are combined value by value. All other lists multiply."""

    paired: Annotated[list[StrictStr], Key(min_length=2)]
    """Keys whose lists are combined value by value, such as ["surface.cutoff", "grid.points"]. The
    lists have the same length. For several groups of lists, repeat the table as [[sweep]]."""

    @model_validator(mode="after")
    def _names_keys(self) -> Self:
        for address in self.paired:
            table, _, key = address.partition(".")
            if table not in (*SWEPT, "load") or not key:
                tables = ", ".join((*SWEPT, "load"))
                raise ValueError(f"paired needs TABLE.KEY, TABLE one of {tables}; got {address!r}")
        return self


class OutputTable(SpecTable):
    """Table [output]: results that are stored in addition to the scalar results."""

    histogram: bool = True
    """Stress distribution Pr(sigma) in linear and logarithmic bins."""
    fields: Annotated[list[FieldName], Key(max_length=4)] = Key(default_factory=list)
    """Fields on the grid: displacement u, stress sigma = K u + p, height of the indenter, and
    contact_pressure, which is exactly zero off contact."""
    cross_section: bool = False
    """All four fields along the diagonal; for a line contact, along x."""
    true_contact: bool = False
    """Rms stress in full contact, taken over the true contact instead of the whole cell: columns
    deviation_c, quadrature_c and deviation_bearing."""
    patches: bool = False
    """Number of the contact patches, their areas and the distribution of the areas."""
    gap_distribution: bool = False
    """Gap distribution Pr(g) in linear and logarithmic bins."""
    stiffness: bool = False
    """Contact stiffness -dp/du_g from a linear-response calculation."""
    spectra: bool = False
    """Power spectra and autocorrelations of height, displacement and stress."""
    percolation: bool = False
    """Whether the gap percolates along x and along y: columns percolates_x and percolates_y."""

    def on_request(self) -> list[str]:
        """The keys of `ON_REQUEST` that are switched on."""
        return [name for name in ON_REQUEST if getattr(self, name)]

    def names(self) -> frozenset[str]:
        """Everything that is stored: the keys that are on, a field as "fields.u"."""
        keys = {key for key, value in self if value is True}
        return frozenset(keys | {f"fields.{name}" for name in self.fields})

    def with_names(self, names: Iterable[str]) -> "OutputTable":
        """The same with these things stored as well."""
        all_names = self.names().union(names)
        keys: dict[str, Any] = {key: key in all_names for key, value in self if key != "fields"}
        fields = [name for name in get_args(FieldName) if f"fields.{name}" in all_names]
        return OutputTable(fields=fields, **keys)


ON_REQUEST = tuple(
    name
    for name, key in OutputTable.model_fields.items()
    if key.default is False and name != "cross_section"
)
"""Keys of [output] that are off by default and need whole fields."""


class Spec(SpecTable):
    """A resolved run spec: every sweep expanded, every default filled in."""

    study: StudyTable
    surface: list[Surface]
    elastomer: list[Elastomer]
    grid: list[GridTable]
    load: LoadTable
    solver: list[AnySolver]
    output: OutputTable
    accuracy: AccuracyTable | None = None
    sweep: list[SweepTable] = Key(default_factory=list)
    source: str = ""
    """The file of the spec, for messages."""
    places: dict[str, list[tuple[int | None, ...]]]
    """Where each entry of a table, and each load, stands in each group of paired lists; None where
    the table has no list of the pair."""

    def study_path(self, output: Path | None = None) -> Path:
        """The study file, or `output`. Raises InputError for a suffix of files of another kind."""
        if output is not None and output.suffix.lower() in NO_STUDY:
            raise InputError(
                f"{output}: a study is an HDF5 file, such as {output.stem}.h5; gfmd export writes "
                "CSV, netCDF and VTK, gfmd report HTML"
            )
        return output or Path(f"{self.study.name}.h5")

    def combinations(self) -> Iterator[tuple[dict[str, int], list[float]]]:
        """The entries of the swept tables that go together, by table, and their loads."""
        for entries in product(*(range(len(getattr(self, table))) for table in SWEPT)):
            at = dict(zip(SWEPT, entries, strict=True))
            places = [self.places[table][i] for table, i in at.items()]
            pairs = zip(self.load.listed(), self.places["load"], strict=True)
            loads = [load for load, place in pairs if _fit([*places, place])]
            if loads:
                yield at, list(dict.fromkeys(loads))

    def resolved(self) -> dict[str, Any]:
        """What determines the results, as plain data: files stand for their content."""
        left_out = {"study", "load", "places", "source"}
        left_out |= {name for name in ("sweep", "accuracy") if not getattr(self, name)}
        data: dict[str, Any] = self.model_dump(mode="json", exclude=left_out, by_alias=True)
        for name in set(ON_REQUEST) - set(self.output.on_request()):
            del data["output"][name]  # a new key must not change the identity of other tasks
        for table in ("surface", "elastomer"):
            for dumped, choice in zip(data[table], getattr(self, table), strict=True):
                if choice.file is not None:
                    dumped["path"] = choice.file.name
                    dumped["sha256"] = file_digest(choice.file)
        data["load"] = {self.load.key: self.load.values()}
        if LOADS[self.load.key].searched:
            data["load"]["tolerance"] = self.load.tolerance
        return data


def _fit(places: list[tuple[int | None, ...]]) -> bool:
    """Whether entries stand at the same places of the paired lists."""
    return all(len(set(pair) - {None}) <= 1 for pair in zip(*places, strict=True))
