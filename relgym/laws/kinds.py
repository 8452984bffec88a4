"""One axis' law for all kinds of contacts, or several where that is shorter: materials differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import LEFT_OPEN
from relgym.laws.ledger import doubtful
from relgym.laws.pieces import AxisExamples
from relgym.laws.records import AxisLaw, Kind, Operator, Piece
from relgym.laws.selection import AxisFit, fit_axis, refitted

__all__ = ["KindsFit", "fit_apart", "fit_together"]


@dataclass(frozen=True, slots=True)
class KindsFit:
    """The laws of one axis, and which examples they explain."""

    laws: tuple[AxisLaw, ...]
    explained: NDArray[np.bool_]

    @property
    def bits(self) -> float:
        """Description length of all laws, what they leave unexplained included."""
        return sum(law.bits for law in self.laws)


def fit_together(
    examples: AxisExamples, kinds: NDArray[np.intp], names: Sequence[Kind], *, rng: np.random.Generator
) -> KindsFit:
    """One law for all kinds of contacts.

    Parameters
    ----------
    examples
        Examples of the axis.
    kinds, names
        Number of each example's kind, and what the kinds are.
    rng
        Source of random samples.
    """
    whole = fit_axis(examples, rng=rng)
    return KindsFit((_law(whole, examples, kinds, names),), whole.explained)


def fit_apart(
    examples: AxisExamples,
    kinds: NDArray[np.intp],
    names: Sequence[Kind],
    together: KindsFit,
    limit: float,
    *,
    rng: np.random.Generator,
) -> KindsFit:
    """Several laws, each for some kinds, if that is shorter than one for all; else that one.

    Parameters
    ----------
    examples, kinds, names
        As for `fit_together`.
    together
        The law of all kinds.
    limit
        Several laws are given up as soon as they need as many bits.
    rng
        Source of random samples.
    """
    present = np.unique(kinds)
    if together.explained.all() or len(present) == 1:
        return together
    groups = _alike(examples, _groups(examples, kinds, present, min(limit, together.bits), rng=rng))
    if len(groups) < 2:
        return together
    explained = np.zeros(len(examples), dtype=bool)
    laws = []
    for fit, _, rows in groups:
        explained[rows] = fit.explained
        laws.append(_law(fit, examples.rows(rows), kinds[rows], names, apart=True))
    apart = KindsFit(tuple(laws), explained)
    naming = float(len(present) * np.log2(len(groups)))
    return apart if apart.bits + naming < together.bits else together


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
            if joint.explained[len(theirs) :].mean() >= 1.0 - LEFT_OPEN:
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
    """Decide ties by analogy: a form that a law without alternatives has needs to be stated only once."""
    settled = {_form(fit.operator, fit.pieces) for fit, _, _ in groups if not fit.alternatives}
    result = []
    for fit, members, rows in groups:
        every = [(fit.operator, fit.pieces), *fit.alternatives]
        familiar = [each for each in every if _form(*each) in settled]
        if fit.alternatives and len(familiar) == 1:
            fit = refitted(examples.rows(rows), *familiar[0])
        result.append((fit, members, rows))
    return result


def _form(operator: Operator, pieces: tuple[Piece, ...]) -> tuple[Operator, tuple[tuple[str, ...], ...]]:
    """A law without its numbers."""
    return operator, tuple(sorted(tuple(name for name, _ in piece.terms) for piece in pieces))


def _shown(fit: AxisFit, examples: AxisExamples, acts: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """For each piece with a number of its own, the examples that it alone explains, and that a contact acts on."""
    explained = [examples.explains(piece) for piece in fit.pieces]
    alone = sum(each.astype(np.intp) for each in explained) == 1
    pairs = zip(fit.pieces, explained, strict=True)
    return [each & alone & acts & fit.explained for piece, each in pairs if piece.free_parameters()]


def _law(
    fit: AxisFit,
    examples: AxisExamples,
    kinds: NDArray[np.intp],
    names: Sequence[Kind],
    *,
    apart: bool = False,
) -> AxisLaw:
    """The law of some kinds of contacts; `apart` if others obey another one.

    Then a number that goes with the material isn't known of a kind that never showed it: what stuck so far may have a
    grip of its own.
    """
    present = np.unique(kinds).tolist()
    # Contacts that let go as they should tell nothing of what a contact does.
    free = examples.x[:, examples.names.index(examples.free)]
    acts = ~fit.explained | (np.abs(examples.y - free) > examples.tolerance)
    doubted = tuple(
        names[k]
        for k in present
        if doubtful(int((~fit.explained[kinds == k]).sum()), int((acts & (kinds == k)).sum()), LEFT_OPEN)
        or (apart and not all(shown[kinds == k].any() for shown in _shown(fit, examples, acts)))
    )
    # Sides of 0 on which no velocity was ever seen: what ends there would be outside experience.
    signs = (bool((examples.y < -examples.tolerance).any()), bool((examples.y > examples.tolerance).any()))
    excused = np.isin(kinds, [k for k in present if names[k] in doubted])
    return AxisLaw(
        fit.pieces,
        fit.operator,
        tuple(names[k] for k in present),
        fit.alternatives,
        signs,
        len(examples),
        int((~fit.explained).sum()),
        fit.bits,
        doubted,
        int((~fit.explained & excused).sum()),
    )
