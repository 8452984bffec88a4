"""Where modes are used for prediction, and the largest changes that approximations may predict.

Examples that no mode explains, or comes close to, lie together more often than not: a lander's law of flight doesn't
hold when its legs touch, let alone in a crash; an end that was seen nine times has no mode yet, and the modes of other
ends would predict their rewards for it. A decision tree over the target's own numbers and the action's (§3.4.4), of
reward and termination over next values too, tells where; there modes aren't used: the outcome is `UNEXPLAINED`, and the
value a guess (`relgym.model.target.guess`). And since no law says how far approximations and guesses go, they never go
far beyond the changes that were seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.clusterer import ModeClusterer
from relgym.clustering.columns import PRIME, SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE
from relgym.config.constants import BEYOND, FEWEST, MOST_ROWS
from relgym.numeric.tree import DecisionTree, learn_tree
from relgym.scene.objects import TASK, Target

__all__ = ["EVERYWHERE", "Scope", "alike", "find_scope", "spread_out"]


@dataclass(frozen=True, slots=True)
class Scope:
    """Where modes of a target are used, and how large a change may be.

    Attributes
    ----------
    tree
        Says yes where some mode explains what follows, or comes close to it; None: everywhere.
    least, most
        Smallest and largest change that approximations and guesses may predict, in units of the target.
    """

    tree: DecisionTree | None = None
    least: float = -np.inf
    most: float = np.inf
    _places: dict[int, tuple[SlotSignature, tuple[int, ...] | None]] = field(
        default_factory=dict, compare=False, repr=False
    )

    def covers_one(self, x: Sequence[float], signature: SlotSignature) -> bool:
        """Whether modes are used for one row; they are where a number that the tree tests is missing."""
        if self.tree is None or (places := self.places(signature)) is None:
            return True
        return self.tree.predict_one([x[k] for k in places])

    def covers(self, x: NDArray[np.float64], signature: SlotSignature) -> NDArray[np.bool_]:
        """Whether modes are used for rows ``(n, d)``, shape ``(n,)``; equal to `covers_one` of each."""
        if self.tree is None or (places := self.places(signature)) is None:
            return np.ones(len(x), dtype=np.bool_)
        return self.tree.predict_batch(x[:, list(places)])

    def places(self, signature: SlotSignature) -> tuple[int, ...] | None:
        """Columns of a signature's rows that the tree looks at, by name; None where one that it tests is missing.

        Bodiless objects come and go: the same number stands in one column today, in another one tomorrow.
        """
        known = self._places.get(id(signature))
        if known is None or known[0] is not signature:
            known = self._places[id(signature)] = (signature, self._found(signature))
        return known[1]

    def _found(self, signature: SlotSignature) -> tuple[int, ...] | None:
        assert self.tree is not None, "asked only where there is a tree"
        there = {signature.named(k): k for k in range(signature.core)}
        if any(k >= 0 and self.tree.columns[k] not in there for k in self.tree.column):
            return None
        return tuple(there.get(name, 0) for name in self.tree.columns)  # what it doesn't test doesn't matter

    def within(
        self, values: NDArray[np.float64], signature: SlotSignature, x: NDArray[np.float64], target: Target
    ) -> NDArray[np.float64]:
        """Values predicted of rows ``(n, d)``, none further from the present ones than is allowed; NaN stays."""
        present = signature.present(x, target)
        found: NDArray[np.float64] = np.clip(values, present + self.least, present + self.most)
        return found

    def beyond(self) -> tuple[str, ...]:
        """Tests of the places where modes aren't used: ``py <= 0.1 ∧ left > 0.5``."""
        if self.tree is None:
            return ()
        return tuple(self.tree.path(leaf) for leaf in self.tree.leaves if not self.tree.says_yes(leaf))

    def place(self, x: Sequence[float], signature: SlotSignature) -> str:
        """The tree's tests that one row passes; empty without a tree, or where it can't be asked."""
        if self.tree is None or (places := self.places(signature)) is None:
            return ""
        return self.tree.path(self.tree.leaf_one([x[k] for k in places]))

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        tree = None if self.tree is None else self.tree.to_dict()
        reach = [self.least, self.most] if np.isfinite([self.least, self.most]).all() else None
        return {"tree": tree, "reach": reach}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Scope:
        """Read what `to_json` wrote."""
        if not data:
            return EVERYWHERE
        tree = None if data.get("tree") is None else DecisionTree.from_dict(data["tree"])
        return cls(tree, *(data.get("reach") or ()))


