"""Laws as sentences for people, and what follows from them along the world's axes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

from relgym.clustering.mode import sum_text
from relgym.config.constants import ALIKE, DIGITS, ROUNDED
from relgym.errors import ConfigError
from relgym.laws.frames import NORMAL_FRAMES, POINT, axis_names
from relgym.laws.records import ONE, Kind, PairLaw, Piece
from relgym.scene.axes import Axes

if TYPE_CHECKING:
    from relgym.laws.book import LawBook

__all__ = ["DIRECTIONS", "LEGEND", "LawRow", "WorldRow", "law_rows", "world_rows"]

LEGEND = (
    "v: velocity now; u: what the next one would be without this contact; v': what it is with it; all of them\n"
    "relative to the other body. J_n = v'_n - u_n is the impulse. Several contacts act until nothing changes."
)

DIRECTIONS = {
    "n": "along the normal n",
    "t": "along the slip direction t",
    "s": "across the normal, along s",
    "c": "along the line of centres c",
    "a": "along the own axis a",
    "b": "along the own axis b",
}


@dataclass(frozen=True, slots=True)
class LawRow:
    """One sentence.

    Attributes
    ----------
    subject
        What it is about.
    statement
        Such as ``v'_n = max(u_n, -0.9 v_n)``.
    frame
        Frame in which it is stated.
    examples, unexplained
        Of the examples kept.
    """

    subject: str
    statement: str
    frame: str
    examples: int
    unexplained: int

    def __str__(self) -> str:
        return f"{self.subject}: {self.statement}"


@dataclass(frozen=True, slots=True)
class WorldRow:
    """What the laws give along the world's axes where one surface is touched.

    Attributes
    ----------
    case
        The pieces that hold, such as ``v'_n = -0.9 v_n, v'_t = u_t``, and which way the body slips if that
        matters.
    functions
        One per component of the velocity, such as ``vx' = 0.525 vx - 0.8227241 vy + 0.0004243524``.
    """

    case: str
    functions: tuple[str, ...]


def law_rows(book: LawBook, types: Iterable[str], digits: int = DIGITS) -> tuple[LawRow, ...]:
    """The laws that govern some types, a sentence each."""
    rows = [row for name in sorted(types) for row in _free_rows(book, name, digits)]
    if book.pair is None:
        return tuple(rows)
    letters = axis_names(book.pair.frame, len(Axes.of(book.schema).used))
    for letter, laws in zip(letters, book.pair.axes, strict=True):
        for law in laws:
            whom = "touching" if len(laws) == 1 else f"touching {_names(law.kinds)}"
            where = DIRECTIONS.get(letter, f"along {letter}")
            where += " (of the points that touch)" if book.pair.frame == POINT else ""
            statement = f"v'_{letter} = {law.formula(digits)}"
            rows.append(LawRow(f"{whom}, {where}", statement, book.pair.frame, law.examples, law.unexplained))
    for (a, b), share in sorted(book.shares.items()):
        statement = f"A's velocity takes {share.formula(digits)} of the change, B's the rest"
        rows.append(LawRow(f"{a} A touching {b} B", statement, book.pair.frame, 0, 0))
    for sentence in book.inertia.sentences(digits):
        subject, _, statement = (
            sentence.partition(": ") if "over mass" in sentence else sentence.partition(" go as ")
        )
        rows.append(LawRow(subject, statement, book.pair.frame, 0, 0))
    for (a, b), speed in book.pair.surfaces:
        statement = f"surfaces run at {speed:.{digits}g} along the turned normal"
        rows.append(LawRow(f"{a} touching {b}", statement, book.pair.frame, 0, 0))
    for grip, kinds in _grips(book.pair).items():
        statement = f"velocities take {grip:.{digits}g} of the change along t, spins the rest"
        rows.append(LawRow(f"touching {kinds}", statement, book.pair.frame, 0, 0))
    return tuple(rows)


def _grips(law: PairLaw) -> dict[float, str]:
    """Kinds of contacts by their grip, those that agree together."""
    found: dict[float, list[Kind]] = {}
    for kind, grip in law.grips:
        same = next((g for g in found if abs(g - grip) <= ALIKE), grip)
        found.setdefault(same, []).append(kind)
    return {grip: _names(tuple(kinds)) for grip, kinds in found.items()}


def _free_rows(book: LawBook, name: str, digits: int) -> Iterator[LawRow]:
    if (law := book.free.get(name)) is None:
        return
    for where, components in (("", law.components), *((r.text(digits), r.components) for r in law.regions)):
        pairs = zip(book.components(name), components, strict=False)
        statement = ", ".join(f"{v}' = {piece.formula(digits)}" for v, piece in pairs)
        subject = f"{name} touching nothing" + (f", where {where}" if where else "")
        yield LawRow(subject, statement, "world", law.examples, law.unexplained)


def _names(kinds: tuple[Kind, ...]) -> str:
    return ", ".join(dict.fromkeys(b for _, b in kinds))


# ------------------------------------------------------------------ along the world's axes
_Form = dict[str, float]
"""A linear function of the free law's columns."""


