"""Self-affine fits of scans with borders: parts of Gaussian rough surfaces with a known spectrum.

    python scripts/spectrum_fits.py
    python scripts/spectrum_fits.py --search

Prints the table of docs/map_evidence.md: mean and standard deviation over seeds of H, lambda_s,
lambda_r and the rms height of the fit, the last three relative to those of the whole surface, and
the median of the standard errors of H that the fits state.

With --search: the errors of fits to periodic surfaces of random phases, of which the fit is exact,
so that they are those of the search for the largest likelihood (`SEARCH_ERROR`).
"""

import argparse
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.spectrum_fit import fit
from gfmd_cli.physics.surface_spectrum import map_spectrum

POINTS = 512  # of a scan; the surface has twice as many along each side
COLUMNS = ("L / lambda_r", "pixels", "H", "fit", "error", "lambda_s", "lambda_r", "rms", "scatter")


def gaussian_roughness(
    draw: np.random.Generator, points: int, hurst: float, mode_r: float, mode_s: float
) -> np.ndarray:
    """White noise, filtered to C = [1 + (m / m_r)^2]^(-1-H) for modes m up to m_s."""
    noise = np.fft.rfft2(draw.standard_normal((points, points)))
    m = np.hypot(np.fft.fftfreq(points, 1 / points)[:, None], np.arange(points // 2 + 1))
    noise *= np.where(m <= mode_s, (1 + (m / mode_r) ** 2) ** (-0.5 * (1 + hurst)), 0)
    noise[0, 0] = 0
    return np.fft.irfft2(noise)


def fits(folder: Path, seeds: range, hurst: float, rolloff: float, pixels: float) -> list[str]:
    """The cells of one row."""
    values, failed = [], 0
    for seed in seeds:
        draw, points = np.random.default_rng(seed), 2 * POINTS
        heights = gaussian_roughness(draw, points, hurst, 2 * rolloff, points / pixels)
        path = folder / f"{seed}-{hurst}-{rolloff}-{pixels}.npy"
        np.save(path, heights[:POINTS, :POINTS])
        fitted = map_spectrum(FileSurface(path=path, periodic=False)).fit
        path.unlink()
        if fitted is None:
            failed += 1
            continue
        cutoff, wavelength = pixels / POINTS, fitted.rolloff_wavelength or np.nan
        relative = fitted.cutoff_wavelength / cutoff, wavelength * rolloff
        values.append((fitted.hurst, *relative, fitted.rms_height / heights.std(),
                       fitted.scatter, fitted.hurst_error))  # fmt: skip
    if not values:
        return ["no fit"]
    mean, deviation = np.nanmean(values, 0), np.nanstd(values, 0, ddof=1)
    h, s, r, rms, scatter, _ = (f"{m:.3f} ± {d:.3f}" for m, d in zip(mean, deviation, strict=True))
    note = [f"{failed} without fit"] if failed else []
    return [h, f"{np.median(values, 0)[-1]:.3f}", s, r, rms, scatter.partition(" ")[0], *note]


def print_search_errors(seeds: range, hursts: list[float]) -> None:
    """Root mean square and largest errors of H and ln q_r."""
    errors = []
    for seed, hurst, rolloff, cutoff in product(seeds, hursts, (0.5, 0.2), (0.05, 0.02)):
        surface = SelfAffine(hurst=hurst, rolloff=rolloff, cutoff=cutoff, seed=seed)
        fitted = fit(build_scene(surface, HalfSpace(), surface.smallest_grid()).shells)
        errors.append((fitted.hurst - hurst, np.log(fitted.q_r * rolloff / (2 * np.pi))))
    for name, error in zip(("H", "ln q_r"), np.abs(np.transpose(errors)), strict=True):
        rms = np.sqrt(np.mean(error**2))
        print(f"{name}: {error.size} surfaces, rms error {rms:.1e}, largest {error.max():.1e}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--hurst", type=float, nargs="+", default=[0.3, 0.8, 1.0])
    parser.add_argument("--rolloffs", type=float, nargs="+", default=[20.0, 5.0, 2.0])
    parser.add_argument("--pixels", type=float, nargs="+", default=[2.0, 4.0, 8.0, 16.0])
    parser.add_argument("--search", action="store_true")
    options = parser.parse_args()
    if options.search:
        print_search_errors(range(options.seeds), options.hurst)
        return
    print(*COLUMNS, sep=" | ")
    with TemporaryDirectory() as folder:
        for rolloff, pixels, hurst in product(options.rolloffs, options.pixels, options.hurst):
            cells = fits(Path(folder), range(options.seeds), hurst, rolloff, pixels)
            print(f"{rolloff:g}", f"{pixels:g}", f"{hurst:g}", *cells, sep=" | ", flush=True)


if __name__ == "__main__":
    main()
