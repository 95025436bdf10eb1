"""Colours of the report's pages and figures, safe for colour-blind readers."""

SERIES = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9"]
"""Colours of lines and bars, one for each series, after Okabe and Ito (2008, https://jfly.uni-koeln.de/color/)."""
ERROR_SCALE: list[tuple[float, str]] = [(0.0, "#8fabc6"), (0.5, "#dc861f"), (1.0, "#b3161f")]
"""Colour scale of errors: fraction of the scale, and colour. Lightness falls along the scale."""
INPUT, TOUCH, TRUTH = "#1f6fb2", "#d0202b", "#4a5560"
"""Colours of clouds, equal to those of page.css in a bright room."""
INK, SOFT, LINE = "#1c2024", "#5d6670", "#d9dee3"
"""Colours of text, secondary text and frames, equal to those of page.css in a bright room."""
