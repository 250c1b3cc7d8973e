"""Rigid indenters: the height h on a grid, pointing towards the elastic body.

Each class is one `kind` of the run spec's [surface]. `on(grid)` samples the surface on the
grid [y, x] (line scenes: [x]); `smallest_grid()` says which grid resolves it. Equation numbers
are those of Mueser, "Elastic contacts of randomly rough surfaces across the spatial dimensions".
"""

from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

import numpy as np
from pydantic import Field as Key
from pydantic import model_validator

from gfmd_cli.errors import InputError
from gfmd_cli.physics.bodies import (
    SMALLEST_GRID,
    Cone,
    Indenter,
    LineParabola,
    Parabola,
    PowerLawBody,
    Punch,
    Ridge,
    Wave,
)
from gfmd_cli.physics.choice import FilePath, Positive, Seed
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.grid import Grid
from gfmd_cli.physics.preparation import Edges, Levelling, border_step, level, make_periodic
from gfmd_cli.physics.ranks import Ranks
from gfmd_cli.physics.slabs import lay_out
from gfmd_cli.physics.topography import Topography, read_topography


class SelfAffine(Indenter):
    """Random self-affine surface: |h(q)| = sqrt(C(q)), each phase drawn evenly from (0, 2 pi).

    Paper Eqs. (3) and (40). The phase of a mode depends on the seed and on the mode alone, so one
    seed is one continuous surface, whatever the grid; a smaller cut-off only adds modes to it.
    """

    dimension: ClassVar[int] = 2
    kind: Literal["self-affine"] = "self-affine"
    hurst: Annotated[float, Key(gt=0, le=1)] = 0.8
    """Hurst exponent H, above 0 and up to 1."""
    rolloff: Positive = 0.5
    """Roll-off (or cut-off) wavelength lambda_r / L."""
    cutoff: Annotated[float, Key(gt=0, le=1)] = 0.005
    """Short-wavelength cut-off lambda_s / L."""
    spectrum: Literal["rolloff", "cutoff"] = "rolloff"
    """"rolloff": C = [1 + (q/q_r)^2]^(-1-H), Eq. (3); "cutoff": C = (q/q_r)^(-2-2H) from q_r
    on, zero below, Eq. (40)."""
    seed: Seed = 0
    """Seed of the random phases."""
    h_std: Positive | None = None
    """Root-mean-square height [m] to scale to; by default C = 1 m^2 at long wavelengths."""
    length: Positive = 1.0
    """Side of the cell L [m]."""

    @model_validator(mode="after")
    def _has_modes(self) -> Self:
        if self.spectrum == "cutoff" and self.cutoff > self.rolloff:
            raise ValueError(
                f"cutoff = {self.cutoff:g} above rolloff = {self.rolloff:g} leaves no roughness"
            )
        return self

    @property
    def highest_mode(self) -> int:
        """Largest |q| L / 2 pi along an axis: L / lambda_s."""
        return int(np.floor(1 / max(self.cutoff, 1e-300) * (1 + 1e-12)))  # 1/0.01: 100, not 99

    def smallest_grid(self) -> int:
        """Two points per lambda_s."""
        return max(SMALLEST_GRID, 2 * self.highest_mode)

    def on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        self._write_modes(grid)
        height = grid.empty()
        grid.backward_into(height)
        return height

    def _amplitude(self, m: Field) -> Field:
        """sqrt(C(q)) at |q| = 2 pi m / L, zero beyond the cut-off. Paper Eqs. (3), (40)."""
        reduced = m * self.rolloff  # q / q_r
        known = (m > 0) & (m * self.cutoff <= 1 + 1e-12)
        if self.spectrum == "rolloff":
            return np.where(known, (1 + reduced**2) ** (-0.5 - 0.5 * self.hurst), 0.0)
        known &= reduced >= 1 - 1e-12
        return np.where(known, np.where(known, reduced, 1.0) ** (-1 - self.hurst), 0.0)

    def _write_modes(self, grid: Grid) -> None:
        """Set `grid.work` to the Fourier coefficients on a grid that resolves the surface.

        Phases are drawn in square rings |m|_max = 1, 2, ...; of q and -q one is drawn. The modes
        with a component at the highest wavenumber of the grid stand for +q and -q alike.
        """
        modes, (first, last) = grid.work, grid.span
        modes[...] = 0.0
        draw = np.random.Generator(np.random.PCG64(self.seed))
        variance = 0.0
        for ring in range(1, self.highest_mode + 1):
            y, x, phase = _ring(draw, ring, first, last)
            value = self._amplitude(np.hypot(y, x)) * np.exp(2j * np.pi * phase)
            variance += 2 * float(np.sum(np.abs(value) ** 2))
            modes[y, x - first] = value
            if first == 0:
                modes[-ring, 0] = modes[ring, 0].conj()
        if 2 * self.highest_mode == len(modes):  # (0, highest) and (highest, 0) and their mirrors
            if grid.ends[1]:
                modes[0, -1] = 2 * modes[0, -1].real
            if grid.ends[0]:
                modes[self.highest_mode, 0] = 2 * modes[self.highest_mode, 0].real
        if self.h_std is not None:
            modes *= self.h_std / np.sqrt(grid.total(variance) or 1.0)


