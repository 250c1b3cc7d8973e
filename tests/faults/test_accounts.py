"""An account that has no home and can write to its working directory only."""

import os
import shutil
import subprocess
import sys

import pytest

from .conftest import SPEC

NOBODY = "54321"  # a number that no account has
GFMD = (sys.executable, "-P", "-m", "gfmd_cli")


def as_account(number):
    """It can read the interpreter wherever that is, and write as any other account can."""
    return (
        "setpriv", "--reuid", number, "--regid", number, "--clear-groups",
        "--inh-caps", "+dac_read_search", "--ambient-caps", "+dac_read_search",
    )  # fmt: skip


@pytest.fixture
def call(tmp_path):
    """Calls the command as that account, with a folder for temporary files or without."""
    if os.geteuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("another account can be taken by root only")
    for folder in (tmp_path, *tmp_path.parents[:2]):
        folder.chmod(0o777)
    (tmp_path / "spec.toml").write_text(SPEC)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    temporary.chmod(0o777)
    names = ("PATH", "PYTHONPATH", "LANG")
    bare = {name: os.environ[name] for name in names if name in os.environ}

    def call(*words, account=NOBODY, limits=(), **more):
        environment = bare | {"TMPDIR": str(temporary)} | more
        words = [*as_account(account), *limits, *GFMD, *words]
        return subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True)

    return call


@pytest.mark.parametrize("home", [{}, {"HOME": "/proc"}])
def test_without_a_home_compiled_code_is_kept_in_a_private_folder(call, tmp_path, home):
    done = call("run", "spec.toml", "-q", "--set", "elastomer.n=0", **home)
    assert done.returncode == 0, done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert "no cache folder can be written" in done.stderr
    folder = tmp_path / "temporary" / f"gfmd-{NOBODY}"
    assert folder.stat().st_mode & 0o777 == 0o700
    assert list(folder.rglob("*.nbc"))
    assert not (tmp_path / "~").exists()


def test_a_folder_of_another_user_in_that_place_is_not_used(call, tmp_path):
    foreign = tmp_path / "temporary" / f"gfmd-{NOBODY}"
    foreign.mkdir()
    foreign.chmod(0o777)
    done = call("run", "spec.toml", "-q", "--set", "elastomer.n=0")
    assert done.returncode == 0, done.stderr
    assert "each run compiles anew" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not list(foreign.iterdir())
    assert not (tmp_path / "~").exists()


@pytest.mark.parametrize(
    "words", [("schema",), ("run", "spec.toml", "--dry-run"), ("init", "a.toml")]
)
def test_other_commands_need_no_home(call, words):
    done = call(*words, TMPDIR="/proc")
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("account", "words", "said"),
    [
        ("54322", ("--set", "grid.points=1024", "--set", "load.p_star=0.1"), "one thread is used"),
        ("54323", ("-j", "2"), "left to the process of the run itself"),
    ],
)
def test_an_account_that_may_have_no_further_thread_solves_on_one(call, account, words, said):
    if len(os.sched_getaffinity(0)) == 1:
        pytest.skip("a run on one core starts no threads")
    words = ("run", "spec.toml", "-q", "--set", "elastomer.n=0", *words)
    done = call(*words, account=account, limits=("prlimit", "--nproc=1"))
    assert done.returncode == 0, done.stderr
    cache, message = done.stderr.splitlines()
    assert "no cache folder can be written" in cache
    assert message.endswith(said)
