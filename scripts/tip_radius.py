"""Contact of maps that a blunt tip has scanned: the tables of docs/map_evidence.md.

    python scripts/tip_radius.py [contacts] [--points 1024] [--seeds 3] [--hurst 0.3 0.8]

Self-affine surfaces on a half-space, scanned by a paraboloid of the radius R: the map is the
dilation of the surface by the tip, at every second or fourth point of the grid. R is given in units
of 1 / h''_rms, h'' the second derivative of the surface along x. Map and surface are solved on the
same grid, at pressures that are a given p* for the surface. Printed are the mean length of the
blunt structures in points of the map (0 if no map gives a warning), the fraction of maps that give
a warning without the radius, the mean ratio (map over surface) of Delta_sigma and, for each p*, of
contact area and mean gap; then those of both after the S-filter that the warning names, with the
largest deviation of the area.

    python scripts/tip_radius.py sound [--points 64 256] [--seeds 10]

Numbers of sound surfaces (those of noise_of_maps.py), and of those with the warning.
"""

import argparse
import re
from collections.abc import Sequence
from itertools import product

import numpy as np
from noise_of_maps import surfaces
from scipy.ndimage import grey_dilation
from unresolved_roughness import P_STARS, contacts, pressures, ratios, sampled

from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.gaussian_filter import gaussian_filter
from gfmd_cli.maps.tip import blunted
from gfmd_cli.maps.topography import Topography
from gfmd_cli.physics.self_affine import SelfAffine

RADII = (0.1, 0.3, 1.0, 3.0, 10.0)  # in units of 1 / h''_rms
ROLLOFF, SHORTEST = 1 / 4, 1 / 128  # of the side
PIXELS = (1 / 256, 1 / 512)  # of the side
WITHOUT_TIP = "seen with a round tip"  # the surfaces of noise_of_maps.py that are not counted


def scanned(heights: Field, radius: float) -> Field:
    """The dilation of a periodic map by a paraboloid; `radius` in points, if heights are too."""
    reach = min(int(np.sqrt(2 * radius * np.ptp(heights))) + 1, len(heights) // 2 - 1)
    tip = -(np.arange(-reach, reach + 1) ** 2) / (2 * radius)
    for line in (tip[None], tip[:, None]):  # a paraboloid is the sum of two parabolas
        heights = grey_dilation(heights, structure=line, mode="wrap")
    return heights


def warning(heights: Field, spacing: float, radius: float | None = None) -> str:
    """The warning of a blunt tip about a map."""
    topography = Topography(
        heights=heights,
        missing=None,
        spacing=None,
        shape=heights.shape,
        precision=float(np.finfo(float).eps),
        source="",
    )
    return blunted(topography, (spacing, spacing), 1.0, radius)


def compared(of_map: Field, surface: Field) -> list[float]:
    """Ratios of Delta_sigma and, for each p*, of contact area and mean gap, map over surface."""
    spec: dict[str, dict[str, object]] = {
        "elastomer": {"kind": "half-space"},
        "surface": {"length": 1.0},
        "grid": {"points": len(surface)},
    }
    loads = pressures(surface, spec, P_STARS)
    return ratios(contacts(of_map, spec, loads), contacts(surface, spec, loads))[1:]


def scans(points: int, hurst: float, options: argparse.Namespace) -> None:
    """Print the ratios for scans of random surfaces."""
    sign = -1 if options.flip else 1
    rows: dict[tuple[int, float], list[list[float]]] = {}
    filtered: dict[tuple[int, float], list[list[float]]] = {}
    for seed in range(options.seeds):
        surface = SelfAffine(cutoff=SHORTEST, rolloff=ROLLOFF, hurst=hurst, h_std=1e-3, seed=seed)
        heights = surface.heights(points)
        second = points**2 * np.diff(heights, 2, axis=1)
        for pixel, radius in product(PIXELS, options.radii):
            step = round(pixel * points)
            if not step:
                continue
            tip = radius / second.std()
            seen = sampled(scanned(points * heights, points * tip) / points, len(heights) // step)
            text = warning(seen, pixel, tip)
            match = re.search(r"shorter than about (\S+) m.*s_filter = (\S+) or", text)
            length = float(match[1]) / pixel if match else 0.0
            is_noticed = float(bool(warning(seen, pixel)))
            row = [length, is_noticed, *compared(sign * seen, sign * heights)]
            rows.setdefault((step, radius), []).append(row)
            if match:
                cutoff, whole = options.cutoff * float(match[2]), (1 / points, 1 / points)
                smooth = gaussian_filter(heights, whole, cutoff, periodic=True)
                of_map = gaussian_filter(seen, (pixel, pixel), cutoff, periodic=True)
                row = compared(sign * of_map, sign * smooth)
                filtered.setdefault((step, radius), []).append(row)
    for (step, radius), values in rows.items():
        kept = np.array(filtered.get((step, radius), []))
        mean = np.mean(values, axis=0)
        mean[0] *= len(values) / max(len(kept), 1)  # the others have 0
        text = f"{hurst:3g} {points:5} {step:2} {radius:4g} {mean[0]:5.1f} {mean[1]:4.0%}"
        text += "".join(f"{value:7.2f}" for value in mean[2:])
        if kept.size:
            worst = np.abs(kept[:, 1::2] - 1).max(axis=0)
            text += "  |" + "".join(f"{value:6.2f}" for value in kept.mean(axis=0))
            text += "  |" + "".join(f"{value:6.2f}" for value in worst) + f" of {len(kept)}"
        print(text, flush=True)


def sound(sizes: Sequence[int], seeds: int) -> None:
    """Print the numbers of sound surfaces, and of those with a warning."""
    for points in sizes:
        made = [pair for seed in range(seeds) for pair in surfaces(points, seed)]
        maps = [(name, heights) for name, heights in made if name != WITHOUT_TIP]
        names = [name for name, heights in maps if warning(heights, 1.0)]
        print(f"{points}^2: {len(names)} of {len(maps)} maps give the warning", *names, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("table", nargs="?", choices=("contacts", "sound"), default="contacts")
    parser.add_argument("--points", type=int, nargs="+", default=[1024])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--hurst", type=float, nargs="+", default=[0.3, 0.8])
    parser.add_argument("--radii", type=float, nargs="+", default=RADII)
    parser.add_argument("--flip", action="store_true", help="turn map and surface upside down")
    parser.add_argument("--cutoff", type=float, default=1.0, help="over that of the warning")
    arguments = parser.parse_args()
    if arguments.table == "sound":
        sound(arguments.points, arguments.seeds)
        return
    print("H, points of the grid, of a pixel, R h''_rms; length in pixels, noticed; Delta_sigma")
    print("p*, for a_r and mean gap each:", *P_STARS, "; with the S-filter; largest deviations")
    for points, hurst in product(arguments.points, arguments.hurst):
        scans(points, hurst, arguments)


if __name__ == "__main__":
    main()
