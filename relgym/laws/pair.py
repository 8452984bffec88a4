"""The law of touching pairs: learned in every frame, stated in the one that needs fewest bits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relgym.laws.description import CONSTANT_BITS, EXCEPTION_BITS
from relgym.laws.frames import FRAMES, POINT, Bearings, axes_of, axis_names, turned
from relgym.laws.pieces import AxisExamples
from relgym.laws.records import ONE, AxisLaw, Kind, Operator, PairLaw, Piece
from relgym.laws.selection import AxisFit, fit_axis, refitted
from relgym.scene.geometry.vectors import FloatArray, dot, norm

__all__ = ["Encounters", "PairFit", "fit_pair"]

JOINS = 0.98
"""A kind of contact obeys a law of other kinds if that explains at least this share of its examples."""


TOLD = 100.0
"""A change of more than this many tolerances tells how bodies divide it."""


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
    rims: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.kinds)

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
    d = len(encounters.now)
    best: PairFit | None = None
    for frame in frames:
        if frame == "turned" and d != 2:
            continue
        limit = np.inf if best is None else best.law.bits
        fit = _fit_points if frame == POINT else _fit_frame
        found = fit(frame, encounters, limit, rng=rng)
        if found is not None and (best is None or found.law.bits < best.law.bits - 1e-6):
            best = found
    assert best is not None, "without a limit every frame gives a law"
    return best


def _fit_frame(
    frame: str, encounters: Encounters, limit: float, *, rng: np.random.Generator
) -> PairFit | None:
    """The law in one frame, or None as soon as it needs as many bits as `limit`."""
    axes = axes_of(frame, encounters.bearings, encounters.free)
    letters = axis_names(frame, len(encounters.now))
    laws: list[tuple[AxisLaw, ...]] = []
    rest = encounters.after - encounters.free
    for axis in axes:
        rest = rest - dot(rest, axis) * axis
    explained = norm(rest) <= 2.0 * encounters.tolerance
    # Each axis that the frame lacks, and each that its law misses, has to be stated number by number.
    bits = EXCEPTION_BITS * max(1, len(encounters.now) - len(axes)) * float((~explained).sum())
    for k in range(len(axes)):
        examples = _axis_examples(k, letters, axes, encounters)
        found, fits = _fit_kinds(examples, encounters, limit - bits, rng=rng)
        laws.append(found)
        explained &= fits
        bits += sum(law.bits for law in found)
        if bits >= limit:
            return None
    return PairFit(PairLaw(frame, tuple(laws), bits), explained)


def _fit_points(
    frame: str, encounters: Encounters, limit: float, *, rng: np.random.Generator
) -> PairFit | None:
    """The law of the points that touch, and how much of it the bodies' velocities feel."""
    points = encounters.at_points()
    found = None if points is None else _fit_frame(frame, points, limit, rng=rng)
    if points is None or found is None:
        return None
    normal, told = encounters.bearings.normal, TOLD * encounters.tolerance
    change, whole = (e.after - e.free for e in (encounters, points))
    felt, slid = (c - dot(c, normal) * normal for c in (change, whole))
    acts = found.explained & (norm(slid) > told)
    grips, explained, bits = [], found.explained.copy(), found.law.bits
    for k in np.unique(encounters.kinds).tolist():
        part = encounters.kinds == k
        if not (part & acts).any():
            continue
        rows = part & acts
        grip = float(np.median(dot(felt, slid)[rows] / dot(slid, slid)[rows]))
        left = norm(felt - grip * slid)
        explained &= ~part | (left <= 2.0 * encounters.tolerance)
        grips.append((encounters.names[k], grip))
    bits += EXCEPTION_BITS * float((found.explained & ~explained).sum())
    bits += (CONSTANT_BITS + 0.5 * float(np.log2(len(encounters)))) * len({f"{g:.6g}" for _, g in grips})
    return PairFit(replace(found.law, bits=bits, grips=tuple(grips)), explained)


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


