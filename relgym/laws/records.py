"""What was learned, as frozen records: pieces, laws of one axis, laws of a pair, free laws."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.mode import sum_text
from relgym.config.constants import ALIKE, DIGITS, LEFT_OPEN, SAME_DIGITS
from relgym.scene.geometry.vectors import FloatArray

__all__ = [
    "ONE",
    "ZERO",
    "AxisLaw",
    "Bound",
    "FreeLaw",
    "Kind",
    "Operator",
    "PairLaw",
    "Piece",
    "Region",
    "Share",
]

_KEY = "rivals"  # of alternatives in files
ONE = "1"
"""Name of the feature whose weight is a constant term."""

Kind: TypeAlias = tuple[str, str]
"""Types of the two bodies of a contact: the first one moves."""

Operator: TypeAlias = Literal["max", "min"]


@dataclass(frozen=True, slots=True)
class Piece:
    """A linear function of features, ``sum(weight * feature)``; without terms it is 0."""

    terms: tuple[tuple[str, float], ...]

    def values(self, features: Mapping[str, FloatArray], like: FloatArray) -> FloatArray:
        """The function on arrays of features, of the shape of `like`; summed term by term (bit for bit)."""
        total = np.zeros(like.shape)
        for name, weight in self.terms:
            total = total + (weight if name == ONE else weight * features[name])
        return total

    def formula(self, digits: int = DIGITS) -> str:
        """Such as ``u_t - 0.2 J_n``."""
        constant = sum(weight for name, weight in self.terms if name == ONE)
        return sum_text([(weight, name) for name, weight in self.terms if name != ONE], constant, digits)

    def free_parameters(self) -> int:
        """Number of weights that are neither 1 nor -1."""
        return sum(abs(weight) != 1.0 for _, weight in self.terms)

    def releases(self, free: str) -> bool:
        """Whether the piece is the free motion as soon as no impulse acts: ``free`` plus impulses."""
        others = [name for name, _ in self.terms if name != free]
        return (free, 1.0) in self.terms and all(name.startswith("J_") for name in others)


ZERO = Piece(())


@dataclass(frozen=True, slots=True)
class AxisLaw:
    """The velocity after a contact along one axis of its frame: the maximum or minimum of pieces.

    A continuous function made of two linear pieces *is* their maximum or minimum, so no classifier says
    which piece holds.

    Attributes
    ----------
    pieces
        One to three of them.
    operator
        How they are combined.
    kinds
        Kinds of contacts that it was learned from.
    alternatives
        Other choices of (operator, pieces) that explain every example just as well and as briefly. Where they
        differ, the law claims nothing.
    signs
        Whether velocities below and above 0 were seen after a contact. A law that never saw a body move back
        has not seen what keeps it from doing so, and claims nothing where its impulse would make it.
    examples, unexplained
        Of these kinds, among the stored contacts.
    bits
        Description length, the unexplained examples included.
    doubted
        Kinds of contacts of which it leaves surely more unexplained than a law may: rare ones don't show among all.
    excused
        Of the unexplained examples those of doubted kinds: they say nothing of the others.
    """

    pieces: tuple[Piece, ...]
    operator: Operator
    kinds: tuple[Kind, ...]
    alternatives: tuple[tuple[Operator, tuple[Piece, ...]], ...] = ()
    signs: tuple[bool, bool] = (True, True)
    examples: int = 0
    unexplained: int = 0
    bits: float = 0.0
    doubted: tuple[Kind, ...] = ()
    excused: int = 0

    def values(self, features: Mapping[str, FloatArray], like: FloatArray) -> FloatArray:
        """Velocity after the contact along the axis."""
        return combined(self.operator, [piece.values(features, like) for piece in self.pieces])

    def formula(self, digits: int = DIGITS) -> str:
        """Such as ``max(u_n, -0.9 v_n)``."""
        texts = [piece.formula(digits) for piece in self.pieces]
        return texts[0] if len(texts) == 1 else f"{self.operator}({', '.join(texts)})"

    def says(self) -> tuple[Any, ...]:
        """Operator and pieces of the law and of its alternatives, weights to nine digits, and what it has seen."""
        forms = ((self.operator, self.pieces), *self.alternatives)
        stated = tuple((o, tuple(piece.formula(SAME_DIGITS) for piece in pieces)) for o, pieces in forms)
        return stated, self.signs, self.trusted(), self.doubted

    def trusted(self, kind: Kind | None = None) -> bool:
        """Whether it explains nearly all of its own examples (of a kind): what it doesn't, it must not claim.

        A kind never seen is doubted where one of the bodies is known from doubted kinds alone: what a belt does to
        boxes no law says, and it may do that to others. So it is where one is known from some, and the other not at
        all: a floor isn't like a box to a ball, and a ramp may be like neither.
        """
        if (
            self.unexplained - self.excused > LEFT_OPEN * (self.examples - self.excused)
            or kind in self.doubted
        ):
            return False
        if kind is None or kind in self.kinds or not self.doubted:
            return True
        fine = {name for each in self.kinds if each not in self.doubted for name in each}
        odd = {name for each in self.doubted for name in each}
        new = any(name not in fine | odd for name in kind)
        return not any(name in odd and (new or name not in fine) for name in kind)

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {
            "pieces": _pieces_to_json(self.pieces),
            "operator": self.operator,
            "kinds": [list(kind) for kind in self.kinds],
            _KEY: [[operator, _pieces_to_json(pieces)] for operator, pieces in self.alternatives],
            "signs": list(self.signs),
            "examples": self.examples,
            "unexplained": self.unexplained,
            "bits": self.bits,
        } | (
            {"doubted": [list(kind) for kind in self.doubted], "excused": self.excused}
            if self.doubted
            else {}
        )

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> AxisLaw:
        """Read what `to_json` wrote."""
        return cls(
            _pieces_from_json(data["pieces"]),
            data["operator"],
            tuple((str(a), str(b)) for a, b in data["kinds"]),
            tuple((operator, _pieces_from_json(pieces)) for operator, pieces in data[_KEY]),
            (bool(data["signs"][0]), bool(data["signs"][1])),
            int(data["examples"]),
            int(data["unexplained"]),
            float(data["bits"]),
            tuple((str(a), str(b)) for a, b in data.get("doubted", ())),
            int(data.get("excused", 0)),
        )


def combined(operator: Operator, values: list[FloatArray]) -> FloatArray:
    """Maximum or minimum of several arrays, element by element."""
    total = values[0]
    for each in values[1:]:
        total = np.maximum(total, each) if operator == "max" else np.minimum(total, each)
    return total


@dataclass(frozen=True, slots=True)
class PairLaw:
    """What a contact does to the relative velocity of its two bodies.

    Attributes
    ----------
    frame
        Name of the frame (`relgym.laws.frames`) along whose axes the laws are stated.
    axes
        For each axis the laws of different kinds of contacts (one law, unless materials differ).
    bits
        Description length of all of them.
    grips
        In the frame of the points that touch: for each kind with a body that spins, which part of a change along the
        slip direction velocities take. Spins take the rest.
    surfaces
        Of bodies that turn: kinds of contacts at which surfaces run, as a conveyor's, and how fast: the velocity along
        the turned normal at which the first body rests on the second one.
    """

    frame: str
    axes: tuple[tuple[AxisLaw, ...], ...]
    bits: float
    grips: tuple[tuple[Kind, float], ...] = ()
    surfaces: tuple[tuple[Kind, float], ...] = ()

    def law_of(self, axis: int, kind: Kind) -> AxisLaw | None:
        """The law for a kind of contact; that of all kinds, if they agree, for one never seen."""
        laws = self.axes[axis]
        known = next((law for law in laws if kind in law.kinds), None)
        return laws[0] if known is None and len(laws) == 1 else known

    def running(self, kinds: Sequence[Kind]) -> NDArray[np.float64]:
        """Speed of the surfaces at each kind of contacts, shape ``(len(kinds),)``.

        Of a kind never seen to run it is that at which others run on the same body, if they agree; else NaN.
        """
        known, found = dict(self.surfaces), []
        for kind in kinds:
            same = [known[kind]] if kind in known else [v for (_, b), v in self.surfaces if b == kind[1]]
            alike = not same or max(same) - min(same) <= ALIKE * abs(same[0])
            found.append((same[0] if same else 0.0) if alike else math.nan)
        return np.array(found)

    @property
    def examples(self) -> int:
        """Contacts that it was learned from."""
        return sum(law.examples for law in self.axes[0])

    @property
    def unexplained(self) -> int:
        """Numbers among them, one for each axis of a contact, that it doesn't explain."""
        return sum(law.unexplained for laws in self.axes for law in laws)

    def grip(self, kind: Kind) -> float:
        """The grip of a kind of contact; that of all kinds, if they agree, for one never seen; else NaN."""
        known = dict(self.grips)
        if kind in known or not known:
            return known.get(kind, math.nan)
        alike = max(known.values()) - min(known.values()) <= ALIKE
        return next(iter(known.values())) if alike else math.nan

    def says(self) -> tuple[Any, ...]:
        """What the law states: equal for laws that differ in examples and in rounding only."""
        axes = (tuple((law.says(), law.kinds if len(laws) > 1 else ()) for law in laws) for laws in self.axes)
        grips, surfaces = (
            tuple((kind, f"{value:.{SAME_DIGITS}g}") for kind, value in pairs)
            for pairs in (self.grips, self.surfaces)
        )
        return self.frame, *axes, *grips, surfaces

    def doubting(self, kinds: Collection[Kind]) -> PairLaw:
        """The same, but that it says nothing of some kinds of contacts."""

        def doubted(law: AxisLaw) -> AxisLaw:
            more = tuple(kind for kind in law.kinds if kind in kinds and kind not in law.doubted)
            return replace(law, doubted=law.doubted + more) if more else law

        return replace(self, axes=tuple(tuple(map(doubted, laws)) for laws in self.axes))

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        axes = [[law.to_json() for law in laws] for laws in self.axes]
        grips = [[*kind, grip] for kind, grip in self.grips]
        data = {"frame": self.frame, "axes": axes, "bits": self.bits, "grips": grips}
        surfaces = [[*kind, speed] for kind, speed in self.surfaces]
        return data | ({"surfaces": surfaces} if surfaces else {})

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> PairLaw:
        """Read what `to_json` wrote."""
        axes = tuple(tuple(AxisLaw.from_json(law) for law in laws) for laws in data["axes"])
        grips, surfaces = (
            tuple(((str(a), str(b)), float(value)) for a, b, value in data.get(name, ()))
            for name in ("grips", "surfaces")
        )
        return cls(str(data["frame"]), axes, float(data["bits"]), grips, surfaces)


