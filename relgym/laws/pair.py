"""The law of touching pairs: learned in every frame, stated in the one that needs fewest bits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ALIKE, ALTERNATIVES, TOLD
from relgym.laws.description import CONSTANT_BITS, EXCEPTION_BITS, shorter_apart
from relgym.laws.frames import FRAMES, POINT, Bearings, axes_of, axis_names, turned
from relgym.laws.kinds import KindsFit, fit_apart, fit_together
from relgym.laws.pieces import AxisExamples
from relgym.laws.records import ONE, Kind, PairLaw
from relgym.numeric.changes import changed_at
from relgym.scene.geometry.vectors import FloatArray, dot, norm

__all__ = ["Encounters", "PairFit", "explained_by", "fit_pair", "outdated"]


@dataclass(frozen=True, slots=True)
class Encounters:
    """Single contacts, as the laws see them.

    Attributes
    ----------
    now, free, after
        Relative velocities of A and B: before, without this contact, and after it; shape ``(d, n)``.
    bearings
        Directions at the contacts.
    kinds
        Number of each contact's kind, shape ``(n,)``.
    names
        The kinds.
    tolerance
        Largest residual of an explained velocity.
    places, arrived, foreseen
        Where each contact is kept, how many had come when it came, itself counted, and whether it came as the laws of
        that time said; shape ``(n,)``.
    rims
        How fast the surfaces of A and B move where they touch, against their centres and summed up, along the turned
        normal: before, without this contact, and after it; shape ``(3, n)``. All 0 where nothing spins.
    """

    now: FloatArray
    free: FloatArray
    after: FloatArray
    bearings: Bearings
    kinds: NDArray[np.intp]
    names: tuple[Kind, ...]
    tolerance: float
    places: NDArray[np.intp]
    arrived: NDArray[np.int64]
    foreseen: NDArray[np.bool_]
    rims: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.kinds)

    def rows(self, chosen: NDArray[np.intp]) -> Encounters:
        """Some of the contacts."""
        normal, centres, angles = (
            np.ascontiguousarray(each[:, chosen])
            for each in (self.bearings.normal, self.bearings.centres, self.bearings.angles)
        )
        return Encounters(
            self.now[:, chosen],
            self.free[:, chosen],
            self.after[:, chosen],
            Bearings(normal, centres, angles),
            self.kinds[chosen],
            self.names,
            self.tolerance,
            self.places[chosen],
            self.arrived[chosen],
            self.foreseen[chosen],
            None if self.rims is None else self.rims[:, chosen],
        )

    def at_points(self) -> Encounters | None:
        """The contacts with the velocities of the points that touch; None where no spin is known to differ."""
        if self.rims is None or not np.isfinite(self.rims).all() or not self.rims.any():
            return None
        side = turned(self.bearings.normal)
        now, free, after = (
            v - rim * side for v, rim in zip((self.now, self.free, self.after), self.rims, strict=True)
        )
        return replace(self, now=now, free=free, after=after)


@dataclass(frozen=True, slots=True)
class PairFit:
    """A law of pairs and which contacts it explains, shape ``(n,)``."""

    law: PairLaw
    explained: NDArray[np.bool_]


def fit_pair(encounters: Encounters, *, rng: np.random.Generator, frames: Sequence[str] = FRAMES) -> PairFit:
    """Learn the law of touching pairs in the frame that describes the contacts in fewest bits.

    Parameters
    ----------
    encounters
        At least one single contact.
    rng
        Source of random samples.
    frames
        Frames to compare, the preferred ones first.
    """
    drafts: list[_Draft] = []
    for frame in frames:
        if frame == "turned" and len(encounters.now) != 2:
            continue
        draft = _Draft.of(frame, encounters, _limit(drafts), rng=rng)
        if draft is not None:
            drafts.append(draft)
    best: PairFit | None = None
    # Should one law not be enough for all, materials are told apart in the best frames.
    for draft in sorted(drafts, key=_bits)[:ALTERNATIVES]:
        found = draft.split(np.inf if best is None else best.law.bits, rng=rng)
        if best is None or found.law.bits < best.law.bits - ALIKE:
            best = found
    assert best is not None, "without a limit every frame gives a law"
    return best


def outdated(encounters: Encounters, found: PairFit, *, rng: np.random.Generator) -> NDArray[np.intp]:
    """Where contacts of a world that has changed are kept (`shorter_apart`).

    What the later law says of earlier contacts, too, isn't outdated.

    Parameters
    ----------
    encounters
        The contacts.
    found
        The law of them all.
    rng
        Source of random samples.
    """
    order = np.argsort(encounters.arrived)
    if found.explained.all() or (began := changed_at(~encounters.foreseen[order])) is None:
        return encounters.places[:0]
    early, late = (encounters.rows(part) for part in (order[:began], order[began:]))
    then, now = (fit_pair(part, rng=rng).law for part in (early, late))
    if not shorter_apart(found.law.bits, then.bits, now.bits, len(encounters)):
        return encounters.places[:0]
    return early.places[~explained_by(now, early)]


def explained_by(law: PairLaw, encounters: Encounters) -> NDArray[np.bool_]:
    """Which contacts came as a law says, whether it is doubted of their kind or not; shape ``(n,)``."""
    seen = encounters.at_points() if law.frame == POINT else encounters
    if seen is None:
        return np.zeros(len(encounters), dtype=np.bool_)
    axes, letters = axes_of(law.frame, seen.bearings, seen.free), axis_names(law.frame, len(seen.now))
    found = _inside(axes, seen)
    for k in range(len(axes)):
        examples = _axis_examples(k, letters, axes, seen)
        columns = {name: examples.x[:, j] for j, name in enumerate(examples.names)}
        for number in np.unique(seen.kinds).tolist():
            own = law.law_of(k, seen.names[number])
            says = np.full(len(seen), np.nan) if own is None else own.values(columns, examples.y)
            found &= (seen.kinds != number) | (np.abs(says - examples.y) <= examples.tolerance)
    return found


def _bits(draft: _Draft) -> float:
    return draft.bits


def _limit(drafts: Sequence[_Draft]) -> float:
    """Bits at which a further frame can't win any more, neither as it is nor by telling kinds apart."""
    known = sorted(drafts, key=_bits)
    if known and known[0].whole:
        return known[0].bits
    return known[ALTERNATIVES - 1].bits if len(known) >= ALTERNATIVES else np.inf