def _ring(draw: np.random.Generator, ring: int, first: int, last: int) -> tuple[Any, Any, Field]:
    """The modes of a square ring with first <= m_x < last, and the phases drawn for them / 2 pi.

    In the order of the draw: m_x = ring from m_y = -ring on; m_y = ring; m_y = -ring. The draws for
    the others are skipped.
    """
    side = (0, 2 * ring + 1) if first <= ring < last else (0, 0)
    above = tuple(2 * ring + 1 + min(x, ring) for x in (first, last))
    below = tuple(3 * ring + max(min(x, ring), 1) for x in (first, last))
    drawn, phases, places = 0, [], []
    for begin, end in (side, above, below):
        if begin > drawn:
            draw.bit_generator.advance(begin - drawn)  # type: ignore[attr-defined]
        phases.append(draw.random(end - begin))
        places.append(np.arange(begin, end))
        drawn = max(drawn, end)
    if drawn < 4 * ring:
        draw.bit_generator.advance(4 * ring - drawn)  # type: ignore[attr-defined]
    place = np.concatenate(places)
    on_side, is_above = place <= 2 * ring, place <= 3 * ring
    y = np.where(on_side, place - ring, np.where(is_above, ring, -ring))
    x = np.where(on_side, ring, place - np.where(is_above, 2 * ring + 1, 3 * ring))
    return y, x, np.concatenate(phases)


STEEP = 3.0  # rms gradient that no machined or worn surface has
CLIFF = 5.0  # step across the border of a map over those inside, which is no roughness