@dataclass(frozen=True, slots=True)
class Share:
    """Which part of a contact's impulse changes the first body's velocity; the second one gets the rest.

    Attributes
    ----------
    property
        The share is ``b^power / (a^power + b^power)`` for this property of the two bodies (a mass, say);
        empty: it is `constant`.
    """

    property: str = ""
    power: int = 1
    constant: float = 0.5

    def formula(self, digits: int = DIGITS) -> str:
        """Such as ``m_B / (m_A + m_B)``."""
        if not self.property:
            return f"{self.constant:.{digits}g}"
        power = "" if self.power == 1 else f"^{self.power}"
        a, b = (f"{self.property}_{side}{power}" for side in "AB")
        return f"{b} / ({a} + {b})"


@dataclass(frozen=True, slots=True)
class Bound:
    """A test of one component of a position. Between `low` and `high` nothing was seen, and nothing is known.

    Attributes
    ----------
    name
        The component.
    above
        Whether it holds from `high` on, or else up to `low`.
    low, high
        The last number seen on the one side, and the first one on the other.
    """

    name: str
    above: bool
    low: float
    high: float

    def text(self, digits: int = DIGITS) -> str:
        """Such as ``px >= 0.003 (else px <= -0.001)``."""
        low, high = (
            f"{self.name} {sign} {value:.{digits}g}" for sign, value in (("<=", self.low), (">=", self.high))
        )
        return f"{high} (else {low})" if self.above else f"{low} (else {high})"


