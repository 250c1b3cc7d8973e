"""Mutated specs, height files and studies: one message and an exit status each, soon, in bounds."""

import json
import os
import random
import resource
import time
import traceback
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from gfmd_cli.cli import main

SECONDS, BYTES = 5.0, 2**30
STATUSES = {0, 1, 2, 73, 74}
BASE = """\
[study]
name = "x"
[surface]
kind = "self-affine"
hurst = 0.8
rolloff = 0.5
cutoff = 0.05
spectrum = "rolloff"
seed = [0, 1]
[elastomer]
kind = "power"
n = [0, 0.5, 1]
[grid]
points = 64
[load]
p_star = { from = 1e-3, to = 3.0, per_decade = 4 }
[solver]
kind = "auto"
tolerance = 1e-6
[accuracy]
mean_gap = 1e-2
[output]
fields = ["u"]
histogram = true
"""
WORDS = [
    "nan", "inf", "-1", "0", "1e999", "-0.0", "9" * 400, "true", '""', '"auto"', "[]", "{}", "[[]]",
    "1979-05-27", '"\\u0000"', "[1, 2", "}", "=", ".", "[", "#", "'", '"""', "1e-320", "131072",
    "{ from = 1e-300, to = 1e300, per_decade = 1000 }", "[" + "0.5," * 3000 + "]", "\x00", "é",
    "=1\n", '"/dev/zero"', '"file"\npath = "/dev/zero"', '"file"\npath = "."',
    '"table"\npath = "/dev/zero"',
    '"slab"', '"ridge"', '"parabola"', "9" * 20, "0x7fffffffffffffff",
    "[surface]",

    "[[surface]]", "surface.hurst = 1", "a" + ".b" * 100, '"' + "x" * 10000 + '"', "[1, 'x']",
]  # fmt: skip


def mutated_spec(rng):
    """The spec with one to four words or lines replaced, dropped, doubled, or bytes changed."""
    lines = BASE.splitlines()
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(lines))
        how = rng.randrange(7)
        if how == 0:
            lines.insert(at, rng.choice(lines))
        elif how == 1:
            del lines[at]
        elif how == 2:
            lines.insert(at, rng.choice(WORDS))
        elif how == 3:
            text = list(lines[at] or " ")
            text[rng.randrange(len(text))] = chr(rng.choice([rng.randrange(128), 0x20AC]))
            lines[at] = "".join(text)
        elif how == 4:
            lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
        else:
            lines[at] = lines[at].partition("=")[0] + "= " + rng.choice(WORDS)
        lines = lines or [""]
    return "\n".join(lines).encode()


def mutated_bytes(content, rng):
    """Bytes flipped, overwritten, cut out, doubled or cut off."""
    data = bytearray(content)
    for _ in range(rng.choice([1, 1, 2, 5, 20])):
        at, size = rng.randrange(len(data)), rng.randint(1, 16)
        how = rng.randrange(6)
        if how < 2:
            data[at] ^= 1 << rng.randrange(8)
        elif how == 2:
            data[at : at + size] = rng.randbytes(size)
        elif how == 3:
            data[at : at + size] = rng.choice([b"\xff", b"\x00", b"\x7f"]) * size
        elif how == 4:
            del data[at : at + rng.choice([size, 1000])]
        else:
            data[at:at] = data[at : at + size]
        data = data or bytearray(b"\0")
    return bytes(data[: rng.randrange(len(data))] if rng.random() < 0.1 else data)


def survey(folder, cases, batch=100):
    """Call the command for each (name, content, words) in children with 1 GiB to spare.

    Returns how often each exit status came; fails on a traceback, a crash, a hang, silence.
    """
    cases, met, worst = list(cases), Counter(), 0.0
    for first in range(0, len(cases), batch):
        log = folder / f"{first}.log"
        pid = os.fork()
        if pid == 0:
            try:
                _call_all(folder, cases[first : first + batch], log)
            except BaseException:
                with log.open("a") as file:
                    file.write(json.dumps(["error", traceback.format_exc()]) + "\n")
            os._exit(0)
        ended = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        data = [json.loads(line) for line in log.read_text().splitlines()]
        case = first + len(data) - 1
        assert ended == 0, f"case {case} ended the process ({ended}); it lies in {folder}"
        for status, output, seconds in data:
            assert status in STATUSES, output
            assert "Traceback" not in output
            assert output.strip()
            assert seconds < SECONDS, output
            met[status] += 1
            worst = max(worst, seconds)
    assert sum(met.values()) == len(cases)
    print(dict(met), f"slowest {worst:.2f} s")
    return met


