"""How hard bodies are to move and to turn, found in what single contacts did to them.

A contact in one point pushes both bodies with equal and opposite impulses, whatever its law. So
``m_A dv_A = - m_B dv_B`` tells the ratio of two masses, and ``r x dv = g ds`` of one body the mean square distance g of
its mass from its position (moment over mass), with the arm r and the change ds of its turning rate. Both are stated as
functions of what can be seen of a body, or else as constants: of types, or of objects. Of all that explain the contacts
the shortest wins. Only ratios of masses can be found.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import (
    ALIKE,
    DEGREES,
    DIGITS,
    DRAWS,
    FEWEST,
    LEFT_OPEN,
    LITTLE,
    SAME_DIGITS,
    TOLD,
)
from relgym.laws.description import CONSTANT_BITS, EXCEPTION_BITS
from relgym.laws.records import ONE, Piece
from relgym.scene.geometry.vectors import FloatArray, dot

__all__ = [
    "AREA",
    "NOTHING",
    "SQUARE",
    "By",
    "Gyration",
    "Inertia",
    "Mass",
    "Pushes",
    "find_gyrations",
    "find_mass",
    "ratios",
]

AREA: Final = "shape.area"
"""Name of a body's area among what inertia may be a function of."""

SQUARE: Final = "shape.r2"
"""Name of the mean square distance of a body's points from its position."""

By = Literal["", "type", "object"]


@dataclass(frozen=True, slots=True)
class Mass:
    """Mass up to a common factor: a product of powers, times a constant of each type or object.

    Attributes
    ----------
    factors
        Names and powers.
    by, constants
        Whose constants, and these by name; none without `by`.
    examples, unexplained
        Contacts of two bodies that move.
    """

    factors: tuple[tuple[str, int], ...]
    by: By = ""
    constants: tuple[tuple[str, float], ...] = ()
    examples: int = 0
    unexplained: int = 0

    def values(self, features: Mapping[str, FloatArray], names: Sequence[str]) -> FloatArray:
        """Masses of n bodies; NaN for one without a constant, or without what it is a function of.

        Parameters
        ----------
        features
            What is seen of them, shape ``(n,)`` each.
        names
            Of each body's type or object, as `by` asks.
        """
        known = dict(self.constants)
        constant = np.array([known.get(name, np.nan) if self.by else 1.0 for name in names])
        return constant * _product(self.factors, features, len(names))


@dataclass(frozen=True, slots=True)
class Gyration:
    """Moment over mass of some types, linear in what is seen of a body; None where contacts don't turn it.

    Attributes
    ----------
    types
        The types it was found for; with `whole` it holds for all, those never seen included.
    """

    types: tuple[str, ...]
    piece: Piece | None
    whole: bool = False
    examples: int = 0
    unexplained: int = 0


@dataclass(frozen=True, slots=True)
class Inertia:
    """What is known of masses and moments; nothing, to begin with."""

    mass: Mass | None = None
    gyrations: tuple[Gyration, ...] = ()

    def gyration(self, type_name: str) -> Gyration | None:
        """Moment over mass of a type, if known."""
        known = (g for g in self.gyrations if type_name in g.types or g.whole)
        return next(known, None)

    def says(self) -> tuple[Any, ...]:
        """What is stated, up to rounding."""
        mass = self.mass and (
            self.mass.factors, self.mass.by, tuple((n, f"{c:.6g}") for n, c in self.mass.constants)
        )  # fmt: skip
        return mass, tuple(
            (g.types, g.piece and g.piece.formula(SAME_DIGITS), g.whole) for g in self.gyrations
        )

    def sentences(self, digits: int = DIGITS) -> tuple[str, ...]:
        """What is known, a sentence each; `parse_inertia` reads them back."""
        found = []
        if (m := self.mass) is not None:
            constants = ", ".join(f"{name}: {value:.{digits}g}" for name, value in m.constants)
            found.append(
                f"masses go as {_factors_text(m.factors)}"
                + (f"; by {m.by}, times {constants}" if m.by else "")
            )
        for g in self.gyrations:
            whom = "" if g.whole else f" of {', '.join(g.types)}"
            found.append(
                f"moment over mass{whom}: {'infinite' if g.piece is None else g.piece.formula(digits)}"
            )
        return tuple(found)

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        m = self.mass
        return {
            "mass": None if m is None else {
                "factors": [list(f) for f in m.factors], "by": m.by, "constants": [list(c) for c in m.constants],
                "examples": m.examples, "unexplained": m.unexplained,
            },
            "gyrations": [
                {
                    "types": list(g.types), "whole": g.whole, "examples": g.examples, "unexplained": g.unexplained,
                    "terms": None if g.piece is None else [list(t) for t in g.piece.terms],
                }
                for g in self.gyrations
            ],
        }  # fmt: skip

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Inertia:
        """Read what `to_json` wrote."""
        m = data.get("mass")
        mass = None if m is None else Mass(
            tuple((str(n), int(k)) for n, k in m["factors"]), m["by"],
            tuple((str(n), float(c)) for n, c in m["constants"]), int(m["examples"]), int(m["unexplained"]),
        )  # fmt: skip
        gyrations = tuple(
            Gyration(
                tuple(map(str, g["types"])),
                None if g["terms"] is None else Piece(tuple((str(n), float(w)) for n, w in g["terms"])),
                bool(g["whole"]), int(g["examples"]), int(g["unexplained"]),
            )
            for g in data.get("gyrations", ())
        )  # fmt: skip
        return cls(mass, gyrations)