class FileSurface(Indenter):
    """A height map from a file: .npy, HDF5, netCDF, or what microscopes write (SurfaceTopography).

    A `.npy` or HDF5 array is periodic and used as it is. A scan is not: it is levelled, and its
    edges are made to meet. Both can be asked for or left off.
    """

    dimension: ClassVar[int] = 2
    kind: Literal["file"] = "file"
    path: FilePath
    """The file, relative to the run spec."""
    dataset: str | None = None
    """HDF5 dataset or microscope channel; by default the only map, or the default channel."""
    crop: bool = False
    """Take the largest square of even side from the middle of a map that is none."""
    missing: Literal["refuse", "fill"] = "refuse"
    """What to do about missing heights: "fill" spans each hole as smoothly as can be."""
    periodic: bool | None = None
    """Whether the map repeats as it is; by default true for arrays, false for scans."""
    level: Levelling | None = None
    """What to take off first: "none", "mean", "plane" or "curvature"; by default "plane" where
    the map is not periodic, else "none"."""
    edges: Edges | None = None
    """How to make the edges meet: "window" fades the outer `taper` of each side to the mean height,
    "mirror" doubles the cell by reflection, "none"; by default "window" where not periodic."""
    taper: Annotated[float, Key(gt=0, le=0.5)] = 0.1
    """Width of the frame that a window fades, as a share of the side."""
    scale: Positive = 1.0
    """Factor from the heights of the file to metres; on its side, too, where it names no unit."""
    length: Positive | None = None
    """Side of the (cropped) map [m]; by default what the file says, else 1."""

    def smallest_grid(self) -> int:
        """The map's own points. Raises InputError for a flat map."""
        heights = self._periodic_heights()
        if np.ptp(heights) == 0:
            raise InputError(f"{self.path}: surface.path: the map is flat; roughness is needed")
        return len(heights)

    def on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid: the map's own, or Fourier-interpolated."""
        heights = self._periodic_heights()
        if len(heights) != grid.points:
            return Grid(len(heights)).resample(heights, grid)
        return heights if grid.whole else heights[grid.own].copy()

    @property
    def cell(self) -> float:
        """Side of the periodic cell [m]: twice that of the map where it is mirrored."""
        stated = self._stated() or 1.0
        return 2 * stated if self.treatment()[1] == "mirror" else stated

    def states_no_length(self) -> bool:
        """Whether the side of the map is 1 m for want of anything else."""
        return self._stated() is None

    def _stated(self) -> float | None:
        """Side of the map [m]; without a unit it is in that of the heights, and scaled as they."""
        read = self._topography()
        if self.length is not None or read.length is None:
            return self.length
        return read.length if read.metres else self.scale * read.length

    def treatment(self) -> tuple[Levelling, Edges]:
        """What is done to the map: levelling, edges."""
        says = self._topography().periodic
        periodic = self.periodic if self.periodic is not None else says in (True, None)
        return (
            self.level or ("none" if periodic else "plane"),
            self.edges or ("none" if periodic else "window"),
        )

    def _periodic_heights(self) -> Field:
        levelling, edges = self.treatment()
        heights = self.scale * self._topography().heights
        return make_periodic(level(heights, levelling), edges, self.taper)

    def _topography(self) -> Topography:
        return _topography(self.path, self.dataset, self.crop, self.missing == "fill")

    def remarks(self) -> list[str]:
        """What looks like a mistake, for people."""
        heights, notes = self._periodic_heights(), []
        if self.states_no_length():
            notes.append("the file names no side, so L = 1 m: surface.length")
        step = np.sqrt(2 * np.mean(np.diff(heights, axis=0) ** 2))
        gradient = float(step) * len(heights) / self.cell
        if gradient > STEEP:
            notes.append(
                f"rms gradient {gradient:.3g}: are heights and side in metres? surface.scale is "
                "the factor from the heights of the file to metres, surface.length the side"
            )
        cliff = border_step(heights)
        if cliff > CLIFF:
            notes.append(
                f"the step across the border is {cliff:.3g} times those inside: if the map does "
                "not repeat, surface.periodic = false levels it and makes its edges meet"
            )
        return notes

    def preparation(self) -> str:
        """What was read and what was done to it, for people."""
        read, (levelling, edges) = self._topography(), self.treatment()
        rows, columns = read.shape
        steps = [f"{self.path.name} ({read.source}): {rows} x {columns} points"]
        if read.heights.shape != read.shape:
            steps.append("cropped to {} x {}".format(*read.heights.shape))
        if read.filled:
            steps.append(f"{read.filled} missing heights filled in")
        if levelling != "none":
            steps.append(f"{levelling} taken off")
        if edges == "window":
            steps.append(f"edges faded to the mean height over {self.taper:g} of the side")
        elif edges == "mirror":
            steps.append("mirrored to twice the side")
        else:
            steps.append("taken as periodic")
        return ", ".join(steps)


@lru_cache(maxsize=4)
def _topography(path: Path, dataset: str | None, crop: bool, fill: bool) -> Topography:
    """The file, read once as a rule."""
    return read_topography(path, dataset, crop=crop, fill=fill)


Surface = Annotated[
    SelfAffine | Parabola | PowerLawBody | Cone | Punch | Ridge | LineParabola | Wave | FileSurface,
    Key(discriminator="kind"),
]


def dimension_of(kind: str) -> int:
    """Dimension of the scenes of a kind of surface; 2 where the kind is not known."""
    surface = _of_kind(kind)
    return 2 if surface is None else surface.dimension


def default_of(kind: str, key: str) -> object:
    """Value of a key of a kind of surface where none is given; None where there is no such."""
    field = surface.model_fields.get(key) if (surface := _of_kind(kind)) else None
    return None if field is None or field.is_required() else field.default


def _of_kind(kind: str) -> type[Indenter] | None:
    known = get_args(get_args(Surface)[0])
    return next((c for c in known if c.model_fields["kind"].default == kind), None)


def sample(surface: Surface, points: int, ranks: Ranks | None = None) -> tuple[Grid, Field]:
    """The surface on `points` per side of its cell: the grid and the heights [m].

    `ranks` are the processes that share large grids.

    Raises InputError where the grid does not resolve the surface, or the surface is flat, or its
    heights overflow.
    """
    needed = surface.smallest_grid()
    if points < needed:
        raise InputError(
            f"grid.points: {points} points per side do not resolve this surface "
            f"(kind {surface.kind!r}); {needed} or more do"
        )
    length = surface.cell if isinstance(surface, FileSurface) else surface.length
    grid = lay_out(points, surface.dimension, length, ranks)
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        heights = surface.on(grid)
        range_of_heights = grid.most(float(heights.max())) + grid.most(-float(heights.min()))
    if not np.isfinite(range_of_heights):
        raise InputError(f"surface: heights overflow (kind {surface.kind!r}); choose other units")
    if range_of_heights == 0:
        raise InputError(f"surface: flat (kind {surface.kind!r}); reduced units need roughness")
    return grid, heights
