"""docs/parts: for each kind its contract, an example that is what `pcsr plugins new` writes, and our own parts."""

import re
from inspect import get_annotations, isfunction, signature
from pathlib import Path

import pytest

from pcsr import contracts
from pcsr.cli.plugin_new import distribution
from pcsr.clouds.touch import Touch
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import FIRST_PARTY, KINDS
from pcsr.testing.construction import TRAITS

DOCS = Path(__file__).parents[2] / "docs" / "parts"
PAGES = {kind: (DOCS / f"{kind}.md").read_text(encoding="utf-8") for kind in KINDS}


def section(page, title):
    return re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", page, re.MULTILINE | re.DOTALL)[1]


def rows(text):
    """The first cells of the tables in a text."""
    return re.findall(r"^\| `([^|]+)` \|", text, re.MULTILINE)


def methods(contract):
    """What a person may call, as it is written in a table."""
    functions = {name: f for name, f in vars(contract).items() if isfunction(f) and not name.startswith("_")}
    return {f"{name}({', '.join(list(signature(f).parameters)[1:])})" for name, f in functions.items()}


def test_there_is_a_page_for_each_kind_and_none_besides():
    assert {path.stem for path in DOCS.iterdir()} == set(KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_the_contract_is_told_whole(kind):
    contract = getattr(contracts, KINDS[kind])
    attributes = {name for name in get_annotations(contract) if not name.startswith("_")}
    table = re.search(r"\|---\|---\|---\|\n((?:\|.*\n)+)", section(PAGES[kind], "The contract"))[1]
    assert set(rows(table)) == methods(contract) | attributes


@pytest.mark.parametrize("kind", KINDS)
def test_the_example_is_what_a_command_writes(kind):
    (block,) = re.findall(r"```python\n(.*?)```", PAGES[kind], re.DOTALL)
    assert f"`pcsr plugins new {kind} my-{kind}` writes this, as `my_{kind}.py`" in PAGES[kind]
    assert block == distribution(kind, f"my-{kind}")[f"my_{kind}.py"]


@pytest.mark.parametrize("kind", KINDS)
def test_the_traits_are_those_that_the_kind_can_claim(kind):
    documented = set(re.findall(r"`([A-Z_]+)`", section(PAGES[kind], "Traits")))
    assert documented == {trait.name for trait in TRAITS[kind]}
    assert documented or "None says anything of" in PAGES[kind]


@pytest.mark.parametrize("kind", KINDS)
def test_every_part_that_comes_with_pcsr_is_listed(kind):
    ours = [entry.name for entry in load_plugins() if (entry.kind, entry.owner) == (kind, FIRST_PARTY)]
    assert rows(section(PAGES[kind], "Parts of pcsr")) == ours


@pytest.mark.parametrize(
    ("kind", "record"),
    [("fusion", contracts.TouchBatch), ("touch", Touch), ("shapes", contracts.ShapeItem)],
)
def test_what_is_handed_over_is_told_field_by_field(kind, record):
    names = {
        *record.__dataclass_fields__,
        *(name for name, value in vars(record).items() if isinstance(value, property)),
    }
    documented = set(re.findall(r"`([a-z_]+)`", PAGES[kind]))
    assert names <= documented


def test_what_an_objective_may_call_is_told():
    documented = {row.removeprefix("network.") for row in rows(PAGES["objective"]) if row.startswith("network")}
    assert documented == {*methods(contracts.UpsamplingNetwork), "upsampler", "network(points, rate, touches)"}
