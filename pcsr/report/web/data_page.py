"""Interactive HTML page of a data set, which shows objects as the paper's Fig. 4 does."""

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pcsr.data.dataset import Split
from pcsr.data.schema import Manifest
from pcsr.data.shards import read_card
from pcsr.errors import UserError, did_you_mean
from pcsr.files import write_text
from pcsr.report.web.document import document, example_tabs, plotly_source
from pcsr.report.web.views import cube, plain, view

SHOWN = 4
"""Number of objects on the page, unless one is named."""


def write_data_page(path: Path, folder: Path, manifest: Manifest, name: str | None = None) -> list[str]:
    """Write the page of a data set: for each object the truth, the sparse cloud with touches, and one touch alone.

    Args:
        path: path of the page.
        folder: folder of the data set.
        manifest: manifest of the data set.
        name: object to show; by default `SHOWN` objects, spread over the first split that has any.

    Returns:
        Names of the objects on the page.

    Raises:
        UserError: there is no such object, no object at all, or the extra `[report]` is not installed.
        RunError: the page can't be written.
    """
    plotly = plotly_source()
    split = _chosen(folder, manifest, name)
    rows = [_row(split, k) for k in range(len(split))]
    body = (
        f"<h1>{html.escape(folder.name)}</h1>"
        f'<p class="lead">{html.escape(_statement(manifest))}</p>'
        f'<section id="examples"><h2>Objects</h2><nav>{example_tabs(split.names)}</nav>'
        '<div class="row"></div></section>'
    )
    page = document(f"{folder.name}: data", body, {"examples": rows, "charts": {}}, plotly=plotly)
    write_text(path, page)
    return list(split.names)


def _chosen(folder: Path, manifest: Manifest, name: str | None) -> Split:
    there = {split: about for split, about in manifest.splits.items() if about.objects}
    if not there:
        raise UserError(f"{folder} has no finished split with an object in it: run `pcsr data make` to its end")
    if name is None:
        split, about = next(iter(there.items()))
        count = min(SHOWN, about.objects)
        rows = [about.locate(k * about.objects // count) for k in range(count)]
        return Split.joined([Split.load(folder, split, [number]).chosen([row]) for number, row in rows])
    known: list[str] = []
    for split, about in there.items():
        for number, shard in enumerate(about.shards):
            names = read_card(folder / shard.file).names
            if name in names:
                return Split.load(folder, split, [number]).chosen([names.index(name)])
            known += names
    raise UserError(f"{folder} has no object '{name}': {_nearest(name, known)}")


def _nearest(name: str, known: Sequence[str]) -> str:
    hint = did_you_mean(name, known)
    return hint if hint.startswith("did") else f"it has {len(known)}, such as '{known[0]}'"


def _row(split: Split, k: int) -> dict[str, Any]:
    """Row of views: the truth; the sparse cloud (blue) with the touches (red); the first touch alone."""
    truth, points, touches = (clouds[k].numpy() for clouds in (split.truth, split.points, split.touches))
    touched = touches.reshape(-1, 3)
    covered = split.covered[k][-1] if len(touches) else 0
    shown = [
        view(f"(a) truth, {len(truth)} points", plain(truth, "truth", 1.6)),
        view(
            f"(b) {len(points)} points, {len(touches)} touches, {covered:.1%} covered",
            plain(points, "input", 2.5),
            *([plain(touched, "touch", 2.0)] if len(touched) else []),
        ),
    ]
    if len(touched):
        alone = view(f"(c) the first touch, {len(touches[0])} points", plain(touches[0], "touch", 3.0))
        shown.append({**alone, "range": cube(touches[0])})
    return {"name": split.names[k], "limit": 1.0, "range": cube(truth, points), "views": shown}


def _statement(manifest: Manifest) -> str:
    data = manifest.data
    objects = ", ".join(f"{about.objects} {split}" for split, about in manifest.splits.items())
    return (
        f"Objects: {objects}, of {data.shapes.use}. {data.points * data.rate} true points ({data.truth}), "
        f"{data.points} sparse ones ({data.sampling}), {data.touches} touches by {data.touch.use}, seed {data.seed}; "
        f"fingerprint {manifest.fingerprint[:12]}, {manifest.made_by}. Each object fills the unit sphere. Turning one "
        f"view turns all."
    )
