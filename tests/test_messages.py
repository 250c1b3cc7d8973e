import os
import subprocess

import numpy as np
import pytest

from gfmd_cli.cli.messages import printable

MAP = """
surface = { kind = "file", path = "\\u001b[31m.npy" }
elastomer = { kind = "half-space" }
grid = { points = 8 }
load = { p_star = 0.1 }
"""


def test_control_characters_are_spelled_out():
    assert printable("a\x1b[31mb\x07\r\x9b1m\udc80") == r"a\x1b[31mb\x07\r\x9b1m\udc80"
    assert printable("λ_s = 1 µm\n\tE* Å") == "λ_s = 1 µm\n\tE* Å"


def test_escapes_in_a_file_name_do_not_reach_the_terminal(tmp_path, command):
    words = [*command, "export", "\x1b]0;x\x07.h5"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True)
    assert done.returncode == 2
    assert b"\x1b" not in done.stderr + done.stdout


def test_a_table_shows_no_escapes_of_the_name_of_a_map(tmp_path, invoke):
    np.save(tmp_path / "\x1b[31m.npy", np.random.default_rng(1).normal(size=(8, 8)))
    (tmp_path / "spec.toml").write_text(MAP)
    assert invoke("run", tmp_path / "spec.toml", "-o", tmp_path / "study.h5", "-q").exit_code == 0
    for words in (("analyze",), ("diff", tmp_path / "study.h5")):
        output = invoke(*words, tmp_path / "study.h5").output
        assert r"\x1b[31m.npy" in output
        assert "\x1b" not in output


@pytest.mark.parametrize(
    "words", [("schema",), ("status", "spec.toml", "--json"), ("export", "study.h5")], ids=" ".join
)
@pytest.mark.usefixtures("springs")
def test_a_reader_that_has_enough_is_no_error(tmp_path, invoke, command, words):
    """As in `gfmd schema | head -1`, where exit status 1 would mean that a task failed."""
    invoke("run", tmp_path / "spec.toml", "-o", tmp_path / "study.h5", "-q", "-j", "1")
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([*command, *words], cwd=tmp_path, stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize("closed", ["stderr", "stdout"])
@pytest.mark.parametrize("jobs", ["1", "2"])
@pytest.mark.usefixtures("springs")
def test_a_terminal_that_is_closed_ends_no_run(tmp_path, command, closed, jobs):
    read, write = os.pipe()
    os.close(read)  # whoever writes to the other end gets EPIPE
    words = [*command, "run", "spec.toml", "-j", jobs, "-o", "study.h5"]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | {closed: write}
    done = subprocess.run(words, cwd=tmp_path, **streams)
    os.close(write)
    assert done.returncode == 0
    assert (tmp_path / "study.h5").exists()
