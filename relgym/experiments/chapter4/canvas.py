"""What all figures share: a canvas without a window system, colours of learners, a floor for logarithms."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from relgym.experiments.plots import require_matplotlib

__all__ = ["COLOURS", "FLOOR", "TITLES", "above", "canvas", "error_axis", "save"]

FLOOR: Final = 1e-18
"""Errors of 0 are drawn here."""

COLOURS: Final[Mapping[str, str]] = {
    "original": "#8c8c8c",
    "thesis": "#4878a8",
    "world": "#6aa879",
    "default": "#c44e52",
}

TITLES: Final[Mapping[str, str]] = {
    "original": "original()",
    "thesis": "thesis()",
    "world": "modes, world axes",
    "default": "relgym as it comes",
}
"""Learners as legends name them."""

_DOTS: Final = 80


def canvas(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Any, Any]:
    """A figure of so many inches and its panels, an array of shape ``(rows, columns)``."""
    require_matplotlib()
    from matplotlib.figure import Figure

    # No pyplot: it would choose a window system and keep global state.
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def save(figure: Any, path: Path) -> None:
    """Write a figure as PNG, the same bytes every time."""
    figure.savefig(path, dpi=_DOTS, metadata={"Software": None})


def above(value: float) -> float:
    """The value, or the floor, so that a logarithm exists."""
    return max(value, FLOOR)


def error_axis(panel: Any, *, label: bool = True) -> None:
    """A logarithmic axis of absolute errors, from the floor to 10."""
    panel.set_yscale("log")
    panel.set_ylim(FLOOR / 2, 10.0)
    panel.set_yticks([10.0**k for k in range(-18, 1, 3)])
    panel.grid(alpha=0.3)
    if label:
        panel.set_ylabel("absolute error, units per step")
