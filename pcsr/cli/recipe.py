"""`pcsr recipe`: check, show and describe recipes."""

import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli.options import FILE, plugin_option, set_option

if TYPE_CHECKING:
    from pcsr.plugins.registry import Registry


@click.group()
def recipe() -> None:
    """Check, show and describe recipes."""


@recipe.command()
@click.argument("files", nargs=-1, required=True, type=FILE, metavar="RECIPES...")
@set_option
@plugin_option
def check(files: tuple[Path, ...], overrides: tuple[str, ...], registry: "Registry") -> None:
    """Check recipes and report all mistakes.

    Each mistake is printed on one line with its file, line and column, and how to mend it. The runs of a study are
    listed with their numbers for pcsr run --row.
    """
    from pcsr.errors import UserError
    from pcsr.recipe import load

    wrong = False
    for file in files:
        try:
            recipes = load(file, registry, overrides)
        except UserError as error:
            wrong = True
            click.echo(str(error), err=True)
        else:
            click.echo(f"{file}: good" + (f", {len(recipes)} runs:" if len(recipes) > 1 else ""))
            for number, one in enumerate(recipes if len(recipes) > 1 else (), 1):
                click.echo(f"{number:>5} {one.name}")
    if wrong:
        click.get_current_context().exit(UserError.exit_code)


@recipe.command()
@click.argument("file", type=FILE, metavar="RECIPE")
@set_option
@plugin_option
def show(file: Path, overrides: tuple[str, ...], registry: "Registry") -> None:
    """Print a recipe with all defaults filled in.

    If the recipe describes several runs, the recipe of each is printed as one YAML document.
    """
    from pcsr.recipe import load

    texts = [to_yaml(one.resolved()) for one in load(file, registry, overrides)]
    click.echo("---\n".join(texts), nl=False)


@recipe.command()
@plugin_option
def schema(registry: "Registry") -> None:
    """Print the JSON schema of recipes, for completion in editors.

    The schema includes the options of all installed parts.
    """
    from pcsr.recipe.json_schema import json_schema

    click.echo(json.dumps(json_schema(registry), indent=2))


def to_yaml(data: dict[str, Any]) -> str:
    """Convert plain data to YAML text, with mappings as blocks and lists on one line."""
    from ruamel.yaml import YAML

    text = io.StringIO()
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment] # ruamel types it by its default
    yaml.width = 110
    yaml.dump(data, text)
    return text.getvalue()
