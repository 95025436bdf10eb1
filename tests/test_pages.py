"""All pages: the index and the site have each, links lead somewhere, and what is filled in is as it would be now."""

import importlib
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
AT_ROOT = ("RESULTS.md", "PAPER.md", "CONTRIBUTING.md", "CHANGELOG.md")
PAGES = [ROOT / "README.md", *(ROOT / name for name in AT_ROOT), *sorted(DOCS.rglob("*.md"))]
LINK = re.compile(r"\]\((?!https?:)([^)\s#]*)(#[^)\s]*)?\)")


def written(path):
    """A page without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def anchors(path):
    """Of a page's headings, as forges and MkDocs make them."""
    heads = re.findall(r"^#+ (.*)$", written(path), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


def navigated(entry):
    """The pages of the site's navigation."""
    if isinstance(entry, str):
        return [entry]
    below = entry if isinstance(entry, list) else entry.values()
    return [page for one in below for page in navigated(one)]


def names(text):
    return re.findall(r"^(pcsr\.[\w.]+): (?!module$)", text, re.MULTILINE)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_to_pages_and_headings(path):
    for page, anchor in LINK.findall(written(path)):
        target = (path.parent / page).resolve() if page else path
        assert target.exists(), page
        assert target.is_relative_to(ROOT), page
        if anchor and target.suffix == ".md":
            assert anchor[1:] in anchors(target), page + anchor


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_prose_is_wrapped(path):
    prose = re.sub(r"^[|>#<!].*$", "", written(path), flags=re.MULTILINE)
    assert not [line for line in prose.splitlines() if len(line) > 120]


def test_every_page_is_on_the_site_and_in_the_index():
    site = navigated(YAML(typ="safe", pure=True).load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"])
    wanted = {*AT_ROOT, *(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))}
    assert sorted(site) == sorted(wanted)
    index = DOCS / "README.md"
    linked = {(DOCS / page).resolve() for page, _ in LINK.findall(written(index)) if page}
    assert linked | {index} >= set(PAGES)


def test_each_public_name_is_on_one_page_of_the_reference():
    public = names((ROOT / "tests" / "public_api.txt").read_text(encoding="utf-8"))
    pages = [path.read_text(encoding="utf-8") for path in (DOCS / "api").iterdir()]
    described = [name for page in pages for name in re.findall(r"^::: (\S+)$", page, re.MULTILINE)]
    assert sorted(described) == sorted([*public, "pcsr.plugins.hookspecs.pcsr_register"])


def test_tables_are_as_code_and_measurements_make_them_now():
    cog = [sys.executable, "-m", "cogapp", "--check", "--diff", "--verbosity=0", "-U", "-I", "docs", "-p"]
    pages = [path for path in PAGES if "[[[cog" in path.read_text(encoding="utf-8")]
    assert len(pages) >= 7
    done = subprocess.run([*cog, "import tables", *map(str, pages)], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stdout}{done.stderr}\n`make pages` fills the pages anew"


def test_every_measured_table_is_shown_and_says_its_command():
    text = "".join(path.read_text(encoding="utf-8") for path in PAGES)
    shown = {name for names in re.findall(r"tables\.numbers\((.*?)\)", text) for name in re.findall(r'"(.*?)"', names)}
    shown |= set(re.findall(r'tables\.(?:calibration|reliability)\("(.*?)"', text))
    assert shown == {path.stem for path in (DOCS / "numbers").iterdir()}
    for path in (DOCS / "numbers").iterdir():
        measured = json.loads(path.read_text(encoding="utf-8"))
        assert measured["command"]
        assert {len(row) for row in measured["rows"]} == {len(measured["columns"])}


@pytest.mark.parametrize(
    ("page", "link", "target"),
    [
        ("upsample.md", "../RESULTS.md", "RESULTS.md"),
        ("parts/touch.md", "../touch.md", "../touch.md"),
        ("RESULTS.md", "docs/pictures/figure-4.png", "pictures/figure-4.png"),
        ("api/parts.md", "../plugins.md", "../plugins.md"),
        ("performance.md", "../pcsr/threads.py", "https://example.org/blob/main/pcsr/threads.py"),
    ],
)
def test_links_of_the_site(page, link, target, monkeypatch):
    pytest.importorskip("mkdocs", reason="the site's packages are in the dependency group docs")
    monkeypatch.syspath_prepend(str(DOCS))
    hook = importlib.import_module("outside")
    folder = hook.PurePosixPath("." if page in hook.PAGES else f"docs/{page}").parent
    assert hook.target(link, folder, page, "https://example.org") == target
    assert hook.PAGES == AT_ROOT
