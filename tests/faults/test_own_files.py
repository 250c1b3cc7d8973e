"""Whatever stands in the place of a file that gfmd itself wrote: it is refused or made anew."""

import os
import shutil
import signal
import stat
from contextlib import suppress

import pytest
from specs import power_spec

from gfmd_cli.errors import Interrupted
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.run import RunOptions, run_study

from .test_input_kinds import SECONDS, make

SPEC = power_spec(n=1, points=16, p_star=[0.1, 0.3], cutoff=0.2)
KINDS = (
    "directory", "loop", "link", "hard link", "pipe", "socket", "zero", "empty", "bytes",
    "without permission",
)  # fmt: skip
RUN = ("run", "spec.toml", "-j", "1", "-q")
PLACES = {
    "study.h5": RUN,
    "study.parts": RUN,
    "study.parts/in-use": RUN,
    "study.parts/collecting": RUN,
    "study.parts/planning": RUN,
    "study.parts/WISDOM": RUN,
    "study.parts/RECORD": RUN,
    "study.parts/.RECORD.bad": RUN,
    "study.parts/TASK": RUN,
    "study.parts/TASK/lock": RUN,
    "study.parts/TASK/pointer": RUN,
    "study.parts/TASK/a": RUN,
    "study.parts/TASK/b": RUN,
    "cache/gfmd": RUN,
    "cache/gfmd/planning": RUN,
    "cache/gfmd/WISDOM": RUN,
    "study.sbatch": ("submit", "spec.toml", "--missing", "--dry-run"),
}
"""The files, with the command that reads them."""
REFUSED = (2, 73, 74)
NOBODY = 54321  # a user that no account has


@pytest.fixture(scope="session")
def unfinished(tmp_path_factory):
    """A study of two tasks: the record of one, the checkpoint of the other; a cache; a script."""
    folder = tmp_path_factory.mktemp("unfinished")
    (folder / "spec.toml").write_text(SPEC)
    spec, text = read_spec(folder / "spec.toml", ())

    def stop_at(event):
        return lambda progress: progress.event == event and signal.raise_signal(signal.SIGTERM)

    for shard, event in ((0, "end"), (1, "step")):
        with suppress(Interrupted):
            run_study(
                spec, text, folder / "study.h5", stop_at(event),
                RunOptions(shard=(shard, 2), jobs=1, reproducible=True),
            )  # fmt: skip
    return folder


@pytest.fixture
def study(unfinished, tmp_path, monkeypatch, gfmd, small_plans_measured):
    """A copy of it, with plans in its folder and in the cache."""
    place = tmp_path / "study"
    monkeypatch.setenv("XDG_CACHE_HOME", str(place / "cache"))
    (tmp_path / "plans").mkdir()
    (tmp_path / "plans" / "spec.toml").write_text(SPEC)
    assert gfmd(tmp_path / "plans", *RUN)[0] == 0
    (wisdom,) = (place / "cache" / "gfmd").glob("wisdom-*.json")
    shutil.copytree(unfinished, place, dirs_exist_ok=True)
    shutil.copy(wisdom, place / "study.parts")
    shutil.copytree(place, tmp_path / "original")

    def fresh():
        shutil.rmtree(place)
        shutil.copytree(tmp_path / "original", place)
        return place

    return fresh


def named(place, folder):
    """The path of a place in a folder."""
    (record,) = folder.glob("study.parts/*.record")
    (pointer,) = folder.glob("study.parts/*/pointer")
    (wisdom,) = folder.glob("study.parts/wisdom-*.json")
    for word, name in (("RECORD", record), ("TASK", pointer.parent), ("WISDOM", wisdom)):
        place = place.replace(word, name.name)
    return folder / place


def replace(path, kind, outside):
    """Put something else in the place of a file."""
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    if kind == "link":
        path.symlink_to(outside)
    elif kind == "hard link":
        os.link(outside, path)
    elif kind == "bytes":
        path.write_bytes(b"\x00\xffbytes" * 100)
    elif kind == "without permission":
        path.write_bytes(b"content")
        path.chmod(0)
    else:
        make(path, kind)


def as_nobody(folder):
    """Give a folder to another user, and become that user."""
    for path in (folder, *folder.rglob("*")):
        os.lchown(path, NOBODY, NOBODY)
    os.setgroups([])
    os.setresgid(NOBODY, NOBODY, NOBODY)
    os.setresuid(NOBODY, NOBODY, NOBODY)


@pytest.mark.parametrize("place", PLACES)
def test_what_is_no_file_of_gfmd_is_refused_or_made_anew(study, start, gfmd, tmp_path, place):
    outside = tmp_path / "outside"
    for kind in KINDS:
        folder = study()
        outside.write_bytes(b"precious")
        outside.chmod(0o640)
        path = named(place, folder)
        replace(path, kind, outside)

        def prepare(kind=kind, folder=folder):
            signal.alarm(SECONDS)
            if kind == "without permission" and os.geteuid() == 0:
                as_nobody(folder)

        child = start(folder, PLACES[place], prepare)
        status, output = child.wait(), child.said
        assert status in (0, *REFUSED), (kind, status, output)
        assert "Traceback" not in output, (kind, output)
        assert len(output.splitlines()) < 6
        assert outside.read_bytes() == b"precious", kind
        assert outside.stat().st_mode & 0o777 == 0o640, kind
        if status in REFUSED:
            known = (path.name, path.parent.name, os.path.realpath(path))
            assert any(name in output for name in known), (kind, output)
            assert os.path.lexists(path), kind
            shutil.rmtree(path) if kind == "directory" else path.unlink()
            assert gfmd(folder, *RUN) == (0, ""), kind
        else:
            assert len(output.splitlines()) < 2
        assert [row["status"] for row in read_rows(folder / "study.h5")] == ["converged"] * 2


@pytest.mark.parametrize(
    "words",
    [RUN, (*RUN, "--dry-run"), (*RUN, "--overwrite"), ("status", RUN[1]), ("collect", RUN[1])],
)
def test_a_study_without_permission_is_not_begun_anew(study, start, tmp_path, words):
    folder = study()
    parts = folder / "study.parts"
    shutil.copy(folder / "spec.toml", tmp_path)
    before = {path: path.is_dir() or path.read_bytes() for path in folder.rglob("*")}
    cases = [(folder, 0), (folder, 0o600), (parts, 0), (parts, 0o300), (parts, 0o600)]
    for place, mode in cases:
        usual = stat.S_IMODE(place.stat().st_mode)

        def prepare(place=place, mode=mode):
            place.chmod(mode)
            if os.geteuid() == 0:
                as_nobody(tmp_path)

        child = start(tmp_path, (*words, "-o", "study/study.h5"), prepare)
        status = child.wait()
        place.chmod(usual)
        assert status in REFUSED, (place, mode, child.said)
        assert place.name in child.said
        assert child.said.startswith("gfmd: ")
        assert child.said.count("\n") == 1
        assert "Permission denied" in child.said
        after = {path: path.is_dir() or path.read_bytes() for path in folder.rglob("*")}
        assert after == before
