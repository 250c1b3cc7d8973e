import os
import signal
import sys

# One thread for BLAS: side by side with other workers its threads spin for longer than they work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, settings
from specs import power_spec

from gfmd_cli.cli import main
from gfmd_cli.errors import Interrupted
from gfmd_cli.grid import plans
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study import run_task
from gfmd_cli.study.columns import COLUMNS
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.run import RunOptions, run_study

BY_SIZE = Grid._threads
if "GFMD_TEST_THREADS" in os.environ:  # `make test-portable`: on small grids too
    every_grid = int(os.environ["GFMD_TEST_THREADS"])
    Grid._threads = property(lambda grid: every_grid if grid.dimension == 2 else 1)


# A shell lets its background jobs ignore these signals, and nohup the last one; they would let what
# tests start do so. (A handler that does nothing is the default action in what is started.)
for number, default in {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGQUIT: signal.SIG_DFL,
    signal.SIGHUP: lambda *_: None,
}.items():
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, default)

# Drawn examples are the same in every run, and may share a folder or a study.
settings.register_profile(
    "same",
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
settings.load_profile("same")


SPRINGS = power_spec(n=0, points=32, p_star=[0.1, 0.3])


@pytest.fixture(scope="session", autouse=True)
def plans_of_the_tests(tmp_path_factory):
    """A folder for the plans of all processes of the tests.

    Studies are compared to the last bit. Without plans in common they would differ there: where the
    user's cache cannot be written, or other processes write it at the same time.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def estimated_plans():
    """Plans that are not measured: the same in all studies, and at once, also of large grids.

    For modules that test no plans, and whose tests would spend most of their time on measuring.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GFMD_PLANS", "estimated")
        yield


@pytest.fixture
def small_plans_measured(monkeypatch):
    """Plans of small grids that are measured, as those of large ones are."""
    monkeypatch.delenv("GFMD_PLANS", raising=False)  # under `make test-portable` too
    monkeypatch.setattr(plans, "MIN_MEASURED_POINTS", 1)


@pytest.fixture
def springs(tmp_path):
    """spec.toml in tmp_path, of two contacts that take no time to solve."""
    (tmp_path / "spec.toml").write_text(SPRINGS)


@pytest.fixture
def threads_by_size(monkeypatch):
    """As many threads as in the processes that a test starts, where the last bits are compared."""
    monkeypatch.setattr(Grid, "_threads", BY_SIZE)


@pytest.fixture(scope="session")
def command():
    """The words that start a process of the command, which imports nothing from its folder."""
    return (sys.executable, "-P", "-m", "gfmd_cli")


@pytest.fixture
def spec_of(tmp_path, request):
    """The spec of a text, by default SPEC of the test's module, with overrides."""

    def spec_of(*overrides, text=None):
        path = tmp_path / "spec.toml"
        path.write_text(text or request.module.SPEC)
        return read_spec(path, overrides)[0]

    return spec_of


@pytest.fixture
def goes_on_bit_for_bit(rows_of, tmp_path, monkeypatch):
    """Run the module's SPEC with overrides, stopped at every eleventh report; compare with one run.

    Returns the row and the number of reports.
    """

    def goes_on_bit_for_bit(*overrides):
        monkeypatch.setattr(run_task, "REPORT_EVERY", 0.0)
        # Both studies have the plans of this cache: others may add to the usual one in between.
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        (straight,) = rows_of(*overrides)
        states = []

        def interrupt(progress):
            states.append(progress)
            if len(states) % 11 == 0:
                signal.raise_signal(signal.SIGTERM)

        for _ in range(1000):
            try:
                (stopped,) = rows_of(*overrides, name="stopped.h5", report=interrupt)
                break
            except Interrupted:
                assert list((tmp_path / "stopped.parts").glob("*/pointer"))
        for column in COLUMNS:
            if column.name != "seconds":
                same = stopped[column.name], straight[column.name]
                assert same[0] == same[1] or np.all(np.isnan(same))
        return stopped, len(states)

    return goes_on_bit_for_bit


@pytest.fixture
def rows_of(tmp_path, spec_of, request):
    """The rows of such a spec, solved."""

    def rows_of(*overrides, text=None, name="study.h5", report=lambda progress: None):
        spec = spec_of(*overrides, text=text)
        run_study(spec, text or request.module.SPEC, tmp_path / name, report, RunOptions(jobs=1))
        return read_rows(tmp_path / name)

    return rows_of


@pytest.fixture(scope="session")
def invoke():
    """Calls the command; returns its result."""
    return lambda *words: CliRunner().invoke(main, [str(word) for word in words])


@pytest.fixture(scope="session")
def output_of(invoke):
    """Calls the command; returns what it printed, where the exit status is as expected."""

    def output_of(*words, status=0):
        done = invoke(*words)
        assert done.exit_code == status, done.output
        return done.output

    return output_of


@pytest.fixture
def gfmd(tmp_path, monkeypatch, request, invoke):
    """`invoke` in tmp_path, where spec.toml is SPEC of the test's module."""
    monkeypatch.chdir(tmp_path)
    Path("spec.toml").write_text(request.module.SPEC)
    return invoke
