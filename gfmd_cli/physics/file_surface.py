"""Height maps and line profiles from files as surfaces: reading, preparation, heights on grids.

How a map goes on beyond its borders follows from two keys, `periodic` and `edges`:

    periodic  edges         _is_repeated  has_borders  _is_reflected  is_mirrored
    true      None, "none"  yes           no           no             no
    false     None          no            yes          yes            yes
    false     "none"        no            no           yes            yes
    either    "mirror"      no            no           no             yes
    either    "window"      no            no           no             no
"""

from math import comb
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field as Key

from gfmd_cli.errors import InputError
from gfmd_cli.files.file_cache import file_cache
from gfmd_cli.grid.arrays import Field, Mask, MaskedField
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.maps import map_warnings, misread
from gfmd_cli.maps.gaussian_filter import MIN_SPACINGS, gaussian_filter
from gfmd_cli.maps.height_map import shape_text
from gfmd_cli.maps.interpolation import (
    Interpolation,
    at_centres,
    monotone,
    nearest,
    suited_interpolation,
)
from gfmd_cli.maps.map_preparation import (
    DEGREES,
    LEVELLING_ROUNDING,
    Edges,
    Levelling,
    fill_missing,
    level,
    make_periodic,
    mirror,
    window,
)
from gfmd_cli.maps.noise import noise_beyond, noisy
from gfmd_cli.maps.pictures import Picture, picture
from gfmd_cli.maps.tip import blunted
from gfmd_cli.maps.topography import Region, Topography, read_topography
from gfmd_cli.physics.indenters import SMALLEST_GRID, RigidSurface
from gfmd_cli.spec_table import FilePath, Positive, Scale
from gfmd_cli.units import count, labelled

SHOWN_ROUNDING = 1e-5  # of a length that a message shows with six digits


