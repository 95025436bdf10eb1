"""Opening files and pipes; what hostile ones do is in tests/hostile."""

import io
import os

import pytest

from pcsr import UserError, inputs


@pytest.mark.parametrize("size", [0, 1, inputs.HEAD - 1, inputs.HEAD, inputs.HEAD + 1, 3 * inputs.HEAD])
def test_a_file_and_a_pipe_give_what_is_in_them(tmp_path, size):
    content = os.urandom(size)
    (tmp_path / "a").write_bytes(content)
    heads = []
    assert inputs.read_bytes(tmp_path / "a", check=heads.append) == content
    assert inputs.read_pipe(io.BytesIO(content), "a pipe", check=heads.append) == content
    assert heads[-1] == content[: inputs.HEAD]
    assert set(heads) == {content[: inputs.HEAD]}


def test_no_more_is_read_than_was_asked_for(tmp_path):
    (tmp_path / "a").write_bytes(b"12345")
    assert inputs.read_bytes(tmp_path / "a", most=5) == b"12345"
    with pytest.raises(UserError, match=r"has 0\.005 kB, more than the 0\.004 kB that such a file may have"):
        inputs.read_bytes(tmp_path / "a", most=4)
    assert inputs.read_pipe(io.BytesIO(b"12345"), "a pipe", most=5) == b"12345"
    with pytest.raises(UserError, match="a pipe did not end within"):
        inputs.read_pipe(io.BytesIO(b"12345"), "a pipe", most=4)


def test_the_beginning_is_looked_at_before_the_rest_is_read(tmp_path):
    with (tmp_path / "a").open("wb") as file:
        file.truncate(1 << 33)

    def refuse(head):
        raise UserError(f"of {len(head)}")

    with pytest.raises(UserError, match=f"of {inputs.HEAD}"):
        inputs.read_bytes(tmp_path / "a", memory=0.0, check=refuse)


def test_a_pipe_that_needs_more_memory_than_is_free(monkeypatch):
    monkeypatch.setattr("pcsr.limits.free_memory", lambda: 10**9)
    with pytest.raises(UserError, match=r"a pipe \(.* so far\) needs about"):
        inputs.read_pipe(io.BytesIO(bytes(1 << 24)), "a pipe", memory=1000)


def test_only_files_are_mapped(tmp_path):
    (tmp_path / "a").write_bytes(b"")
    inputs.check_file(tmp_path / "a")
    os.mkfifo(tmp_path / "b")
    with pytest.raises(UserError, match="it is a pipe"):
        inputs.check_file(tmp_path / "b")
    with pytest.raises(UserError, match="No such file"):
        inputs.check_file(tmp_path / "c")
