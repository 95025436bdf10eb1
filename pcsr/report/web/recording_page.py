"""HTML page of a recording: a picture of each touch, a table, and what is odd."""

import base64
import html
from collections.abc import Sequence

from pcsr.recorded import Recording
from pcsr.report.colours import VALUE_SCALE
from pcsr.report.recording.facts import TouchFacts, table
from pcsr.report.recording.pictures import depth_pictures
from pcsr.report.web import document

MOST_PICTURES = 200
"""Most touches that have a picture; the table lists all."""


def recording_page(title: str, recording: Recording, facts: Sequence[TouchFacts], odd: Sequence[str]) -> str:
    """HTML page of a recording, which needs no network and no script.

    Args:
        title: title of the page.
        recording: the recording.
        facts: facts about its touches.
        odd: lines about what is odd, and about touches that are skipped.
    """
    heads, rows = table(facts, recording.touches[0].unit)
    shown = document.table([html.escape(head) for head in heads], [[html.escape(cell) for cell in row] for row in rows])
    listed = "".join(f"<li>{html.escape(line)}</li>" for line in odd)
    pictures = "".join(_figures(recording, facts))
    gradient = ", ".join(f"{colour} {100 * place:g}%" for place, colour in VALUE_SCALE)
    more = len(facts) - MOST_PICTURES
    note = f" The first {MOST_PICTURES} of {len(facts)} touches have a picture." if more > 0 else ""
    body = (
        f"<h1>{html.escape(title)}</h1>"
        f'<p class="lead">{len(facts)} touches can be used, {len(recording.skipped)} are skipped.</p>'
        + (f"<section><h2>Odd</h2><ul>{listed}</ul></section>" if odd else "")
        + (
            f'<section><h2>Depth</h2><div class="row">{pictures}</div>'
            f'<div class="scale"><span>0</span><i style="background: linear-gradient(to right, {gradient})"></i>'
            '<span>the deepest point of the picture</span></div><p class="note">As the sensor sees it: x to the '
            f"right, y up. A picture shows what the sensor sees, if that is known, else the contact alone.{note}</p>"
            "</section>"
            if pictures
            else ""
        )
        + f"<section><h2>Touches</h2>{shown}</section>"
    )
    return document.document(f"{title}: recording", body)


def _figures(recording: Recording, facts: Sequence[TouchFacts]) -> list[str]:
    figures = []
    for touch, one in list(zip(recording.touches, facts, strict=True))[:MOST_PICTURES]:
        name = html.escape(one.name)
        pictures = depth_pictures(touch)
        images = "".join(
            f'<img alt="depth of {name}" src="data:image/png;base64,{base64.b64encode(data).decode()}">'
            for data in pictures
        )
        if pictures:
            caption = f"{name}, {one.points} points, {one.depth:.2f} mm deep"
            figures.append(f"<figure>{images}<figcaption>{caption}</figcaption></figure>")
    return figures
