"""The table in front of the first-party parts says what the recipes say."""

from pathlib import Path

import pcsr_plugins
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.recipes import names

COLUMNS = ("encoder", "fusion", "backbone", "upsampler", "objective")
_, HEADER, _, *ROWS, _ = pcsr_plugins.__doc__[pcsr_plugins.__doc__.index("===") :].rpartition("\n\n")[0].splitlines()
TABLE = {row.split()[0]: row.split()[1:6] for row in ROWS}
REGISTRY = load_plugins()


def of(name):
    recipe, *_ = load(Path(name), REGISTRY)
    parts = {column: getattr(recipe.model, column).use for column in COLUMNS[:-1]}
    return [*parts.values(), recipe.train.objective.use]


def test_each_row_is_its_recipe_and_tapsr_is_the_first():
    assert HEADER.split() == ["recipe", *COLUMNS, "source"]
    assert next(iter(TABLE)) == "tapsr"
    assert {name: of(name) for name in TABLE} == TABLE


def test_each_network_of_the_recipes_has_a_row():
    networks = [name for name in names() if name.split("/")[0] not in ("fusions", "graft", "shipped", "touch")]
    studies = ("pretrained", "smoke", "table2", "table3", "table4", "table5")
    assert set(networks) - set(studies) == TABLE.keys()


def test_each_part_of_a_network_is_in_a_row():
    used = {(kind, name) for row in TABLE.values() for kind, name in zip(COLUMNS, row, strict=True)}
    there = {(entry.kind, entry.name) for entry in REGISTRY if entry.owner == "pcsr" and entry.kind in COLUMNS}
    assert used == there
