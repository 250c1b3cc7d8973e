"""What the paper claims, and what the studies say to it."""

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["agrees", "agrees in part", "disagrees", "not decidable here"]


@dataclass(frozen=True)
class Claim:
    """One statement of the paper beside what is found."""

    where: str
    """Section, equation or figure of the paper."""
    says: str
    finds: str
    """In numbers, with their errors."""
    verdict: Verdict
    figure: str = ""
    """Name of the figure that shows it."""


def table(claims: list[Claim]) -> str:
    """The claims as a Markdown table, numbered."""
    lines = [
        "| | where | the paper says | found here | verdict |",
        "| --- | --- | --- | --- | --- |",
    ]
    for number, claim in enumerate(claims, 1):
        found = claim.finds + (
            f" [Figure](figures/paper/{claim.figure}.png)" if claim.figure else ""
        )
        cells = (str(number), claim.where, claim.says, found, f"**{claim.verdict}**")
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def count(claims: list[Claim]) -> str:
    """How many claims got which verdict."""
    verdicts = [claim.verdict for claim in claims]
    told = [f"{verdicts.count(v)} {v}" for v in dict.fromkeys(verdicts)]
    return f"{len(claims)} claims: " + ", ".join(told)
