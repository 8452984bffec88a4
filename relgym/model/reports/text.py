"""Records as text and as plain data: aligned tables, long lines broken, dictionaries for JSON."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final, TypeAlias

__all__ = ["SURFACES", "Cell", "amount", "as_relations", "indented", "percent", "plain", "table", "wrapped"]

Cell: TypeAlias = str | int | float
"""Integers get thousands separators, floats six significant digits."""

SURFACES: Final = (0.0, 90.0)
"""Angles of the surfaces of which functions along the world's axes are told, in degrees: floors and walls."""

_GAP = "  "
_HALF = re.compile(r"(?<![\w.])(?<!- )(?P<name>[\w.]+) (?P<sign>>|<=) 0\.5(?![\d.e])")
"""A number that is compared with a half, and is no difference's end."""


def table(heading: Sequence[str], rows: Sequence[Sequence[Cell] | str]) -> str:
    """Rows under a heading, all columns aligned.

    Parameters
    ----------
    heading
        Names of the columns.
    rows
        As many cells as the heading has, or one string that runs across all columns. Columns that hold
        only numbers and empty strings are aligned to the right.

    Examples
    --------
    >>> print(table(["mode", "examples"], [[1, 15574], "rare:", [2, 295]]))
    mode  examples
       1    15,574
    rare:
       2       295
    """
    cells = [row for row in rows if not isinstance(row, str)]
    right = [all(not isinstance(row[k], str) or not row[k] for row in cells) for k in range(len(heading))]
    widths = [max(len(name), *(len(_text(row[k])) for row in cells), 0) for k, name in enumerate(heading)]

    def line(row: Sequence[Cell]) -> str:
        texts = zip(map(_text, row), widths, right, strict=True)
        return _GAP.join(text.rjust(w) if to_right else text.ljust(w) for text, w, to_right in texts).rstrip()

    return "\n".join([line(heading), *(row if isinstance(row, str) else line(row) for row in rows)])


def indented(text: str, by: int = 2) -> str:
    """The text with every line that isn't empty moved to the right."""
    return "\n".join(" " * by + line if line else line for line in text.split("\n"))


def as_relations(text: str, flags: Collection[str]) -> str:
    """Clauses or tests in which flags are told as relations are.

    Parameters
    ----------
    text
        What tests numbers against thresholds.
    flags
        Names of those that are 1 or 0.

    Examples
    --------
    >>> as_relations("action.left > 0.5 ∧ x <= 0.5 ∧ action.up <= 0.5", {"action.left", "action.up"})
    'action.left ∧ x <= 0.5 ∧ ¬action.up'
    >>> as_relations("F1 - action.up > 0.5 ∧ action.up > 0.55", {"action.up"})
    'F1 - action.up > 0.5 ∧ action.up > 0.55'
    """

    def told(test: re.Match[str]) -> str:
        if test["name"] not in flags:
            return test[0]
        return test["name"] if test["sign"] == ">" else "¬" + test["name"]

    return _HALF.sub(told, text) if flags else text


def wrapped(text: str, width: int, signs: str) -> list[str]:
    """Lines of at most `width` characters, broken before one of the given signs, if the parts allow it.

    Examples
    --------
    >>> wrapped("v' = 0.5 v - 2 force + 1", 16, "+-")
    ["v' = 0.5 v", '- 2 force + 1']
    """
    first, *rest = re.split(f" (?=[{re.escape(signs)}] )", text)
    lines = [first]
    for part in rest:
        if len(lines[-1]) + 1 + len(part) <= width:
            lines[-1] += f" {part}"
        else:
            lines.append(part)
    return lines


def amount(count: int, noun: str) -> str:
    """Such as ``1 mode`` and ``16,000 examples``."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def percent(share: float) -> str:
    """Such as ``12 %`` and ``0.5 %``."""
    return f"{100.0 * share:.2g} %"


def plain(value: Any) -> Any:
    """Records as dictionaries, ready for JSON; what JSON has no number for becomes None.

    Examples
    --------
    >>> plain({"modes": (1, 2), "median": float("nan")})
    {'modes': [1, 2], 'median': None}
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _text(cell: Cell) -> str:
    if isinstance(cell, str):
        return cell
    return f"{cell:,}" if isinstance(cell, int) else f"{cell:.6g}"
