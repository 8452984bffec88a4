"""Role classifiers (§3.5): which object plays which role of a mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.mode import Role
from relgym.scene.objects import SceneLayout
from relgym.thesis.facts import Facts
from relgym.thesis.foil import Clause, holds, learn_clauses
from relgym.thesis.settings import ThesisSettings

__all__ = ["RoleRule", "assign", "learn_role"]

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class RoleRule:
    """What must hold of an object B bound to a role beside the target A; no clauses: any object of the type does."""

    role: Role
    clauses: tuple[Clause, ...]

    def __str__(self) -> str:
        return " | ".join(map(str, self.clauses))

    def fits(self, facts: Facts, state: int, target: int, number: int) -> bool:
        """Whether an object may play it, by its number in a state."""
        if not self.clauses:
            return True
        one = facts.of(np.array([state]), np.array([[target, number]]))
        return any(bool(holds(clause, one)[0]) for clause in self.clauses)


def learn_role(
    role: Role,
    facts: Facts,
    played: Sequence[tuple[int, int, int, bool]],
    settings: ThesisSettings,
    rng: np.random.Generator,
) -> RoleRule:
    """Learn what objects that are bound to a role have in common, and others of their type have not.

    Parameters
    ----------
    role
        The role.
    facts
        Relational states, with all relations.
    played
        State, the target's number, an object's number, whether it played the role; once for each example and object.
    settings, rng
        As for mode classifiers.
    """
    situations, which = np.unique(
        np.array([p[:3] for p in played], dtype=np.intp), axis=0, return_inverse=True
    )
    yes = np.array([p[3] for p in played], dtype=np.bool_)
    counts = [np.bincount(which.reshape(-1)[part], minlength=len(situations)) for part in (yes, ~yes)]
    if not counts[1].any():
        return RoleRule(role, ())
    seen = facts.of(situations[:, 0], situations[:, 1:])
    clauses = learn_clauses(seen, counts[0], counts[1], settings, rng)
    return RoleRule(role, tuple(clause for clause, _, _ in clauses))


def assign(
    rules: Sequence[RoleRule],
    layout: SceneLayout,
    facts: Facts,
    state: int,
    objects: Rows,
    target: int,
) -> tuple[int, ...] | None:
    """Fill a mode's roles one after the other; none if a role stays open (§3.5).

    Parameters
    ----------
    rules
        Of all roles but the target's.
    layout
        The scene's.
    facts, state, objects
        Its relational state, and the object behind each number in it, -1 for none.
    target
        The target object.

    Returns
    -------
    The objects, the target first.
    """
    taken = [target]
    place = {int(i): k for k, i in enumerate(objects.tolist()) if i >= 0}
    for rule in rules:
        free = [i for i in layout.of_type(rule.role.type) if i not in taken]
        if len(free) > 1 and rule.clauses:
            free = [i for i in free if rule.fits(facts, state, place[target], place[i])]
        if not free:
            return None
        taken.append(free[0])
    return tuple(taken)
