"""Direct solutions of contacts so small that the rounding of K u exceeds their tolerance.

    python scripts/direct_solutions.py [--points 512 1024 2048] [--exponents 3 4]

Self-affine surfaces with lambda_s / L = `--cutoff`, tolerance 1e-6. The columns, of which
docs/solver_measurements.md has a table:

    points in contact, status, natural residual
    K u        estimated rounding of the stress K u + p: its natural residual
    sigma      largest error of sigma over the largest sigma. The truth is a solution of the same
               equations for the points in contact in extended precision (80-bit numbers, solved
               with 40 digits)
    u          largest error of the displacement [h_std]
    outside    smallest gap of the truth outside the contact [h_std]: not negative if the points in
               contact are the right ones
    stress     smallest stress of the truth in contact over the mean one: likewise
"""

import argparse

import mpmath
import numpy as np
import scipy.fft
from markdown_tables import print_head, print_row

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import Solution, solve_contact

COLUMNS = ("in contact", "status", "residual", "K u", "sigma", "u", "outside", "stress")
TOLERANCE = 1e-6
DIGITS = 40
Extended = np.longdouble


def exact(contact: Contact, solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Stresses and displacement of C s + c = h at the points in contact, in extended precision."""
    shape, k = contact.grid.shape, contact.stiffness.astype(Extended)
    compliance = np.where(k > 0, 1 / np.where(k > 0, k, 1), 0)
    unit = np.zeros(shape, Extended)
    unit[0, 0] = 1
    by_unit = scipy.fft.irfft2(scipy.fft.rfft2(unit) * compliance, s=shape)
    points = np.nonzero(solution.u == contact.height)
    steps = [(along[:, None] - along) % side for along, side in zip(points, shape, strict=True)]
    matrix, h = by_unit[tuple(steps)], contact.height[points].astype(Extended)
    m = h.size
    with mpmath.workdps(DIGITS):
        left, right = mpmath.ones(m + 1, m + 1), mpmath.matrix(m + 1, 1)
        for i in range(m):
            right[i] = _number(h[i])
            for j in range(m):
                left[i, j] = _number(matrix[i, j])
        left[m, m], right[m] = 0, mpmath.mpf(contact.pressure) * contact.grid.size
        *stresses, level = (_extended(value) for value in mpmath.lu_solve(left, right))
    s = np.zeros(shape, Extended)
    s[points] = stresses
    return s, scipy.fft.irfft2(scipy.fft.rfft2(s) * compliance, s=shape) + level


def _number(value: Extended) -> mpmath.mpf:
    high = float(value)
    return mpmath.mpf(high) + mpmath.mpf(float(value - Extended(high)))


def _extended(value: mpmath.mpf) -> Extended:
    high = float(value)
    return Extended(high) + Extended(float(value - mpmath.mpf(high)))


def row(contact: Contact) -> list[str]:
    """The columns of one contact."""
    solution = solve_contact(contact, Auto(tolerance=TOLERANCE))
    touching = solution.u == contact.height
    cells = [f"{np.count_nonzero(touching)}", str(solution.status)]
    values = [solution.residual, contact.rounding(solution.u)]
    if not solution.is_direct:
        return [*cells, *(f"{value:.0e}" for value in values), *4 * ["not direct"]]
    s, u = exact(contact, solution)
    gap = u - contact.height
    values += [
        float(np.abs(s - solution.sigma).max() / s.max()),
        float(np.abs(u - solution.u).max()),
        float(gap[~touching].min()),
        float(s[touching].min() / s[touching].mean()),
    ]
    return [*cells, *(f"{value:.0e}" for value in values)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[512, 1024, 2048])
    parser.add_argument("--exponents", type=float, nargs="+", default=[3.0, 4.0])
    parser.add_argument("--p-star", type=float, nargs="+", default=[1e-5, 1e-4, 1e-3])
    parser.add_argument("--cutoff", type=float, default=0.1)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    arguments = parser.parse_args()
    print_head("n", "points a side", "p*", "seed", *COLUMNS)
    for n in arguments.exponents:
        for points in arguments.points:
            for seed in arguments.seeds:
                surface = SelfAffine(cutoff=arguments.cutoff, seed=seed)
                scene = build_scene(surface, Power(n=n), points)
                for p_star in arguments.p_star:
                    cells = row(scene.contact(p_star))
                    print_row(f"{n:g}", points, f"{p_star:g}", seed, *cells)


if __name__ == "__main__":
    main()
