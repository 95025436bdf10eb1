"""Lines with their spread, as a PNG file."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from PIL import Image, ImageDraw

from pcsr.errors import UserError
from pcsr.report.curves import COLOURS
from pcsr.report.lettering import INK, LINE, PAPER, SOFT, Number, fitted, font, plain, rgb, save_png, sideways

WIDTH, HEIGHT = 760, 440
"""In pixels; a long legend makes the chart higher."""
LEFT, RIGHT, TOP, BOTTOM = 78, 24, 48, 64
"""Margins around the plot, without the legend's."""
FINE = 3
"""Each pixel is the mean of so many each way, which softens edges."""
BAND = 0.18
"""Opacity of a spread."""
TEXT = 13

Line = tuple[Sequence[Number], Sequence[Number] | None]
"""Mean and spread at each x; a mean that is not a number was not measured, a spread that is not one is nought."""


def line_chart(
    title: str,
    x_label: str,
    y_label: str,
    x: Sequence[Number | str],
    lines: Mapping[str, Line],
    path: Path,
) -> None:
    """Draw lines over a common x, each with a band of its mean ± its spread.

    Args:
        title: above the chart.
        x_label: below the horizontal axis.
        y_label: beside the vertical axis, which begins at 0 unless something is below it.
        x: numbers, or names, which are set side by side in the order given.
        lines: by name, in the order of the legend. A line goes straight past what was not measured.
        path: of the PNG file, which is written whole or not at all.

    Raises:
        UserError: there is no x or no line, or a line has other than one number for each x, or none that is finite.
        RunError: the file can't be written.
    """
    save_png(draw(title, x_label, y_label, x, lines), path)


def draw(title: str, x_label: str, y_label: str, x: Sequence[Number | str], lines: Mapping[str, Line]) -> Image.Image:
    """The picture that `line_chart` writes."""
    _check(title, x, lines)
    names = any(isinstance(one, str) for one in x)
    across = np.arange(len(x), dtype=float) if names else np.array(x, dtype=float)
    order = np.argsort(across, kind="stable")
    across = across[order]
    curves = {name: _curve(line, order) for name, line in lines.items()}

    low = min(float(np.nanmin(mean - spread)) for mean, spread in curves.values())
    high = max(float(np.nanmax(mean + spread)) for mean, spread in curves.values())
    up = ticks(min(low, 0.0), high if high > min(low, 0.0) else min(low, 0.0) + 1.0)
    along = across.tolist() if names else _marks(across)
    reach = (across[0] - 0.5, across[-1] + 0.5) if names or across[0] == across[-1] else (across[0], across[-1])

    legend = int(min(max(font(TEXT).getlength(plain(name)) for name in lines) + 34, 0.4 * WIDTH))
    plot = _Plot(WIDTH - RIGHT - legend, max(HEIGHT, TOP + 20 * (len(lines) + 1)), reach, (up[0], up[-1]))
    for value in up:
        plot.rule(value)
    for value in along:
        plot.mark(value, str(x[order[round(value)]]) if names else f"{value:.6g}")
    for k, (mean, spread) in enumerate(curves.values()):
        plot.band(across, mean, spread, COLOURS[k % len(COLOURS)])
    for k, (mean, _) in enumerate(curves.values()):
        plot.line(across, mean, COLOURS[k % len(COLOURS)], k // len(COLOURS))
    plot.words(title, x_label, y_label, list(lines), legend)
    return plot.image()


def ticks(low: Number, high: Number, *, whole: bool = True) -> list[float]:
    """About six round numbers from `low` to `high`; `whole`: the first and last lie on or beyond both."""
    if not high > low:
        return [float(low)]
    rough = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1, 2, 2.5, 5, 10) if power * factor >= rough * (1 - 1e-9))
    first, last = low / step, high / step
    ends = (math.floor(first + 1e-9), math.ceil(last - 1e-9)) if whole else (math.ceil(first), math.floor(last))
    return [float(f"{k * step:.10g}") for k in range(ends[0], ends[1] + 1)]


def _marks(across: Float[np.ndarray, " n"]) -> list[float]:
    """The x themselves where they are few and not too near to one another, else round numbers."""
    own = np.unique(across)
    if len(own) <= 8 and (len(own) == 1 or np.diff(own).min() > 0.06 * (own[-1] - own[0])):
        return [float(value) for value in own]
    return ticks(float(own[0]), float(own[-1]), whole=False)


def _check(title: str, x: Sequence[Number | str], lines: Mapping[str, Line]) -> None:
    if not x or not lines:
        raise UserError(f"chart '{title}': there is no {'x' if lines else 'line'}: nothing can be drawn")
    if not any(isinstance(one, str) for one in x) and not np.isfinite(np.array(x, dtype=float)).all():
        raise UserError(f"chart '{title}': an x is not finite: {list(x)}")
    for name, (mean, spread) in lines.items():
        for what, values in (("means", mean), ("spreads", spread)):
            if values is not None and len(values) != len(x):
                raise UserError(
                    f"chart '{title}': line '{name}' has {len(values)} {what} for {len(x)} x: give one each"
                )
        if np.isinf(mean).any() or np.isnan(mean).all() or (spread is not None and np.isinf(spread).any()):
            raise UserError(f"chart '{title}': line '{name}' is not finite: {list(mean)}")
        if spread is not None and (np.array(spread, dtype=float) < 0).any():
            raise UserError(f"chart '{title}': line '{name}' has a spread below 0: {list(spread)}")


