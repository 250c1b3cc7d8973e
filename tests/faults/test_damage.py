"""Cut off or with a bit flipped: found out, or without effect; never a wrong number."""

import random
import shutil
from collections import Counter
from dataclasses import replace

import numpy as np

from gfmd_cli.errors import GfmdError
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.solvers.loop import Solver, State
from gfmd_cli.spec.models import OutputTable
from gfmd_cli.study.checkpoint import Checkpoint
from gfmd_cli.study.history import TaskHistory, Trial
from gfmd_cli.study.reading import open_study, read_rows
from gfmd_cli.study.unfinished_work import read_record, write_record

CUTS, FLIPS = 200, 500


def damaged(content, seed):
    """Copies that are cut off, and copies with one bit changed."""
    rng = random.Random(seed)
    for _ in range(CUTS):
        yield content[: rng.randrange(len(content))]
    for _ in range(FLIPS):
        changed = bytearray(content)
        changed[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        yield bytes(changed)


def count(path, copy, read, seed=0):
    """How many damaged copies are refused, and how many read as before; no other outcome."""
    content, met = path.read_bytes(), Counter()
    before = read(path)
    for bad in damaged(content, seed):
        copy.write_bytes(bad)
        try:
            contents = read(copy)
        except GfmdError as error:
            met["refused" if str(copy) in str(error) else "without its name"] += 1
            continue
        np.testing.assert_equal(contents, before)
        met["harmless"] += 1
    print(path.name, dict(met))
    return met


def test_damaged_records_are_refused(folder, gfmd):
    gfmd(folder, "run", "spec.toml", "-j", "1", "-q", "-o", "study.h5")
    with open_study(folder / "study.h5") as study:
        result = study.result(2)
    u = np.random.default_rng(0).normal(size=(64, 64))
    arrays = {"fields": {"u": u}, "cross_sections": {"u": u[0]}}
    stored = OutputTable(fields=["u"], cross_section=True).names()
    entry = result.entry._replace(task_id="copy", stored=stored)
    result = replace(result, entry=entry, arrays=arrays)
    (folder / "whole").mkdir()
    path = write_record(folder / "whole", result)
    met = count(path, folder / "copy.record", lambda path: vars(read_record(path)))
    assert met == {"refused": CUTS + FLIPS}


def test_damaged_studies_are_refused_or_read_as_before(folder, gfmd):
    gfmd(folder, "run", "spec.toml", "-j", "1", "-q", "-o", "study.h5")

    def read(path):
        rows = read_rows(path)
        with open_study(path) as file:
            fields = [file.arrays("fields", row["task"]) for row in rows]
            shells = [vars(file.shells(scene)) for scene in range(2)]
            return rows, fields, file.attributes, shells

    met = count(folder / "study.h5", folder / "copy.h5", read)
    assert met["refused"] >= CUTS + FLIPS / 2  # two fifths of so small a file are empty space
    assert met["refused"] + met["harmless"] == CUTS + FLIPS


def test_a_damaged_checkpoint_gives_an_older_state_or_none(tmp_path):
    grid, rng = Grid(16), np.random.default_rng(0)

    class Contact:
        pass

    contact = Contact()
    contact.grid = grid
    states = []
    with Checkpoint.exclusive(tmp_path / "c") as checkpoint:
        for step in (1, 2):
            state = State(u=rng.random((16, 16)), sigma=rng.random((16, 16)), step=step)
            checkpoint.save(contact, state, TaskHistory(trials=[Trial(16, step, 0.1, 1.0)]))
            states.append(state.u)
    met = Counter()
    for name in ("a", "b", "pointer"):
        content = (tmp_path / "c" / name).read_bytes()
        for bad in damaged(content, 1):
            shutil.copytree(tmp_path / "c", tmp_path / "d")
            (tmp_path / "d" / name).write_bytes(bad)
            checkpoint = Checkpoint(tmp_path / "d")
            message, resume = checkpoint.restore(), checkpoint.load(grid, Solver(kind="plain"))
            if resume is None:
                met["anew"] += 1
                assert ".bad" in message
            else:
                step = resume.state.step
                met[f"from step {step}"] += 1
                assert checkpoint.history.trials[0].pressure == step
                assert (message is None) == (step == 2)
                np.testing.assert_array_equal(resume.state.u, states[step - 1])
            shutil.rmtree(tmp_path / "d")
            for bad_file in tmp_path.glob("*.bad"):
                bad_file.unlink()
    print(dict(met))
    assert met["anew"] == CUTS + FLIPS  # the pointer
    assert met["from step 1"] == CUTS + FLIPS  # the newer slot