def _call_all(folder, cases, log):
    os.chdir(folder)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, used + BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for name, content, words, check in cases:
        (folder / name).write_bytes(content)
        resource.setrlimit(resource.RLIMIT_CPU, (_cpu() + 3 * int(SECONDS), -1))
        begun = time.process_time()
        result = CliRunner().invoke(main, words)
        seconds = time.process_time() - begun
        status, output = result.exit_code, result.output
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            status, output = "raised", "".join(traceback.format_exception(result.exception))
        if status == 0 and check is not None and output != check:
            status, output = "wrong", output
        with log.open("a") as file:
            file.write(json.dumps([status, output[:5000], seconds]) + "\n")


def _cpu():
    used = resource.getrusage(resource.RUSAGE_SELF)
    return int(used.ru_utime + used.ru_stime)


def test_mutated_specs(folder):
    rng = random.Random(0)
    words = ["run", "x.toml", "--dry-run"]
    met = survey(folder, (("x.toml", mutated_spec(rng), words, None) for _ in range(1000)))
    assert met[2] > 500


HEIGHT_FILES = ("h.npy", "old.h5", "new.h5", "old.nc", "new.nc")


def height_files(folder):
    """One of each kind: their names and content."""
    heights = np.random.default_rng(0).normal(size=(32, 32))
    np.save(folder / "h.npy", heights)
    for name, libver in (("old.h5", "earliest"), ("new.h5", "latest")):
        with h5py.File(folder / name, "w", libver=libver) as file:
            file.create_dataset("h", data=heights, compression="gzip", chunks=(16, 16))
            file["h"].attrs["units"] = "m"
    for name, libver in (("old.nc", "earliest"), ("new.nc", "latest")):
        with h5py.File(folder / name, "w", libver=libver) as file:
            file["h"] = heights
            for axis, positions in enumerate("yx"):
                file[positions] = 0.5 * np.arange(32)
                file[positions].make_scale(positions)
                file["h"].dims[axis].attach_scale(file[positions])
            for dataset in file.values():
                dataset.attrs["units"] = "nm"
    return {name: (folder / name).read_bytes() for name in HEIGHT_FILES}


@pytest.mark.parametrize("kind", HEIGHT_FILES)
def test_mutated_height_files(folder, kind):
    content, rng, cases = height_files(folder)[kind], random.Random(kind), []
    for i in range(500):
        name = f"{i}-{kind}"  # its own: a file is read once a process
        surface = f"surface={{kind='file', path='{name}'}}"
        words = ["run", "spec.toml", "--dry-run", "--set", surface]
        if i % 5 == 4:
            words = [["surface", name], ["init", f"{i}.toml", "--from", name]][i % 2]
        cases.append((name, mutated_bytes(content, rng), words, None))
    met = survey(folder, cases)
    assert met[2] > 0


def test_mutated_studies(folder, gfmd):
    assert gfmd(folder, "run", "spec.toml", "-q", "-j", "1", "-o", "study.h5")[0] == 0
    content, rng = (folder / "study.h5").read_bytes(), random.Random(2)
    export = ["export", "bad.h5"]
    sound = CliRunner().invoke(main, ["export", str(folder / "study.h5")]).output
    cases = [("bad.h5", mutated_bytes(content, rng), export, sound) for _ in range(500)]
    analyze = ["analyze", "bad.h5", "--json"]
    cases += [("bad.h5", mutated_bytes(content, rng), analyze, None) for _ in range(100)]
    for words in (
        ["diff", "bad.h5", "study.h5", "--json"],
        ["report", "bad.h5", "-o", "bad.html"],
        ["export", "bad.h5", "-o", "bad.nc"],
        ["export", "bad.h5", "-o", "bad.vti", "--task", "0"],
        ["status", "bad.h5", "--json"],
    ):
        cases += [("bad.h5", mutated_bytes(content, rng), words, None) for _ in range(50)]
    met = survey(folder, cases)
    assert met[74] > 250


