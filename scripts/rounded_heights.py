"""Errors of a contact if the heights of its map are rounded: the table of docs/map_evidence.md.

    python scripts/rounded_heights.py

Self-affine surfaces with ten points per lambda_s on the half-space, at the pressure that is
p* = 0.05 without rounding; the mean over seeds of the errors relative to the exact heights.
"""

import argparse

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.contact import Scene
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.observables import observe
from gfmd_cli.physics.scenes import build_scene, reduce_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

POINTS_PER_WAVE = 10
P_STAR = 0.05
ROUNDINGS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)  # over the rms difference of neighbouring heights


def results(scene: Scene, height: Field) -> Field:
    """Rms gradient (as Delta_sigma), contact area, mean gap and sigma_p of other heights."""
    pressure = P_STAR * scene.delta_sigma
    other = reduce_scene(scene.grid, height * scene.h_std, HalfSpace())
    contact = other.contact(pressure / other.delta_sigma)
    solution = solve_contact(contact, Auto(tolerance=1e-5))
    observables = observe(contact, solution.u, solution.sigma)
    gap, deviation = observables.u_g * other.h_std, observables.sigma_p * other.delta_sigma
    return np.array([other.delta_sigma, observables.a_r, gap, deviation])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, nargs="+", default=[128, 256, 512])
    parser.add_argument("--seeds", type=int, default=8)
    arguments = parser.parse_args()
    for points in arguments.points:
        print(f"{points}^2: step, equal neighbours, errors of gradient, a_r, mean gap, sigma_p")
        rows = []
        for seed in range(arguments.seeds):
            surface = SelfAffine(cutoff=POINTS_PER_WAVE / points, seed=seed)
            scene = build_scene(surface, HalfSpace(), points)
            difference = float(np.diff(scene.height, axis=1).std())
            exact = results(scene, scene.height)
            for rounding in ROUNDINGS:
                step = rounding * difference
                height = np.round(scene.height / step) * step
                equal = np.mean([np.mean(np.diff(height, axis=axis) == 0) for axis in (0, 1)])
                rows.append([equal, *(results(scene, height) / exact - 1)])
        mean = np.mean(np.reshape(rows, (arguments.seeds, len(ROUNDINGS), 5)), axis=0)
        for rounding, row in zip(ROUNDINGS, mean, strict=True):
            print(f"{rounding:5.2f}" + "".join(f"{value:8.1%}" for value in row))


if __name__ == "__main__":
    main()
