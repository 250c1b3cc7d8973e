from types import SimpleNamespace

import pytest

from gfmd_cli.status import Status
from gfmd_cli.study.context import ProgressEvent
from gfmd_cli.study.tasks import plan
from gfmd_cli.study.time_left import RemainingTime

SPEC = """
[surface]
kind = "self-affine"
cutoff = 0.02
[elastomer]
kind = "power"
n = 1
[grid]
points = 512
[load]
p_star = 0.1
"""


def task(index, seconds, elastomer="a"):
    return SimpleNamespace(
        index=index,
        seconds=seconds,
        seconds_at=lambda p_star: seconds * p_star / 0.1,
        elastomer=elastomer,
        surface=SimpleNamespace(dimension=2),
        size=64**2,
        solver=SimpleNamespace(tolerance=1e-6),
    )


@pytest.fixture
def time():
    return SimpleNamespace(now=0.0)


def clock_of(time, *tasks, jobs=1):
    return RemainingTime(tasks, jobs, lambda: time.now)


def word(index, event, residual=float("nan"), points=64, **others):
    return ProgressEvent(
        index, event, "", points=points, residual=residual, size=points**2, **others
    )


def test_before_any_task_the_forecast_is_told(time):
    assert clock_of(time, task(0, 3.0), task(1, 5.0)).left() == 8.0
    assert clock_of(time, task(0, 3.0), task(1, 5.0), jobs=2).left() == 4.0


def test_no_time_is_left_at_the_end(time):
    """0.1 + 0.2 - 0.1 - 0.2 is not zero."""
    clock = clock_of(time, task(0, 0.1), task(1, 0.2), task(2, 0.3))
    for index in (0, 1, 2):
        clock.update(word(index, "end"))
    assert 0 <= clock.left() < 1e-12


def test_forecasts_are_corrected_by_what_ended_of_the_same_elastomer(time):
    clock = clock_of(time, task(0, 1.0), task(1, 1.0), task(2, 1.0, "b"), task(3, 1.0, "b"))
    for index, seconds in ((0, 10.0), (2, 2.0)):
        clock.update(word(index, "start"))
        time.now += seconds
        clock.update(word(index, "end", status=Status.CONVERGED))
    assert clock.left() == pytest.approx(10 + 2)


def test_a_elastomer_not_met_yet_is_taken_as_the_others(time):
    clock = clock_of(time, task(0, 1.0), task(1, 2.0, "b"))
    clock.update(word(0, "start"))
    time.now = 3.0
    clock.update(word(0, "end", status=Status.CONVERGED))
    assert clock.left() == pytest.approx(6.0)


def test_near_its_end_a_task_is_told_by_its_residual(time):
    """1e-1 to 1e-5.9 in 10 s: 0.1 of 5 decades are left, 0.2 s at that rate."""
    clock = clock_of(time, task(0, 100.0))
    clock.update(word(0, "start"))
    clock.update(word(0, "step", 1e-1))
    time.now = 10.0
    clock.update(word(0, "step", 10**-5.9))
    assert 0.2 < clock.left() < 0.25


def test_a_pressure_in_other_units_is_forecast_once_it_is_known(time):
    """Until a task of its elastomer has ended, whose time has the pressure in it."""
    clock = clock_of(time, task(0, 100.0), task(1, 100.0), jobs=2)
    clock.update(word(0, "start"))
    clock.update(word(0, "step", 1e-1, points=32, p_star=0.5))
    assert clock.left() == 500.0
    clock.update(word(1, "start"))
    time.now = 300.0
    clock.update(word(1, "end", status=Status.CONVERGED))
    assert clock.left() == 150.0  # at least half of the elapsed time


def test_little_remains_after_the_last_step(time):
    clock = clock_of(time, task(0, 100.0))
    clock.update(word(0, "start"))
    clock.update(word(0, "step", 1e-1))
    time.now = 10.0
    clock.update(word(0, "step", 1e-7))
    assert 0.0 < clock.left() < 0.1


def test_the_longest_task_bounds_the_end_of_the_run(time):
    clock = clock_of(time, task(0, 100.0), task(1, 1.0), jobs=2)
    clock.update(word(0, "start"))
    assert clock.left() == 100.0


def test_words_are_passed_on_with_what_is_left(time):
    clock = clock_of(time, task(0, 2.0), task(1, 2.0))
    words = [clock.with_time_left(word(0, "start"))]
    time.now = 1.0
    words.append(clock.with_time_left(word(0, "end", status=Status.CONVERGED)))
    words.append(clock.with_time_left(word(-1, "warning")))
    assert [(w.tasks_left, w.seconds_left) for w in words] == [(2, 4.0), (1, 1.0), (1, 1.0)]


def test_failed_tasks_do_not_correct_forecasts(time):
    clock = clock_of(time, task(0, 1.0), task(1, 1.0))
    clock.update(word(0, "start"))
    time.now = 50.0
    clock.update(word(0, "end", status=Status.FAILED))
    assert clock.left() == 1.0


def test_slower_methods_are_forecast_to_take_longer(spec_of):
    auto, ccg, fire = (
        plan(spec_of(f"solver.kind={kind}"))[0].seconds for kind in ("auto", "ccg", "fire")
    )
    assert 2 * auto < ccg < fire


def test_a_free_boundary_is_forecast_to_take_longer(spec_of):
    periodic, free = (
        plan(spec_of(f"grid.boundary={boundary}"))[0].seconds for boundary in ("periodic", "free")
    )
    assert free > 2 * periodic
