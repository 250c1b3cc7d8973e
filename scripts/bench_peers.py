"""Time against error: gfmd and other open contact codes on one height field, one thread each.

    python scripts/bench_peers.py --points 512 1024 --repeats 3 --p-star 0.1 0.01

A half-space (E* = 1, the only elastomer that all codes know) under the default surface. Each solve
runs in a process of its own and starts from the height field in memory: imports, files and a first
solve on fewer points, which loads what a code loads late, are not timed; the code's own set-up is.
Before the solve the process writes and frees memory for several fields: a virtual machine gets
memory from its host when it is written for the first time, which takes about 1.4 ms per MiB.
What it returns is judged here, by the same measures for all, against our solution at natural
residual 1e-9. Tolerances mean different things in different codes. Each code is therefore run from
loose to tight, and compared where its mean gap, or its residual, is as good and stays so.

The peers are installed by pip into a virtual environment of their own. docs/performance.md has the
results.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TOLERANCES = [10.0 ** (-k / 2) for k in range(2, 19)]
TARGETS = {"u_g": (1e-4, 1e-6), "residual": (1e-3,)}  # error of the mean gap, natural residual
MAX_STEPS = 20000
SLOW = 10.0  # seconds; such a solve is not repeated, and runs at whole decades only
TOUCHED_FIELDS = 16  # of doubles; more than any of the codes needs
PEERS = ("tamaas", "ContactMechanics", "aspher")
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}


# The codes. Each imports what it needs and returns the solve to be timed, which returns
# the gap, the pressure, the iterations (None: they stand in its log) and whether it says converged.


def gfmd(job, height):
    from gfmd_cli.physics.elastomers import HalfSpace
    from gfmd_cli.physics.file_surface import FileSurface
    from gfmd_cli.physics.scenes import build_scene
    from gfmd_cli.solvers.auto import Auto
    from gfmd_cli.solvers.nested_grids import solve_contact

    surface = FileSurface(path=Path(job["height"]))
    surface.smallest_grid()  # reads the file

    def solve():
        scene = build_scene(surface, HalfSpace(), len(height))
        contact = scene.contact(job["pressure"] / scene.delta_sigma)
        solver = Auto(tolerance=job["tolerance"])
        solution = solve_contact(contact, solver)
        gap, pressure = solution.u, solution.sigma
        gap -= contact.height
        pressure[gap > 0] = 0.0
        np.maximum(pressure, 0.0, out=pressure)
        gap *= scene.h_std
        pressure *= scene.delta_sigma
        return gap, pressure, solution.steps, solution.status == "converged"

    return solve


def tamaas(job, height):
    """Polonsky and Keer. The tolerance is its own measure of complementarity."""
    import tamaas as tm

    def solve():
        sides = list(height.shape)
        model = tm.ModelFactory.createModel(tm.model_type.basic_2d, [1.0, 1.0], sides)
        model.E, model.nu = 1.0, 0.0
        solver = tm.PolonskyKeerRey(model, height, job["tolerance"])
        solver.max_iter = MAX_STEPS
        done = solver.solve(job["pressure"]) < job["tolerance"]
        gap, pressure = np.asarray(model["gap"]), np.asarray(model.traction)
        # it shifts the gap until that is nowhere negative, which costs it digits: undone
        return gap - np.vdot(gap, pressure) / pressure.sum(), pressure, None, done

    return solve


def contact_mechanics(job, height):
    """Three ways of one code; tolerances have dimensions, here a share of h_std and of p.

    "pk": Polonsky and Keer at fixed load. "dual": Bugnicourt's constrained CG in the pressure, at
    fixed load through NuMPI's `mean_val`. "dual-offset": the same as the code itself calls it,
    at fixed offset; it is given that of the solution, which a user would have to search for.
    """
    from ContactMechanics import PeriodicFFTElasticHalfSpace
    from ContactMechanics.Systems import NonSmoothContactSystem
    from NuMPI.Optimization.CCGWithoutRestart import constrained_conjugate_gradients
    from SurfaceTopography import Topography

    area = 1.0 / height.size
    force, length = job["pressure"] * area, job["tolerance"] * float(height.std())
    uniform = np.full(height.shape, force)

    def solve():
        substrate = PeriodicFFTElasticHalfSpace(height.shape, 1.0, (1.0, 1.0))
        topography = Topography(height, (1.0, 1.0), periodic=True)
        system = NonSmoothContactSystem(substrate, topography)
        if job["variant"] == "pk":
            result = system.minimize_proxy(
                external_force=job["pressure"],
                pentol=length,
                forcetol=job["tolerance"] * force,
                thermotol=job["tolerance"],
                maxiter=MAX_STEPS,
            )
            return result.x - height - result.offset, result.jac / area, result.nit, result.success
        if job["variant"] == "dual":
            result = constrained_conjugate_gradients(
                system.dual_objective(0.0),
                system.dual_hessian_product,
                x0=uniform,
                mean_val=force,
                gtol=length,
                maxiter=MAX_STEPS,
            )
        else:  # a uniform pressure lowers this code's half-space, too
            offset = float(substrate.evaluate_disp(-uniform).mean()) - job["mean_gap"]
            result = system.dual_minimize_proxy(
                offset, init_force=uniform, gtol=length, maxiter=MAX_STEPS
            )
        forces = np.reshape(result.x, height.shape)
        gap = substrate.evaluate_disp(-forces) - height  # `jac` is projected, hence of no use
        shift = gap[forces > 0].mean() if job["variant"] == "dual" else offset
        return gap - shift, forces / area, result.nit, result.success

    return solve


def aspher(job, height):
    """Polonsky and Keer with a Fourier preconditioner: one grid, nested, or nested in two
    precisions. The tolerance is a duality gap, checked on what is returned.
    """
    import aspher as code

    arguments = {"gap": -height.ravel(), "p_nominal": job["pressure"], "tol": job["tolerance"]}
    arguments["max_iter"] = MAX_STEPS

    def solve():
        if job["variant"] == "pcg":
            solver = code.ContactSolver(grid_size=len(height), backend="periodic")
            result = solver.solve(**arguments, precond="fourier-fft")
        else:
            precision = "float_then_double" if job["variant"] == "mixed" else "double"
            result = code.solve_nested(
                grid_size=len(height), backend="periodic", precision=precision, **arguments
            )
        return result.gap, result.pressure, result.iterations, result.converged

    return solve


CODES = {  # label: function, variant, package
    "gfmd": (gfmd, "", "gfmd-cli"),
    "tamaas, Polonsky-Keer": (tamaas, "", "tamaas"),
    "ContactMechanics, Polonsky-Keer": (contact_mechanics, "pk", "ContactMechanics"),
    "ContactMechanics, dual": (contact_mechanics, "dual", "ContactMechanics"),
    "ContactMechanics, dual at its offset": (contact_mechanics, "dual-offset", "ContactMechanics"),
    "aspher, preconditioned": (aspher, "pcg", "aspher"),
    "aspher, nested": (aspher, "nested", "aspher"),
    "aspher, nested, float then double": (aspher, "mixed", "aspher"),
}


def work(path):
    """In a process of its own: solve one job and write the result next to it."""
    job = json.loads(Path(path).read_text())
    code = CODES[job["label"]][0]
    code({**job, "height": job["warm_up"], "tolerance": 1e-2}, np.load(job["warm_up"]))()
    solve = code(job, height := np.load(job["height"]))
    np.ones((TOUCHED_FIELDS, *height.shape))  # freed at once
    Path("/proc/self/clear_refs").write_text("5")  # the peak of memory begins anew
    cpu, wall = time.process_time(), time.perf_counter()
    gap, pressure, iterations, converged = solve()
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    peak = re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())
    np.savez(job["result"], gap=np.asarray(gap), pressure=np.asarray(pressure))
    numbers = {"cpu": cpu, "wall": wall, "iterations": iterations, "converged": bool(converged)}
    numbers["mib"] = int(peak[1]) / 1024 if peak else float("nan")
    Path(job["result"]).with_suffix(".json").write_text(json.dumps(numbers))


def run(python, job, folder, limit):
    """One solve; its numbers, or None where it failed or took longer than `limit` seconds."""
    path = folder / "job.json"
    path.write_text(json.dumps(job))
    command = [str(python), __file__, "--work", str(path)]
    environment = {**os.environ, **ONE_THREAD}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, env=environment, timeout=limit
        )
    except subprocess.TimeoutExpired:
        print(f"{job['label']:36} {job['tolerance']:6.0e}  not done within {limit:g} s", flush=True)
        return None
    if done.returncode != 0:
        why = (done.stderr.strip() or f"exit status {done.returncode}").splitlines()[-1]
        print(f"{job['label']:36} {job['tolerance']:6.0e}  failed: {why}", flush=True)
        return None
    numbers = json.loads((folder / "result.json").read_text())
    if numbers["iterations"] is None:  # tamaas says them in its log only
        steps = re.findall(r"^\s*(\d+)\s+\S+e[+-]\d+\s", done.stdout + done.stderr, re.MULTILINE)
        numbers["iterations"] = int(steps[-1]) if steps else -1
    return numbers


def sweep(label, python, job, judge, folder, options):
    """Solve to tighter and tighter tolerances until all targets are reached; the rows."""
    rows, variant = [], CODES[label][1]
    for index, tolerance in enumerate(TOLERANCES):
        if index % 2 == 1 and rows[-1]["wall"] > SLOW:
            continue
        full = {**job, "label": label, "variant": variant, "tolerance": tolerance}
        best = run(python, full, folder, options.limit)
        if best is None:
            break
        for _ in range(options.repeats - 1 if best["wall"] < SLOW else 0):
            again = run(python, full, folder, options.limit)
            if again is not None:
                best.update({key: min(best[key], again[key]) for key in ("cpu", "wall", "mib")})
        row = {"label": label, "tolerance": tolerance, **best, **judge(job["result"])}
        rows.append(row)
        flag = "" if row["converged"] else "  NOT CONVERGED, it says"
        print(
            f"{label:36} {tolerance:6.0e} {row['iterations']:6d} {row['cpu']:8.3f} "
            f"{row['wall']:8.3f} {row['mib']:6.0f}  {row['a_r']:8.1e} {row['sigma_p']:8.1e} "
            f"{row['u_g']:8.1e} {row['residual']:8.1e}{flag}",
            flush=True,
        )
        if all(row[name] <= min(targets) for name, targets in TARGETS.items()):
            break
    return rows


def reach(rows, name, target):
    """The loosest tolerance from which on a measure is within the target."""
    good = None
    for row in reversed(rows):
        if row[name] > target:
            break
        good = row
    return good


def compare(points, p_star, pythons, options):
    """All codes at one size and pressure: every run, then seconds at equal error."""
    from gfmd_cli.physics.elastomers import HalfSpace
    from gfmd_cli.physics.observables import observe
    from gfmd_cli.physics.scenes import build_scene
    from gfmd_cli.physics.self_affine import SelfAffine
    from gfmd_cli.solvers.auto import Auto
    from gfmd_cli.solvers.nested_grids import solve_contact

    scene = build_scene(SelfAffine(), HalfSpace(), points)
    contact = scene.contact(p_star)
    exact = solve_contact(contact, Auto(tolerance=1e-9))
    reference = observe(contact, exact.u, exact.sigma)
    print(
        f"\n{points}^2, p* = {p_star:g}, load {os.getloadavg()[0]:.1f}; reference: {exact.status}, "
        f"residual {exact.residual:.1e}, a_r {reference.a_r:.6f}, sigma_p {reference.sigma_p:.6f}, "
        f"u_g {reference.u_g:.6f}\n{'code':36} {'tol.':>6} {'steps':>6} {'CPU s':>8} {'wall s':>8} "
        f"{'MiB':>6}  {'a_r':>8} {'sigma_p':>8} {'u_g':>8} {'residual':>8}   (relative errors)"
    )

    def judge(path):
        result = np.load(path)
        u = contact.grid.empty()
        u[...] = contact.height + result["gap"] / scene.h_std
        residual = contact.residual(u, contact.stress(u, out=contact.grid.empty()))
        pressure = result["pressure"] / scene.delta_sigma
        return {
            "a_r": abs(np.count_nonzero(pressure > 0) / pressure.size / reference.a_r - 1),
            "sigma_p": abs(float(pressure.std()) / reference.sigma_p - 1),
            "u_g": abs(float(np.mean(u - contact.height)) / reference.u_g - 1),
            "residual": residual,
        }

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        job = {"height": str(folder / "height.npy"), "result": str(folder / "result.npz")}
        job["warm_up"] = str(folder / "warm_up.npy")
        np.save(job["height"], contact.height * scene.h_std)
        every = max(2, points // 512)  # on fewer points not all of a program may be loaded
        np.save(job["warm_up"], contact.height[::every, ::every] * scene.h_std)
        job["pressure"] = p_star * scene.delta_sigma
        job["mean_gap"] = reference.u_g * scene.h_std
        warm = {**job, "label": "gfmd", "variant": "", "tolerance": 1e-2}
        run(sys.executable, warm, folder, options.limit)  # FFT plans are measured once a machine
        table = {
            label: sweep(label, pythons[package], job, judge, folder, options)
            for label, (_, _, package) in CODES.items()
            if package in pythons and any(label.startswith(word) for word in options.codes)
        }

    titles = {"u_g": "mean gap within", "residual": "natural residual"}
    for name, target in ((name, value) for name, values in TARGETS.items() for value in values):
        ours = reach(table.get("gfmd", []), name, target)
        title = f"{titles[name]} {target:g}"
        print(f"  {title:36} {'tol.':>6} {'CPU s':>8} {'MiB':>6}  gfmd is faster by")
        for label, rows in table.items():
            row = reach(rows, name, target)
            if row is None:
                print(f"  {label:36} not reached")
                continue
            ratio = f"{row['cpu'] / ours['cpu']:.1f}" if ours else "-"
            print(
                f"  {label:36} {row['tolerance']:6.0e} {row['cpu']:8.3f} {row['mib']:6.0f}  {ratio}"
            )
    sys.stdout.flush()


def version(python, package):
    """The installed version, or None."""
    code = f"from importlib.metadata import version; print(version({package!r}))"
    done = subprocess.run([str(python), "-c", code], capture_output=True, text=True)
    return done.stdout.strip() if done.returncode == 0 else None


def install(venv, packages=PEERS):
    """Make the environment of the peers and say what is in it; package -> its Python."""
    python = venv.absolute() / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
    pythons = {"gfmd-cli": sys.executable}
    for package in packages:
        if version(python, package) is None and not pip(python, package) and package == "aspher":
            fetch_eigen(venv)  # its build looks for Eigen 3.4 on the system, then on gitlab.com
            pip(python, package, CMAKE_PREFIX_PATH=str(venv.absolute() / "eigen" / "usr"))
        if version(python, package) is not None:
            pythons[package] = python
        else:
            print(f"{package}: left out, `{python} -m pip install {package}` fails")
    versions = [f"{package} {version(python, package)}" for package, python in pythons.items()]
    print(", ".join(versions))
    return pythons


def pip(python, package, **variables):
    """Install one package, built for this processor where it is built; whether that worked."""
    environment = {"CMAKE_ARGS": "-DASPHER_NATIVE=ON", **os.environ, **variables}
    command = [str(python), "-m", "pip", "install", "-q", package]
    return subprocess.run(command, env=environment, capture_output=True).returncode == 0


def fetch_eigen(venv):
    """On Debian: the headers of Eigen, unpacked into the environment."""
    if shutil.which("apt-get") is None:
        return
    folder = venv.absolute() / "eigen"
    folder.mkdir(exist_ok=True)
    subprocess.run(["apt-get", "download", "libeigen3-dev"], cwd=folder, capture_output=True)
    for archive in folder.glob("*.deb"):
        subprocess.run(["dpkg", "-x", str(archive), str(folder)], check=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[512, 1024], help="per side")
    parser.add_argument("--p-star", type=float, nargs="+", default=[0.1, 0.01])
    parser.add_argument("--repeats", type=int, default=3, help="of each solve; the minimum counts")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for one solve")
    parser.add_argument("--codes", nargs="+", default=[""], help="beginnings of their labels")
    parser.add_argument("--venv", type=Path, default=Path(".venv-peers"), help="of the peers")
    parser.add_argument("--work", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        work(options.work)
        return
    os.environ.update(ONE_THREAD)
    pythons = install(options.venv)
    for points in options.points:
        for p_star in options.p_star:
            compare(points, p_star, pythons, options)
    print(f"\nload at the end {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")


if __name__ == "__main__":
    main()