def _fit_kinds(
    examples: AxisExamples, encounters: Encounters, limit: float, *, rng: np.random.Generator
) -> tuple[tuple[AxisLaw, ...], NDArray[np.bool_]]:
    """One law for all kinds of contacts, or several where that is shorter: materials differ.

    Several are given up as soon as they need as many bits as `limit`.
    """
    present = np.unique(encounters.kinds)
    whole = fit_axis(examples, rng=rng)
    everyone = tuple(encounters.names[k] for k in present)
    pooled = _law(whole, everyone, examples)
    if whole.explained.all() or len(present) == 1:
        return (pooled,), whole.explained
    groups = _alike(examples, _groups(examples, encounters.kinds, present, limit, rng=rng))
    if len(groups) < 2:
        return (pooled,), whole.explained
    explained = np.zeros(len(examples), dtype=bool)
    laws = []
    for fit, members, rows in groups:
        explained[rows] = fit.explained
        laws.append(_law(fit, tuple(encounters.names[k] for k in members), examples.rows(rows)))
    naming = float(len(present) * np.log2(len(groups)))
    if sum(law.bits for law in laws) + naming >= pooled.bits:
        return (pooled,), whole.explained
    return tuple(laws), explained


def _groups(
    examples: AxisExamples,
    kinds: NDArray[np.intp],
    present: NDArray[np.intp],
    limit: float,
    *,
    rng: np.random.Generator,
) -> list[tuple[AxisFit, list[int], NDArray[np.intp]]]:
    """Kinds that share a law: the fit, the kinds and their rows, the most frequent kinds first.

    None at all as soon as they need as many bits as `limit`.
    """
    groups: list[tuple[AxisFit, list[int], NDArray[np.intp]]] = []
    for kind in sorted(present.tolist(), key=lambda k: (-int((kinds == k).sum()), k)):
        rows = np.flatnonzero(kinds == kind)
        for g, (fit, members, theirs) in enumerate(groups):
            # Separate fits know different pieces: the larger group's form is tried on both together.
            both = np.concatenate([theirs, rows])
            joint = refitted(examples.rows(both), fit.operator, fit.pieces)
            if joint.explained[len(theirs) :].mean() >= JOINS:
                groups[g] = (joint, [*members, kind], both)
                break
        else:
            groups.append((fit_axis(examples.rows(rows), rng=rng), [kind], rows))
            if sum(fit.bits for fit, _, _ in groups) >= limit:
                return []
    return groups


def _alike(
    examples: AxisExamples, groups: list[tuple[AxisFit, list[int], NDArray[np.intp]]]
) -> list[tuple[AxisFit, list[int], NDArray[np.intp]]]:
    """Decide ties by analogy: a form that a law without rivals has needs to be stated only once."""
    settled = {_form(fit.operator, fit.pieces) for fit, _, _ in groups if not fit.rivals}
    result = []
    for fit, members, rows in groups:
        every = [(fit.operator, fit.pieces), *fit.rivals]
        familiar = [each for each in every if _form(*each) in settled]
        if fit.rivals and len(familiar) == 1:
            fit = refitted(examples.rows(rows), *familiar[0])
        result.append((fit, members, rows))
    return result


def _form(operator: Operator, pieces: tuple[Piece, ...]) -> tuple[Operator, tuple[tuple[str, ...], ...]]:
    """A law without its numbers."""
    return operator, tuple(sorted(tuple(name for name, _ in piece.terms) for piece in pieces))


def _law(fit: AxisFit, kinds: tuple[Kind, ...], examples: AxisExamples) -> AxisLaw:
    # Sides of 0 on which no velocity was ever seen: what ends there would be outside experience.
    signs = (bool((examples.y < -examples.tolerance).any()), bool((examples.y > examples.tolerance).any()))
    unexplained = int((~fit.explained).sum())
    return AxisLaw(fit.pieces, fit.operator, kinds, fit.rivals, signs, len(examples), unexplained, fit.bits)
