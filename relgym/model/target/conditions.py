"""Predicted values as conditions: what classifiers see of the next values that a target is given.

A wall is ``x + v' <= -1.2``, not a threshold on x: preconditions must be able to test what is predicted (§1.2.3 has
actions and states only). A target that is given others' next values may test them, named with a prime; a target that
others follow (``x' = x + k v'``) may test where they would get to if a mode held (`Vocabulary.follows`).

What a step is worth, and whether it ends the episode, depends on what was as well as on what came of it: a truck that
stops has moved before (``truck.vx > 0``). No object is part of the task, so that its classifiers are shown no body's
present values otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import Vocabulary
from relgym.clustering.columns import PRIME, SlotSignature
from relgym.clustering.mode import Mode
from relgym.scene.objects import TASK, Target
from relgym.scene.schema import SceneSchema

__all__ = ["Conditions", "needed"]


class Conditions:
    """Next values that a target's clauses may test.

    Parameters
    ----------
    schema
        The scenes' schema.
    target
        Its `given` pairs count where they belong to the target's own object or to a bodiless one, of which there is
        one only; for reward and termination, of which no object is part, all count, and of bodies the present values,
        too.

    Attributes
    ----------
    pairs
        Those pairs.
    columns
        (type, column) of every value, next ones with a prime.
    """

    def __init__(self, schema: SceneSchema, target: Target) -> None:
        own, alone = target.type, {t.name for t in schema.types if not t.has_body}
        self.pairs = tuple(p for p in target.given if own == TASK or p[0] == own or p[0] in alone)
        present = tuple(p for p in self.pairs if own == TASK and p[0] not in alone)
        self.columns = (*((t, p + PRIME) for t, p in self.pairs), *present)
        self._own, self._property = own, target.property
        self._places: dict[int, NDArray[np.intp]] = {}

    def __getstate__(self) -> dict[str, object]:
        return self.__dict__ | {"_places": {}}  # keyed by identity, which a copy doesn't share

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values, as clauses print them."""
        return tuple(column if name == self._own else f"{name}.{column}" for name, column in self.columns)

    def keep(self, names: Collection[str]) -> None:
        """Show of present values only those of these names: classifiers of an older file were taught without."""
        shown = zip(self.columns, self.names, strict=True)
        self.columns = tuple(c for c, name in shown if name in names or name.endswith(PRIME))
        self._places.clear()

    def vocabulary(self, base: Vocabulary, follows: tuple[tuple[str, float], ...]) -> Vocabulary:
        """The vocabulary with the values as further own features, and what it needs to know of the target."""
        known = tuple(pair for pair in follows if pair[0] in base.own)
        present = self._property if self._property in base.own else ""
        return replace(base, own=base.own + self.names, follows=known, present=present)

    def values(self, signature: SlotSignature, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values on regression rows ``(n, d)``, shape ``(n, len(columns))``; NaN where an object is missing."""
        if not self.columns:
            return np.empty((len(x), 0))
        places = self._places.get(id(signature))
        if places is None:
            places = self._places[id(signature)] = np.array(self.places(signature), dtype=np.intp)
        found: NDArray[np.float64] = np.where(places >= 0, x[:, places], np.nan)
        return found

    def places(self, signature: SlotSignature) -> list[int]:
        """Where each value stands in a signature's rows; -1 where no object, or none alone of its type, has it."""
        return [self._place(signature, *column) for column in self.columns]

    def _place(self, signature: SlotSignature, name: str, column: str) -> int:
        slots = (0,) if name == self._own else signature.slots_by_type.get(name, ())
        if len(slots) != 1 or not signature.has(slots[0], column):
            return -1
        return signature.column(slots[0], column)


def needed(
    target: Target, modes: Iterable[Mode], classifiers: Iterable[BinaryClassifier]
) -> frozenset[tuple[str, str]]:
    """Those of a target's given pairs whose next values a mode's function reads or a clause or tree tests."""
    if not target.given:
        return frozenset()
    names = {name for mode in modes for role in mode.roles for name, _ in role.terms}
    for c in classifiers:
        names |= {literal.relation for clause in c.definition.clauses for literal in clause}
        trees = [tree for tree in (*c.clause_trees, c.fall_through_tree) if tree is not None]
        names |= {tree.columns[k] for tree in trees for k in tree.column if k >= 0}
    words = {word for name in names for word in re.findall(r"[\w.]+'", name)}
    bare = {word.rpartition(".")[2] for word in words}
    return frozenset(pair for pair in target.given if pair[1] + PRIME in bare)
