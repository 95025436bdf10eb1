"""The page around the numbers and views: one file that opens offline."""

import io
import json
from html import escape
from importlib.resources import files
from typing import Any

from plotly.offline import get_plotlyjs
from ruamel.yaml import YAML

from pcsr.report.table import cells, compared, statement


def page(results: dict[str, Any], data: dict[str, Any]) -> str:
    """The whole page; `data` is what its script draws."""
    asset = files("pcsr.report")
    block = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")  # nothing in it can end the script element
    curve = '<h2>Training</h2>\n<div id="curve"></div>' if data["curve"] else ""
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(results["name"])}: pcsr report</title>
<style>{asset.joinpath("page.css").read_text(encoding="utf-8")}</style>
</head>
<body>
<h1>{escape(results["name"])}</h1>
<p class="note">{escape(statement(results))}</p>
<p>{escape(compared(results))}</p>
{_table(results)}
<p class="note">{escape(_training(results["training"]))}</p>
<h2>Examples</h2>
<p class="note">Drag one view, all turn. Predictions are coloured by the distance of each point to the truth.</p>
<select id="picker" aria-label="example"></select>
<div id="views"></div>
<h2>By family</h2>
<div id="groups"></div>
{curve}
<details><summary>The resolved recipe</summary><pre>{escape(_yaml(results["recipe"]))}</pre></details>
<script>{get_plotlyjs()}</script>
<script type="application/json" id="data">{block}</script>
<script>{asset.joinpath("page.js").read_text(encoding="utf-8")}</script>
</body>
</html>
"""


def _table(results: dict[str, Any]) -> str:
    heads = [f"{name} ×{about['scale']}" for name, about in results["metrics"].items()]
    head = "".join(f"<th>{escape(h)}</th>" for h in ("method", *heads, "wins", "weights", "seconds a cloud"))
    table = cells(results)
    first = next(iter(results["metrics"]))
    rows = []
    for number, method in enumerate(results["methods"]):
        name = method["name"]
        shown = [table[name, metric] for metric in results["metrics"]]
        columns = "".join(f'<td{" class=best" if cell.best else ""}>{cell}</td>' for cell in shown)
        wins = f"{table[name, first].wins}/{len(results['objects'])}" if number != 1 else ""
        rows.append(
            f"<tr><td>{escape(name)}</td>{columns}<td>{wins}</td><td>{method['parameters']:,}</td>"
            f"<td>{method['seconds']:.2f}</td></tr>"
        )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _training(training: dict[str, Any]) -> str:
    return (
        f"Weights: {training['source']}; trained for {training['steps']} steps in {training['seconds'] / 60:.1f} minutes "
        f"on {training['device']}."
    )


def _yaml(plain: dict[str, Any]) -> str:
    text = io.StringIO()
    YAML(typ="safe").dump(plain, text)
    return text.getvalue()
