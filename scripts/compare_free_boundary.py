"""Free boundary: gfmd against ContactMechanics and tamaas on the same grid.

    python scripts/compare_free_boundary.py configs/data/di-3.di

A half-space under random maps, square and oblong, and under the levelled maps of the given files.
All codes have the same kernel (stress constant on each pixel, Love 1929), so that they have to
agree to their tolerances: FreeFFTElasticHalfSpace of ContactMechanics and dcfft of tamaas, both by
the method of Polonsky and Keer. The peers are installed by pip into an environment of their own.
The results are in docs/verification.md.
"""

import argparse
import json
import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from bench_peers import ONE_THREAD, install

MODULUS = 1.0  # E* [Pa]; reduced results do not depend on it
TOLERANCE = 1e-9  # natural residual; of the peers: of h_std, and the one of tamaas
MAX_STEPS = 50000
HEADER = f"{'map':12} {'points':>9} {'p*':>5}  {'code':18} {'contact':>8} {'other':>6} " + " ".join(
    f"{name:>9}" for name in ("mean gap", "rms p", "largest")
)


def contact_mechanics(height, sides, pressure):
    """Gap and contact pressure, indexed as the heights, [x, y]; whether it says converged."""
    from ContactMechanics import FreeFFTElasticHalfSpace
    from ContactMechanics.Systems import NonSmoothContactSystem
    from SurfaceTopography import Topography

    substrate = FreeFFTElasticHalfSpace(height.shape, MODULUS, sides)
    system = NonSmoothContactSystem(substrate, Topography(height, sides))
    result = system.minimize_proxy(
        external_force=pressure * sides[0] * sides[1],
        pentol=TOLERANCE * float(height.std()),
        maxiter=MAX_STEPS,
    )
    own = tuple(slice(n) for n in height.shape)
    area = sides[0] * sides[1] / height.size
    return result.x[own] - height - result.offset, result.jac[own] / area, result.success


def tamaas(height, sides, pressure):
    """The same by tamaas."""
    import tamaas as tm

    model = tm.ModelFactory.createModel(tm.model_type.basic_2d, list(sides), list(height.shape))
    model.E, model.nu = MODULUS, 0.0
    solver = tm.PolonskyKeerRey(model, height, TOLERANCE)
    tm.ModelFactory.registerNonPeriodic(model, "dcfft")
    solver.setIntegralOperator("dcfft")
    solver.max_iter = MAX_STEPS
    done = solver.solve(pressure) < TOLERANCE
    gap, stress = np.asarray(model["gap"]), np.asarray(model.traction)
    # it shifts the gap until that is nowhere negative: undone
    return gap - np.vdot(gap, stress) / stress.sum(), stress, done


CODES = {"ContactMechanics": contact_mechanics, "tamaas": tamaas}


def work(path):
    """In a process of its own: solve one job and write the result next to it."""
    job = json.loads(Path(path).read_text())
    height = np.load(job["height"]).T.copy()
    gap, stress, done = CODES[job["code"]](height, tuple(job["sides"]), job["pressure"])
    np.savez(job["result"], gap=gap.T, stress=stress.T, done=done)


def solve_by(code, python, height, sides, pressure):
    """Gap, contact pressure and success of a peer."""
    with tempfile.TemporaryDirectory() as name:
        files = {key: str(Path(name) / f"{key}.npy") for key in ("height", "job")}
        result = str(Path(name) / "result.npz")
        np.save(files["height"], height)
        job = {"code": code, "pressure": pressure, "sides": sides[::-1]}
        Path(files["job"]).write_text(
            json.dumps({**job, "height": files["height"], "result": result})
        )
        command = [str(python), __file__, "--work", files["job"]]
        subprocess.run(command, check=True, capture_output=True, env={**os.environ, **ONE_THREAD})
        fields = np.load(result)
        return fields["gap"], fields["stress"], bool(fields["done"])


def cases(points, scans):
    """The maps: name, surface and numbers of points along x and y."""
    from gfmd_cli.physics.file_surface import FileSurface
    from gfmd_cli.physics.self_affine import SelfAffine

    yield "square", SelfAffine(cutoff=8 / points), points, points
    yield "oblong", SelfAffine(cutoff=8 / points, length_y=0.5), points, points // 2
    stretched = SelfAffine(cutoff=16 / points, length_y=0.75)
    yield "odd pixels", stretched, points, points // 2 - 1  # 1.5 times as long along y
    for path in scans:
        scan = FileSurface(path=path, level="plane", edges="none")
        yield path.name, scan, scan.smallest_grid(), scan.smallest_grid_y()


def compare(name, surface, points, points_y, p_star, pythons):
    """One map at one pressure: a line for each code."""
    from gfmd_cli.physics.elastomers import HalfSpace
    from gfmd_cli.physics.free_contact import build_free_scene
    from gfmd_cli.physics.observables import contact_pressure
    from gfmd_cli.solvers.auto import Auto
    from gfmd_cli.solvers.nested_grids import solve_contact

    scene = build_free_scene(surface, HalfSpace(E_star=MODULUS), points, points_y=points_y)
    contact = scene.contact(p_star)
    solution = solve_contact(contact, Auto(tolerance=TOLERANCE))
    stress = contact_pressure(contact.height, solution.u, solution.sigma) * scene.delta_sigma
    gap = (solution.u - contact.height) * scene.h_std
    shape = f"{points} x {points_y}"
    touching = stress > 0
    print(
        f"{name:12} {shape:>9} {p_star:5g}  {'gfmd':18} {np.count_nonzero(touching):8d} {'':6} "
        f"{gap.mean() / scene.h_std:9.6f} {stress.std() / scene.delta_sigma:9.6f} "
        f"{stress.max() / scene.delta_sigma:9.6f}  {solution.status}, {solution.residual:.0e}",
        flush=True,
    )
    for code in CODES:
        if code not in pythons:
            continue
        height, load = contact.height * scene.h_std, p_star * scene.delta_sigma
        their_gap, their_stress, done = solve_by(
            code, pythons[code], height, scene.grid.sides, load
        )
        differ = np.count_nonzero((their_stress > 0) != touching)
        ratios = (
            theirs / ours - 1
            for theirs, ours in (
                (their_gap.mean(), gap.mean()),
                (their_stress.std(), stress.std()),
                (their_stress.max(), stress.max()),
            )
        )
        print(
            f"{name:12} {shape:>9} {p_star:5g}  {code:18} {np.count_nonzero(their_stress > 0):8d} "
            f"{differ:6d} "
            + " ".join(f"{ratio:9.0e}" for ratio in ratios)
            + ("  converged" if done else "  NOT CONVERGED, it says"),
            flush=True,
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scans", type=Path, nargs="*", help="files of measured maps")
    parser.add_argument("--points", type=int, default=256, help="along x, of the random maps")
    parser.add_argument("--p-star", type=float, nargs="+", default=[0.02, 0.5])
    parser.add_argument("--venv", type=Path, default=Path(".venv-peers"), help="of the peers")
    parser.add_argument("--work", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        work(options.work)
        return
    pythons = install(options.venv, tuple(CODES))
    print("gfmd: mean gap / h_std, rms and largest contact pressure / Delta_sigma; peers: relative")
    print("differences; other: points that touch in one of the two codes only\n" + HEADER)
    for case in cases(options.points, options.scans):
        for p_star in options.p_star:
            compare(*case, p_star, pythons)


if __name__ == "__main__":
    main()