@dataclass(frozen=True, slots=True)
class Region:
    """Where another free law holds: where all bounds do."""

    bounds: tuple[Bound, ...]
    components: tuple[Piece, ...]

    def text(self, digits: int = DIGITS) -> str:
        """Such as ``px >= 0.003 (else px <= -0.001)``, its bounds joined by ``and``."""
        return " and ".join(bound.text(digits) for bound in self.bounds)

    def where(self, columns: Mapping[str, FloatArray]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether bodies are surely inside, and surely outside."""
        shape = columns[self.bounds[0].name].shape
        inside, outside = np.ones(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
        for bound in self.bounds:
            value = columns[bound.name]
            below, beyond = value <= bound.low, value >= bound.high
            inside = inside & (beyond if bound.above else below)
            outside = outside | (below if bound.above else beyond)
        return inside, outside


@dataclass(frozen=True, slots=True)
class FreeLaw:
    """The next velocity of an object that touches nothing, along each world axis.

    Attributes
    ----------
    type
        The type of the objects.
    components
        A function for each component of the velocity, and for the spin if it is known.
    examples, unexplained, bits
        Examples that it was learned from, those that it doesn't explain, and description length.
    regions
        Where others hold; the first one counts.
    """

    type: str
    components: tuple[Piece, ...]
    examples: int = 0
    unexplained: int = 0
    bits: float = 0.0
    regions: tuple[Region, ...] = ()

    def first(self, count: int) -> FreeLaw:
        """The law of the first components alone."""
        regions = tuple(replace(region, components=region.components[:count]) for region in self.regions)
        return replace(self, components=self.components[:count], regions=regions)

    def at(self, columns: Mapping[str, FloatArray]) -> tuple[Piece, ...]:
        """The functions that hold for a single body; those that hold elsewhere where that isn't known."""
        there = (region.components for region in self.regions if region.where(columns)[0].all())
        return next(there, self.components)

    def says(self) -> tuple[Any, ...]:
        """What is stated, up to rounding and to where exactly regions end."""
        regions = tuple(
            (tuple((b.name, b.above) for b in region.bounds), _formulas(region.components))
            for region in self.regions
        )
        return _formulas(self.components), regions

    def reads(self) -> frozenset[str]:
        """Names of all columns that it reads."""
        pieces = [*self.components, *(piece for region in self.regions for piece in region.components)]
        bounds = (bound.name for region in self.regions for bound in region.bounds)
        return frozenset({name for piece in pieces for name, _ in piece.terms if name != ONE}.union(bounds))

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {
            "type": self.type,
            "components": _pieces_to_json(self.components),
            "examples": self.examples,
            "unexplained": self.unexplained,
            "bits": self.bits,
        } | ({"regions": [_region_to_json(region) for region in self.regions]} if self.regions else {})

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> FreeLaw:
        """Read what `to_json` wrote."""
        numbers = (int(data["examples"]), int(data["unexplained"]), float(data["bits"]))
        regions = tuple(_region_from_json(region) for region in data.get("regions", ()))
        return cls(str(data["type"]), _pieces_from_json(data["components"]), *numbers, regions)


def _formulas(pieces: tuple[Piece, ...]) -> tuple[str, ...]:
    return tuple(piece.formula(SAME_DIGITS) for piece in pieces)


def _region_to_json(region: Region) -> dict[str, Any]:
    bounds = [[b.name, b.above, b.low, b.high] for b in region.bounds]
    return {"bounds": bounds, "components": _pieces_to_json(region.components)}


def _region_from_json(data: Mapping[str, Any]) -> Region:
    bounds = tuple(Bound(str(n), bool(a), float(low), float(high)) for n, a, low, high in data["bounds"])
    return Region(bounds, _pieces_from_json(data["components"]))


def _pieces_to_json(pieces: tuple[Piece, ...]) -> list[Any]:
    return [[[name, weight] for name, weight in piece.terms] for piece in pieces]


def _pieces_from_json(data: list[Any]) -> tuple[Piece, ...]:
    return tuple(Piece(tuple((str(name), float(weight)) for name, weight in terms)) for terms in data)