NOTHING: Final = Inertia()
"""What is known before anything was learned."""


def _factors_text(factors: Iterable[tuple[str, int]]) -> str:
    return " ".join(name if power == 1 else f"{name}^{power}" for name, power in factors) or ONE


@dataclass(frozen=True, slots=True)
class Pushes:
    """What single contacts did to n bodies.

    Attributes
    ----------
    change
        Of the velocity, shape ``(2, n)``.
    turn
        Of the turning rate, shape ``(n,)``.
    torque
        Arm times change of velocity (cross product), shape ``(n,)``.
    reach
        Length of the arm, shape ``(n,)``.
    features
        What is seen of the bodies, by name, shape ``(n,)``; NaN where a body lacks it.
    types, objects
        Names of each body's type, and of the body.
    """

    change: FloatArray
    turn: FloatArray
    torque: FloatArray
    reach: FloatArray
    features: Mapping[str, FloatArray]
    types: NDArray[np.str_]
    objects: NDArray[np.str_]

    def of(self, some: NDArray[Any]) -> Pushes:
        """Some of them."""
        features = {name: values[some] for name, values in self.features.items()}
        return Pushes(
            self.change[:, some], self.turn[some], self.torque[some], self.reach[some], features,
            self.types[some], self.objects[some],
        )  # fmt: skip


