"""Kinds of roles, what is known of their players, and the ways to fill all roles at once (§3.5).

References
----------
G. D. Plotkin, "A note on inductive generalization", Machine Intelligence 5 (1970).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import numpy as np

from relgym.classification.examples import Bools, Example
from relgym.logic.clause import Coverage, Definition
from relgym.logic.csp import World, satisfiable

__all__ = ["Option", "Places", "RoleDescription", "RoleKind", "fillings", "stances"]

Places: TypeAlias = tuple[int, ...]
"""Object index per role, or role numbers."""

Option: TypeAlias = tuple[float, bool, int, int]
"""(score, is it typical, minus its place in the order of preference, object index) of a candidate."""


@dataclass(frozen=True, slots=True, order=True)
class RoleKind:
    """What makes two roles interchangeable: the same type and the same weights (§3.2.3).

    Parameters
    ----------
    type
        The objects' type: a unary relation of the vocabulary.
    weights
        (property, weight) pairs of the mode's function.
    """

    type: str
    weights: tuple[tuple[str, float], ...] = ()


@dataclass(slots=True)
class RoleDescription:
    """What is known of the objects that play one kind of role.

    Parameters
    ----------
    kind
        The kind.
    places
        Positions of the roles of this kind.
    definition
        ``fulfils(A, B)``: B is bound to the role for target A; none: any object of the type does.
    common
        What all players had in common (see `stances`), shape ``(2 R + U,)``; none: no player was seen.
    """

    kind: RoleKind
    places: Places
    definition: Definition | None = None
    common: Bools | None = None

    def witness(self, players: Bools) -> bool:
        """Take in how some players stood, shape ``(n, 2 R + U)``; whether less is common to all than before."""
        before, shared = self.common, np.logical_and.reduce(players, axis=0)
        self.common = shared if before is None else before & shared
        return before is None or bool((before & ~shared).any())

    def typical(self, stance: Bools) -> Bools:
        """Which objects have all that players had in common: shape ``(K, 2 R + U)`` → ``(K,)``.

        The least general description (Plotkin 1970) of players alone, whereas `definition` is the most general one
        that keeps the others out. It says what is plausible where others of their type were never seen.
        """
        if self.common is None:
            return np.zeros(len(stance), dtype=np.bool_)
        typical: Bools = np.logical_and.reduce(stance[:, self.common], axis=1)
        return typical

    def score(self, world: World, target: int, candidate: int) -> float | None:
        """Log-odds that a candidate is bound to the role; none if no clause covers it."""
        if self.definition is None:
            return 0.0
        for clause, coverage in zip(self.definition.clauses, self.definition.coverage, strict=True):
            if satisfiable(clause, world, (target, candidate)):
                return _log_odds(coverage)
        missed = self.definition.uncovered
        # Only a description that missed some of its own objects leaves room for others.
        return _log_odds(missed) if missed.positives > 0 else None

    def holds(self, world: World, target: int, candidate: int) -> bool:
        """Whether some clause covers a candidate; true without a definition."""
        if self.definition is None:
            return True
        return any(satisfiable(clause, world, (target, candidate)) for clause in self.definition.clauses)

    def __str__(self) -> str:
        rule = f"any {self.kind.type}" if self.definition is None else str(self.definition)
        return f"{self.kind.type}: {rule}"


def stances(example: Example) -> Bools:
    """How each object stands to the target and the target to it, and what it is: shape ``(K, 2 R + U)``."""
    towards, back = example.table[:, :, example.target], example.table[:, example.target]
    return np.concatenate([towards, back, example.unary]).T


def fillings(
    descriptions: Sequence[RoleDescription],
    options: Sequence[Sequence[Option]],
    taken: frozenset[int],
) -> Iterator[tuple[tuple[float, int], list[tuple[int, int]]]]:
    """All ways to fill all roles without using an object twice.

    Yields
    ------
    ((score, number of typical players), [(role, object), ...])
    """
    if not descriptions:
        yield (0.0, 0), []
        return
    free = [option for option in options[0] if option[3] not in taken]
    for chosen in combinations(free, len(descriptions[0].places)):
        players = [each for *_, each in sorted(chosen, key=lambda option: -option[2])]
        mine = list(zip(descriptions[0].places, players, strict=True))
        score, typical = sum(option[0] for option in chosen), sum(option[1] for option in chosen)
        for (rest, more), others in fillings(descriptions[1:], options[1:], taken | set(players)):
            yield (score + rest, typical + more), mine + others


def _log_odds(coverage: Coverage) -> float:
    return math.log((coverage.positives + 1.0) / (coverage.negatives + 1.0))