def forged(folder):
    """Files that are what they should not be: links, external and virtual storage, bombs."""
    (folder / "secret").write_bytes(bytes(range(256)) * 64)
    with h5py.File(folder / "other.h5", "w") as file:
        file["h"] = np.random.default_rng(0).normal(size=(32, 32))
    with h5py.File(folder / "soft.h5", "w") as file:
        file["h"] = h5py.SoftLink("/nowhere")
    with h5py.File(folder / "link.h5", "w") as file:
        file["h"] = h5py.ExternalLink("other.h5", "h")
    with h5py.File(folder / "external.h5", "w") as file:
        file.create_dataset("h", (32, 32), "f8", external=[("secret", 0, 8192)])
    with h5py.File(folder / "virtual.h5", "w") as file:
        layout = h5py.VirtualLayout((32, 32), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "h", (32, 32))
        file.create_virtual_dataset("h", layout)
    with h5py.File(folder / "bomb.h5", "w") as file:
        file.create_dataset("h", (2**20, 2**20), "f8", chunks=(1024, 1024), compression="gzip")
    with h5py.File(folder / "zeros.h5", "w") as file:
        file.create_dataset("h", data=np.zeros((4096, 4096)), compression="gzip")
    with h5py.File(folder / "text.h5", "w") as file:
        file["h"] = np.full((8, 8), b"x")
    np.save(folder / "pickle.npy", np.full((8, 8), {}), allow_pickle=True)
    head = (
        b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (32768, 32768)}"
    )
    (folder / "claims.npy").write_bytes(head.ljust(127) + b"\n" + bytes(64))
    os.mkfifo(folder / "pipe.h5")
    return [p.name for p in folder.iterdir() if p.suffix in (".h5", ".npy") and p.stem != "other"]


def test_forged_files_are_refused_as_heights_and_as_studies(folder):
    names = forged(folder)
    assert len(names) == 10
    cases = []
    for name in names:
        surface = f"surface={{kind='file', path='{name}'}}"
        as_height = ["run", "spec.toml", "--dry-run", "--set", surface]
        as_study = ["run", "spec.toml", "-o", name, "--dry-run"]
        calls = (as_height, ["export", name], as_study)
        cases += [("unused", b"", words, None) for words in calls]
    met = survey(folder, cases)
    assert met[0] == 0


@pytest.mark.parametrize("how", ["external", "soft", "link", "virtual", "bomb"])
def test_a_forged_column_of_a_study_is_refused(folder, gfmd, how):
    assert gfmd(folder, "run", "spec.toml", "-q", "-j", "1", "-o", "study.h5")[0] == 0
    (folder / "secret").write_bytes(bytes(256))
    with h5py.File(folder / "other.h5", "w") as file:
        file["a_r"] = np.full(4, 0.5)
    with h5py.File(folder / "study.h5", "r+") as file:
        file.move("a_r", "hidden")
        if how == "external":
            file.create_dataset("a_r", (4,), "f8", external=[("secret", 0, 32)])
        elif how == "soft":
            file["a_r"] = h5py.SoftLink("hidden")
        elif how == "link":
            file["a_r"] = h5py.ExternalLink("other.h5", "a_r")
        elif how == "virtual":
            layout = h5py.VirtualLayout((4,), "f8")
            layout[:] = h5py.VirtualSource("other.h5", "a_r", (4,))
            file.create_virtual_dataset("a_r", layout)
        else:
            file.create_dataset("a_r", (2**40,), "f8", chunks=(2**20,), compression="gzip")
    for words in (("export",), ("analyze",)):
        status, output = gfmd(folder, *words, "study.h5")
        assert status == 74
        assert "a_r" in output
        assert "Traceback" not in output