def ratios(features: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Features, and the ratios of any two that are no shape's: a moment that is seen beside a mass, say."""
    found = dict(features)
    own = [name for name in features if not name.startswith("shape.") and name not in ("sx", "sy", "sz")]
    for a, b in combinations(own, 2):
        for top, bottom in ((a, b), (b, a)):
            below = features[bottom]
            found[f"{top}/{bottom}"] = np.where(
                below == 0.0, np.nan, features[top] / np.where(below == 0.0, 1.0, below)
            )
    return found


# ------------------------------------------------------------------ moments
def find_gyrations(pushes: Pushes, tolerance: float, *, rng: np.random.Generator) -> tuple[Gyration, ...]:
    """Moment over mass of every type that was pushed often enough: one statement for all, or one for each.

    Parameters
    ----------
    pushes
        Bodies whose turning rate is seen, each pushed in one point.
    tolerance
        Largest error of a velocity.
    rng
        Source of random samples.
    """
    told = np.abs(pushes.torque) > TOLD * tolerance * np.maximum(pushes.reach, 1.0)
    pushes = pushes.of(told)
    apart: list[Gyration] = []
    bits = 0.0
    for name in np.unique(pushes.types).tolist():
        own = pushes.of(pushes.types == name)
        if len(own.turn) >= FEWEST:
            found, cost = _gyration(own, (name,), tolerance, rng=rng)
            bits += cost
            apart.append(found)
    if len(apart) > 1:
        names = tuple(g.types[0] for g in apart)
        together, cost = _gyration(pushes.of(np.isin(pushes.types, names)), names, tolerance, rng=rng)
        if cost < bits:
            apart = [together]
    kept = [g for g in apart if g.unexplained <= LEFT_OPEN * g.examples]
    if len(kept) == 1 and len(apart) == 1 and kept[0].piece is not None:
        # Nothing says that it is a matter of the type, unless a constant is part of it.
        general = all(name != ONE for name, _ in kept[0].piece.terms)
        kept = [Gyration(kept[0].types, kept[0].piece, general, kept[0].examples, kept[0].unexplained)]
    return tuple(kept)


def _gyration(
    pushes: Pushes, types: tuple[str, ...], tolerance: float, *, rng: np.random.Generator
) -> tuple[Gyration, float]:
    """The shortest statement about some pushes, and its bits."""
    n = len(pushes.turn)
    constant = CONSTANT_BITS + 0.5 * float(np.log2(max(n, 2)))
    features = _squares(ratios(pushes.features))
    features = {name: f for name, f in features.items() if np.isfinite(f).all()}
    naming = float(np.log2(max(2, len(features))))
    limit = 2.0 * tolerance * (1.0 + pushes.reach)
    best: tuple[float, Piece | None, int] = _cost(None, np.abs(pushes.turn) > tolerance, 1.0)
    for terms, stated in _forms(features, pushes, naming, constant, rng=rng):
        left = pushes.torque - pushes.turn * sum(weight * features[name] for name, weight in terms)
        # An error of the turning rate counts by what it stands for.
        size = limit + 2.0 * tolerance * np.abs(sum(weight * features[name] for name, weight in terms))
        found = _cost(Piece(terms), np.abs(left) > size, stated)
        best = min(best, found, key=_first)
    bits, piece, wrong = best
    return Gyration(types, piece, False, n, wrong), bits


def _cost(piece: Piece | None, wrong: NDArray[np.bool_], stated: float) -> tuple[float, Piece | None, int]:
    return stated + EXCEPTION_BITS * float(wrong.sum()), piece, int(wrong.sum())


def _first(found: tuple[float, Piece | None, int]) -> float:
    return found[0]


def _squares(features: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """What moment over mass may be linear in: squares of lengths, and whatever else is seen."""
    found = {SQUARE: features[SQUARE], **features}
    for name in ("sx", "sy", "sz"):
        if name in features:
            found[f"{name}^2"] = features[name] ** 2
            del found[name]
    some = next(iter(features.values()))
    return found | {ONE: np.ones(some.shape)}


def _forms(
    features: Mapping[str, FloatArray],
    pushes: Pushes,
    naming: float,
    constant: float,
    *,
    rng: np.random.Generator,
) -> Iterator[tuple[tuple[tuple[str, float], ...], float]]:
    """Linear functions worth a look, and the bits of stating them."""
    for name, values in features.items():
        if name != ONE:
            yield ((name, 1.0),), naming
        weight = _weight((pushes.turn * values)[None], pushes.torque[None])
        if np.isfinite(weight) and weight > 0.0:
            yield ((name, weight),), naming + constant
    n = len(pushes.turn)
    for a, b in combinations(features, 2):
        x = np.stack([pushes.turn * features[a], pushes.turn * features[b]])
        picks = rng.integers(0, n, (2, DRAWS))
        one, other = x[:, picks[0]], x[:, picks[1]]
        determinant = one[0] * other[1] - one[1] * other[0]
        solved = np.abs(determinant) > ALIKE * np.hypot(one[0], one[1]) * np.hypot(other[0], other[1])
        if not solved.any():
            continue
        y0, y1 = pushes.torque[picks[0]][solved], pushes.torque[picks[1]][solved]
        one, other, determinant = one[:, solved], other[:, solved], determinant[solved]
        weights = np.stack(
            [(y0 * other[1] - y1 * one[1]) / determinant, (one[0] * y1 - other[0] * y0) / determinant]
        )
        rough = np.median(weights, axis=1)
        near = np.abs(pushes.torque - rough @ x) <= LITTLE * np.abs(pushes.torque)
        if near.sum() > 2:
            rough = np.linalg.lstsq(x[:, near].T, pushes.torque[near], rcond=None)[0]
        yield ((a, float(rough[0])), (b, float(rough[1]))), 2.0 * (naming + constant)


# ------------------------------------------------------------------ masses
def find_mass(a: Pushes, b: Pushes, tolerance: float) -> Mass | None:
    """Mass as a function of what is seen, or by constants; None where too little is known or nothing fits.

    Parameters
    ----------
    a, b
        The two bodies of each contact, both of which move.
    tolerance
        Largest error of a velocity.
    """
    told = np.minimum(dot(a.change, a.change), dot(b.change, b.change)) > (TOLD * tolerance) ** 2
    a, b = a.of(told), b.of(told)
    n = len(a.turn)
    if n < FEWEST:
        return None
    constant = CONSTANT_BITS + 0.5 * float(np.log2(n))
    shared = [
        name
        for name in a.features
        if np.isfinite(a.features[name]).all() and np.isfinite(b.features[name]).all()
    ]
    best: tuple[float, Mass] | None = None
    for factors in _factors(shared):
        for by in ("", "type", "object"):
            named = [_names(side, by) for side in (a, b)]
            sides = [_product(factors, side.features, n) for side in (a, b)]
            constants = _constants(a, b, sides, named) if by else {}
            if by and len(constants) < 2:
                continue
            masses = [
                side * np.array([constants.get(str(k), 1.0) for k in own])
                for side, own in zip(sides, named, strict=True)
            ]
            left = np.abs(masses[0] * a.change + masses[1] * b.change).max(axis=0)
            # Each change is the difference of two velocities.
            wrong = int((left > 2.0 * tolerance * (masses[0] + masses[1])).sum())
            bits = sum(np.log2(max(2, len(shared))) + 2.0 for _ in factors) + EXCEPTION_BITS * wrong
            bits += constant * max(0, len(constants) - 1) + float(bool(by))
            if wrong <= LEFT_OPEN * n and (best is None or bits < best[0] - ALIKE):
                best = bits, Mass(factors, by, tuple(sorted(constants.items())), n, wrong)
    return None if best is None else best[1]


def _names(side: Pushes, by: By) -> list[str]:
    """Whose constant each body has."""
    if not by:
        return [""] * len(side.turn)
    names: list[str] = (side.types if by == "type" else side.objects).tolist()
    return names


def _factors(names: Iterable[str]) -> Iterator[tuple[tuple[str, int], ...]]:
    """Products of powers, the plainest first."""
    yield ()
    names = [name for name in names if name != SQUARE]
    for power in DEGREES:
        yield from (((name, power),) for name in names)
    yield from (((a, 1), (b, 1)) for a, b in combinations(names, 2))


def _product(
    factors: Iterable[tuple[str, int]], features: Mapping[str, FloatArray], count: int
) -> FloatArray:
    total = np.ones(count)
    for name, power in factors:
        values = features.get(name)
        total = total * (np.full(count, np.nan) if values is None else values**power)
    return total


def _constants(
    a: Pushes, b: Pushes, sides: Sequence[FloatArray], names: Sequence[Sequence[str]]
) -> dict[str, float]:
    """Constants that make the impulses of both bodies opposite, for names that contacts tie together.

    Names that aren't tied to the first one get none.
    """
    ratio: dict[tuple[str, str], float] = {}
    one, other = (np.array(each) for each in names)
    for first, second in sorted({(min(p, q), max(p, q)) for p, q in zip(*names, strict=True) if p != q}):
        rows = [np.flatnonzero((one == p) & (other == q)) for p, q in ((first, second), (second, first))]
        p = np.concatenate([(sides[0] * a.change)[:, rows[0]], (sides[1] * b.change)[:, rows[1]]], axis=1)
        q = np.concatenate([(sides[1] * b.change)[:, rows[0]], (sides[0] * a.change)[:, rows[1]]], axis=1)
        if p.shape[1] >= 2:
            ratio[first, second] = _weight(p, -q)
    known = sorted({*names[0], *names[1]})
    found = {known[0]: 1.0}
    for _ in known:
        for (first, second), value in sorted(ratio.items()):
            if second in found and first not in found:
                found[first] = found[second] * value
            elif first in found and second not in found and value > 0.0:
                found[second] = found[first] / value
    return found


def _weight(x: FloatArray, y: FloatArray) -> float:
    """The weight w of ``y = w x`` for vectors, shape ``(d, n)``: what most say, then as exactly as those can tell."""
    size = (x * x).sum(axis=0)
    told = size > 0.0
    if not told.any():
        return float("nan")
    rough = float(np.median((x * y).sum(axis=0)[told] / size[told]))
    near = told & (((y - rough * x) ** 2).sum(axis=0) <= LITTLE**2 * (y * y).sum(axis=0))
    return float((x * y)[:, near].sum() / size[near].sum()) if near.any() else rough
