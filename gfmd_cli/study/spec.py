"""The run spec: its models, and the sweeps that a list in the place of a scalar makes."""

import hashlib
import json
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Discriminator, StrictStr, Tag, model_validator
from pydantic import Field as Key

from gfmd_cli.errors import InputError
from gfmd_cli.physics.bodies import SMALLEST_GRID
from gfmd_cli.physics.choice import Choice, Positive
from gfmd_cli.physics.elastomer import Elastomer
from gfmd_cli.physics.surface import Surface
from gfmd_cli.solvers.cascade import SolverChoice

MAX_LADDER = 100_000  # pressures of one ladder; more are a slip of the pen
SWEPT = ("surface", "elastomer", "grid", "solver")


class StudyTable(Choice):
    """Table [study]."""

    name: Annotated[StrictStr, Key(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$")] = "study"
    """Name of the study; its file is NAME.h5 in the working directory."""


MOST_POINTS = 2**17

Points = Annotated[
    Annotated[int, Key(ge=SMALLEST_GRID, le=MOST_POINTS, multiple_of=2), Tag("count")]
    | Annotated[Literal["auto"], Tag("word")],
    Discriminator(lambda given: "word" if isinstance(given, str) else "count"),
]


class GridTable(Choice):
    """Table [grid]."""

    points: Points
    """Points per side, even; or "auto", with [accuracy]: the coarsest grid that is good enough."""


class Ladder(Choice):
    """Pressures in geometric progression."""

    from_: Annotated[float, Key(gt=0, alias="from")]
    """First pressure."""
    to: Positive
    """Last pressure, included."""
    per_decade: Annotated[float, Key(gt=0, le=1000)] = 4
    """Pressures per decade; the step is stretched a little so that the last one is hit."""

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if self.to < self.from_:
            raise ValueError(f"to = {self.to:g} lies below from = {self.from_:g}")
        return self

    def pressures(self) -> list[float]:
        """The pressures, rising."""
        decades = np.log10(self.to) - np.log10(self.from_)  # the ratio can overflow
        steps = max(1, round(decades * self.per_decade)) if decades > 0 else 0
        return [float(p) for p in np.geomspace(self.from_, self.to, steps + 1)]


def _shape(given: Any) -> str:
    """In which of the three ways pressures are given."""
    if isinstance(given, dict | Ladder):
        return "ladder"
    return "list" if isinstance(given, list) else "number"


Pressures = Annotated[
    Annotated[Positive, Tag("number")]
    | Annotated[list[Positive], Key(min_length=1, max_length=MAX_LADDER), Tag("list")]
    | Annotated[Ladder, Tag("ladder")],
    Discriminator(_shape),
]
SHAPES = ("number", "list", "ladder", "count", "word")
"""Tags of the unions above, which no message should name."""


Share = Annotated[float, Key(gt=0, lt=1)]
Areas = Annotated[
    Annotated[Share, Tag("number")]
    | Annotated[list[Share], Key(min_length=1, max_length=MAX_LADDER), Tag("list")],
    Discriminator(_shape),
]
LOADS = ("p_star", "pressure", "contact_area", "mean_gap")
"""Ways to say how hard the bodies are pressed together."""
SOUGHT = {"contact_area": "a_r", "mean_gap": "u_g"}
"""Those whose pressure is searched, with the column that is to take the value asked for."""


class LoadTable(Choice):
    """Table [load]: one of the four ways, as a number, a list or a ladder."""

    p_star: Pressures | None = None
    """Reduced pressures p / Delta_sigma."""
    pressure: Pressures | None = None
    """Pressures [Pa]."""
    contact_area: Areas | None = None
    """Relative contact areas a_r of the solved grid; their pressures are searched."""
    mean_gap: Pressures | None = None
    """Mean gaps u_g / h_std of the solved grid; their pressures are searched."""
    within: Share = 1e-3
    """Relative distance to contact_area or mean_gap at which the search ends."""

    @model_validator(mode="after")
    def _one_of_all(self) -> Self:
        given = [name for name in LOADS if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give one of {', '.join(LOADS)}")
        if "within" in self.model_fields_set and given[0] not in SOUGHT:
            raise ValueError(f"within belongs to {' or '.join(SOUGHT)}")
        return self

    @property
    def quantity(self) -> str:
        """Which of the ways is taken."""
        return next(name for name in LOADS if getattr(self, name) is not None)

    def values(self) -> list[float]:
        """The values asked for, in the order given, each once."""
        given = getattr(self, self.quantity)
        if isinstance(given, Ladder):
            return given.pressures()
        return list(dict.fromkeys(given if isinstance(given, list) else [given]))


class AccuracyTable(Choice):
    """Table [accuracy]: errors that are accepted, relative to the continuum value."""

    mean_gap: Share | None = None
    """Of u_g."""
    contact_area: Share | None = None
    """Of a_r."""
    stress_deviation: Share | None = None
    """Of sigma_p."""
    max_points: Annotated[int, Key(ge=SMALLEST_GRID, le=MOST_POINTS)] = MOST_POINTS
    """Points per side that grid.points = "auto" may grow to; memory may end it before."""

    def asked(self) -> dict[str, float]:
        """Accepted relative errors by the name of the column."""
        given = {
            "u_g": self.mean_gap,
            "a_r": self.contact_area,
            "sigma_p": self.stress_deviation,
        }
        return {name: share for name, share in given.items() if share is not None}


ON_REQUEST = (
    "true_contact", "patches", "gap_distribution", "stiffness", "spectra", "percolation",
)  # fmt: skip
"""Keys of [output] that are off unless asked for, and take whole grids."""


class OutputTable(Choice):
    """Table [output]: what is kept beside the scalars."""

    histogram: bool = True
    """Pr(sigma) in linear and logarithmic bins."""
    fields: Annotated[list[Literal["u", "sigma", "height"]], Key(max_length=3)] = Key(
        default_factory=list
    )
    """Fields on the grid: displacement, stress, indenter."""
    cross_section: bool = False
    """Height, displacement and stress along the diagonal (of a line scene: all of it)."""
    true_contact: bool = False
    """Delta_sigma over the true contact, as columns deviation_c, quadrature_c and
    deviation_bearing."""
    patches: bool = False
    """Number and areas of the contact patches, with the distribution of the areas."""
    gap_distribution: bool = False
    """Pr(g) in linear and logarithmic bins."""
    stiffness: bool = False
    """Contact stiffness -dp/du_g, by linear response."""
    spectra: bool = False
    """Power spectra and autocorrelations of height, displacement and stress."""
    percolation: bool = False
    """Whether the gap percolates through the periodic cell, as columns leaks_x and leaks_y."""

    def on_request(self) -> list[str]:
        """The keys of `ON_REQUEST` that are asked for."""
        return [name for name in ON_REQUEST if getattr(self, name)]


class Spec(Choice):
    """A resolved run spec: every sweep expanded, every default filled in."""

    study: StudyTable
    surface: list[Surface]
    elastomer: list[Elastomer]
    grid: list[GridTable]
    load: LoadTable
    solver: list[SolverChoice]
    output: OutputTable
    accuracy: AccuracyTable | None = None

    def resolved(self) -> dict[str, Any]:
        """What determines the results, as plain data: files stand for their content."""
        data: dict[str, Any] = self.model_dump(
            mode="json", exclude={"study", "load"}, by_alias=True
        )
        if self.accuracy is None:
            del data["accuracy"]
        for name in set(ON_REQUEST) - set(self.output.on_request()):
            del data["output"][name]  # studies older than the key go on
        for table in ("surface", "elastomer"):
            for dumped, choice in zip(data[table], getattr(self, table), strict=True):
                for later, default in (("crop", False), ("missing", "refuse")):
                    if dumped.get(later) == default:  # as in specs of older versions
                        del dumped[later]
                if "path" in dumped:
                    dumped["path"] = Path(dumped["path"]).name
                    dumped["sha256"] = file_digest(choice.path)
        data["load"] = {self.load.quantity: self.load.values()}
        if self.load.quantity in SOUGHT:
            data["load"]["within"] = self.load.within
        return data


def file_digest(path: Path) -> str:
    """SHA-256 of a file's content. Raises InputError where it cannot be read."""
    if not path.is_file():
        raise InputError(f"{path}: no such file, or not a regular one")
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error


def digest(data: Any) -> str:
    """Short name of plain data by its content."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def differences(old: Any, new: Any, where: str = "") -> list[str]:
    """What changed between two pieces of plain data, a line for each key."""
    if isinstance(old, dict) and isinstance(new, dict):
        lines = []
        for key in [*old, *(key for key in new if key not in old)]:
            inner = f"{where}.{key}" if where else str(key)
            lines += differences(old.get(key), new.get(key), inner)
        return lines
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return [
            line
            for i, (a, b) in enumerate(zip(old, new, strict=True))
            for line in differences(a, b, f"{where}[{i}]" if len(old) > 1 else where)
        ]
    if all(_is_sweep(value) for value in (old, new)) and (
        lines := differences(_swept(old), _swept(new), where)
    ):
        return lines  # else the combinations differ
    return [] if old == new else [f"{where}: {_short(old)} -> {_short(new)}"]


def _is_sweep(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, dict) for v in value)


def _swept(tables: list[dict[str, Any]]) -> dict[str, Any]:
    """Values that each key of a sweep takes, one by itself."""
    keys = dict.fromkeys(key for table in tables for key in table)
    taken = {key: [t[key] for t in tables if key in t] for key in keys}
    distinct = {key: [v for i, v in enumerate(vs) if v not in vs[:i]] for key, vs in taken.items()}
    return {key: vs[0] if len(vs) == 1 else vs for key, vs in distinct.items()}


def refuse_other(stored: Any, spec: "Spec", message: str) -> None:
    """Raise InputError, with the difference, where a file was made from another spec."""
    changed = differences(stored, spec.resolved())
    if changed:
        shown = "\n".join(f"  {line}" for line in changed[:20])
        raise InputError(f"{message}\nStored -> asked for:\n{shown}")


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 80 else text[:77] + "..."


def expand(table: dict[str, Any]) -> list[tuple[dict[str, Any], dict[str, int]]]:
    """All combinations of the lists in a table, with the place that each value has in its list."""
    swept = [key for key, value in table.items() if isinstance(value, list)]
    combinations = []
    for places in product(*(range(len(table[key])) for key in swept)):
        where = dict(zip(swept, places, strict=True))
        combinations.append((table | {key: table[key][i] for key, i in where.items()}, where))
    return combinations
