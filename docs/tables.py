"""What pages take from code and from measurements: their blocks `[[[cog … ]]]` call these functions.

`make pages` fills the blocks anew; `make check` fails where one differs from what it would be filled with.
"""

import ast
import inspect
import itertools
import json
import re
from collections.abc import Sequence
from pathlib import Path

import click
import cog

NUMBERS = Path(__file__).parent / "numbers"
MESHES = (".obj", ".off", ".stl", ".glb")
EXACT = 1e-5
"""True errors below this share of the largest ones are those of rounding."""
EXTRAS = {".pcd": "pcd", ".las": "las", ".laz": "las", ".e57": "e57"}


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table in Markdown."""
    for cells in (columns, ["---"] * len(columns), *rows):
        cog.outl(f"| {' | '.join(cells)} |")


def numbers(*names: str) -> None:
    """Measured tables of one set of columns, one below the other: docs/numbers/NAME.json."""
    found = [json.loads((NUMBERS / f"{name}.json").read_text(encoding="utf-8")) for name in names]
    table(found[0]["columns"], [row for one in found for row in one["rows"]])


def reliability(name: str, kind: str) -> None:
    """Expected errors of a kind of cloud in ten bins: the median of each bin, and the share of points within."""
    rows = _rows(name)
    models = list(dict.fromkeys(row[1] for row in rows if row[0] == kind))
    found = {(row[1], row[2]): row for row in rows if row[0] == kind}
    bins = [row[2] for row in rows if row[:2] == [kind, models[0]]]
    columns = [f"{what}, `{model}`" for model in models for what in ("expected", "within")]
    cells = [[one for model in models for one in _bin(found[model, number])] for number in bins]
    points = [found[models[0], number][3] for number in bins]
    made = [[number, *row, count] for number, row, count in zip(bins, cells, points, strict=True)]
    table(["bin", *columns, "points each"], made)


def calibration(name: str) -> None:
    """Each kind of cloud and model: the points, the share within their expected error, and that of each bin.

    Shares of bins whose points lie on the surface up to rounding are in parentheses, and are not counted.
    """
    rows = _rows(name)
    made = []
    for kind, model in dict.fromkeys((row[0], row[1]) for row in rows):
        of_both = [row for row in rows if row[:2] == [kind, model]]
        counts, shares = ([int(row[column]) for row in of_both] for column in (3, 6))
        mean = sum(count * share for count, share in zip(counts, shares, strict=True)) / sum(counts)
        least = EXACT * max(float(row[5]) for row in of_both)
        inexact = [float(row[5]) >= least for row in of_both]
        cells = [str(share) if any_error else f"({share})" for share, any_error in zip(shares, inexact, strict=True)]
        near = sum(abs(share - 68) <= 5 for share in itertools.compress(shares, inexact))
        shown = f"`{model}`" if model != "registration" else model
        made.append([kind, shown, f"{sum(counts):,}", f"{mean:.0f} %", *cells, f"{near} of {sum(inexact)}"])
    table(["clouds", "model", "points", "within", *map(str, range(1, 11)), "68 ± 5"], made)


def _rows(name: str) -> list[list[str]]:
    rows: list[list[str]] = json.loads((NUMBERS / f"{name}.json").read_text(encoding="utf-8"))["rows"]
    return rows


def _bin(row: Sequence[str]) -> tuple[str, str]:
    return row[4], f"{row[6]} ± {row[7]} %"


def metrics() -> None:
    """Every metric and its convention."""
    from pcsr.metrics import METRICS

    table(("metric", "definition"), [(f"`{name}`", metric.description) for name, metric in METRICS.items()])


def formats() -> None:
    """The suffixes and names of formats that `pcsr upsample` and `pcsr evaluate` read, and those that are written."""
    from pcsr.clouds.formats import CLOUD_READERS, CLOUD_WRITERS, NAMED_READERS
    from pcsr.ros.paths import SUFFIXES

    rows = []
    for suffix in CLOUD_READERS:
        what = "vertices" if suffix in MESHES else "yes"
        extra = f"`[{EXTRAS[suffix]}]`" if suffix in EXTRAS else ""
        rows.append((f"`{suffix}`", what, what if suffix in CLOUD_WRITERS else "no", extra))
    rows += [(f"`{suffix}`", "yes", "no", "`[ros]`") for suffix in SUFFIXES]
    rows += [(f"`--format {name}`", "yes", "no", "") for name in NAMED_READERS]
    table(("suffix", "read", "written", "extra"), rows)


def sensor(name: str) -> None:
    """The figures of a sensor preset, with source and doubt."""
    from pcsr_plugins.touch.digit import sensors

    rows = [(f"`{one.name}`", _shown(one.value), one.source, one.doubt) for one in sensors.figures(name)]
    table(("figure", "value", "source", "doubt"), rows)


def options(kind: str, name: str, *wanted: str) -> None:
    """Options of a part: their defaults, and what the constructor's docstring says of them.

    Args:
        kind: of the part.
        name: of the part.
        wanted: the options; by default all.
    """
    from pcsr.options import Options
    from pcsr.plugins.loading import load_plugins

    constructor = load_plugins().get(kind, name).__init__
    arguments = inspect.getdoc(constructor).partition("Args:\n")[2].partition("\n\n")[0]
    said = dict(re.findall(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", arguments, re.MULTILINE))
    rows = []
    for option, parameter in inspect.signature(constructor).parameters.items():
        if parameter.kind is parameter.KEYWORD_ONLY and option in (wanted or said):
            default = parameter.default
            shown = getattr(default, "use", "{}") if isinstance(default, Options) else _yaml(default)
            rows.append((f"`{option}`", f"`{shown}`", " ".join(said[option].split())))
    table(("option", "default", "meaning"), rows)


def group(kind: str, part: str, option: str) -> None:
    """The options of a group: their defaults, and the docstrings of the group's fields."""
    from pcsr.plugins.loading import load_plugins

    default = inspect.signature(load_plugins().get(kind, part).__init__).parameters[option].default
    (body,) = ast.parse(inspect.getsource(type(default))).body
    fields = [one for one in body.body if isinstance(one, ast.AnnAssign | ast.Expr)]
    meanings = {
        before.target.id: " ".join(after.value.value.split())
        for before, after in itertools.pairwise(fields)
        if isinstance(before, ast.AnnAssign) and isinstance(after, ast.Expr)
    }
    rows = [(f"`{option}.{name}`", f"`{_yaml(getattr(default, name))}`", meaning) for name, meaning in meanings.items()]
    table(("option", "default", "meaning"), rows)


