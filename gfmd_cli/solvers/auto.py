"""The choice of a solver: one class per kind of the table [solver]."""

from typing import Annotated, Literal

from pydantic import Field as Key

from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.ccg import ConstrainedCG
from gfmd_cli.solvers.dual import Dual
from gfmd_cli.solvers.fire import Fire
from gfmd_cli.solvers.loop import Solver
from gfmd_cli.solvers.pcg import ProjectedCG
from gfmd_cli.solvers.polonsky_keer import PolonskyKeer
from gfmd_cli.solvers.sort import Sort, is_flat


class Auto(Solver):
    """The fastest solver, by measurement.

    "dual" for a free boundary. For a periodic boundary "sort" if k does not depend on q (n = 0),
    otherwise "pcg".
    """

    kind: Literal["auto"] = "auto"

    def for_contact(self, contact: Contact) -> Solver:
        """The solver to use for this contact."""
        flat = contact.is_periodic and is_flat(contact)
        return _fastest(contact.boundary, flat)(**self.shared_keys())

    def fields_for(self, boundary: str, exponent: float | None) -> float:
        """Fields at the peak of a solve, of the solver that is chosen."""
        return _fastest(boundary, exponent == 0).fields_in_memory

    def check_boundary(self, boundary: str) -> None:
        """Every boundary has a solver."""


def _fastest(boundary: str, flat: bool) -> type[Solver]:
    """The fastest kind for a boundary and a stiffness that is flat or not."""
    if boundary == Dual.boundary:
        return Dual
    return Sort if flat else ProjectedCG


AnySolver = Annotated[
    Auto | ProjectedCG | Dual | Sort | Fire | ConstrainedCG | PolonskyKeer,
    Key(discriminator="kind"),
]
