import errno
import os
import socket
from pathlib import Path

import pytest

from gfmd_cli.errors import GfmdError
from gfmd_cli.files.atomic import (
    NewFile,
    check_place,
    exists,
    make_folder,
    target_of,
    write_whole,
)
from gfmd_cli.files.cache import cache_folder
from gfmd_cli.files.checksums import file_digest
from gfmd_cli.files.regular import open_regular, read_regular

READ, WRITE = os.O_RDONLY, os.O_RDWR | os.O_CREAT


def not_regular(folder):
    """One of each kind that must not be opened, by name."""
    (folder / "target").write_bytes(b"content")
    (folder / "link").symlink_to(folder / "target")
    (folder / "dangling").symlink_to(folder / "nowhere")
    (folder / "directory").mkdir()
    os.mkfifo(folder / "pipe")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(folder / "socket"))
    (folder / "device").symlink_to("/dev/zero")
    return [path for path in sorted(folder.iterdir()) if path.name != "target"]


@pytest.mark.parametrize("flags", [READ, WRITE])
def test_what_is_no_regular_file_is_not_opened(tmp_path, flags):
    paths = not_regular(tmp_path)
    assert len(paths) == 6
    for path in paths:
        with pytest.raises(OSError, match=path.name):
            open_regular(path, flags)
    assert (tmp_path / "target").read_bytes() == b"content"
    assert not (tmp_path / "nowhere").exists()


def test_a_link_is_followed_only_to_a_regular_file(tmp_path):
    not_regular(tmp_path)
    with open_regular(tmp_path / "link", follow=True) as file:
        assert file.read() == b"content"
    with pytest.raises(OSError, match="not a regular file"):
        open_regular(tmp_path / "device", follow=True)


def test_a_file_of_several_names_is_read_but_not_written(tmp_path):
    (tmp_path / "own").write_bytes(b"content")
    os.link(tmp_path / "own", tmp_path / "other")
    assert read_regular(tmp_path / "other", 7) == b"content"
    with pytest.raises(OSError, match="several names"):
        open_regular(tmp_path / "other", WRITE)


def test_no_more_is_read_than_allowed(tmp_path):
    (tmp_path / "sparse").touch()
    os.truncate(tmp_path / "sparse", 2**36)
    with pytest.raises(OSError, match="larger than 100 bytes") as caught:
        read_regular(tmp_path / "sparse", 100)
    assert caught.value.errno == errno.EFBIG


@pytest.mark.parametrize(("given", "folder"), [("/c", "/c/gfmd"), ("c", "/home/me/.cache/gfmd")])
def test_a_relative_cache_folder_is_ignored(monkeypatch, given, folder):
    monkeypatch.setenv("HOME", "/home/me")
    monkeypatch.setenv("XDG_CACHE_HOME", given)
    assert cache_folder() == Path(folder)


def test_after_an_error_what_was_not_written_is_read_as_zeros(tmp_path):
    """HDF5 reads back what it wrote, and takes the former content of its memory where it cannot."""
    with NewFile(tmp_path / "file", "w+b") as file:
        file.write(b"ab")
        file.error = OSError(errno.ENOSPC, "full")
        file.write(b"cd")
        file.seek(0)
        buffer = bytearray(b"wxyz")
        file.readinto(buffer)
    assert buffer == b"ab\0\0"


@pytest.mark.parametrize("call", [check_place, make_folder, file_digest])
def test_a_folder_that_cannot_be_searched_is_one_message(tmp_path, call):
    with pytest.raises(GfmdError, match=r"cannot be (written|read)"):
        call(tmp_path / ("long" * 100) / "file")


def test_a_file_that_cannot_be_looked_for_is_not_taken_for_missing(tmp_path):
    (tmp_path / "file").touch()
    assert exists(tmp_path)
    assert exists(tmp_path / "file")
    for missing in ("none", "none/file", "file/none", "null\0"):
        assert not exists(tmp_path / missing)
    with pytest.raises(OSError, match="too long"):
        exists(tmp_path / ("long" * 100))


def test_a_file_may_lie_in_a_folder_that_cannot_be_read(tmp_path, monkeypatch):
    def refuse(path, *_):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)

    monkeypatch.setattr("gfmd_cli.files.atomic.os.open", refuse)
    write_whole(tmp_path / "file", b"content")
    assert (tmp_path / "file").read_bytes() == b"content"


@pytest.mark.parametrize("follow", [False, True])
def test_only_a_link_of_a_user_is_followed(tmp_path, follow):
    (tmp_path / "file").write_bytes(b"old")
    (tmp_path / "link").symlink_to("file")
    write_whole(target_of(tmp_path / "link") if follow else tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink() == follow
    assert (tmp_path / "link").read_bytes() == b"new"
    assert (tmp_path / "file").read_bytes() == (b"new" if follow else b"old")
