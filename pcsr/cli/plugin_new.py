"""`pcsr plugins new`: write a distribution with one new part and a passing test."""

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

from pcsr.errors import RunError, UserError
from pcsr.version import __version__

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
    "logger": "train",
    "policy": "data",
}
"""Each kind of part, and the section of a recipe that names one."""
LISTED = {"metric": "metrics", "baseline": "baselines", "logger": "loggers"}
"""Kinds that a recipe names in a list, and the key of that list."""
WITHIN = {"policy": ("touch", "digit")}
"""Kinds that a recipe names among the options of another part: the key of that part, and a part that has the option."""

LONGEST = 100
"""Greatest length of a part's name in characters."""
NAME = r"[A-Za-z][A-Za-z0-9]*(-[A-Za-z0-9]+)*"
"""Pattern of a part's name."""


@click.command()
@click.argument("kind", type=click.Choice(list(SECTIONS)))
@click.argument("name")
def new(kind: str, name: str) -> None:
    """Write a distribution with a new part.

    Creates the folder NAME with a pyproject.toml, a module with a working part of this kind, its test, and a README.
    NAME also names the distribution and the part. It consists of letters, digits and hyphens.

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
        raise UserError(f"name '{name}': {taken.owner} already registers a {kind} of this name: choose another")
    folder = Path(name)
    if folder.exists():
        raise UserError(f"folder {name} exists already: choose another name, or remove it")
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
    """Return the text of each file of a distribution with one part, by file name.

    Args:
        kind: kind of the part; a key of `SECTIONS`.
        name: name of the distribution and the part.

    Raises:
        UserError: the name is invalid, or its module, class or distribution would hide or replace another.
    """
    from pcsr.plugins import renamed

    if not re.fullmatch(NAME, name):
        raise UserError(
            f"name '{name}': it must consist of letters and digits with single hyphens between them, and begin with a "
            f"letter, such as my-{kind}"
        )
    if (kind, name) in renamed.PARTS:
        raise UserError(
            f"name '{name}': in pcsr 0.1 it was that of {kind} '{renamed.PARTS[kind, name]}': choose another"
        )
    module = name.replace("-", "_").lower()
    part = "".join(word[0].upper() + word[1:] for word in name.split("-"))
    values = {"kind": kind, "name": name, "module": module, "section": SECTIONS[kind], "version": __version__}
    values |= {"setting": f"{SECTIONS[kind]}.{kind}={name}", "line": f"{kind}: {{use: {name}}}"}
    if kind in LISTED:
        values |= {"setting": f"'{SECTIONS[kind]}.{LISTED[kind]}=[{name}]'", "line": f"{LISTED[kind]}: [{name}]"}
    if kind in WITHIN:
        outer, of = WITHIN[kind]
        values |= {"setting": f"{SECTIONS[kind]}.{outer}.{kind}={name}"}
        values |= {"line": f"{outer}: {{use: {of}, {kind}: {name}}}"}
    source = _template(f"{kind}.py.txt")
    if keyword.iskeyword(module) or keyword.iskeyword(part) or part in _names(source.substitute(values, part="_")):
        raise UserError(f"name '{name}': module {module} or class {part} has another meaning: choose another")
    if len(name) > LONGEST:
        raise UserError(f"name '{name[:20]}…' is {len(name)} characters long: shorten it to {LONGEST} or less")
    if (owner := _installed(name)) is not None:
        raise UserError(f"name '{name}': pip would replace {owner}, which is installed: choose another")
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
    """Return the name of the installed distribution whose normalised name (PEP 503) is the same; None: none is."""
    wanted = re.sub(r"[-_.]+", "-", name).lower()
    owners = (str(one.metadata["Name"]) for one in importlib.metadata.distributions())
    return next((owner for owner in owners if re.sub(r"[-_.]+", "-", owner).lower() == wanted), None)


def _template(file: str) -> Template:
    return Template(resources.files("pcsr.cli").joinpath("templates", file).read_text(encoding="utf-8"))


def _names(module: str) -> set[str]:
    """Return all names that the source code of a module uses."""
    return {node.id for node in ast.walk(ast.parse(module)) if isinstance(node, ast.Name)}