@dataclass(frozen=True, slots=True)
class _Draft:
    """One frame's laws as long as all kinds of contacts obey the same.

    Attributes
    ----------
    frame
        The frame.
    encounters
        The contacts as they were observed.
    axes
        The examples of each axis, and its law.
    inside
        Contacts whose change of velocity lies along the frame's axes.
    bits
        Description length.
    """

    frame: str
    encounters: Encounters
    axes: tuple[tuple[AxisExamples, KindsFit], ...]
    inside: NDArray[np.bool_]
    bits: float

    @classmethod
    def of(
        cls, frame: str, encounters: Encounters, limit: float, *, rng: np.random.Generator
    ) -> _Draft | None:
        """Learn the laws; None where the frame isn't offered, and as soon as they need as many bits as `limit`."""
        seen = encounters.at_points() if frame == POINT else encounters
        if seen is None:
            return None
        axes = axes_of(frame, seen.bearings, seen.free)
        letters = axis_names(frame, len(seen.now))
        inside = _inside(axes, seen)
        bits, known = _outside_bits(axes, seen, inside), []
        for k in range(len(axes)):
            examples = _axis_examples(k, letters, axes, seen)
            fit = fit_together(examples, seen.kinds, seen.names, rng=rng)
            known.append((examples, fit))
            bits += fit.bits
            if bits >= limit:
                return None
        return cls(frame, encounters, tuple(known), inside, bits)

    @property
    def whole(self) -> bool:
        """Whether it explains every contact."""
        return bool(self.inside.all()) and all(bool(fit.explained.all()) for _, fit in self.axes)

    def split(self, limit: float, *, rng: np.random.Generator) -> PairFit:
        """Tell kinds apart where that is shorter; in vain, it may stop at as many bits as `limit`."""
        seen, explained, laws = self.encounters, self.inside.copy(), []
        bits = self.bits
        for examples, together in self.axes:
            room = limit - bits + together.bits
            fit = fit_apart(examples, seen.kinds, seen.names, together, room, rng=rng)
            bits += fit.bits - together.bits
            explained &= fit.explained
            laws.append(fit.laws)
        found = PairFit(PairLaw(self.frame, tuple(laws), bits), explained)
        return _gripped(found, seen) if self.frame == POINT else found


def _inside(axes: list[FloatArray], encounters: Encounters) -> NDArray[np.bool_]:
    rest = encounters.after - encounters.free
    for axis in axes:
        rest = rest - dot(rest, axis) * axis
    inside: NDArray[np.bool_] = norm(rest) <= 2.0 * encounters.tolerance
    return inside


def _outside_bits(axes: list[FloatArray], encounters: Encounters, inside: NDArray[np.bool_]) -> float:
    """Each axis that the frame lacks has to be stated number by number."""
    return EXCEPTION_BITS * max(1, len(encounters.now) - len(axes)) * float((~inside).sum())


def _gripped(found: PairFit, encounters: Encounters) -> PairFit:
    """The law of the points that touch, with how much of what happens there the bodies' velocities feel."""
    points = encounters.at_points()
    assert points is not None, "the frame was offered"
    normal, told = encounters.bearings.normal, TOLD * encounters.tolerance
    felt, slid = (_across(e.after - e.free, normal) for e in (encounters, points))
    acts = found.explained & (norm(slid) > told)
    grips, explained = [], found.explained.copy()
    for k in np.unique(encounters.kinds[acts]).tolist():
        part = encounters.kinds == k
        rows = part & acts
        grip = float(np.median(dot(felt, slid)[rows] / dot(slid, slid)[rows]))
        explained &= ~part | (norm(felt - grip * slid) <= 2.0 * encounters.tolerance)
        grips.append((encounters.names[k], grip))
    constant = CONSTANT_BITS + 0.5 * float(np.log2(len(encounters)))
    bits = found.law.bits + constant * len({f"{grip:.6g}" for _, grip in grips})
    bits += EXCEPTION_BITS * float((found.explained & ~explained).sum())
    return PairFit(replace(found.law, bits=bits, grips=tuple(grips)), explained)


def _across(change: FloatArray, normal: FloatArray) -> FloatArray:
    """The part of a change across a normal."""
    return change - dot(change, normal) * normal


def _axis_examples(
    k: int, letters: tuple[str, ...], axes: list[FloatArray], encounters: Encounters
) -> AxisExamples:
    """Examples of the k-th axis: its own velocities first, then the others', then earlier axes' impulses."""
    order = [k, *(j for j in range(len(axes)) if j != k)]
    columns: dict[str, FloatArray] = {}
    for j in order:
        columns[f"u_{letters[j]}"] = dot(encounters.free, axes[j])
        columns[f"v_{letters[j]}"] = dot(encounters.now, axes[j])
    for j in range(k):
        columns[f"J_{letters[j]}"] = dot(encounters.after - encounters.free, axes[j])
    columns[ONE] = np.ones(len(encounters))
    x = np.stack(list(columns.values()), axis=1)
    return AxisExamples(
        tuple(columns), x, dot(encounters.after, axes[k]), f"u_{letters[k]}", encounters.tolerance
    )
