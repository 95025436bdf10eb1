"""Limits of what is read."""

import pytest

from pcsr import UserError, limits


def test_memory_that_is_not_free_is_refused_and_some_is_always_free(monkeypatch):
    monkeypatch.setattr(limits, "free_memory", lambda: 10**9)
    limits.check_memory(10**9, "a")
    with pytest.raises(UserError, match=r"a\.ply needs about 1\.5 GB of memory, and 1 GB are free: split it"):
        limits.check_memory(1.5e9, "a.ply")
    monkeypatch.setattr(limits, "free_memory", lambda: 0)
    limits.check_memory(limits.UNCHECKED_SIZE, "a")
    monkeypatch.setattr(limits, "free_memory", lambda: None)
    limits.check_memory(10**15, "a")


def test_free_memory_is_the_least_that_the_system_says(monkeypatch, tmp_path):
    resource = pytest.importorskip("resource")
    files = {
        "/proc/meminfo": "MemTotal: 9000 kB\nMemAvailable: 5000 kB\nSwapFree: 1000 kB\nHugePages_Total: 0\n",
        "/sys/fs/cgroup/memory.max": "max\n",
        "/sys/fs/cgroup/memory.stat": "anon 1000\nfile 9999999\n",
        "/proc/self/statm": "10 1 1 0 0 0 0\n",
    }

    def path(name):
        (tmp_path / "file").write_text(files[name])
        return tmp_path / "file"

    monkeypatch.setattr(limits, "Path", path)
    monkeypatch.setattr(resource, "getrlimit", lambda which: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    assert limits.free_memory() == 6000 << 10
    files["/sys/fs/cgroup/memory.max"] = "501000\n"
    assert limits.free_memory() == 500_000
    monkeypatch.setattr(resource, "getrlimit", lambda which: (10 * resource.getpagesize() + 77, 0))
    assert limits.free_memory() == 77
    files.clear()  # another system
    monkeypatch.setattr(resource, "getrlimit", lambda which: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    monkeypatch.setattr(limits, "Path", lambda name: tmp_path / "none")
    assert limits.free_memory() is None


def test_what_is_compressed_becomes_no_more_than_points_can():
    limits.check_inflated(1, limits.UNCHECKED_SIZE)
    limits.check_inflated(limits.UNCHECKED_SIZE // 40, limits.UNCHECKED_SIZE * 2)
    with pytest.raises(UserError, match="more than 100 times as much"):
        limits.check_inflated(limits.UNCHECKED_SIZE // 60, limits.UNCHECKED_SIZE * 2)


@pytest.mark.parametrize(("count", "words"), [(1.5e9, "1.5 GB"), (537 << 20, "0.563 GB"), (2_000_000, "2 MB")])
def test_bytes_in_words(count, words):
    assert limits.gigabytes(count) == words
