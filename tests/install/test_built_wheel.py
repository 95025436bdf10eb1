"""The wheel that is built from this tree: what is in it besides modules, and what PyPI shows of it."""

import re
import subprocess
import sys
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest

from pcsr import weights

ROOT = Path(__file__).parents[2]
pytest.importorskip("hatch_fancy_pypi_readme", reason="`make test` installs what builds a wheel")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """As `pip wheel` builds it, in this environment."""
    folder = tmp_path_factory.mktemp("wheel")
    script = "import sys; from hatchling.build import build_wheel; build_wheel(sys.argv[1])"
    done = subprocess.run([sys.executable, "-c", script, folder], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as archive:
        yield archive


@pytest.fixture(scope="module")
def metadata(wheel):
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    return message_from_bytes(wheel.read(name))


def test_it_holds_every_file_of_the_packages(wheel):
    there = {
        path.relative_to(root).as_posix()
        for root, package in ((ROOT, "pcsr"), (ROOT / "plugins", "pcsr_plugins"))
        for path in (root / package).rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    packed = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert packed == there
    assert {f"pcsr/weights/{name}.safetensors" for name in weights.names()} <= packed
    assert {"pcsr/report/web/page.css", "pcsr/report/web/page.js", "pcsr/py.typed", "pcsr_plugins/py.typed"} <= packed
    assert "pcsr_plugins/touch/digit/sensors.toml" in packed
    assert any(name.startswith("pcsr/cli/templates/") for name in packed)


def test_links_of_the_description_lead_somewhere(metadata):
    text = metadata.get_payload(decode=True).decode()
    links = re.findall(r"\]\(([^)]*)\)", text)
    assert len(links) > 15
    assert all(link.startswith("https://") for link in links), links
    ours = "https://(?:raw.githubusercontent.com/pcsr/pcsr/main|github.com/pcsr/pcsr/blob/main)/"
    for link in links:
        path = re.sub(ours, "", link)
        assert path != link
        assert (ROOT / path.partition("#")[0]).is_file(), link
        assert link.startswith("https://raw.") == path.endswith(".png"), "a picture is the file itself"


def test_its_pages_are_all_of_one_project(metadata, project):
    urls = dict(line.split(", ") for line in metadata.get_all("Project-URL"))
    assert urls == project["urls"]
    assert {url.split("/")[3] + "/" + url.split("/")[4] for url in urls.values()} == {"pcsr/pcsr"}
    for url in urls.values():
        if "/blob/main/" in url:
            assert (ROOT / url.partition("/blob/main/")[2]).is_file()


def test_its_classifiers_are_the_versions_that_it_takes(metadata):
    versions = [re.fullmatch(r".*Python :: 3\.(\d+)", one) for one in metadata.get_all("Classifier")]
    assert [int(found[1]) for found in versions if found] == [11, 12, 13, 14]
    assert metadata["Requires-Python"] == ">=3.11"
