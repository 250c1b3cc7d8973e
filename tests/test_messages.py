import os
import subprocess

import pytest

from gfmd_cli.cli.messages import printable


def test_control_characters_are_spelled_out():
    assert printable("a\x1b[31mb\x07\r\x9b1m\udc80") == r"a\x1b[31mb\x07\r\x9b1m\udc80"
    assert printable("λ_s = 1 µm\n\tE* Å") == "λ_s = 1 µm\n\tE* Å"


def test_escapes_in_a_file_name_do_not_reach_the_terminal(tmp_path, command):
    words = [*command, "export", "\x1b]0;x\x07.h5"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True)
    assert done.returncode == 2
    assert b"\x1b" not in done.stderr + done.stdout


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
