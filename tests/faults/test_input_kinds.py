"""Whatever stands in the place of an input file: one message and a status, within seconds."""

import os
import signal
import socket
from pathlib import Path

import pytest

SECONDS = 20  # of the wall, on a machine that does other work as well
KINDS = ("missing", "directory", "loop", "dangling", "pipe", "socket", "zero", "full", "empty")
PLACES = {
    "spec": ("run", "X.toml", "--dry-run"),
    "spec to submit": ("submit", "X.toml", "--shards", "1"),
    "map": ("run", "spec.toml", "--dry-run", "--set", "surface={kind='file', path='X.npy'}"),
    "hdf5 map": ("run", "spec.toml", "--dry-run", "--set", "surface={kind='file', path='X.h5'}"),
    "scan": ("surface", "X.txt"),
    "scan to begin with": ("init", "new.toml", "--from", "X.di"),
    "table of k(q)": ("run", "spec.toml", "--set", "elastomer={kind='table', path='X.txt'}"),
    "study to export": ("export", "X.h5"),
    "study to analyze": ("analyze", "X.h5"),
    "study to report": ("report", "X.h5", "-o", "report.html"),
    "study to compare": ("diff", "X.h5", "X.h5"),
    "study to look at": ("status", "X.h5"),
    "bench to report": ("report", "study.h5", "--bench", "X.h5", "-o", "report.html"),
}


def make(path, kind):
    """Something that is no file that the program can use."""
    if kind == "directory":
        path.mkdir()
    elif kind == "loop":
        path.symlink_to(path.name)
    elif kind == "dangling":
        path.symlink_to("nowhere")
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as listening:
            os.chdir(path.parent)  # a name of a socket is short
            listening.bind(path.name)
    elif kind in ("zero", "full"):
        path.symlink_to(f"/dev/{kind}")
    elif kind == "empty":
        path.write_bytes(b"")


@pytest.mark.parametrize("place", PLACES)
def test_what_is_no_input_file_is_refused_soon(folder, start, gfmd, place):
    if "study.h5" in PLACES[place]:
        assert gfmd(folder, "run", "spec.toml", "-j", "1", "-q", "-o", "study.h5")[0] == 0
    for kind in KINDS:
        words = [word.replace("X", kind) for word in PLACES[place]]
        name = next(Path(word.split("'")[-2] if "'" in word else word) for word in words
                    if kind in word)  # fmt: skip
        make(folder / name.name, kind)
        child = start(folder, words, lambda: signal.alarm(SECONDS))
        status, output = child.wait(), child.said
        assert status in (2, 73, 74), (kind, status, output)
        assert "Traceback" not in output, (kind, output)
        assert kind in output or Path(os.path.realpath(folder / name.name)).name in output, output
        assert len(output.splitlines()) < 6


LONG = 10_000_000  # bytes
TEXTS = {
    "one line of numbers": b"1.0 " * (LONG // 4),
    "one number": b"1" * LONG,
    "one column": b"1.0\n" * (LONG // 4),
    "letters": b"a" * LONG,
    "blanks": b" " * LONG,
    "empty lines": b"\n" * LONG,
    "a header without an end": b"# x " * (LONG // 4),
    "lines of words": b"some words here\n" * (LONG // 16),
    "zeros": bytes(LONG),
    "a table that ends in one line": b"1 2 3\n" * 1000 + b"1 " * (LONG // 2),
}


@pytest.mark.parametrize("suffix", ["txt", "asc", "xyz"])
@pytest.mark.parametrize("text", TEXTS)
def test_a_long_text_that_is_no_map_is_refused_soon(folder, start, text, suffix):
    pytest.importorskip("SurfaceTopography")
    (folder / f"map.{suffix}").write_bytes(TEXTS[text])
    child = start(folder, ("surface", f"map.{suffix}"), lambda: signal.alarm(SECONDS))
    status, output = child.wait(), child.said
    assert status == 2, (status, output)
    assert "not in a known topography format" in output
