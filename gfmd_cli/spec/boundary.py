"""The boundary of a contact for which the spec gives none."""

from gfmd_cli.errors import InputError
from gfmd_cli.physics.elastomers import LinearElastomer
from gfmd_cli.physics.indenters import RigidSurface
from gfmd_cli.solvers.auto import AnySolver
from gfmd_cli.spec.models import GridTable


def with_boundary(
    surface: RigidSurface,
    elastomer: LinearElastomer,
    grid: GridTable,
    solver: AnySolver,
) -> tuple[RigidSurface, GridTable]:
    """The surface with the treatment of its edges, and the grid with its boundary.

    A map that ends at its borders has a free boundary where elastomer and solver allow it, and is
    mirrored elsewhere. Every other surface is periodic.
    """
    if grid.boundary is None:
        free = surface.has_borders and _allows_free(surface.dimension, elastomer, solver)
        grid = grid.model_copy(update={"boundary": "free" if free else "periodic"})
    return surface.within(grid.boundary or "periodic"), grid


def _allows_free(dimension: int, elastomer: LinearElastomer, solver: AnySolver) -> bool:
    """Whether contacts of this elastomer and solver can have a free boundary."""
    try:
        solver.check_boundary("free")
        elastomer.check_free_boundary(dimension)
    except InputError:
        return False
    return True