class FileSurface(RigidSurface):
    """Height map from a .npy, HDF5, netCDF or microscope file (SurfaceTopography).

    A `.npy` or HDF5 array is used unchanged, as a periodic map. A microscope scan, or an array with
    coordinates and units, is not periodic: a plane is subtracted, and the contact has a free
    boundary or, if this is not available, the map is mirrored. The keys `periodic`, `level` and
    `edges` override this.
    """

    rough: ClassVar[bool] = True
    is_map: ClassVar[bool] = True
    size_hint: ClassVar[str] = "surface.region takes a part of the map"
    is_centred: ClassVar[bool] = False
    """Where the points of finer grids lie, see `interpolation.positions`."""
    kind: Literal["file"] = "file"
    path: FilePath
    """Path of the file, relative to the run spec."""
    dataset: str | None = None
    """HDF5 dataset or microscope channel; by default the only map, the only one with a name such as
    "height", or the default channel."""
    region: Region | None = None
    """Part of the map to use, such as { x = [10, 110], y = [0, 90] } in pixels, or with
    unit = "m" in metres; by default all of it."""
    flip: bool = False
    """Whether to turn the heights upside down, as for the replica of a surface."""
    crop: bool = False
    """Whether to use only the largest square of an even number of points in the middle."""
    missing: Literal["fill", "void", "refuse"] = "fill"
    """Treatment of missing heights. "fill": they are interpolated by the solution of the Laplace
    equation. "void": likewise for spectrum and mean gap, but these points never touch. "refuse":
    a map with missing heights is an error."""
    periodic: bool | None = None
    """Whether the map is periodic; by default true for arrays, unless grid.boundary is "free", and
    false for scans."""
    level: Levelling | None = None
    """Trend that is subtracted first: "none", "mean", "plane" or "curvature"; by default "plane"
    for scans and with surface.periodic = false, otherwise "none"."""
    s_filter: Positive | None = None
    """Cut-off wavelength of the S-filter [m], a Gaussian low-pass filter (ISO 16610-61) against
    noise: it halves the amplitude of waves of this length and damps shorter ones more. By default
    no filter."""
    lateral_period_limit: Positive | None = None
    """Wavelength [m] at which the microscope shows half of the amplitude (ISO 25178-600; not the
    Rayleigh distance), at least that of two points. The program then warns of roughness that the
    map does not resolve, and of strong shorter waves, which are probably noise. By default that of
    two points, without the second warning. The heights are not changed."""
    tip_radius: Positive | None = None
    """Radius of the tip that scanned the map [m]; the program then warns of structures that the tip
    has blunted. By default it warns only if many peaks have one curvature that almost none exceeds.
    The heights are not changed."""
    edges: Edges | None = None
    """How the map is made periodic: "window" tapers the heights near the border to their mean,
    "mirror" reflects the map to twice its sides, "none" changes nothing. By default "none" for a
    periodic map and for a free boundary (see grid.boundary), otherwise "mirror"."""
    taper: Annotated[float, Key(gt=0, le=0.5)] = 0.1
    """Width of the tapered zone of the window at each edge, as a fraction of the side."""
    interpolation: Interpolation | None = None
    """Interpolation on grids finer than the map: "fourier", exact for band-limited maps, or
    "monotone", without overshoot. The default depends on the spectrum, the plateaus and the steps
    of the map."""
    scale: Scale = 1.0
    """Factor from the heights of the file to metres; also for its side if it states no unit."""
    length: Scale | None = None
    """Side of the map along x [m]; with a region or cropped, of the part that is used. By default
    that of the file, or 1 if the file states none."""
    length_y: Scale | None = None
    """Side of the map along y [m]; by default that of the file, else the points along y times the
    spacing along x."""

    @property
    def dimension(self) -> int:  # type: ignore[override]
        """1 for a line profile, 2 for a map."""
        return self._topography().heights.ndim

    @file_cache(maxsize=16)
    def smallest_grid(self) -> int:
        """Number of points of the map along x; cached, because scenes ask for it several times.

        Raises InputError for a flat map, also where levelling leaves the rounding of its heights,
        as it does where too few of them are known.
        """
        heights, topography = _prepared(self), self._topography()
        largest = self.scale * float(max(topography.heights.max(), -topography.heights.min()))
        left = float(np.ptp(heights))
        if left <= (LEVELLING_ROUNDING + 2 * topography.precision) * largest:
            known = topography.heights.size - topography.missing_count
            degree = DEGREES.get(self.levelling(), 0)
            least = comb(degree + self.dimension, degree) + 1  # more than the terms of the trend
            if topography.missing is not None and known < least:
                raise InputError(
                    f"{self.path}: surface.path: the map has {count(known, 'known height')} at "
                    f"{topography.heights.size} points, the others are missing; with "
                    f'surface.level = "{self.levelling()}" it needs {least} or more'
                )
            rounding = (
                f' with surface.level = "{self.levelling()}": what is left, {left:.2g} m, is the '
                f"rounding of heights of up to {largest:.3g} m"
            )
            raise InputError(
                f"{self.path}: surface.path: the map is flat{rounding if left else ''}; roughness "
                "is needed"
            )
        return int(heights.shape[-1])

    def smallest_grid_y(self) -> int:
        """Number of points of the map along y."""
        return len(_prepared(self)) if self.dimension == 2 else 1

    def own_points(self) -> int:
        """Points of the map itself along x, or a multiple if one side has fewer than any grid."""
        least = min(_prepared(self).shape) // self.copies
        return -(-SMALLEST_GRID // least) * self.smallest_grid() // self.copies

    def points_y(self, points: int) -> int:
        """Points along y where a spec gives none: in the ratio of those of the map."""
        if self.dimension == 1:
            return 1
        return round(points * self.smallest_grid_y() / self.smallest_grid())

    def on_cell(self, points: int, points_y: int) -> Self:
        """The map itself, whose cell does not depend on the grid.

        Raises InputError where one side is very much longer than the other.
        """
        if self.dimension == 2:
            self._checked_sides()
        return self

    def heights_on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid, between the points of the map by interpolation."""
        heights = _prepared(self)
        if heights.shape == grid.whole_shape:
            return heights[grid.own].copy()
        if self.applied_interpolation() == "monotone":
            return monotone(heights, grid.whole_shape, grid.own, centred=self.is_centred)
        if self.is_centred:
            heights = at_centres(heights, grid.whole_shape)
        shape = heights.shape
        own_grid = Grid(shape[-1], heights.ndim, points_y=shape[0], is_temporary=True)
        return own_grid.resample(heights, grid)

    def _is_reflected(self) -> bool:
        """Whether the map has borders, beyond which it is reflected for the interpolation only."""
        return self.edges in (None, "none") and not self._is_periodic()

    @property
    def band_limited(self) -> bool:  # type: ignore[override]
        """Whether the map is interpolated by a Fourier series."""
        return self.applied_interpolation() == "fourier"

    @file_cache(maxsize=16)
    def applied_interpolation(self) -> Interpolation:
        """The interpolation on grids finer than the map; cached, as it may need a transform."""
        if self.interpolation is not None:
            return self.interpolation
        return suited_interpolation(self.resolved_heights(), mirrored=self.is_mirrored)

    def smallest_grid_reason(self) -> str:
        """Reason for the smallest grid: the points of the map."""
        return f"a map of {shape_text(self._topography().heights.shape)} points"

    def parameters(self) -> dict[str, Any]:
        """Value of every key, with the defaults that depend on the file as they are applied."""
        return super().parameters() | {
            "level": self.levelling(),
            "edges": self.edges or "none",
            "periodic": self._is_periodic(),
            "interpolation": self.applied_interpolation(),
            "lateral_period_limit": self.period_limit() or None,
        }

    @property
    def sides(self) -> tuple[float, ...]:
        """Sides of the periodic cell [m]: twice those of the map where it is mirrored.

        Raises InputError for a side along y of a line profile.
        """
        if self.length_y is not None and self.dimension == 1:
            raise InputError(
                f"{self.path}: surface.length_y = {self.length_y:g}: a line profile has no side "
                "along y; leave surface.length_y out"
            )
        stated = self.stated_sides()
        along_y, along_x = (1.0, *(stated or self._topography().heights.shape))[-2:]
        length = self.length or (stated[-1] if stated else 1.0)
        sides = self.length_y or length * (along_y / along_x), length
        return tuple(self.copies * side for side in sides[-self.dimension :])

    def stated_sides(self) -> tuple[float, ...] | None:
        """Sides of the map [m] by its file, scaled as the heights where it states no unit."""
        topography = self._topography()
        if topography.spacing is None:
            return None
        factor = 1.0 if topography.metric_sides else self.scale
        shape = topography.heights.shape
        return tuple(factor * (n * step) for n, step in zip(shape, topography.spacing, strict=True))

    def levelling(self) -> Levelling:
        """The trend that is subtracted from the map."""
        return self.level or ("none" if self._is_periodic() else "plane")

    @property
    def has_borders(self) -> bool:  # type: ignore[override]
        """Whether the map is not periodic, and the spec does not say how to make it periodic."""
        return self.edges is None and not self._is_periodic()

    def within(self, boundary: str) -> Self:
        """The map with the treatment of its edges that goes with a boundary by default.

        With a free boundary an array, too, ends at its borders, but by default no trend is
        subtracted from it. Raises InputError for a mirrored map with a free boundary.
        """
        if boundary == "free" and self.edges == "mirror":
            raise InputError(
                'surface.edges = "mirror" makes a map periodic, and grid.boundary = "free" lets it '
                "end at its borders: leave out one of them"
            )
        if self.has_borders:
            return self.model_copy(update={"edges": "none" if boundary == "free" else "mirror"})
        is_made_periodic = self.edges not in (None, "none")
        if boundary == "periodic" or is_made_periodic or self._stated_periodic() is not None:
            return self
        array = {"periodic": False, "level": self.levelling(), "edges": "none"}
        return self.model_copy(update=array)

    @property
    def copies(self) -> int:  # type: ignore[override]
        """Copies of the map along each side of its cell: two where it is mirrored."""
        return 2 if self.edges == "mirror" else 1

    def _stated_periodic(self) -> bool | None:
        """Whether the map is periodic, by the spec or else by the file; None if neither says so."""
        return self._topography().periodic if self.periodic is None else self.periodic

    def _is_periodic(self) -> bool:
        return self._stated_periodic() is not False

    def _is_repeated(self) -> bool:
        """Whether the map itself is repeated, so that opposite borders are neighbours."""
        return self._is_periodic() and self.edges in (None, "none")

    def measured_map(self) -> tuple[MaskedField, tuple[float, ...]]:
        """Levelled and filtered heights [m], masked where missing, and their spacing [m].

        Nothing is subtracted from a map that is taken as periodic, unless `level` says so.
        """
        missing = self._topography().missing
        mask = np.ma.nomask if missing is None else missing
        return np.ma.masked_array(_filtered(self), mask), self._map_spacing()

    def _levelled(self) -> Field:
        """The heights [m] less the trend of the known ones, any value where missing."""
        topography = self._topography()
        known = None if topography.missing is None else ~topography.missing
        heights = topography.heights  # read-only; not copied, because maps are large
        if self.scale != 1.0:
            heights = self.scale * heights
        return level(heights, self.levelling(), known)

    def changed(self, grid: Grid, *, is_periodic: bool = True) -> dict[str, Mask]:
        """Points of a grid that the window has changed, and nearest to heights filled in.

        With a free boundary the points of a finer grid are centred, see `mirrored`.
        """
        zones = {}
        if self.edges == "window":
            own_shape = self._topography().heights.shape
            zones["edge"] = window(own_shape, self.taper, grid.whole_shape)[grid.own] < 1.0
        is_centred = not is_periodic and self._is_reflected()
        filled = self._missing_on(grid, is_centred) if self.missing == "fill" else None
        return zones if filled is None else zones | {"filled": filled}

    def mirrored(self) -> "FileSurface | None":
        """The map mirrored to twice its sides; None if it is periodic or made so.

        A quarter of the mirrored cell (half of a line) is the map itself.
        """
        if not self._is_reflected():
            return None
        same = {"interpolation": self.applied_interpolation()}
        return MirroredMap.model_construct(**dict(self) | same | {"edges": "mirror"})

    def peak(self) -> float | None:
        """Height of the highest point [m]: of the map, or of the Fourier series through it."""
        if self.missing == "void" and self._topography().missing_count:
            return None
        return super().peak() if self.band_limited else float(_prepared(self).max())

    @property
    def is_mirrored(self) -> bool:
        """Whether the map is mirrored, in its cell or for the interpolation only."""
        return self.edges == "mirror" or self._is_reflected()

    def resolved_heights(self) -> Field:
        """Heights [m] at the points of the map."""
        return _filtered(self) if self.edges == "mirror" else _prepared(self)

    def tapered_map(self) -> "FileSurface | None":
        """The map with tapered edges, scaled to its own power; None where it is periodic."""
        if not self.is_mirrored:
            return None
        return TaperedMap.model_construct(**dict(self) | {"edges": "window"})

    def period_limit(self) -> float:
        """Shortest wavelength that the map resolves [m]; 0 where the spec does not say it.

        Two points or more.
        """
        if self.lateral_period_limit is None:
            return 0.0
        return max(self.lateral_period_limit, 2 * max(self._map_spacing()))

    def void(self, grid: Grid) -> Mask | None:
        """Points of a grid nearest to a missing height of the map, if these never touch."""
        return self._missing_on(grid, self.is_centred) if self.missing == "void" else None

    def _missing_on(self, grid: Grid, is_centred: bool) -> Mask | None:
        """Points of a grid nearest to a missing height of the map; None without one."""
        missing = self._topography().missing
        if missing is None:
            return None
        if self.edges == "mirror":
            missing = mirror(missing)
        return nearest(missing, grid.whole_shape, centred=is_centred)[grid.own]

    def missing_count(self) -> int:
        """Number of missing heights of the map."""
        return self._topography().missing_count

    def pictures(self) -> dict[str, Picture]:
        """The map as it is in the file, and as it is solved."""
        topography, sides = self._topography(), tuple(side / self.copies for side in self.sides)
        measured = picture(self.scale * topography.heights, sides, topography.missing)
        return {"measured": measured, "prepared": picture(_prepared(self), self.sides)}

    def _map_spacing(self) -> tuple[float, ...]:
        """Distance of the points of the map along each axis [m]."""
        shape = self._topography().heights.shape
        return tuple(side / self.copies / n for side, n in zip(self.sides, shape, strict=True))

    def _topography(self) -> Topography:
        return _read(self.path, self.dataset, region=self.region, flip=self.flip, crop=self.crop)

    def warnings(self, boundary: str = "periodic") -> list[str]:
        """Warnings about the side, the heights, their gradient and borders, and unused keys."""
        topography, heights = self._topography(), _prepared(self)
        warnings = [
            *topography.notes,
            *self._warnings_on_sides(),
            map_warnings.unit_of_heights(topography, self.scale),
            *_warnings_on_heights(self),
            map_warnings.unlikely_gradient(heights, self._map_spacing()),
        ]
        if "taper" in self.model_fields_set and self.edges != "window":
            warnings.append('surface.taper has no effect without surface.edges = "window"')
        if self.missing == "fill":
            warnings.append(map_warnings.many_filled_in(topography))
            if not self._is_repeated():
                warnings.append(map_warnings.missing_ends(topography))
        if boundary == "periodic" and not self.has_borders:
            warnings.append(map_warnings.step_at_border(heights, self._remedy_of_step()))
        if boundary == "free" and self.levelling() == "none":
            warnings.append(map_warnings.tilted(heights))
        return list(filter(None, warnings))

    def _remedy_of_step(self) -> str:
        """What to change where opposite borders of a repeated map do not fit."""
        if self.edges == "window":
            return "the tapered zone is too narrow; raise surface.taper"
        changes = ["set surface.periodic = false"] if self._is_periodic() else []
        changes += ["leave out surface.edges"] if self.edges == "none" else []
        return f"if the map is not periodic, {' and '.join(changes)}"

    def _warnings_on_sides(self) -> list[str]:
        """Warnings about the sides, one of them at most for each."""
        topography, stated, warnings = self._topography(), self.stated_sides(), list[str]()
        if self.length_y is not None:
            side = (self.length or stated[-1]) * (stated[0] / stated[-1]) if stated else None
            warnings.append(map_warnings.given_side("length_y", self.length_y, side, topography))
        if self.length is not None:
            side = stated[-1] if stated and topography.metric_sides else None
            warnings.append(map_warnings.given_side("length", self.length, side, topography))
        else:
            length = stated[-1] if stated else None
            warnings.append(map_warnings.unknown_side(topography, self.scale, length))
        return warnings

    def preparation(self, boundary: str = "") -> str:
        """Description of how the map was read and prepared for a boundary."""
        topography, levelling = self._topography(), self.levelling()
        missing = count(topography.missing_count, "missing height")
        is_free, own_shape = boundary == "free", topography.heights.shape
        size = f"{shape_text(topography.shape)} points"
        if self.dimension == 1:
            size = f"profile of {size}, the same at all y (line contact)"
        steps = {
            f"{self.path.name} ({topography.source}): {size}": True,
            f"region {self.region}": self.region is not None,
            f"cropped to {shape_text(own_shape)}": self.crop and own_shape != topography.shape,
            "turned upside down": self.flip,
            f"{missing} {'never touch' if self.missing == 'void' else 'filled in'}": bool(
                topography.missing_count
            ),
            f"{levelling} subtracted": levelling != "none",
            f"S-filter {labelled(self.s_filter or 0, 'm')}": self.s_filter is not None,
            "free boundary": is_free,
            "not periodic (free boundary or mirrored)": self.has_borders and not boundary,
            f"edges tapered to the mean height over {self.taper:g} of the side": (
                self.edges == "window"
            ),
            "mirrored to twice the side": self.edges == "mirror",
            "periodic": self._is_repeated() and not is_free,
            "repeated as it is": self.edges == "none" and not self._is_periodic() and not is_free,
            f"interpolation on finer grids: {self.applied_interpolation()}": True,
        }
        return ", ".join(step for step, applies in steps.items() if applies)


class MirroredMap(FileSurface):
    """A map with borders, mirrored to find the heights between its points."""

    is_centred: ClassVar[bool] = True


class TaperedMap(FileSurface):
    """A map with borders and tapered edges, divided by the rms of the window.

    The mean power of the waves is then that of the map.
    """

    def heights_on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid, over the rms of the window."""
        rms = np.sqrt(np.mean(window(grid.whole_shape, self.taper) ** 2))
        return super().heights_on(grid) / rms


_read = file_cache(maxsize=4)(read_topography)
"""Cached, because the same surface is sampled on several grids."""


@file_cache(maxsize=4)
def _prepared(surface: FileSurface) -> Field:
    """The periodic heights [m], levelled, filled in and filtered; cached like the file."""
    return make_periodic(_filtered(surface), surface.edges or "none", surface.taper)


@file_cache(maxsize=4)
def _filtered(surface: FileSurface) -> Field:
    """The heights [m], levelled, filled in and filtered, before their edges are changed.

    Cached, because the spectrum needs them, too. Raises InputError for a cut-off wavelength that
    the map does not resolve or contain, and for a lateral period limit of more than half its side.
    """
    heights, cutoff, spacing = _filled(surface), surface.s_filter, surface._map_spacing()
    longest = min(n * step for n, step in zip(heights.shape, spacing, strict=True))
    limit = surface.lateral_period_limit
    if limit is not None and limit > (1 + SHOWN_ROUNDING) * longest / 2:
        raise InputError(
            f"{surface.path}: surface.lateral_period_limit = {limit:g} m: the shortest "
            f"wavelength that the microscope resolves must be at most half the shorter side of the "
            f"map, {longest / 2:g} m"
        )
    if cutoff is None:
        return heights
    shortest = MIN_SPACINGS * min(spacing)
    if not (1 - SHOWN_ROUNDING) * shortest <= cutoff <= (1 + SHOWN_ROUNDING) * longest:
        raise InputError(
            f"{surface.path}: surface.s_filter = {cutoff:g} m: the cut-off wavelength must lie "
            f"between {MIN_SPACINGS} spacings of the map, {shortest:g} m, and its shorter side, "
            f"{longest:g} m"
        )
    return gaussian_filter(heights, spacing, cutoff, periodic=surface._is_repeated())


@file_cache(maxsize=4)
def _filled(surface: FileSurface) -> Field:
    """The levelled heights [m], with the missing ones filled in; cached like the file."""
    missing, heights = surface._topography().missing, surface._levelled()
    if missing is None:
        return heights
    if surface.missing == "refuse":
        first = zip(("x", "y"), np.argwhere(missing)[0][::-1], strict=False)
        raise InputError(
            f"{surface.path}: {np.count_nonzero(missing)} of {missing.size} heights are NaN, "
            "infinite or marked as missing, the first at "
            f"{', '.join(f'{axis} = {index}' for axis, index in first)}; "
            'surface.missing = "fill" fills them in, "void" keeps them out of contact'
        )
    spacing, periodic = surface._map_spacing(), surface._is_repeated()
    return fill_missing(heights, missing, spacing=spacing, periodic=periodic)


@file_cache(maxsize=16)
def _warnings_on_heights(surface: FileSurface) -> tuple[str, ...]:
    """Warnings about artefacts of a scan. Cached: every contact of a study has the same."""
    topography, scale = surface._topography(), surface.scale
    shape, spacing = topography.heights.shape, surface._map_spacing()
    levelled = _filled(surface)
    corners = tuple(slice(None, None, n - 1) for n in shape)
    unfilled = levelled if topography.missing is None else surface._levelled()
    subtracted = scale * topography.heights[corners] - unfilled[corners]
    sides = tuple(step * (n - 1) for step, n in zip(spacing, shape, strict=True))
    filled_lines, sound = misread.filled_lines(topography)
    outliers, misread_map = map_warnings.outliers(sound), misread.misread(sound)
    points = "" if misread_map or outliers else map_warnings.single_points(sound)
    lines = "" if misread_map else map_warnings.shifted_lines(sound, spacing)
    rounded = map_warnings.rounded(topography, scale)
    rounded_trend = map_warnings.rounded_trend(topography, levelled, scale)
    cutoff, is_flipped = surface.s_filter or 0.0, surface.flip
    tip = blunted(sound, spacing, scale, surface.tip_radius, cutoff=cutoff, flipped=is_flipped)
    unresolved_noise = noise_beyond(sound, spacing, surface.period_limit(), cutoff)
    is_explained = any((outliers, misread_map, points, lines, rounded, rounded_trend))
    return (
        filled_lines,
        outliers,
        misread_map,
        points,
        lines,
        "" if is_explained else unresolved_noise or noisy(sound, spacing, scale, cutoff),
        "" if misread_map else tip,
        misread.interpolated(sound),
        map_warnings.curved(levelled),
        map_warnings.steep(surface.levelling(), subtracted, sides),
        map_warnings.repeated_lines(topography.heights),
        rounded,
        rounded_trend,
    )
