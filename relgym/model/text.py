"""Plain-text tables: aligned columns, numbers to the right, long cells continued on the next line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

__all__ = ["Cell", "amount", "indented", "table", "wrapped"]

Cell: TypeAlias = str | int | float
"""Integers get thousands separators, floats six significant digits."""

_GAP = "  "


def table(heading: Sequence[str], rows: Sequence[Sequence[Cell] | str]) -> str:
    """Rows under a heading, all columns aligned.

    Parameters
    ----------
    heading
        Names of the columns.
    rows
        As many cells as the heading has, or one string that runs across all columns. Columns that hold
        numbers only are aligned to the right.

    Examples
    --------
    >>> print(table(["mode", "examples"], [[1, 15574], "rare:", [2, 295]]))
    mode  examples
       1    15,574
    rare:
       2       295
    """
    cells = [row for row in rows if not isinstance(row, str)]
    right = [all(not isinstance(row[k], str) for row in cells) for k in range(len(heading))]
    widths = [max(len(name), *(len(_text(row[k])) for row in cells), 0) for k, name in enumerate(heading)]

    def line(row: Sequence[Cell]) -> str:
        texts = zip(map(_text, row), widths, right, strict=True)
        return _GAP.join(text.rjust(w) if to_right else text.ljust(w) for text, w, to_right in texts).rstrip()

    return "\n".join([line(heading), *(row if isinstance(row, str) else line(row) for row in rows)])


def indented(text: str, by: int = 2) -> str:
    """The text with every line that isn't empty moved to the right."""
    return "\n".join(" " * by + line if line else line for line in text.split("\n"))


def wrapped(text: str, width: int, separator: str) -> list[str]:
    """Lines of at most `width` characters, broken before a separator, as far as the parts allow it.

    Examples
    --------
    >>> wrapped("wall(B) ∧ intersect(A, B) ∧ floor(C)", 26, " ∧ ")
    ['wall(B) ∧ intersect(A, B)', '∧ floor(C)']
    """
    first, *rest = text.split(separator)
    lines = [first]
    for part in rest:
        if len(lines[-1]) + len(separator) + len(part) <= width:
            lines[-1] += separator + part
        else:
            lines.append(separator.lstrip() + part)
    return lines


def amount(count: int, noun: str) -> str:
    """Such as ``1 mode`` and ``16,000 examples``."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def _text(cell: Cell) -> str:
    if isinstance(cell, str):
        return cell
    return f"{cell:,}" if isinstance(cell, int) else f"{cell:.6g}"
