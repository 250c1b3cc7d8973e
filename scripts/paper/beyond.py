"""Beyond the paper: maps of the contact."""

from pathlib import Path

from gfmd_cli.analysis.plotting import WIDTH, LegendFigure
from paper.claims import Finding
from paper.drawing import label
from paper.studies import StoredStudies, needs

HIGHEST = 0.5  # gap / h_std at the end of the colours


@needs("plate_map")
def plate_map(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Maps of the contact over the gap, n = 1 to 4, a quarter of the cell."""
    plot = LegendFigure(WIDTH, WIDTH * 1.25)
    axes = plot.figure.subplots(2, 2)
    for ax, row in zip(
        axes.flat, sorted(studies.rows("plate_map"), key=lambda r: r["n"]), strict=False
    ):
        fields = studies.fields("plate_map", row)
        gap = (fields["u"] - fields["height"]) / row["h_std"]
        touching = (fields["u"] == fields["height"]) & (fields["sigma"] > 0)
        half = len(gap) // 2
        image = ax.imshow(
            gap[:half, :half], cmap="Blues", vmin=0, vmax=HIGHEST, origin="lower",
            interpolation="nearest",
        )  # fmt: skip
        y, x = touching[:half, :half].nonzero()
        ax.plot(x, y, ",", color="#cc3311", rasterized=True)
        ax.set(xticks=[], yticks=[])
        ax.set_title(f"{label(row['n'])}, a_r = {row['a_r']:.3f} (grid)", fontsize=8, pad=2)
    plot.figure.colorbar(
        image, ax=axes, orientation="horizontal", label=r"gap  $/\,h_\mathrm{std}$", extend="max",
        fraction=0.05, pad=0.02,
    )  # fmt: skip
    plot.write(folder / "plate_map")
    return []


FIGURES = (plate_map,)