def world_rows(book: LawBook, type_name: str, incline: float, digits: int = DIGITS) -> tuple[WorldRow, ...]:
    """Functions along the world's axes that the laws give on a surface of some incline.

    Parameters
    ----------
    book
        The laws.
    type_name
        The moving type.
    incline
        Angle of the surface in degrees: its normal is ``(sin, cos)`` along the first axis and the up axis, so
        that 0 is a floor, 90 a wall on the left and 30 a ramp that descends to the right.
    digits
        Significant digits of coefficients.

    Raises
    ------
    ConfigError
        The world isn't planar, or the laws aren't stated along normals.
    """
    axes = Axes.of(book.schema)
    if not axes.planar or book.pair is None or book.pair.frame not in NORMAL_FRAMES:
        raise ConfigError(
            "functions along the world's axes follow from laws along contact normals, in the plane only"
        )
    angle = math.radians(incline)
    normal = [0.0, 0.0]
    normal[axes.horizontal[0]], normal[axes.up] = _tidy(math.sin(angle)), _tidy(math.cos(angle))
    rows: dict[tuple[str, ...], list[str]] = {}
    for sign in (1.0, -1.0):
        side = [-sign * normal[1] + 0.0, sign * normal[0] + 0.0]
        for row in _cases(book, type_name, (normal, side), digits):
            where = ", ".join(f"{c:.4g}" for c in side)
            rows.setdefault(row.functions, []).append(f"{row.case}, t = ({where})")
    # What holds whichever way the body slips needs no mention of the way.
    return tuple(
        WorldRow(cases[0] if len(cases) == 1 else cases[0].rsplit(", t = ", 1)[0], functions)
        for functions, cases in rows.items()
    )


def _tidy(value: float) -> float:
    return 0.0 if abs(value) < ROUNDED else value


def _cases(
    book: LawBook, name: str, axes: tuple[list[float], list[float]], digits: int
) -> Iterator[WorldRow]:
    assert book.pair is not None, "checked by the caller"
    velocity = book.sources[name].velocity
    now: list[_Form] = [{v: 1.0} for v in velocity]
    free: list[_Form] = [dict(piece.terms) for piece in book.free[name].components[: len(velocity)]]
    letters = axis_names(book.pair.frame, 2)
    features = {f"u_{c}": _along(free, axis) for c, axis in zip(letters, axes, strict=True)}
    features |= {f"v_{c}": _along(now, axis) for c, axis in zip(letters, axes, strict=True)}
    for normal_law, side_law in product(*book.pair.axes):
        if not set(normal_law.kinds) & set(side_law.kinds):
            continue
        for first, second in product(normal_law.pieces, side_law.pieces):
            if first.releases(f"u_{letters[0]}"):
                continue  # no impulse: the free law
            yield _row(velocity, free, axes, letters, features, (first, second), digits)


def _row(
    velocity: tuple[str, ...],
    free: list[_Form],
    axes: tuple[list[float], list[float]],
    letters: tuple[str, ...],
    features: Mapping[str, _Form],
    pieces: tuple[Piece, Piece],
    digits: int,
) -> WorldRow:
    known = dict(features)
    after = free
    for letter, axis, piece in zip(letters, axes, pieces, strict=True):
        value: _Form = {}
        for name, weight in piece.terms:
            value = _plus(value, {ONE: 1.0} if name == ONE else known[name], weight)
        known[f"J_{letter}"] = _plus(value, known[f"u_{letter}"], -1.0)
        after = [_plus(form, known[f"J_{letter}"], c) for form, c in zip(after, axis, strict=True)]
    case = ", ".join(f"v'_{c} = {piece.formula(digits)}" for c, piece in zip(letters, pieces, strict=True))
    functions = (f"{v}' = {_form_text(f, digits)}" for v, f in zip(velocity, after, strict=True))
    return WorldRow(case, tuple(functions))


def _along(forms: list[_Form], axis: list[float]) -> _Form:
    total: _Form = {}
    for form, c in zip(forms, axis, strict=True):
        total = _plus(total, form, c)
    return total


def _plus(form: _Form, other: Mapping[str, float], weight: float) -> _Form:
    """``form + weight * other``, where sums that vanish up to rounding are gone."""
    total = dict(form)
    for name, value in other.items():
        was = total.get(name, 0.0)
        now = was + weight * value
        total[name] = 0.0 if abs(now) <= ROUNDED * abs(was) else now
    return {name: value for name, value in total.items() if value != 0.0}


def _form_text(form: _Form, digits: int) -> str:
    terms = [(weight, name) for name, weight in sorted(form.items()) if name != ONE]
    return sum_text(terms, form.get(ONE, 0.0), digits)