def _curve(line: Line, order: np.ndarray) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    mean = np.array(line[0], dtype=float)[order]
    spread = np.zeros(len(mean)) if line[1] is None else np.nan_to_num(np.array(line[1], dtype=float)[order])
    return mean, spread


class _Plot:
    """The picture while it is drawn, `FINE` times as large as it will be."""

    def __init__(self, right: int, height: int, across: tuple[float, float], up: tuple[float, float]) -> None:
        self._right, self._height = right, height
        self._across, self._up = across, up
        self._image = Image.new("RGBA", (WIDTH * FINE, self._height * FINE), PAPER)
        self._pen = ImageDraw.Draw(self._image)

    def image(self) -> Image.Image:
        return self._image.convert("RGB").reduce(FINE)

    def _x(self, value: Number) -> float:
        low, high = self._across
        return FINE * (LEFT + 10 + (value - low) / (high - low) * (self._right - LEFT - 20))

    def _y(self, value: Number) -> float:
        low, high = self._up
        return FINE * (self._height - BOTTOM - (value - low) / (high - low) * (self._height - BOTTOM - TOP))

    def _text(self, x: Number, y: Number, text: str, anchor: str, colour: str = INK, size: int = TEXT) -> None:
        self._pen.text((x, y), text, colour, font(size * FINE), anchor)

    def rule(self, value: Number) -> None:
        """A horizontal line with its number."""
        y = self._y(value)
        colour = SOFT if value == self._up[0] else LINE
        self._pen.line([(LEFT * FINE, y), (self._right * FINE, y)], colour, FINE)
        self._text((LEFT - 8) * FINE, y, f"{value:.6g}", "rm", SOFT)

    def mark(self, value: Number, text: str) -> None:
        """A short line below the horizontal axis, with its number or name."""
        x, y = self._x(value), (self._height - BOTTOM) * FINE
        self._pen.line([(x, y), (x, y + 5 * FINE)], SOFT, FINE)
        self._text(x, y + 8 * FINE, fitted(text, TEXT * FINE, 110 * FINE), "ma", SOFT)

    def band(self, across: np.ndarray, mean: np.ndarray, spread: np.ndarray, colour: str) -> None:
        """Mean ± spread, where there is any."""
        if not spread.any():
            return
        there = np.flatnonzero(np.isfinite(mean))
        over = Image.new("RGBA", self._image.size, (*rgb(colour), 0))
        tint = (*rgb(colour), round(255 * BAND))
        upper = [(self._x(across[k]), self._y(mean[k] + spread[k])) for k in there]
        lower = [(self._x(across[k]), self._y(mean[k] - spread[k])) for k in there]
        if len(there) == 1:  # a band of no width would not be seen
            (x, top), (_, bottom) = upper[0], lower[0]
            ImageDraw.Draw(over).rectangle((x - 6 * FINE, top, x + 6 * FINE, bottom), tint)
        else:
            ImageDraw.Draw(over).polygon(upper + lower[::-1], tint)
        self._image.alpha_composite(over)

    def line(self, across: np.ndarray, mean: np.ndarray, colour: str, shape: int) -> None:
        """The line, and its markers."""
        places = [(self._x(across[k]), self._y(mean[k])) for k in np.flatnonzero(np.isfinite(mean))]
        if len(places) > 1:
            self._pen.line(places, colour, 2 * FINE, joint="curve")
        for x, y in places:
            self._marker(x, y, colour, shape)

    def _marker(self, x: Number, y: Number, colour: str, shape: int) -> None:
        """Round; where the colours come round again, of three corners, then of four."""
        if shape == 0:
            self._pen.circle((x, y), 3.5 * FINE, colour)
        else:
            self._pen.regular_polygon((x, y, 5 * FINE), 2 + min(shape, 2), fill=colour)

    def words(self, title: str, x_label: str, y_label: str, names: Sequence[str], legend: int) -> None:
        """Title, labels and legend."""
        self._text(LEFT * FINE, 16 * FINE, fitted(title, 16 * FINE, (WIDTH - LEFT - RIGHT) * FINE), "la", size=16)
        middle = FINE * (LEFT + self._right) / 2
        self._text(middle, (self._height - 16) * FINE, fitted(x_label, TEXT * FINE, 500 * FINE), "ms")
        beside = sideways(fitted(y_label, TEXT * FINE, (self._height - TOP) * FINE), TEXT * FINE)
        self._image.alpha_composite(
            beside, (10 * FINE, max(0, (self._height - BOTTOM + TOP) * FINE - beside.height) // 2)
        )
        for k, name in enumerate(names):
            x, y = (self._right + 14) * FINE, (TOP + 10 + 20 * k) * FINE
            colour = COLOURS[k % len(COLOURS)]
            self._pen.line([(x, y), (x + 14 * FINE, y)], colour, 2 * FINE)
            self._marker(x + 7 * FINE, y, colour, k // len(COLOURS))
            self._text(x + 20 * FINE, y, fitted(name, TEXT * FINE, (legend - 20) * FINE), "lm")
