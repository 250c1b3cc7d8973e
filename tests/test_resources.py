from pathlib import Path

import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study import resources
from gfmd_cli.study.tasks import plan

CONFIGS = Path(__file__).parents[1] / "configs"


@pytest.fixture
def tasks():
    """The tasks of the demo on another grid."""
    return lambda *settings: plan(read_spec(CONFIGS / "demo.toml", settings)[0])


@pytest.fixture
def machine(monkeypatch):
    """A machine of so many cores and bytes."""

    def machine(cores, memory=2.0**40):
        monkeypatch.setattr(resources, "available_cores", lambda: cores)
        monkeypatch.setattr(resources, "available_memory", lambda: memory)

    return machine


def test_cores_are_those_that_slurm_grants(monkeypatch):
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", "7")
    assert resources.available_cores() == 7


def test_cores_are_otherwise_those_of_the_affinity_mask(monkeypatch):
    monkeypatch.delenv("SLURM_CPUS_PER_TASK", raising=False)
    monkeypatch.setattr(resources.os, "sched_getaffinity", lambda _: {0, 3, 5})
    assert resources.available_cores() == 3


def test_slurm_may_grant_less_memory_than_there_is(monkeypatch):
    monkeypatch.setenv("SLURM_MEM_PER_NODE", "100")
    assert resources.available_memory() == 100 * 2**20


def test_the_limit_of_the_address_space_counts_less_what_is_in_use(monkeypatch):
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resources.resource.getpagesize()
    limits = used + 2**24, resources.resource.RLIM_INFINITY
    monkeypatch.setattr(resources.resource, "getrlimit", lambda _: limits)
    assert resources.available_memory() == pytest.approx(2**24, abs=2**22)


def test_threads_need_address_space_for_their_heaps(tasks, machine, monkeypatch):
    machine(8)
    one = tasks("grid.points=4096", "elastomer.n=1", "load.p_star=0.1")
    for gibibytes, threads in (4, 1), (8, 8):
        monkeypatch.setattr(resources, "available_addresses", lambda n=gibibytes: n * 2.0**30)
        assert resources.jobs_and_threads(one, None) == (1, threads)


def test_slurm_may_grant_memory_by_the_core(monkeypatch):
    monkeypatch.setenv("SLURM_MEM_PER_CPU", "50")
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", "3")
    assert resources.available_memory() == 150 * 2**20


@pytest.mark.parametrize(
    ("line", "top", "names"),
    [
        ("0::/slurm/job_7/step_0", "", ("memory.max", "memory.current")),
        (
            "4:cpu,memory:/slurm/job_7/step_0",
            "memory",
            ("memory.limit_in_bytes", "memory.usage_in_bytes"),
        ),
    ],
)
def test_each_cgroup_around_the_process_may_limit_its_memory(tmp_path, line, top, names):
    """The step has no limit of its own, its job one of 1000 bytes, and the group above 5000."""
    membership, root = tmp_path / "cgroup", tmp_path / "fs"
    membership.write_text(f"9:pids:/elsewhere\n{line}\n")
    for group, limit, used in (
        ("slurm", "5000", "400"),
        ("slurm/job_7", "1000", "300"),
        ("slurm/job_7/step_0", "max", "200"),
    ):
        folder = root / top / group
        folder.mkdir(parents=True, exist_ok=True)
        for name, value in zip(names, (limit, used), strict=True):
            (folder / name).write_text(value + "\n")
    assert sorted(resources._cgroup_limits(membership, root)) == [700, 4600]
    prefix = "total_" if top else ""
    cache = f"anon 7\n{prefix}inactive_file 100\n{prefix}active_file 50\ninactive_anon 9\n"
    (root / top / "slurm/job_7/memory.stat").write_text(cache)
    assert sorted(resources._cgroup_limits(membership, root)) == [850, 4600]
    assert list(resources._cgroup_limits(tmp_path / "none", root)) == []


def test_many_tasks_run_side_by_side_on_one_thread_each(tasks, machine):
    machine(8)
    assert resources.jobs_and_threads(tasks(), None) == (8, 1)


def test_one_large_grid_takes_all_threads(tasks, machine):
    machine(8)
    one = tasks("grid.points=4096", "elastomer.n=1", "load.p_star=0.1")
    assert resources.jobs_and_threads(one, None) == (1, 8)


def test_as_many_run_side_by_side_as_the_memory_holds(tasks, machine):
    many = tasks("grid.points=4096")
    machine(8, 2.5 * many[0].bytes / resources.HEADROOM)
    assert resources.jobs_and_threads(many, None) == (2, 4)


def test_a_little_work_is_done_in_this_process(tasks, machine):
    machine(8)
    assert resources.jobs_and_threads(tasks("elastomer.n=0"), None) == (1, 1)


def test_the_asked_number_of_jobs_is_kept(tasks, machine):
    machine(8)
    assert resources.jobs_and_threads(tasks(), 3) == (3, 1)


def test_a_task_beyond_the_memory_is_refused_with_both_numbers(tasks, machine):
    machine(8, 2.0**30)
    with pytest.raises(InputError, match=r"8192 points .* GiB .* 0.9 GiB"):
        resources.check_memory(tasks("grid.points=8192"))


def test_oblong_pixels_and_odd_numbers_of_points_take_more_memory(tasks):
    """Of the same number of points: the next coarser grid has half the points, not a quarter."""
    square = tasks("grid.points=1024", "surface.length_y=0.5")[0]
    oblong = tasks("grid.points=1024", "grid.points_y=512", "surface.length_y=1.0")[0]
    odd = tasks("grid.points=1024", "grid.points_y=511", "surface.length_y=0.5")[0]
    assert square.size == oblong.size
    assert square.bytes < odd.bytes < oblong.bytes
