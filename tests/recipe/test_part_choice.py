"""An option that names a part: the policy of the touch source `digit`."""

import json

import pytest

from pcsr.plugins.loading import load_plugins
from pcsr.recipe import for_data, from_resolved
from pcsr.recipe.json_schema import json_schema
from pcsr.recipe.source import RecipeError

MINE = """
import pcsr

class Lowest(pcsr.Policy):
    def __init__(self, *, sign: float = -1.0) -> None:
        self.sign = sign

    def scores(self, candidates, cloud, touched):
        return self.sign * candidates.points[:, 2]

@pcsr.hookimpl
def pcsr_register(register):
    register.policy("lowest", Lowest)
"""


@pytest.fixture
def registry(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    return load_plugins([tmp_path / "mine.py"])


def recipe(registry, policy):
    return for_data("cad-parts", {}, registry, [f"policy={policy}"], part="touch")


def test_its_options_are_completed_and_reach_the_part(registry):
    found = recipe(registry, "{use: lowest, sign: 2.0, tries: 7}")
    assert found.resolved()["data"]["touch"]["policy"] == {"use": "lowest", "spacing": 20.0, "tries": 7, "sign": 2.0}
    assert recipe(registry, "lowest").resolved()["data"]["touch"]["policy"]["sign"] == -1.0
    built = found.data.touch.build(registry, "touch")
    assert built.hand.policy.sign == 2.0
    assert built.hand.tries == 7


def test_a_resolved_recipe_is_read_again(registry):
    found = recipe(registry, "{use: lowest, sign: 2.0}")
    again = from_resolved(json.loads(json.dumps(found.resolved())), registry)
    assert again.resolved() == found.resolved()
    assert again.fingerprint == found.fingerprint


def test_its_code_and_options_are_part_of_the_fingerprint(registry, tmp_path):
    found = recipe(registry, "lowest")
    assert set(found.code) == {"data.touch.policy"} | set(recipe(registry, "uniform").code)
    assert found.fingerprint != recipe(registry, "{use: lowest, sign: 1.0}").fingerprint
    (tmp_path / "mine.py").write_text(MINE + "\n# changed\n")
    assert found.fingerprint != recipe(load_plugins([tmp_path / "mine.py"]), "lowest").fingerprint


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        ("lowes", "there is no policy 'lowes': did you mean 'lowest'"),
        ("{use: lowest, sgn: 1.0}", "takes no 'sgn': did you mean 'sign'"),
        ("{use: lowest, sign: up}", "sign"),
        ("{use: uniform, sign: 1.0}", "takes no 'sign'"),
        ("{use: uniform, tries: 0}", "tries"),
    ],
)
def test_mistakes_name_the_option(registry, policy, message):
    with pytest.raises(RecipeError, match=message):
        recipe(registry, policy)


def test_the_schema_lists_the_policies(registry):
    assert "expected-error" in json.dumps(json_schema(registry)["$defs"]["touch-digit-PolicyOptions"])
