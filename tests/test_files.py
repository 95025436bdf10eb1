"""A file is written whole or not at all."""

import os
import subprocess
import sys

import pytest
import torch
from safetensors.torch import load_file

from pcsr.errors import RunError, UserError
from pcsr.files import save_tensors, sha256, write_text, write_whole


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_text_is_written_in_utf_8_into_folders_that_need_not_be_there(tmp_path):
    write_text(tmp_path / "a" / "b.txt", "naïve ×10³\n")
    assert (tmp_path / "a" / "b.txt").read_bytes() == "naïve ×10³\n".encode()
    write_text(tmp_path / "a" / "b.txt", "other")
    assert (tmp_path / "a" / "b.txt").read_text() == "other"
    assert names(tmp_path / "a") == ["b.txt"]


@pytest.mark.parametrize("error", [ValueError("a slip"), KeyboardInterrupt()])
def test_a_writer_that_fails_leaves_what_was_there_and_nothing_else(tmp_path, error):
    path = tmp_path / "kept.txt"
    path.write_text("kept")

    def fail(part):
        part.write_text("half")
        raise error

    with pytest.raises(type(error)):
        write_whole(path, fail)
    assert path.read_text() == "kept"
    assert names(tmp_path) == ["kept.txt"]


def test_until_it_is_whole_nobody_sees_it(tmp_path):
    path = tmp_path / "new.txt"

    def watched(part):
        part.write_text("half")
        assert part.parent == path.parent  # a rename is one step within a file system only
        assert not path.exists()
        part.write_text("whole")

    write_whole(path, watched)
    assert path.read_text() == "whole"


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match=r"file/x\.txt could not be written: [^;]*$"):
        write_text(tmp_path / "file" / "x.txt", "x")


def test_that_an_old_file_is_unharmed_is_said_where_there_is_one(tmp_path):
    def fails(part):
        raise OSError(28, "No space left on device")

    path = tmp_path / "x.txt"
    path.write_text("old")
    with pytest.raises(
        RunError, match=r"x\.txt could not be written: No space left on device; the old file is unharmed"
    ):
        write_whole(path, fails)
    assert path.read_text() == "old"


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX has these modes")
def test_others_may_read_what_they_may_read_of_any_new_file(tmp_path):
    (tmp_path / "plain").write_text("")
    save_tensors(tmp_path / "t.safetensors", {"a": torch.zeros(3)}, {})
    write_text(tmp_path / "text", "x")
    modes = {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()}
    assert len(modes) == 1


def test_tensors_come_back(tmp_path):
    save_tensors(tmp_path / "t.safetensors", {"a": torch.arange(6).reshape(2, 3).T}, {"x": "y"})
    assert torch.equal(load_file(tmp_path / "t.safetensors")["a"], torch.arange(6).reshape(2, 3).T)


FULL = """
import resource, sys
from pathlib import Path
import torch
from pcsr.files import save_tensors, write_text
path = Path(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
if sys.argv[2] == "text":
    write_text(path, "x" * 10_000)
else:
    save_tensors(path, {"a": torch.zeros(10_000)}, {})
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="limits on file sizes are POSIX")
@pytest.mark.parametrize("kind", ["text", "tensors"])
def test_a_disk_that_takes_no_more_loses_nothing(tmp_path, kind):
    path = tmp_path / "file"
    path.write_text("kept")
    done = subprocess.run([sys.executable, "-c", FULL, str(path), kind], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert f"RunError: {path} could not be written: " in done.stderr
    assert path.read_text() == "kept"
    assert names(tmp_path) == ["file"]
    assert os.path.getsize(path) == 4


def test_a_link_stays_and_what_it_leads_to_is_replaced(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "a.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real" / "a.txt")
    (tmp_path / "new.txt").symlink_to(tmp_path / "real" / "b.txt")
    for link in ("link.txt", "new.txt"):
        write_text(tmp_path / link, "new")
        assert (tmp_path / link).is_symlink()
    assert {path.name: path.read_text() for path in (tmp_path / "real").iterdir()} == {"a.txt": "new", "b.txt": "new"}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes with a name")
def test_what_is_no_file_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name, what in (("pipe", "a device, a pipe or a socket"), ("folder", "a folder")):
        with pytest.raises(UserError, match=f"{name} is {what}"):
            write_text(tmp_path / name, "text")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "pipe"]
    assert (tmp_path / "pipe").is_fifo()


def test_the_hash_of_a_file_is_that_of_its_bytes(tmp_path):
    (tmp_path / "abc").write_bytes(b"abc")
    assert sha256(tmp_path / "abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