EVERYWHERE: Final = Scope()
"""The scope of laws that explain everything."""


def find_scope(clusterer: ModeClusterer, table: ExampleTable, *, guessing: bool) -> Scope:
    """How far modes and guesses of a target go.

    Parameters
    ----------
    clusterer
        Modes and examples of the target, one or more.
    table
        The rows of the examples.
    guessing
        Whether a guess replaces modes that aren't used. Then modes aren't used where they err by more than half of
        what changes (root mean square); without one only where it is closer to say that nothing changes: a law that is
        off there is better than none.

    Notes
    -----
    The tree pays for its bits in examples explained, so what lies scattered has none. Cost
    O(`MOST_ROWS` * columns * depth), some 10 ms.
    """
    numbers, slots = alike(clusterer, table)
    change = clusterer.y[numbers] - slots.present_of(table.x, clusterer.rows[numbers], clusterer.target)
    least, most = float(change.min()), float(change.max())
    reach = (least - BEYOND * (most - least), most + BEYOND * (most - least))
    if not clusterer.clusters or not clusterer.noise_examples:
        return Scope(None, *reach)
    some = spread_out(numbers, MOST_ROWS)
    columns = [k for k in range(slots.core) if _looked_at(slots, k, clusterer.target)]
    tree = learn_tree(
        table.x[clusterer.rows[some]][:, columns],
        ~_lost(clusterer, table, slots, some, guessing=guessing),
        columns=[slots.named(k) for k in columns],
        min_leaf=FEWEST,
    )
    if len({tree.says_yes(leaf) for leaf in tree.leaves}) == 1:
        return Scope(None, *reach)
    return Scope(tree, *reach)


def _lost(
    clusterer: ModeClusterer,
    table: ExampleTable,
    slots: SlotSignature,
    numbers: NDArray[np.intp],
    *,
    guessing: bool,
) -> NDArray[np.bool_]:
    """Which examples no mode explains or comes close to."""
    lost: NDArray[np.bool_] = clusterer.labels[numbers] == NOISE
    if not lost.any():
        return lost
    change = np.abs(
        clusterer.y[numbers] - slots.present_of(table.x, clusterer.rows[numbers], clusterer.target)
    )
    rows, y = clusterer.rows[numbers[lost]], clusterer.y[numbers[lost]]
    errors = np.min(
        [c.errors(table, rows, y, clusterer.scale)[0] for c in clusterer.clusters.values()], axis=0
    )
    lost[lost] = errors > (0.5 * float(np.sqrt(np.square(change).mean())) if guessing else change[lost])
    return lost


def _looked_at(slots: SlotSignature, index: int, target: Target) -> bool:
    """Whether the tree may look at a column: next values only of what a step is worth, a matter of where it leads."""
    column = slots.at(index)
    if not column.property.endswith(PRIME):
        return slots.types[column.slot].name != TASK
    given = (slots.types[column.slot].name, column.property.rstrip(PRIME)) in target.given
    return given and target.type == TASK


def alike(clusterer: ModeClusterer, table: ExampleTable) -> tuple[NDArray[np.intp], SlotSignature]:
    """Numbers of the examples whose own and bodiless columns are the newest one's, and its signature."""
    slots = table.signatures[int(table.signature_ids[clusterer.rows[-1]])]
    return alike_to(clusterer, table, slots), slots


def alike_to(clusterer: ModeClusterer, table: ExampleTable, slots: SlotSignature) -> NDArray[np.intp]:
    """Numbers of the examples whose own and bodiless columns are those of a signature."""
    ids = table.signature_ids[clusterer.rows]
    core = [(slots.named(k), slots.at(k).slot) for k in range(slots.core)]
    fitting = [
        k
        for k in np.unique(ids).tolist()
        if [(s.named(c), s.at(c).slot) for s in [table.signatures[k]] for c in range(s.core)] == core
    ]
    return np.flatnonzero(np.isin(ids, fitting))


def spread_out(numbers: NDArray[np.intp], most: int) -> NDArray[np.intp]:
    """At most so many of these examples, evenly spread over time."""
    if len(numbers) <= most:
        return numbers
    return numbers[np.linspace(0, len(numbers) - 1, most).astype(np.intp)]
