"""Linear functions as text, and back: ``0.525 vx - 0.8227241 vy + 0.00042``, or with roles ``v - 2.5 box_a.friction``.

A term is a weight and a name: a property of the object itself, of the only object of a type (``action.force``), of an
object bound to a role (``box_a.friction``), a next value (``vx'``) or a product of those and their sines and cosines
(``action.force cos(th)``).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError

__all__ = ["Column", "Sum", "evaluated", "number_of", "parse_sum", "split_outside", "sum_text", "whole_of"]

Column: TypeAlias = Callable[[str], NDArray[np.float64]]
"""Values of a property by name, shape ``(n,)``; NaN where there is none."""

_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
_CALL = re.compile(r"(?P<function>\w+)\((?:(?P<frequency>\d+) )?(?P<name>[^()\s]+)\)")


@dataclass(frozen=True, slots=True)
class Sum:
    """Weighted names and a constant.

    Attributes
    ----------
    terms
        (weight, name) pairs; without any it is the constant.
    constant
        In units of what it predicts.
    """

    terms: tuple[tuple[float, str], ...] = ()
    constant: float = 0.0

    def text(self, digits: int = 7) -> str:
        """Such as ``-0.9 v + 1``."""
        return sum_text(self.terms, self.constant, digits)

    def values(self, column: Column, like: NDArray[np.float64]) -> NDArray[np.float64]:
        """The function of n scenes, shape ``(n,)`` as `like`."""
        total = np.full(like.shape, self.constant)
        for weight, name in self.terms:
            total = total + weight * factor(name, column)
        return total

    def __str__(self) -> str:
        return self.text()


def sum_text(terms: tuple[tuple[float, str], ...], constant: float, digits: int) -> str:
    """Weighted names and a constant as text."""
    pieces = []
    for weight, name in terms:
        size = f"{abs(weight):.{digits}g}"
        pieces.append((weight < 0, name if size == "1" else f"{size} {name}"))
    if constant != 0.0 or not pieces:
        pieces.append((constant < 0, f"{abs(constant):.{digits}g}"))
    negative, text = pieces[0]
    head = f"-{text}" if negative else text
    return head + "".join(f" {'-' if minus else '+'} {piece}" for minus, piece in pieces[1:])


def parse_sum(text: str) -> Sum:
    """Read what `Sum.text` wrote.

    Raises
    ------
    ConfigError
        It isn't a sum.
    """
    terms, constant = [], 0.0
    for number, (sign, piece) in enumerate(_pieces(text)):
        if not piece:
            raise ConfigError(f"function {text!r}: expected a term after {'-' if sign < 0 else '+'}")
        head, _, rest = piece.partition(" ")
        if _NUMBER.fullmatch(piece):
            constant += sign * float(piece)
        elif _NUMBER.fullmatch(head):
            terms.append((sign * float(head), rest))
        else:
            terms.append((sign, piece))
        if terms and (terms[-1][1][0].isdigit() or set(terms[-1][1]) & set("+-")):
            raise ConfigError(
                f"function {text!r}: expected a name in term {number + 1}, got {terms[-1][1]!r}"
            )
    return Sum(tuple(terms), constant)


def number_of(text: str) -> float:
    """The number that a text is; `ConfigError` if it is none."""
    try:
        return float(text)
    except ValueError:
        raise ConfigError(f"rules: expected a number, got {text!r:.60}") from None


def whole_of(text: str) -> int:
    """The whole number that a text is, with or without commas between thousands; `ConfigError` if it is none."""
    digits = text.replace(",", "")
    if not digits.isascii() or not digits.isdigit() or len(digits) > 18:
        raise ConfigError(f"rules: expected a whole number of at most 18 digits, got {text!r:.60}")
    return int(digits)


def _pieces(text: str) -> list[tuple[float, str]]:
    text = text.strip()
    first = -1.0 if text.startswith("-") else 1.0
    found = []
    for plus, part in enumerate(split_outside(text.removeprefix("-"), " + ")):
        for minus, piece in enumerate(split_outside(part, " - ")):
            sign = first if not plus and not minus else (-1.0 if minus else 1.0)
            found.append((sign, piece))
    return found


def factor(name: str, column: Column) -> NDArray[np.float64]:
    """A product of properties and functions of them, shape ``(n,)``."""
    product: NDArray[np.float64] | None = None
    for part in split_outside(name, " "):
        value = _atom(part, column)
        product = value if product is None else product * value
    assert product is not None, "a name has at least one part"
    return product


def _atom(text: str, column: Column) -> NDArray[np.float64]:
    base, _, power = text.partition("^")
    if power:
        return _atom(base, column) ** whole_of(power)
    match = _CALL.fullmatch(text)
    if match is None:
        return column(text)
    inside = column(match["name"])
    if match["function"] in ("sin", "cos"):
        function = np.sin if match["function"] == "sin" else np.cos
        return np.asarray(function(whole_of(match["frequency"] or "1") * inside))
    return np.asarray(registered(match["function"])(inside), dtype=np.float64)


def registered(name: str) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """A user's function by name (`relgym.clustering.features.register_function`)."""
    from relgym.clustering.features import functions_of

    found = functions_of([name])
    if name not in found:
        raise ConfigError(f"function {name!r} isn't registered: call relgym.register_function first")
    return found[name]


def evaluated(text: str, column: Column, like: NDArray[np.float64]) -> NDArray[np.float64]:
    """A number that conditions compare: a sum, a distance ``|v - 1|``, a product ``(v) * w``, or a flag."""
    if text.endswith("?"):
        return factor(text[:-1], column)
    if text.startswith("|") and text.endswith("|"):
        return np.abs(parse_sum(text[1:-1]).values(column, like))
    if text.startswith("(") and ") * " in text:
        inside, name = text[1:].rsplit(") * ", 1)
        return parse_sum(inside).values(column, like) * factor(name, column)
    return parse_sum(text).values(column, like)


def split_outside(text: str, mark: str) -> list[str]:
    """Parts of a text between marks that stand outside all brackets."""
    parts, depth, start, at = [], 0, 0, 0
    while at < len(text):
        depth += (text[at] in "[(") - (text[at] in "])")
        if depth == 0 and text.startswith(mark, at):
            parts.append(text[start:at])
            at = start = at + len(mark)
            continue
        at += 1
    return [*parts, text[start:]]
