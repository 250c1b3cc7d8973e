"""Compiled kernels: the same machine code, and the same bits, from the cache and without it."""

import os
import subprocess
import sys

PROGRAM = """
import hashlib
import numpy as np
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.solvers.contact_state import PRESSED
from gfmd_cli.solvers.multigrid import Multigrid

rng = np.random.default_rng(0)
grid = Grid(64)
for n in (1, 3):
    k = Power(n=n).stiffness(grid.wavenumber(), grid.length)
    contact = Contact(grid, np.zeros(grid.shape), k / k.max(), 1.0)
    held = PRESSED * (rng.random(grid.shape) < 0.05).astype(np.int8)
    cycle = Multigrid(contact, grid)
    cycle.apply(rng.normal(size=grid.shape), held, PRESSED, np.zeros(grid.shape, np.float32))
    print(hashlib.sha256(cycle.z[:, :64].tobytes()).hexdigest())
"""


def test_kernels_from_the_cache_give_the_bits_of_those_just_compiled(tmp_path):
    """On a plain processor, where a part that several kernels have in common was not inlined."""
    plain = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    environment = os.environ | plain | {"NUMBA_CACHE_DIR": str(tmp_path)}
    results = [
        subprocess.run(
            [sys.executable, "-c", PROGRAM],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for _ in range(2)
    ]
    assert len(results[0].split()) == 2
    assert results[0] == results[1]
    assert list(tmp_path.rglob("*.nbc"))


KERNEL = """
import numpy as np
from gfmd_cli.grid.compilation import kernel, part_of_kernel
from other import STATE

@part_of_kernel
def part(x):
    return x + 1

@kernel
def fill(out):
    for i in range(out.size):
        out[i] = part(10 * STATE)

out = np.zeros(2)
fill(out)
print(int(out[0]), len(fill.stats.cache_hits))
"""


def test_an_upgrade_that_changes_a_number_or_a_part_is_compiled_anew(tmp_path):
    """Numba compares date and size of the file with the kernel: here they stay the same."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def output(state, source):
        (tmp_path / "other.py").write_text(f"STATE = {state}\n")
        (tmp_path / "kernels.py").write_text(source)
        os.utime(tmp_path / "kernels.py", (10**9, 10**9))
        words = [sys.executable, "-B", "kernels.py"]
        completed = subprocess.run(
            words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        return completed.stdout.split()

    assert output(1, KERNEL) == ["11", "0"]
    assert output(1, KERNEL) == ["11", "1"]
    assert output(2, KERNEL) == ["21", "0"]
    assert output(2, KERNEL.replace("x + 1", "x + 2")) == ["22", "0"]
