"""Full disks and folders that cannot be written: one message, and nothing lost."""

import resource
import shutil

import pytest

from .conftest import SPEC
from .equal import assert_same_bits

RUN = ("run", "spec.toml", "-j", "1", "-q", "--checkpoint-every", "1e-3", "-o", "study.h5")
SPACES = [
    *(f"size={size}k" for size in (*range(16, 400, 48), *range(400, 1600, 200))),
    *(f"nr_inodes={count}" for count in range(2, 22, 4)),
]
OUTPUTS = {
    "netCDF": ("export", "study.h5", "-o", "a.nc"),
    "VTK": ("export", "study.h5", "-o", "a.vti", "--task", "0"),
    "report": ("report", "study.h5"),
}


@pytest.mark.usefixtures("small_plans_measured")
def test_a_full_disk_is_one_message_and_the_run_goes_on_when_there_is_space(
    folder, gfmd, disk, monkeypatch
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    assert gfmd(folder, *RUN[:-1], "unbroken.h5")[0] == 0
    enough = "size=64m,nr_inodes=1000"
    place, statuses = disk(enough), []
    for space in SPACES:
        for path in place.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        disk(space)
        words = ("run", folder / "spec.toml", *RUN[2:])
        status, output = gfmd(place, *words)
        statuses.append(status)
        assert status in (0, 73), (space, output)
        assert "Traceback" not in output
        assert ("cannot be written" in output) or status == 0
        disk(enough)
        status, output = gfmd(place, *words)
        assert (status, output) == (0, ""), space
        assert_same_bits(place / "study.h5", folder / "unbroken.h5")
    print(dict(zip(SPACES, statuses, strict=True)))
    assert 73 in statuses
    assert 0 in statuses


@pytest.mark.parametrize("name", OUTPUTS)
def test_an_output_that_cannot_be_written_is_one_message_and_leaves_nothing(folder, gfmd, name):
    assert gfmd(folder, *RUN)[0] == 0
    before = sorted(folder.iterdir())
    assert gfmd(folder, *OUTPUTS[name])[0] == 0
    (written,) = set(folder.iterdir()) - set(before)
    whole = written.stat().st_size
    written.unlink()
    for kib in (1, 4, 16, 40, 100):

        def limit(size=1024 * kib):
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

        status, output = gfmd(folder, *OUTPUTS[name], before=limit)
        assert (status != 0) == (1024 * kib < whole)
        if status != 0:
            assert status == 73, (kib, output)
            assert "cannot be written: File too large" in output
            assert len(output.splitlines()) == 1
            assert sorted(folder.iterdir()) == before
    assert gfmd(folder, *OUTPUTS[name])[0] == 0


def test_a_read_only_folder_is_status_73_and_can_be_read(folder, gfmd, disk):
    place = disk("size=64m")
    (place / "spec.toml").write_text(SPEC)
    assert gfmd(place, *RUN, "--shard", "0/2")[0] == 0
    disk("ro")
    status, output = gfmd(place, *RUN)
    assert status == 73
    assert "cannot be written" in output
    assert "Traceback" not in output
    assert gfmd(place, "export", "study.h5")[0] == 0
    assert gfmd(place, "analyze", "study.h5")[0] == 0
    assert gfmd(place, "run", "spec.toml", "-o", "study.h5", "--dry-run")[0] == 0
    for words in (
        ("export", "study.h5", "-o", "a.csv"),
        ("analyze", "study.h5", "--figures", "figures"),
        ("run", "spec.toml", "-o", "new.h5"),
        ("run", "spec.toml", "-o", "study.h5", "--overwrite"),
        ("bench", "spec.toml"),
    ):
        status, output = gfmd(place, *words)
        assert status == 73, (words, output)
        assert "Traceback" not in output
    disk("rw")
    assert gfmd(place, *RUN)[0] == 0


@pytest.mark.parametrize("name", ["study.h5", "study.parts"])
def test_a_directory_or_file_in_the_way_is_one_message(folder, gfmd, name):
    if name == "study.h5":
        (folder / name).mkdir()
    else:
        (folder / name).write_text("")
    status, output = gfmd(folder, *RUN)
    assert status in (73, 74)
    assert len(output.strip().splitlines()) == 1
