"""The power laws of Pr(sigma) in the continuum as a table."""

from gfmd_cli.analysis.compare import Comparison
from gfmd_cli.analysis.distribution import distributions
from gfmd_cli.analysis.edge_law import fit
from gfmd_cli.analysis.table import Column, Group, Record, Table

LAWS = ("small", "large")
POWER_LAWS = (
    Column("p*", "p_star", ".4g"),
    Column("a_r", "a_r"),
    Column("grids", "grids"),
    Column("seeds", "seeds", "d"),
    Column("stress", "law"),
    Column("sigma / Delta_sigma\nfrom", "lowest", ".3g"),
    Column("\nto", "highest", ".3g"),
    Column("exponent", "exponent", error="error"),
    Column("at the edge", "limit", error="limit_error"),
    Column("theory", "theory", ".3g"),
    Column("prefactor", "prefactor", ".3g"),
)


def power_laws(comparison: Comparison) -> Table:
    """The power laws of Pr(sigma), a record each; without one where no contact has two grids."""
    groups: dict[str, list[Record]] = {}
    for found in distributions(comparison):
        record = {
            "p_star": found.finest["p_star"],
            "a_r": found.a_r,
            "grids": f"{found.points[0]} to {found.points[-1]}",
            "seeds": len(found.seeds),
        }
        laws = [law for law in (fit(found, name) for name in LAWS) if law is not None]
        records = [record | vars(law) for law in laws]
        groups.setdefault(found.scene, []).extend(
            records or [record | {"law": "too few bins are resolved"}]
        )
    caption = (
        "Power laws of Pr(sigma) in the continuum. exponent: fit between the two stresses; at the "
        "edge: fit with the first correction to the power law; theory: exponent at the edge of a "
        "contact, n / (2 - n)."
    )
    return Table(caption, POWER_LAWS, [Group(title, held) for title, held in groups.items()])
