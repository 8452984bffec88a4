"""Criteria, and what was measured, as records, as a table and as plain data."""

from __future__ import annotations

import math
from argparse import ArgumentTypeError
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, Literal, TypeAlias

from relgym.model.reports.text import Cell, table

__all__ = ["Figure", "Measure", "Side", "gathered", "measured", "one_of", "report"]

Side: TypeAlias = Literal["<=", ">="]
"""Whether a figure may be at most or must be at least its limit."""

Figure: TypeAlias = tuple[str, float, float, Side]
"""What is measured once: of what, with its unit; the limit; the figure; the limit's side."""


@dataclass(frozen=True, slots=True)
class Measure:
    """A figure, measured several times, beside its limit.

    Attributes
    ----------
    what
        Of what, with its unit.
    limit, side
        The limit, and whether the figure may be at most or must be at least that.
    values
        One figure per repetition (training seed, or pair of training and test seed).
    """

    what: str
    limit: float
    values: tuple[float, ...]
    side: Side = "<="

    @property
    def worst(self) -> float:
        """The figure farthest on the wrong side; NaN if there is none."""
        if not self.values or any(math.isnan(v) for v in self.values):
            return math.nan
        return max(self.values) if self.side == "<=" else min(self.values)

    @property
    def middle(self) -> float:
        """Median of the figures."""
        return median(self.values) if self.values else math.nan

    @property
    def ok(self) -> bool:
        """Whether the worst figure keeps the limit; NaN never does."""
        return self.worst <= self.limit if self.side == "<=" else self.worst >= self.limit

    def to_json(self) -> dict[str, Any]:
        """Plain data; what is no finite number is told in words, as JSON has none."""
        about = {"what": self.what, "limit": self.limit, "side": self.side}
        derived = {"worst": _plain(self.worst), "median": _plain(self.middle), "ok": self.ok}
        return about | {"values": list(map(_plain, self.values))} | derived

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> Measure:
        """Read what `to_json` wrote."""
        return measured(data["what"], data["limit"], data["values"], data["side"])


def _plain(value: float) -> float | str:
    return value if math.isfinite(value) else str(value)


def measured(what: str, limit: float, values: Iterable[float], side: Side = "<=") -> Measure:
    """Figures of any kind of number beside their limit."""
    return Measure(what, limit, tuple(map(float, values)), side)


def gathered(figures: Iterable[Figure]) -> list[Measure]:
    """Figures that come one by one, those of the same thing together; in the order in which each comes first."""
    found: dict[tuple[str, float, Side], list[float]] = {}
    for what, limit, value, side in figures:
        found.setdefault((what, limit, side), []).append(value)
    return [measured(what, limit, values, side) for (what, limit, side), values in found.items()]


def report(title: str, measures: Sequence[Measure], notes: Iterable[str] = ()) -> str:
    """A table of figures and limits, for people."""
    rows: list[list[Cell]] = [
        [
            m.what,
            f"{m.side} {m.limit:g}",
            f"{m.worst:.4g}",
            f"{m.middle:.4g}",
            len(m.values),
            "met" if m.ok else "MISSED",
        ]
        for m in measures
    ]
    header = ["figure", "limit", "worst", "median", "of", ""]
    return "\n".join([title, *([table(header, rows)] if rows else []), *notes])


def one_of(names: Collection[str]) -> Callable[[str], str]:
    """The type of a command line's argument that is one of these names; `choices` would refuse that none is given."""

    def checked(text: str) -> str:
        if text not in names:
            raise ArgumentTypeError(f"{text!r}: expected one of {', '.join(names)}")
        return text

    return checked
