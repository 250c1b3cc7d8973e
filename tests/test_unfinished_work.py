"""The folder of unfinished work, where others may be able to write."""

import json
import os
import stat
from pathlib import Path

import h5py
import numpy as np
import pytest
from specs import power_spec

from gfmd_cli.errors import SpaceError, StudyError
from gfmd_cli.files.checksums import sealed
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.solvers.loop import Solver, State
from gfmd_cli.study import unfinished_work
from gfmd_cli.study.checkpoint import Checkpoint
from gfmd_cli.study.columns import LAYOUT as STUDY_LAYOUT
from gfmd_cli.study.history import TaskHistory
from gfmd_cli.study.pointer import LAYOUT
from gfmd_cli.study.unfinished_work import SUFFIX, read_record_entry

SPEC = power_spec(n=1, points=16, p_star=[0.1, 0.3], cutoff=0.2)


class Contact:
    grid = Grid(16)


STATE = State(u=np.ones((16, 16)), sigma=np.ones((16, 16)), step=3)
SOLVER = Solver(kind="plain")


@pytest.fixture
def checkpoint(tmp_path):
    """The folder of a checkpoint with one state."""
    with Checkpoint.exclusive(tmp_path / "c") as opened:
        opened.save(Contact(), STATE, TaskHistory())
    return tmp_path / "c"


def forge(folder, change):
    """Change what the pointer says and give it a valid checksum."""
    pointer = folder / "pointer"
    data = json.loads(pointer.read_bytes()[:-8])
    change(data["slots"][0])
    pointer.write_bytes(sealed(json.dumps(data).encode()))


def part(**values):
    return lambda slot: slot["parts"][0].update(values)


FORGED = {
    "no fields": lambda slot: slot["fields"].clear(),
    "a state without its step": lambda slot: slot["state"].pop("step"),
    "a residual that is text": lambda slot: slot["state"].update(residual="0"),
    "a state with tables": lambda slot: slot["state"].update(misses={"a": 1}),
    "a step below zero": lambda slot: slot["state"].update(step=-1),
    "a history that is a list": lambda slot: slot.update(history=[]),
    "a grid without its values": lambda slot: slot["history"]["grids"].append({"points": 8}),
    "a trial without pressure": lambda slot: slot["history"]["trials"].append(
        {"points": 8, "pressure": 0.0, "value": 1.0, "cost": 1.0}
    ),
    "an unknown key of the history": lambda slot: slot["history"].update(more=1),
    "another folder": part(file="../secret"),
    "an absolute path": part(file="/dev/zero"),
    "negative rows": part(rows=-16),
    "a negative first row": part(first=-8),
    "too many rows": part(rows=2**40),
    "too many bytes": part(bytes=2**60),
    "no parts": lambda slot: slot.update(parts=[]),
    "parts that are text": lambda slot: slot.update(parts="ab"),
    "a huge grid": lambda slot: slot.update(points=2**40),
    "a state that is a list": lambda slot: slot.update(state=[1, 2]),
    "another slot": lambda slot: slot.update(name="../c"),
}


def test_a_pointer_that_nobody_changed_is_resumed(checkpoint):
    forge(checkpoint, lambda slot: None)
    saved = Checkpoint(checkpoint)
    assert saved.restore() is None
    assert saved.load(Contact.grid, SOLVER).state.step == 3


@pytest.mark.parametrize("case", FORGED)
def test_a_forged_pointer_is_set_aside(checkpoint, case):
    forge(checkpoint, FORGED[case])
    forged = Checkpoint(checkpoint)
    assert forged.saved() is None
    assert "set aside as .bad" in forged.restore()
    assert forged.load(Contact.grid, SOLVER) is None


OF_ANOTHER_SOLVE = {
    "another attribute": lambda slot: slot["state"].update(slope=1.0),
    "a missing attribute": lambda slot: slot["state"].pop("misses"),
    "a switch that is a number": lambda slot: slot["state"].update(exact=1),
    "a field of objects": lambda slot: slot["fields"].update(u="|O"),
    "a field of text": lambda slot: slot["fields"].update(u="<U64"),
    "a field in single precision": lambda slot: slot["fields"].update(u="<f4"),
    "a field that is missing": lambda slot: slot["fields"].pop("sigma"),
    "too many bytes": part(bytes=2**50),
    "another grid": lambda slot: (slot.update(points=18), slot["parts"][0].update(rows=18)),
}


@pytest.mark.parametrize("case", OF_ANOTHER_SOLVE)
def test_a_state_of_another_solve_is_not_loaded(checkpoint, case):
    forge(checkpoint, OF_ANOTHER_SOLVE[case])
    forged = Checkpoint(checkpoint)
    if forged.restore() is None:  # else the size of the file has told
        with pytest.raises(StudyError, match="saved state is of another"):
            forged.load(Contact.grid, SOLVER)
        assert "set aside as .bad" in forged.set_aside()
    assert forged.load(Contact.grid, SOLVER) is None


def test_deeply_nested_json_is_set_aside(checkpoint):
    nested = f'{{"layout": {LAYOUT}, "slots": ' + "[" * 10**5 + "]" * 10**5 + "}"
    (checkpoint / "pointer").write_bytes(sealed(nested.encode()))
    assert Checkpoint(checkpoint).saved() is None
    assert "set aside" in Checkpoint(checkpoint).restore()


