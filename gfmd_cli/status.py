"""The statuses of a task, each with its explanation."""

from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Any, Self

NEARLY_FULL = 0.99
"""Relative contact area above which the mean gap needs fine grids: the 11 contacts that ended at
2048 points (n = 0.5 to 3, p* = 2.6 to 3.3, accuracy.mean_gap = 0.01) had 0.997 and more."""

LARGEST_TOLERANCE = 0.01
"""Largest usual natural residual: the mean gap of the default surface is wrong by 0.1 to 1 %."""


class ExplainedEnum(StrEnum):
    """Members with an explanation; the value of a member is its text in files and tables."""

    explanation: str

    def __new__(cls, value: str, explanation: str = "") -> Self:
        """A member from its text and its explanation."""
        member = str.__new__(cls, value)
        member._value_ = value
        member.explanation = explanation
        return member


class Status(ExplainedEnum):
    """How a task ended. The explanation is a template for `explain`, over the columns of a row."""

    CONVERGED = "converged", "the residual is below the tolerance"
    MAX_STEPS = (
        "max_steps",
        "residual {residual:.1e} after {steps} steps, tolerance {tolerance:.1e}: raise "
        "solver.max_steps",
    )
    ROUNDING = (
        "rounding",
        "residual {residual:.1e}, tolerance {tolerance:.1e}: limited by double-precision "
        "rounding; loosen solver.tolerance",
    )
    DIVERGED = "diverged", 'the solver diverged: use solver.kind = "auto"'
    ACCURACY_NOT_REACHED = (
        "accuracy_not_reached",
        "estimated errors on the grid with {points} points along x are larger than requested or "
        "unknown, and memory and accuracy.max_points allow no finer grid, or no finer grid would "
        "help",
    )
    LOAD_NOT_REACHED = (
        "load_not_reached",
        "no pressure gives load.{load} = {load_value:g} on this grid with this solver.tolerance; "
        "the table has the nearest value",
    )
    MISSING = "missing", "not solved yet, or failed: see `gfmd status`"

    # of a run only; such a task has no record
    FAILED = "failed", "an error ended the task"
    NO_SPACE = "no_space", "the results could not be written"
    KILLED = "killed", "its worker processes died again and again (out of memory?)"
    INTERRUPTED = "interrupted", "stopped by a signal; its state is saved"

    def explain(self, row: Mapping[str, Any]) -> str:
        """The explanation with the numbers of a row."""
        text = self.explanation.format(**row)
        if self is Status.ACCURACY_NOT_REACHED and row["a_r"] > NEARLY_FULL:
            text += (
                f"; next to full contact (a_r = {row['a_r']:.5g}) few points have a gap, and its "
                "relative error needs fine grids: loosen accuracy.mean_gap, or solve this load on "
                "a fixed grid"
            )
        if self is Status.ROUNDING and row["residual"] > LARGEST_TOLERANCE:
            text = (
                f"residual {row['residual']:.1e}: the rounding of the stress in double precision "
                "is not small compared with the pressure; give a larger pressure or fewer points"
            )
        if self is Status.MAX_STEPS and row["solver_kind"] != "auto":
            text += ', or use solver.kind = "auto"'
        return text

    @property
    def is_converged(self) -> bool:
        """Whether the task met its tolerance, accuracy and load."""
        return self is Status.CONVERGED

    @property
    def is_accurate(self) -> bool:
        """Whether a contact is solved to the tolerance, or as far as rounding allows."""
        return self in (Status.CONVERGED, Status.ROUNDING)

    @property
    def is_within_tolerance(self) -> bool:
        """Whether the contact is solved to its tolerance, whatever else the task has missed."""
        return self is Status.CONVERGED or self in SHORTFALLS

    @property
    def shortfall(self) -> str:
        """What a solved task has missed, in words; empty of one that is converged."""
        if self is Status.CONVERGED:
            return ""
        return SHORTFALLS.get(self, TOLERANCE_NOT_REACHED)

    @property
    def is_solved(self) -> bool:
        """Whether the task has a result, converged or not."""
        return not (self.is_failure or self in (Status.MISSING, Status.INTERRUPTED))

    @property
    def is_failure(self) -> bool:
        """Whether an error ended the task, so that it has no result."""
        return self in (Status.FAILED, Status.NO_SPACE, Status.KILLED)


TOLERANCE_NOT_REACHED = "tolerance not reached"
SHORTFALLS = {
    Status.ACCURACY_NOT_REACHED: "accuracy not reached",
    Status.LOAD_NOT_REACHED: "load not reached",
}
"""What tasks within tolerance have missed."""


def worst(statuses: Iterable[Status]) -> Status:
    """The status of several tasks: of one that is not converged, if there is any."""
    order = (Status.CONVERGED, *SHORTFALLS)
    return max(statuses, key=lambda each: order.index(each) if each in order else len(order))


def counted(counts: Mapping[Status, int]) -> str:
    """The counts as text, such as "2 converged, 1 missing"."""
    return ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))
