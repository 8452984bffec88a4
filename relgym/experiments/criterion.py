"""Criteria, and what was measured, as records, as a table and as plain data."""

from __future__ import annotations

import math
from argparse import ArgumentTypeError
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any, Literal, TypeAlias

from relgym.model.reports.text import Cell, table

__all__ = ["Criterion", "Figure", "Measure", "Side", "gathered", "measured", "one_of", "report"]

Side: TypeAlias = Literal["<=", ">="]
"""Whether a figure may be at most or must be at least its limit."""

Figure: TypeAlias = tuple[str, float, float, Side]
"""What is measured once: of what, with its unit; the limit; the figure; the limit's side."""


@dataclass(frozen=True, slots=True)
class Criterion:
    """A limit that a figure must keep.

    Attributes
    ----------
    what
        Of what, with its unit.
    limit
        The limit.
    side
        Whether the figure may be at most or must be at least that.
    """

    what: str
    limit: float
    side: Side = "<="

    def met(self, value: float) -> bool:
        """Whether a figure keeps the limit; NaN never does."""
        return value <= self.limit if self.side == "<=" else value >= self.limit


@dataclass(frozen=True, slots=True)
class Measure:
    """A figure, measured several times, against its criterion.

    Attributes
    ----------
    criterion
        The criterion.
    values
        One figure per repetition (training seed, or pair of training and test seed).
    """

    criterion: Criterion
    values: tuple[float, ...]

    @property
    def worst(self) -> float:
        """The figure farthest on the wrong side; NaN if there is none."""
        if not self.values or any(math.isnan(v) for v in self.values):
            return math.nan
        return max(self.values) if self.criterion.side == "<=" else min(self.values)

    @property
    def middle(self) -> float:
        """Median of the figures."""
        return median(self.values) if self.values else math.nan

    @property
    def ok(self) -> bool:
        """Whether the worst figure keeps the limit."""
        return self.criterion.met(self.worst)

    def to_json(self) -> dict[str, Any]:
        """Plain data; what is no finite number is told in words, as JSON has none."""
        derived = {"worst": _plain(self.worst), "median": _plain(self.middle), "ok": self.ok}
        return asdict(self.criterion) | {"values": list(map(_plain, self.values))} | derived

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Measure:
        """Read what `to_json` wrote."""
        return cls(Criterion(data["what"], data["limit"], data["side"]), tuple(map(float, data["values"])))


def _plain(value: float) -> float | str:
    return value if math.isfinite(value) else str(value)


def measured(what: str, limit: float, values: Iterable[float], side: Side = "<=") -> Measure:
    """A criterion and its figures in one call."""
    return Measure(Criterion(what, limit, side), tuple(map(float, values)))


def gathered(figures: Iterable[Figure]) -> list[Measure]:
    """Figures that come one by one, those of the same thing together; in the order in which each comes first."""
    found: dict[Criterion, list[float]] = {}
    for what, limit, value, side in figures:
        found.setdefault(Criterion(what, limit, side), []).append(float(value))
    return [Measure(criterion, tuple(values)) for criterion, values in found.items()]


def report(title: str, measures: Sequence[Measure], notes: Iterable[str] = ()) -> str:
    """A table of figures and limits, for people."""
    rows: list[list[Cell]] = [
        [
            m.criterion.what,
            f"{m.criterion.side} {m.criterion.limit:g}",
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
