"""Warnings about results that are probably not what the user means."""

from gfmd_cli.study.refinement import Solved
from gfmd_cli.study.tasks import Task

FEW_POINTS = 30  # a choice: the area of a circle of 30 points has an error of its rim of a third
PASCALS = 1e3  # modulus above which it is one in Pa; a choice: gels have 1e3 Pa, reduced units 1
METRES = 1e-2  # rms height above which it is in reduced units; a choice: no rough solid has 1 cm
SEPARATOR = " | "
"""Between the warnings of one contact in a column of text."""


def warnings_of(task: Task, solved: Solved) -> list[str]:
    """Reasons to doubt the result of one contact, a sentence each; mostly none."""
    elastomer, scene = task.elastomer, solved.scene
    warnings = task.surface.remarks(task.boundary)
    if elastomer.modulus > PASCALS and scene.h_std > METRES:
        warnings.append(
            f"a modulus of {elastomer.modulus:.3g} Pa and an rms height of {scene.h_std:.3g} m: "
            "are heights and lengths in metres? Set surface.h_std, surface.length or surface.scale"
        )
    points = round(solved.observables.a_r * scene.grid.size)
    if points < FEW_POINTS:
        warnings.append(
            f"fewer than {FEW_POINTS} grid points in contact: contact area and stress depend on "
            "the grid; use more points"
        )
    return warnings