def in_place_of(path, kind):
    """Put something that is not a regular file in the place of a file."""
    path.unlink(missing_ok=True)
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "directory":
        path.mkdir()
    elif kind == "sparse":
        path.touch()
        os.truncate(path, 2**36)
    else:
        path.symlink_to({"link": path.parent.parent / "target", "device": "/dev/zero"}[kind])


@pytest.mark.parametrize("kind", ["pipe", "directory", "sparse", "link", "device"])
@pytest.mark.parametrize("name", ["pointer", "b"])
def test_a_checkpoint_with_another_kind_of_file_is_not_read(checkpoint, name, kind):
    (checkpoint.parent / "target").write_bytes((checkpoint / name).read_bytes())
    in_place_of(checkpoint / name, kind)
    opened = Checkpoint(checkpoint)
    assert "set aside" in opened.restore()
    assert opened.load(Contact.grid, SOLVER) is None


def test_a_slot_is_not_written_through_a_link(checkpoint):
    target = checkpoint.parent / "target"
    target.write_text("precious")
    (checkpoint / "a").symlink_to(target)
    with Checkpoint.exclusive(checkpoint) as opened:
        opened.restore()
        with pytest.raises(SpaceError, match="cannot be written"):
            opened.save(Contact(), STATE, TaskHistory())
    assert target.read_text() == "precious"


def test_a_checkpoint_whose_folder_cannot_be_made_is_told_with_the_reason(tmp_path):
    folder = tmp_path / ("long" * 100)
    with pytest.raises(SpaceError, match="too long"), Checkpoint.exclusive(folder):
        pass


@pytest.mark.parametrize("kind", ["pipe", "directory", "sparse", "link", "device"])
def test_a_record_of_another_kind_is_refused(tmp_path, kind):
    (tmp_path / "parts").mkdir()
    (tmp_path / "target").write_bytes(b"x")
    path = tmp_path / "parts" / "0.record"
    in_place_of(path, kind)
    with pytest.raises(StudyError, match=r"0\.record"):
        read_record_entry(path)


def unfinished(gfmd):
    """A study with one record that is not collected; its path."""
    assert gfmd("run", "spec.toml", "-o", "s.h5", "-q", "-j", "1", "--shard", "0/2").exit_code == 0
    return Path("s.h5")


def test_a_record_that_links_elsewhere_is_set_aside_and_solved_again(gfmd):
    unfinished(gfmd)
    path = Path("s.parts") / f"{'0' * 16}.record"
    with h5py.File("secret.h5", "w") as file:
        file["names"] = np.array([b"a_r"])
    with h5py.File(path, "w") as file:
        file.attrs["layout"] = STUDY_LAYOUT
        file["columns"] = h5py.ExternalLink("../secret.h5", "/")
    path.write_bytes(sealed(path.read_bytes()))
    done = gfmd("run", "spec.toml", "-o", "s.h5", "-j", "1")
    assert done.exit_code == 0
    assert done.output.count("set aside as") == 1
    assert path.with_suffix(".bad").exists()
    assert list(path.parent.glob(f"*{SUFFIX}")) == []


def test_a_link_to_nowhere_in_the_place_of_a_record_is_set_aside(gfmd):
    unfinished(gfmd)
    path = Path("s.parts") / f"{'0' * 16}.record"
    path.symlink_to("nowhere")
    done = gfmd("run", "spec.toml", "-o", "s.h5", "-j", "1")
    assert done.exit_code == 0
    assert done.output.count("set aside as") == 1
    assert path.with_suffix(".bad").is_symlink()
    assert not path.is_symlink()


def test_a_folder_of_the_user_is_refused_and_kept(gfmd):
    Path("s.parts").mkdir()
    Path("s.parts/drawing.step").write_text("mine")
    done = gfmd("run", "spec.toml", "-o", "s.h5", "-q")
    assert done.exit_code == 2
    assert "drawing.step" in done.output
    assert Path("s.parts/drawing.step").read_text() == "mine"


def test_a_study_keeps_its_mode_and_the_link_to_it(gfmd):
    unfinished(gfmd)
    Path("s.h5").chmod(0o600)
    assert gfmd("run", "spec.toml", "-o", "s.h5", "-q", "-j", "1").exit_code == 0
    assert stat.S_IMODE(Path("s.h5").stat().st_mode) == 0o600
    Path("link.h5").symlink_to("s.h5")
    more = ("--set", "load.p_star=[0.1, 0.3, 0.5]")
    assert gfmd("run", "spec.toml", "-o", "link.h5", "-q", "-j", "1", *more).exit_code == 0
    assert Path("link.h5").is_symlink()
    assert len(gfmd("export", "s.h5").output.splitlines()) == 4
    assert not Path("s.parts").exists()


def test_a_checkpoint_that_another_process_deletes_is_not_a_foreign_file(tmp_path, monkeypatch):
    """It is in the list of the folder, but no longer there."""
    monkeypatch.setattr(unfinished_work, "listed", lambda folder: [folder / ("0" * 16)])
    unfinished_work.check_own(tmp_path)