def shipped() -> None:
    """The shipped weights: their number, the size of the file, and the training that its card records."""
    import pcsr
    from pcsr.weights import names

    rows = []
    for name in names():
        model = pcsr.load(name)
        count, card = sum(weight.numel() for weight in model.network.parameters()), model.card["training"]
        steps = f"{card['steps']:,} steps of {model.recipe.train.batch}"
        size = model.path.stat().st_size / 1e6
        rows.append((f"`{name}`", f"{count / 1e3:,.0f} K", f"{size:.1f} MB", f"{steps}, {card['seconds']:,.0f} s"))
    table(("name", "weights", "file", "training"), rows)


def example(kind: str) -> None:
    """The module that `pcsr plugins new KIND my-KIND` writes."""
    from pcsr.cli.plugin_new import distribution

    cog.outl(f"```python\n{distribution(kind, f'my-{kind}')[f'my_{kind}.py']}```")


def commands() -> None:
    """The help page of each command."""
    from pcsr import cli

    def page(command: click.Command, path: str, above: click.Context | None) -> None:
        context = click.Context(command, above, info_name=path.rpartition(" ")[2], terminal_width=100)
        cog.outl(f"\n{'#' * (1 + len(path.split()))} `{path}`\n\n```text\n{command.get_help(context)}\n```")
        if isinstance(command, click.Group):
            for name in sorted(cli.COMMANDS if above is None else command.list_commands(context)):
                page(command.get_command(context, name), f"{path} {name}", context)

    page(cli.pcsr, "pcsr", None)


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return " × ".join(f"{part:g}" for part in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _yaml(value: object) -> str:
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_yaml, value))}]"
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else _shown(value)
