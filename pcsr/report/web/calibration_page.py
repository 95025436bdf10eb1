"""HTML page of the calibration of a tactile sensor: its errors, and each press with the ball that was found in it."""

import html
from collections.abc import Sequence

import numpy as np

from pcsr.report.sensors.change_picture import GREATEST, change_picture
from pcsr.report.tables.calibration_table import calibration_table, how_measured
from pcsr.report.web.document import document, table, text_table
from pcsr.sensors import Calibrated, Place, PressFigures, PressImage
from pcsr.sensors.images import Image

MOST_PICTURES = 200
"""Most presses that have a picture."""
STROKE = 'fill="none" stroke="var(--touch)" vector-effect="non-scaling-stroke"'
"""Attributes of the circles."""


def calibration_page(made: Calibrated, presses: Sequence[PressImage], background: Image) -> str:
    """HTML page of a calibration, which needs no network and no script.

    Args:
        made: the calibration.
        presses: the images that it was made from; images that it does not use are ignored.
        background: image of the untouched gel.
    """
    calibration, title = made.calibration, f"Calibration of {made.calibration.sensor}"
    by_name = {press.name: press for press in presses}
    used = sorted(made.places, key=lambda name: made.places[name].residual, reverse=True)
    lead = (
        f"Fitted to {len(used)} presses, {len(made.refused)} refused. {calibration.columns} × {calibration.rows} "
        f"pixels of {calibration.mm_per_pixel:g} mm. Errors of {how_measured(made)}."
    )
    figures = "".join(
        _figure(by_name[name], made.places[name], background) for name in used[:MOST_PICTURES] if name in by_name
    )
    body = (
        f'<h1>{html.escape(title)}</h1><p class="lead">{html.escape(lead)}</p>'
        f"{text_table(calibration_table(made))}{_each(made.held_out)}{_spread(made)}{_presses(figures, len(used))}"
        f"{_refused(made.refused)}"
    )
    return document(title, body)


def _each(presses: Sequence[PressFigures]) -> str:
    """Folded table of every held-out press."""
    rows = [
        [
            html.escape(press.name),
            f"{press.diameter:g}",
            f"{100 * (press.radius_ratio - 1):+.1f}",
            f"{press.shape:.4f}",
            f"{press.ball:.4f}",
            f"{100 * press.cap_ratio:.1f}",
            f"{100 * press.area_ratio:.0f}",
            f"{press.depth:.2f}",
        ]
        for press in presses
    ]
    heads = [
        "press",
        "ball mm",
        "radius error %",
        "shape mm",
        "true ball mm",
        "cap height %",
        "contact area %",
        "indentation mm",
    ]
    return f"<details><summary>Every held-out press</summary>{table(heads, rows)}</details>"


def _spread(made: Calibrated) -> str:
    """Section with the contacts in the outline of the image."""
    columns, rows = made.calibration.columns, made.calibration.rows
    circles = "".join(_circle(place) for place in made.places.values())
    width = min(480, 480 * columns // rows)
    return (
        f'<section><h2>Spread over the gel</h2><figure style="max-width: {width}px"><svg '
        f'viewBox="0 0 {columns} {rows}" role="img" aria-label="contacts of the presses">{circles}</svg></figure>'
        '<p class="note">Contacts of the presses that the calibration is fitted to, in the image. Where there are '
        "none, its errors are unknown.</p></section>"
    )


def _presses(figures: str, count: int) -> str:
    """Section with the pictures of the presses."""
    more = f" The first {MOST_PICTURES} of {count} are shown." if count > MOST_PICTURES else ""
    note = (
        f"Change of colour: grey is unchanged, black and white are {GREATEST:g} % and more. The circle is the contact "
        "that was found; it must lie in the middle of the colours. Below it is the median angle between the measured "
        f"slopes and those of the ball, the largest first.{more}"
    )
    return f'<section><h2>Presses</h2><div class="row">{figures}</div><p class="note">{note}</p></section>'


def _figure(press: PressImage, place: Place, background: Image) -> str:
    rows, columns = press.image.shape[:2]
    picture = change_picture(press.image, background)
    caption = f"{press.name}, {press.diameter:g} mm: {np.degrees(place.residual):.1f}°"
    return (
        f'<figure><svg viewBox="0 0 {columns} {rows}" role="img" aria-label="press {html.escape(press.name)}">'
        f'<image href="{picture}" width="{columns}" height="{rows}" preserveAspectRatio="none"/>{_circle(place)}</svg>'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def _circle(place: Place) -> str:
    x, y = place.centre + 0.5  # a pixel's centre is half a pixel from its corner
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{place.rim:.1f}" {STROKE}/>'


def _refused(refused: dict[str, str]) -> str:
    if not refused:
        return ""
    rows = [[html.escape(name), html.escape(reason)] for name, reason in refused.items()]
    return f"<section><h2>Refused presses</h2>{table(['press', 'reason'], rows)}</section>"
