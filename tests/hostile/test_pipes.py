"""Clouds that are no files: devices, folders, pipes, and names that no file can have."""

import os
import socket
import threading
from pathlib import Path

import numpy as np
import pytest

from pcsr import UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes, read_cloud, read_cloud_pipe

POINTS = np.random.default_rng(0).normal(size=(40, 3))


def refused(limited, folder, name, *words, **bounds):
    limited("upsample", name, "-o", "out.ply", "--model", "midpoint", folder=folder).refused(*words, **bounds)
    assert not (folder / "out.ply").exists()


@pytest.mark.parametrize(
    ("path", "what"), [("/dev/zero", "a device"), ("/dev/urandom", "a device"), ("/dev/null", "a device")]
)
def test_devices(limited, tmp_path, path, what):
    (tmp_path / "in.xyz").symlink_to(path)
    refused(limited, tmp_path, "in.xyz", "in.xyz", what, "name a file", megabytes=30)


def test_folders_and_sockets(limited, tmp_path):
    (tmp_path / "in.ply").mkdir()
    refused(limited, tmp_path, "in.ply", "in.ply", "a folder")
    (tmp_path / "in.ply").rmdir()
    with socket.socket(socket.AF_UNIX) as one:
        here = os.getcwd()
        os.chdir(tmp_path)  # the name of a socket is short
        try:
            one.bind("in.ply")
        finally:
            os.chdir(here)
        refused(limited, tmp_path, "in.ply", "in.ply", "a socket")


@pytest.mark.parametrize("name", ["~nobody/in.ply", "a\n.ply"])
def test_names_of_no_file(limited, tmp_path, name):
    refused(limited, tmp_path, name, "cannot be read")


def test_names_that_no_file_can_have():
    with pytest.raises(UserError, match="cannot be read: File name too long"):
        read_cloud(Path("a" * 300 + ".ply"))  # the command line refuses it before: test_options.py


def test_names_with_a_nul():
    with pytest.raises(UserError, match="no file has such a name"):
        read_cloud(Path("a\0.ply"))


def test_a_pipe_that_nobody_writes_into(tmp_path, monkeypatch):
    monkeypatch.setattr("pcsr.inputs.PIPE_TIMEOUT", 0.2)
    os.mkfifo(tmp_path / "in.xyz")
    with pytest.raises(UserError, match=r"in\.xyz cannot be read: it is a pipe, and nobody wrote into it for 0\.2 s"):
        read_cloud(tmp_path / "in.xyz")


def test_a_pipe_that_somebody_writes_into_is_read(tmp_path):
    os.mkfifo(tmp_path / "in.xyz")
    writer = threading.Thread(target=(tmp_path / "in.xyz").write_bytes, args=(cloud_bytes(Cloud(POINTS), ".xyz"),))
    writer.start()
    assert read_cloud(tmp_path / "in.xyz").points.tobytes() == POINTS.tobytes()
    writer.join()


def test_a_pipe_without_a_name_is_read_however_late_it_comes(tmp_path):
    read, write = os.pipe()
    os.write(write, cloud_bytes(Cloud(POINTS), ".xyz"))
    os.close(write)
    (tmp_path / "in.xyz").symlink_to(f"/proc/self/fd/{read}")
    assert len(read_cloud(tmp_path / "in.xyz")) == 40
    os.close(read)


class Endless:
    """A pipe that gives the same for ever."""

    def __init__(self, text):
        self.text, self.given = text, 0

    def read(self, size):
        self.given += size
        return (self.text * (size // len(self.text) + 1))[:size]


@pytest.mark.parametrize("text", [b"1 2 3\n", b"1", b"\n", b"\0"])
def test_a_pipe_that_never_ends(text):
    pipe = Endless(text)
    with pytest.raises(UserError, match=r"did not end within 16\.8 MB|line of more than|nearly all of them empty"):
        read_cloud_pipe(pipe, ".xyz", "what came through the pipe", most=1 << 24)
    assert pipe.given <= 1 << 25
