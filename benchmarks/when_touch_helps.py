"""Pictures and tables of docs/when-touch-helps.md, from the run folders of the studies in pcsr/recipes/touch.

python benchmarks/when_touch_helps.py RUNS [-o docs/pictures] [--page docs/when-touch-helps.md] [--save]

The tables are printed; `--page` also puts them into the page, between `<!-- NAME -->` and `<!-- /NAME -->`. What of the
studies has not been run is left out, and its part of the page stays as it is.
"""

from collections.abc import Sequence
from pathlib import Path

import click
from saved import save
from touch_charts import by_distance, draw
from touch_errors import arm_settings, cells_of, settings_of
from touch_studies import BESIDE, HEADS, NETWORK, PLAIN, STUDIES, Row, around, read

from pcsr.errors import PcsrError, UserError
from pcsr.files import write_text
from pcsr.metrics.touch_effect import EFFICIENCY, efficiency
from pcsr.report.tables.scores import efficiency_cell


def table(rows: Sequence[Row], keys: Sequence[str]) -> str:
    """The rows as a table in Markdown, with the objects and the weights below it."""
    beside = [name for name in BESIDE if any(name in row.beside for row in rows)]
    label = rows[0].label
    heads = [*(HEADS[key] for key in keys), "touches", "coverage", f"{label} {PLAIN}", "with touch"]
    heads += ["change ± standard error", "better", EFFICIENCY, *beside]
    cells = []
    for row in rows:
        share = efficiency(row.touched.tolist(), row.plain.tolist(), row.replaced.tolist())
        cells.append(
            [
                *(f"{one:g}" if isinstance(one := row.settings[key], float) else str(one) for key in keys),
                str(row.touches),
                f"{row.coverage:.2%}",
                f"{row.plain.mean():.3f}",
                f"{row.touched.mean():.3f}",
                f"{row.change:+.3f} ± {row.error:.3f} ({row.change / row.plain.mean():+.1%})",
                f"{(row.touched < row.plain).sum()}/{len(row.plain)}",
                efficiency_cell([share]),
                *(f"{row.beside[name]:.3f}" if name in row.beside else "" for name in beside),
            ]
        )
    return _markdown(heads, cells) + f"\n\n{len(rows[0].plain)} objects. {_weights(rows)}"


def sensor_table(rows: Sequence[Row]) -> str:
    """The study of errors as a table in Markdown, a line for each setting, with the weights below it."""
    return f"{_markdown(*cells_of(settings_of(rows)))}\n\n{_weights(rows)}"


def distance_table(row: Row) -> str:
    """What the picture of the error around touches shows, and of how many points of the truth each number is."""
    x, lines = by_distance(row)
    cells = [
        [str(of), f"{count:,}", *(f"{means[k]:.3f}" if count else "" for means, _ in lines.values())]
        for k, (of, count) in enumerate(zip(x, row.effect.counts, strict=True))
    ]
    return _markdown(["radii of the object", "true points", *lines], cells)


def _weights(rows: Sequence[Row]) -> str:
    weights = dict.fromkeys(f"`{row.settings[NETWORK]}` {row.weights[:12]}" for row in rows)
    return f"Weights: {', '.join(weights)}."


def _markdown(heads: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(line)} |" for line in (heads, ["---"] * len(heads), *cells))


def fill(page: str, tables: dict[str, str], source: str = "the page") -> str:
    """The page with each table between its markers, in the place of what stood there.

    Raises:
        UserError: a pair of markers is missing, or there twice.
    """
    for name, text in tables.items():
        begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
        if (page.count(begin), page.count(end)) != (1, 1) or page.index(begin) > page.index(end):
            raise UserError(f"{source} must have {begin} and after it {end}, each once: put the table '{name}' there")
        page = f"{page[: page.index(begin)]}{begin}\n\n{text}\n\n{page[page.index(end) :]}"
    return page


@click.command()
@click.argument("runs", type=click.Path(path_type=Path))
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("docs/pictures"), show_default=True)
@click.option("--page", type=click.Path(path_type=Path, exists=True, dir_okay=False), help="Put the tables into it.")
@click.option("--save", "saving", is_flag=True, help="Write the table of the arm's errors to docs/numbers/arm.json.")
def main(runs: Path, out: Path, page: Path | None, saving: bool) -> None:
    """Print the tables of the studies in RUNS and draw their pictures."""
    try:
        studies = read(runs)
        tables = {
            study: sensor_table(rows) if study == "sensor" else table(rows, STUDIES[study])
            for study, rows in studies.items()
        }
        if (row := around(studies.get("size", []))) is not None:
            tables["distance"] = distance_table(row)
        for study, text in tables.items():
            click.echo(f"## {study}\n\n{text}\n")
        filled = page and fill(page.read_text(encoding="utf-8"), tables, str(page))
        for path in draw(studies, out):
            click.echo(str(path))
        if page and filled:
            write_text(page, filled)
        if saving and "sensor" in studies:
            save("arm", "pcsr run touch/sensor", *cells_of(arm_settings(studies["sensor"])))
    except PcsrError as error:
        raise click.ClickException(str(error)) from error


if __name__ == "__main__":
    main()
