"""Markdown tables, for the scripts that print those of docs/."""

from collections.abc import Iterable


def print_row(*cells: object) -> None:
    """One line of a table, at once."""
    print(f"| {' | '.join(map(str, cells))} |", flush=True)


def print_head(*heads: object) -> None:
    """The head of a table."""
    print_row(*heads)
    print_row(*["---"] * len(heads))


def print_table(title: str, heads: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """A whole table under a title."""
    print(f"\n{title}\n")
    print_head(*heads)
    for row in rows:
        print_row(*row)
