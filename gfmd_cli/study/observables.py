"""The scalar observables that [output] turns on, each declared once.

The declaration of an observable gives its column in a study file, in CSV and xarray, its key in
the records of `gfmd analyze --json`, its column in tables, and the function that measures it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.maps.map_preparation import mirror
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.observables import contact_points
from gfmd_cli.physics.patches import contact_patches, open_gap
from gfmd_cli.physics.true_contact import ContactStress, bearing, contact_stress
from gfmd_cli.solvers.contact_stiffness import contact_stiffness
from gfmd_cli.study.column import Column


@dataclass(frozen=True)
class SolvedContact:
    """A solved contact in reduced units, with what several observables share."""

    contact: Contact
    u: Field
    sigma: Field

    @cached_property
    def touching(self) -> Mask:
        """Points in contact."""
        return contact_points(self.contact.obstacle, self.u, self.sigma)

    @cached_property
    def patch_areas(self) -> Field:
        """Areas of the contact patches / L^2; of a line contact, lengths / L."""
        grid = self.contact.grid
        point = grid.area / grid.size / grid.length**grid.dimension
        return contact_patches(self.touching, periodic=self.contact.is_periodic).sizes * point

    @cached_property
    def mirrored(self) -> Contact:
        """See `Contact.mirrored`."""
        return self.contact.mirrored()

    @cached_property
    def full_contact_stress(self) -> ContactStress:
        """Statistics of the full-contact stress over the points in contact."""
        touching = self.touching if self.contact.is_periodic else mirror(self.touching)
        return contact_stress(self.mirrored, touching, touching.size // self.touching.size)

    @cached_property
    def percolates(self) -> list[bool]:
        """Whether the gap percolates along x and, if there is a second axis, along y."""
        gap = open_gap(self.touching, periodic=self.contact.is_periodic)
        return gap.percolates.tolist()[::-1]


class ReducedUnit(NamedTuple):
    """The unit of an observable in reduced units."""

    symbol: str
    """In symbols, such as "L^2"."""
    si_unit: str
    """The SI unit, such as "m^2"."""
    value: Callable[[Mapping[str, Any]], float]
    """Its value in SI units, from a row of a study."""


class OptionalObservable(NamedTuple):
    """One scalar of a solved contact."""

    output_key: str
    """The key of [output] that turns it on."""
    column: Column
    measure: Callable[[SolvedContact], float | None]
    """Its value; None where it does not exist, so that the column is blank."""
    heading: str = ""
    """Short heading in tables; empty if a table of its own shows it."""
    unit: ReducedUnit | None = None
    """Its unit; None for a pure number. Tables then have a second column in SI units."""
    line_unit: ReducedUnit | None = None
    """Its unit in a line contact, where that is another one."""
    is_flag: bool = False
    """Whether the values 0 and 1 mean no and yes."""


PATCH_AREA = ReducedUnit("L^2", "m^2", lambda row: float(row["length"] ** 2))
PATCH_LENGTH = ReducedUnit("L", "m", lambda row: float(row["length"]))
STIFFNESS = ReducedUnit(
    "(Delta_sigma / h_std)", "Pa/m", lambda row: float(row["delta_sigma"] / row["h_std"])
)

OPTIONAL_OBSERVABLES = (
    OptionalObservable(
        "true_contact",
        Column(
            "deviation_c",
            "standard deviation of the full-contact stress K h over the true contact / "
            "Delta_sigma; NaN with fewer than 10 points in contact",
        ),
        lambda solved: solved.full_contact_stress.deviation,
    ),
    OptionalObservable(
        "true_contact",
        Column("quadrature_c", "rms of i (q / |q|) k h over the true contact / Delta_sigma"),
        lambda solved: solved.full_contact_stress.quadrature,
    ),
    OptionalObservable(
        "true_contact",
        Column(
            "deviation_bearing",
            "standard deviation of K h over the highest points, as many as the predicted a_r, "
            "/ Delta_sigma",
        ),
        lambda solved: float(bearing(solved.mirrored).delta_sigma_c(solved.contact.pressure)),
    ),
    OptionalObservable(
        "patches",
        Column("patches", "number of contact patches (8-connected points)", kind=int),
        lambda solved: solved.patch_areas.size,
        "patches",
    ),
    OptionalObservable(
        "patches",
        Column("patch_area_mean", "mean area of a patch / L^2; in a line contact, / L"),
        lambda solved: float(solved.patch_areas.mean()) if solved.patch_areas.size else None,
        "mean patch",
        PATCH_AREA,
        PATCH_LENGTH,
    ),
    OptionalObservable(
        "patches",
        Column("patch_area_largest", "area of the largest patch, in the same units"),
        lambda solved: float(solved.patch_areas.max()) if solved.patch_areas.size else None,
        "largest patch",
        PATCH_AREA,
        PATCH_LENGTH,
    ),
    OptionalObservable(
        "stiffness",
        Column(
            "stiffness",
            "contact stiffness -dp/du_g / (Delta_sigma / h_std); for both boundaries with respect "
            "to the mean gap of the map, not to the displacement of the indenter",
        ),
        lambda solved: contact_stiffness(solved.contact, solved.touching),
        "-dp/du_g",
        STIFFNESS,
    ),
    OptionalObservable(
        "percolation",
        Column(
            "percolates_x",
            "1 (yes) if the gap (4-connected points) percolates along x, 0 (no) if not; through "
            "the periodic cell or, with a free boundary, from border to border",
            kind=int,
        ),
        lambda solved: solved.percolates[0],
        "percolates\nalong x",
        is_flag=True,
    ),
    OptionalObservable(
        "percolation",
        Column("percolates_y", "the same along y; blank for a line contact", kind=int),
        lambda solved: solved.percolates[1] if len(solved.percolates) > 1 else None,
        "along y",
        is_flag=True,
    ),
)
