"""What can be said of runs on several processes without starting any."""

import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from gfmd_cli.grid.halo import MIN_ROWS, block_edges, is_distributable
from gfmd_cli.grid.ranks import RANK_VARIABLES, SIZE_VARIABLES, is_first, process_count

SMOKE = Path(__file__).parents[1] / "configs" / "smoke.toml"
RUN = ["run", str(SMOKE), "--set", "elastomer.n=0"]


@pytest.fixture
def launcher(monkeypatch):
    """Sets what a launcher tells its processes, and nothing else."""

    def launcher(**variables):
        for name in (*SIZE_VARIABLES, *RANK_VARIABLES, "SLURM_STEP_NUM_TASKS"):
            monkeypatch.delenv(name, raising=False)
        for name, value in variables.items():
            monkeypatch.setenv(name, value)

    return launcher


@pytest.mark.parametrize(
    ("variables", "count", "first"),
    [
        ({}, 1, True),
        ({"PMI_SIZE": "1", "PMI_RANK": "0"}, 1, True),
        ({"PMI_SIZE": "4", "PMI_RANK": "0"}, 4, True),
        ({"PMI_SIZE": "4", "PMI_RANK": "3"}, 4, False),
        ({"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "1"}, 2, False),
        ({"SLURM_STEP_NUM_TASKS": "8", "PMIX_RANK": "2"}, 8, False),
        ({"SLURM_STEP_NUM_TASKS": "8"}, 1, True),  # srun without MPI: processes on their own
    ],
)
def test_launchers_are_recognised(launcher, variables, count, first):
    launcher(**variables)
    assert (process_count(), is_first()) == (count, first)


@pytest.mark.parametrize(("rank", "messages"), [("0", 1), ("1", 0)])
def test_missing_mpi4py_is_told_once(launcher, invoke, monkeypatch, tmp_path, rank, messages):
    launcher(PMI_SIZE="2", PMI_RANK=rank)
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    done = invoke(*RUN, "-o", tmp_path / "s.h5")
    assert done.exit_code == 2
    assert done.output.count('pip install ".[mpi]"') == messages
    assert not list(tmp_path.iterdir())


def test_one_process_never_imports_mpi4py(tmp_path):
    program = (
        "import sys\nfrom gfmd_cli.cli import main\n"
        "try:\n    main(sys.argv[1:])\n"
        "except SystemExit as end:\n    sys.exit(end.code or int('mpi4py' in sys.modules))\n"
    )
    command = [sys.executable, "-c", program, *RUN, "-q", "-o", str(tmp_path / "s.h5")]
    assert subprocess.run(command, check=False).returncode == 0
    assert (tmp_path / "s.h5").exists()


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7, 64])
@pytest.mark.parametrize("points", [64, 98, 100, 1024, 1536, 65536])
def test_row_blocks_cover_the_grid_and_lie_side_by_side_on_all_levels(points, count):
    if not is_distributable(points, count):
        assert points < MIN_ROWS * count
        return
    edges = block_edges(points, count)
    assert (edges[0], edges[-1]) == (0, points)
    assert min(b - a for a, b in pairwise(edges)) >= MIN_ROWS
    if points % 2 == 0 and is_distributable(points // 2, count):
        assert [2 * edge for edge in block_edges(points // 2, count)] == edges
    else:  # the next level is whole
        assert points % 2 or all(edge % 2 == 0 for edge in edges)
