"""Statements of the paper with criteria, measured numbers, and the verdict that follows from both.

The criteria are data, written down with the statement (`statements_*.py`). A figure function only
measures; no verdict is written anywhere.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import floor, inf, isfinite, log10
from typing import Literal

Verdict = Literal["agrees", "agrees in part", "disagrees", "misprint", "not decided here"]
SIGMAS = 2.0  # errors to both sides of a value that a criterion has to allow for
MARKS = {True: "✓", False: "✗", None: "?"}


@dataclass(frozen=True)
class Value:
    """A number with its error."""

    value: float
    error: float = 0.0

    def __str__(self) -> str:
        if not (isfinite(self.error) and self.error > 1e-8):
            return f"{self.value:.4g}"
        leading = -floor(log10(self.error))
        digits = max(0, leading + (0 if self.error >= 2 * 10**-leading else 1))
        return f"{self.value:.{digits}f} ± {self.error:.{digits}f}"

    def times(self, factor: float) -> "Value":
        """The value and its error in another unit."""
        return Value(self.value * factor, self.error * abs(factor))


Cases = Mapping[str, Value]
"""Values by case, for example by exponent."""


def by_exponent(values: Mapping[float, Value]) -> dict[str, Value]:
    """Values of the exponents n as cases."""
    return {f"n = {n:g}": value for n, value in values.items()}


@dataclass(frozen=True)
class Criterion:
    """A quantity and the limits between which the statement holds."""

    quantity: str
    low: float = -inf
    high: float = inf

    def holds(self, value: Value) -> bool | None:
        """Whether the value lies within the limits; None if its error does not decide it."""
        if not isfinite(value.value):
            return None
        reach = SIGMAS * value.error if isfinite(value.error) else inf
        if self.low <= value.value - reach and value.value + reach <= self.high:
            return True
        if value.value + reach < self.low or value.value - reach > self.high:
            return False
        return None

    @property
    def limits(self) -> str:
        """The limits in words."""
        if self.low == -inf:
            return f"at most {self.high:.4g}"
        if self.high == inf:
            return f"at least {self.low:.4g}"
        return f"{self.low:.4g} to {self.high:.4g}"


@dataclass(frozen=True)
class Statement:
    """One statement of the paper that can be checked."""

    where: str
    """Section, equation or figure of the paper."""
    says: str
    criteria: tuple[Criterion, ...] = ()
    """What has to hold; without a criterion nothing can be decided."""
    printed: tuple[Criterion, ...] = ()
    """If its print is in doubt: what has to hold in addition if nothing is misprinted."""
    figure: str = ""
    """Name of the figure that shows it."""


@dataclass(frozen=True)
class Finding:
    """What was measured for a statement: for each criterion one value, or one for each case."""

    key: str
    measured: Mapping[str, Value | Cases]
    """By the quantity of the criterion."""
    remark: str = ""

    def cases(self, criterion: Criterion) -> dict[str, Value]:
        """The values of a criterion by case; a single value has no name."""
        values = self.measured.get(criterion.quantity, {})
        return {"": values} if isinstance(values, Value) else dict(values)

    def judged(self, criteria: Iterable[Criterion]) -> list[bool | None]:
        """Whether each criterion holds, case by case; None where nothing was measured."""
        return [
            judged
            for criterion in criteria
            for judged in ([criterion.holds(v) for v in self.cases(criterion).values()] or [None])
        ]


def verdict(statement: Statement, finding: Finding) -> Verdict:
    """The verdict by the criteria of the statement.

    All hold: agrees; all fail: disagrees; some hold and some fail: agrees in part. If all hold but
    what the print says in addition, that is a misprint. Anything else is not decided. Raises
    ValueError for a measured quantity that no criterion asks for.
    """
    known = {criterion.quantity for criterion in (*statement.criteria, *statement.printed)}
    if finding.measured.keys() - known:
        raise ValueError(f"{finding.key}: no criterion for {finding.measured.keys() - known}")
    parts = finding.judged(statement.criteria)
    if parts and all(parts):
        printed = finding.judged(statement.printed)
        if all(printed):
            return "agrees"
        return "misprint" if False in printed else "not decided here"
    if True in parts and False in parts:
        return "agrees in part"
    if parts and all(part is False for part in parts):
        return "disagrees"
    return "not decided here"


def result(statement: Statement, finding: Finding) -> str:
    """Each criterion with its limits, the values found, and which of them hold."""
    lines = []
    for criterion in (*statement.criteria, *statement.printed):
        values = [
            f"{f'{case}: ' if case else ''}{value} {MARKS[criterion.holds(value)]}"
            for case, value in finding.cases(criterion).items()
        ]
        note = "; printed form" if criterion in statement.printed else ""
        lines.append(
            f"{criterion.quantity} ({criterion.limits}{note}): {', '.join(values) or 'not measured ?'}"
        )
    return "<br>".join([*lines, *([finding.remark] if finding.remark else [])])
