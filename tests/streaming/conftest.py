import pytest

from pcsr.clouds.formats import write_cloud
from tests.streaming.clouds import sheet, use_small_patches


@pytest.fixture(autouse=True)
def small_patches(monkeypatch):
    use_small_patches(monkeypatch)


@pytest.fixture
def scan(tmp_path):
    write_cloud(tmp_path / "scan.ply", sheet())
    return tmp_path / "scan.ply"
