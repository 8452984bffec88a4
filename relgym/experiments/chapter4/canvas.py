"""What tables and figures share: names and colours of learners, a canvas without windows, a floor for logarithms."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from relgym.experiments.plots import require_matplotlib

__all__ = [
    "COLOURS",
    "ERROR",
    "FLOOR",
    "PRINTED",
    "TITLES",
    "above",
    "canvas",
    "error_axis",
    "first_case",
    "legend",
    "mean_change",
    "save",
    "text_figure",
]

FLOOR: Final = 1e-18
"""Errors of 0 are drawn here."""

TITLES: Final[Mapping[str, str]] = {
    "original": "original()",
    "thesis": "thesis()",
    "one polarity": "thesis(), one polarity",
    "world": "world axes",
    "default": "default",
}
"""Learners as headings and legends name them."""

PRINTED: Final = "printed"
"""Heading of what the thesis printed."""

COLOURS: Final[Mapping[str, str]] = {
    "original": "#8c8c8c",
    "thesis": "#4878a8",
    "world": "#6aa879",
    "default": "#c44e52",
}

ERROR: Final = "absolute error, units per step"
"""What axes of errors are called."""

_DOTS: Final = 80


def canvas(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Any, Any]:
    """A figure of so many inches and its panels, an array of shape ``(rows, columns)``."""
    require_matplotlib()
    from matplotlib.figure import Figure

    # No pyplot: it would choose a window system and keep global state.
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def text_figure(path: Path, text: str) -> None:
    """A picture of a text, line by line as it is."""
    lines = text.split("\n")
    figure, panels = canvas(0.085 * max(map(len, lines)) + 0.4, 0.17 * len(lines) + 0.4)
    panels[0][0].set_axis_off()
    panels[0][0].text(
        0.0, 1.0, text, va="top", family="monospace", fontsize=9, transform=panels[0][0].transAxes
    )
    save(figure, path)


def save(figure: Any, path: Path) -> None:
    """Write a figure as PNG, the same bytes every time."""
    figure.savefig(path, dpi=_DOTS, metadata={"Software": None}, bbox_inches="tight", pad_inches=0.1)


def first_case(name: str) -> str:
    """The first of the cases that make up a mode's name.

    Examples
    --------
    >>> first_case("floor (forward, mu 0.2), ceiling (forward, mu 0.2)")
    'floor (forward, mu 0.2)'
    """
    return re.split(r", (?![^(]*\))", name)[0]


def above(value: float) -> float:
    """The value, or the floor, so that a logarithm exists."""
    return max(value, FLOOR)


def mean_change(panel: Any, change: float) -> None:
    """A dashed line at the mean magnitude of change: no model at all errs by so much."""
    panel.axhline(above(change), color="black", lw=0.8, ls="--", label="mean change")


def legend(figure: Any, panel: Any, place: str, **options: Any) -> None:
    """What the lines of a panel mean, once for all panels."""
    figure.legend(*panel.get_legend_handles_labels(), loc=f"outside {place}", **options)


def error_axis(panel: Any, *, label: bool = True) -> None:
    """A logarithmic axis of absolute errors, from the floor, which stays visible, to 10."""
    panel.set_yscale("log")
    panel.set_ylim(FLOOR / 8, 10.0)
    panel.set_yticks([10.0**k for k in range(-18, 1, 3)])
    panel.grid(alpha=0.3)
    if label:
        panel.set_ylabel(ERROR)
