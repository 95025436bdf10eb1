"""`pcsr plugins new`: a distribution with one part of one's own, whose test passes as it is written."""

import ast
import importlib.metadata
import importlib.util
import keyword
import os
import re
import shutil
from importlib import resources
from pathlib import Path
from string import Template

import click

from pcsr import __version__
from pcsr.errors import RunError, UserError

SECTIONS = {
    "encoder": "model",
    "fusion": "model",
    "backbone": "model",
    "upsampler": "model",
    "objective": "train",
    "touch": "data",
    "shapes": "data",
    "metric": "evaluate",
    "baseline": "evaluate",
}
"""Each kind of part, and the section of a recipe that names one."""
LISTED = {"metric": "metrics", "baseline": "baselines"}
"""Kinds that a recipe names in a list, and the key of that list."""

LONGEST = 100
"""Characters of a name."""
NAME = r"[A-Za-z][A-Za-z0-9]*(-[A-Za-z0-9]+)*"


@click.command()
@click.argument("kind", type=click.Choice(list(SECTIONS)))
@click.argument("name")
def new(kind: str, name: str) -> None:
    """Write a distribution with a part of your own.

    It goes into a new folder NAME: what pip needs, the part in one module, a test that passes as it is, and a README.
    NAME also names the distribution and the part: letters, digits and hyphens.

    \b
    pcsr plugins new fusion my-fusion
    pip install -e my-fusion
    pcsr plugins check my-fusion
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.files import write_text
    from pcsr.plugins.loading import load_plugins

    files = distribution(kind, name)
    taken = load_plugins().entries.get((kind, name))
    if taken is not None:
        raise UserError(f"name '{name}': {taken.owner} brings a {kind} of this name already: choose another")
    folder = Path(name)
    if folder.exists():
        raise UserError(f"folder {name} is there already: choose another name, or remove it")
    part = folder.with_name(f".{name}.{os.getpid()}.part")
    try:
        for file, text in files.items():
            write_text(part / file, text)
        os.rename(part, folder)
    except OSError as error:
        raise RunError(f"folder {name} could not be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    click.echo(f"{name}/: {', '.join(files)}")
    click.echo(f"next: pip install -e {name}, then pcsr plugins check {name}")


def distribution(kind: str, name: str) -> dict[str, str]:
    """The files of a distribution with one part, by their names.

    Args:
        kind: of the part; one of `SECTIONS`.
        name: of the distribution and the part.

    Raises:
        UserError: the name is none, or Python could not tell what it stands for.
    """
    if not re.fullmatch(NAME, name):
        raise UserError(
            f"name '{name}': it must be letters and digits, with single hyphens between them, and begin with a letter, "
            f"as my-{kind} does"
        )
    module = name.replace("-", "_").lower()
    part = "".join(word[0].upper() + word[1:] for word in name.split("-"))
    values = {"kind": kind, "name": name, "module": module, "section": SECTIONS[kind], "version": __version__}
    values |= {"setting": f"{SECTIONS[kind]}.{kind}={name}", "line": f"{kind}: {{use: {name}}}"}
    if kind in LISTED:
        values |= {"setting": f"'{SECTIONS[kind]}.{LISTED[kind]}=[{name}]'", "line": f"{LISTED[kind]}: [{name}]"}
    source = _template(f"{kind}.py.txt")
    if keyword.iskeyword(module) or keyword.iskeyword(part) or part in _names(source.substitute(values, part="_")):
        raise UserError(f"name '{name}': its module {module} or class {part} means something else: choose another")
    if len(name) > LONGEST:
        raise UserError(f"name '{name[:20]}…' is {len(name)} characters long: at most {LONGEST} make a file's name")
    if (owner := _installed(name)) is not None:
        raise UserError(f"name '{name}': pip would put it in the place of {owner}, which is installed: choose another")
    if (hidden := importlib.util.find_spec(module)) is not None:
        raise UserError(f"name '{name}': it would hide the module {module} in {hidden.origin}: choose another")
    values["part"] = part
    return {
        "pyproject.toml": _template("pyproject.toml.txt").substitute(values),
        f"{module}.py": source.substitute(values),
        f"test_{module}.py": _template("test.py.txt").substitute(values),
        "README.md": _template("README.md.txt").substitute(values),
    }


def _installed(name: str) -> str | None:
    """The installed distribution that pip takes for the same name, by the rules of PEP 503."""
    wanted = re.sub(r"[-_.]+", "-", name).lower()
    owners = (str(one.metadata["Name"]) for one in importlib.metadata.distributions())
    return next((owner for owner in owners if re.sub(r"[-_.]+", "-", owner).lower() == wanted), None)


def _template(file: str) -> Template:
    return Template(resources.files("pcsr.cli").joinpath("templates", file).read_text(encoding="utf-8"))


def _names(module: str) -> set[str]:
    """The names that a module's code uses."""
    return {node.id for node in ast.walk(ast.parse(module)) if isinstance(node, ast.Name)}
