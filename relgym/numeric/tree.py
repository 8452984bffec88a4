"""Binary decision trees over real-valued features, learned from weighted examples (§3.4.4).

Splits minimise the weighted entropy; thresholds lie midway between two neighbouring *distinct* values, so
that a cut beside a run of identical values (a velocity of exactly 0) is never missed. Trees are pruned by
description length, because held-out estimates mislead an online learner whose data come from a narrow part of
the space (§3.4.4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.config.classification import ClassificationConfig
from relgym.config.constants import CACHED, CALL, ROUNDED
from relgym.errors import ConfigError
from relgym.scheduling.work import Steps, resumable

__all__ = ["DecisionTree", "learn_tree"]

_DEFAULT = ClassificationConfig()

_Float1D: TypeAlias = NDArray[np.float64]
_Float2D: TypeAlias = NDArray[np.float64]
_Weights: TypeAlias = NDArray[np.float64] | NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class DecisionTree:
    """A learned tree, stored as parallel tuples in preorder (node 0 is the root).

    An example goes *below* where ``x[column] <= threshold``, else *above*; an undefined value (NaN) goes
    above.

    Parameters
    ----------
    columns
        Names of the features; their number is the width of an example.
    column
        Feature tested by each node; -1 in a leaf.
    threshold
        Its threshold; 0 in a leaf.
    below, above
        The nodes that follow; the node itself in a leaf.
    positive, negative
        Weight of the training examples that reached each node.
    """

    columns: tuple[str, ...]
    column: tuple[int, ...]
    threshold: tuple[float, ...]
    below: tuple[int, ...]
    above: tuple[int, ...]
    positive: tuple[float, ...]
    negative: tuple[float, ...]

    def leaf_one(self, x: Sequence[float]) -> int:
        """Node number of the leaf that one example of shape ``(len(columns),)`` reaches."""
        column, threshold, node = self.column, self.threshold, 0
        while column[node] >= 0:
            node = self.below[node] if x[column[node]] <= threshold[node] else self.above[node]
        return node

    def leaf_batch(self, x: _Float2D) -> NDArray[np.intp]:
        """Leaves of all rows of `x`, shape ``(n, len(columns))``; equal to `leaf_one` of each."""
        node = np.zeros(len(x), dtype=np.intp)
        column = np.array(self.column, dtype=np.intp)
        threshold, below, above = np.array(self.threshold), np.array(self.below), np.array(self.above)
        moving = np.flatnonzero(column[node] >= 0)
        while len(moving):
            at = node[moving]
            down = x[moving, column[at]] <= threshold[at]
            node[moving] = np.where(down, below[at], above[at])
            moving = moving[column[node[moving]] >= 0]
        return node

    def says_yes(self, leaf: int) -> bool:
        """Whether most of the training weight in a leaf was positive; a tie is no."""
        return self.positive[leaf] > self.negative[leaf]

    def predict_one(self, x: Sequence[float]) -> bool:
        """Class of one example."""
        return self.says_yes(self.leaf_one(x))

    def predict_batch(self, x: _Float2D) -> NDArray[np.bool_]:
        """Classes of all rows of `x`."""
        yes = np.array(self.positive) > np.array(self.negative)
        return yes[self.leaf_batch(x)]

    @property
    def leaves(self) -> tuple[int, ...]:
        """Node numbers of the leaves, from low to high."""
        return tuple(node for node, column in enumerate(self.column) if column < 0)

    def path(self, leaf: int) -> str:
        """The tests that lead to a leaf, of each feature the closest: ``vx <= 0.5 ∧ vy > 1``; ``always`` if none."""
        tests: list[tuple[int, str, float]] = []
        node = leaf
        while node > 0:
            parent = next(p for p in range(node) if node in (self.below[p], self.above[p]))
            op = "<=" if self.below[parent] == node else ">"
            tests.append((self.column[parent], op, self.threshold[parent]))
            node = parent
        # A test further down is closer, or it wouldn't part what came down to it.
        closest = {(column, op): threshold for column, op, threshold in reversed(tests)}
        told = (f"{self.columns[column]} {op} {threshold:.6g}" for (column, op), threshold in closest.items())
        return " ∧ ".join(told) or "always"

    def rules(self) -> tuple[str, ...]:
        """One readable line per leaf, tests first: ``vy <= 0.25 -> yes (12 : 0)``."""
        answers = (self._answer(leaf) for leaf in self.leaves)
        return tuple(
            f"{self.path(leaf)} -> {answer}" for leaf, answer in zip(self.leaves, answers, strict=True)
        )

    def _answer(self, leaf: int) -> str:
        word = "yes" if self.says_yes(leaf) else "no"
        return f"{word} ({self.positive[leaf]:g} : {self.negative[leaf]:g})"

    def __str__(self) -> str:
        return "\n".join(self.rules())

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON-able dictionary; `from_dict` restores an equal tree."""
        return {name: list(getattr(self, name)) for name in self.__slots__}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> DecisionTree:
        """Tree from `to_dict`."""
        return cls(**{name: tuple(data[name]) for name in cls.__slots__})


@resumable
def learn_tree(
    x: _Float2D,
    positive: NDArray[np.bool_],
    *,
    weights: _Float1D | None = None,
    columns: Sequence[str] | None = None,
    min_leaf: int = _DEFAULT.tree_min_leaf,
    max_depth: int = _DEFAULT.tree_max_depth,
    prune: bool = True,
) -> Steps[DecisionTree]:
    """Learn a tree that tells positive from negative examples.

    Parameters
    ----------
    x
        Features, shape ``(n, d)``; NaN where undefined.
    positive
        Class of each example, shape ``(n,)``.
    weights
        How many examples each row stands for, shape ``(n,)``; default 1 each.
    columns
        Names of the features; default ``x0, x1, ...``.
    min_leaf
        Fewest rows on either side of a split.
    max_depth
        Most tests between root and leaf.
    prune
        Whether splits that cost more bits than they save are undone.

    Raises
    ------
    ConfigError
        The arrays' lengths differ.

    Notes
    -----
    Cost: O(depth · d · n log n). Equal entropies are settled by the wider gap relative to the feature's
    range, then by the earlier column.
    """
    x = np.asarray(x, dtype=np.float64)
    weights = np.ones(len(x)) if weights is None else np.asarray(weights, dtype=np.float64)
    names = tuple(columns) if columns is not None else tuple(f"x{i}" for i in range(x.shape[1]))
    if not len(x) == len(positive) == len(weights) or len(names) != x.shape[1]:
        raise ConfigError(
            "a tree needs as many classes and weights as rows and a name per column; "
            f"got x of shape {x.shape}, {len(positive)} classes, {len(weights)} weights, {len(names)} names"
        )
    # Few, so that what is looked up is soon there, and differences of sums are exact to far less than `ROUNDED`.
    whole = weights.sum() <= CACHED and np.array_equal(weights, weights.astype(np.intp))
    grower = _Grower(
        np.ascontiguousarray(x.T),
        np.asarray(positive, dtype=np.bool_),
        weights.astype(np.intp) if whole else weights,
        min_leaf,
        max_depth,
    )
    root = yield from grower.grow(np.arange(len(x)), grower.order(), 0)
    if prune:
        root, _ = _pruned(root, x.shape[1])
    nodes: list[_Node] = []
    links: list[tuple[int, int]] = []
    _flatten(root, nodes, links)
    return DecisionTree(
        names,
        tuple(node.column for node in nodes),
        tuple(node.threshold for node in nodes),
        tuple(below for below, _ in links),
        tuple(above for _, above in links),
        tuple(node.positive for node in nodes),
        tuple(node.negative for node in nodes),
    )


@dataclass(slots=True)
class _Node:
    positive: float
    negative: float
    column: int = -1  # none: a leaf
    threshold: float = 0.0
    cuts: int = 0  # how many cuts there were to choose from
    children: tuple[_Node, _Node] | None = None


@dataclass(frozen=True, slots=True)
class _Grower:
    x: _Float2D  # by column, of shape (d, n)
    positive: NDArray[np.bool_]
    weights: _Weights  # whole numbers where all are, if few
    min_leaf: int
    max_depth: int

    def order(self) -> NDArray[np.intp]:
        """All rows by value, of each column. NaN last: undefined values lie above every cut."""
        return np.argsort(self.x, axis=1, kind="stable")

    def grow(self, rows: NDArray[np.intp], order: NDArray[np.intp], depth: int) -> Steps[_Node]:
        """The tree of some rows, which are in `order` by value of each column: sorted once, and parted at each node."""
        weights, classes = self.weights[rows], self.positive[rows]
        node = _Node(float(weights[classes].sum()), float(weights[~classes].sum()))
        if depth == self.max_depth or not (classes.any() and not classes.all()):
            return node
        best, node.cuts = self._best_split(order)
        # Each column is gone through, and summed up on either side of all cuts.
        yield len(self.x) * (CALL + 2 * len(rows) * len(rows).bit_length())
        if best is None:
            return node
        _, _, node.column, node.threshold = best
        below = self.x[node.column] <= node.threshold
        children = []
        for side in (below, ~below):
            part = rows[side[rows]]
            children.append(
                (yield from self.grow(part, order[side[order]].reshape(len(order), -1), depth + 1))
            )
        node.children = children[0], children[1]
        return node

    def _best_split(self, order: NDArray[np.intp]) -> tuple[tuple[float, float, int, float] | None, int]:
        """(entropy, -relative gap, column, threshold) of the best split, and how many cuts were tried."""
        best: tuple[float, float, int, float] | None = None
        cuts, width = 0, max(1, CACHED // order.shape[1])
        for first in range(0, len(order), width):
            columns = slice(first, first + width)
            values = np.take_along_axis(self.x[columns], order[columns], axis=1)
            may = self._may(values)
            cuts += int(np.count_nonzero(may))
            entropies = np.where(may, self._entropies(order[columns]), np.inf)
            least = entropies.min(axis=1, initial=np.inf)
            leading = least <= np.minimum.accumulate(least) + ROUNDED
            for k in np.flatnonzero(leading & np.isfinite(least)).tolist():
                if best is not None and least[k] > best[0] + ROUNDED:
                    continue
                near = np.flatnonzero(entropies[k] <= least[k] + ROUNDED)
                gaps, thresholds = _gaps(values[k], near)
                pick = int(np.argmax(gaps))
                entropy, gap = float(entropies[k, near[pick]]), float(gaps[pick])
                closer = best is None or entropy < best[0] - ROUNDED
                if closer or (best is not None and entropy <= best[0] + ROUNDED and -gap < best[1]):
                    best = entropy, -gap, first + k, float(thresholds[pick])
        return best, cuts

    def _may(self, values: _Float2D) -> NDArray[np.bool_]:
        """Between which neighbours of sorted values, of shape ``(d, n)``, there may be a cut."""
        n = values.shape[1]
        place = np.arange(n - 1)
        finite = np.isfinite(values).sum(axis=1, keepdims=True)
        with np.errstate(invalid="ignore"):  # what isn't finite is cut off below
            known = np.where(np.arange(n) < finite, np.abs(values), 0.0)
            may: NDArray[np.bool_] = np.diff(values, axis=1) > ROUNDED * known.max(axis=1, keepdims=True)
        may &= (place >= self.min_leaf - 1) & (place < n - self.min_leaf)
        if (finite < n).any():
            may &= place < finite - 1
            # "Is it defined at all?"
            some = (finite > 0) & (finite < n) & (finite >= self.min_leaf) & (n - finite >= self.min_leaf)
            may |= some & (place == finite - 1)
        return may

    def _entropies(self, order: NDArray[np.intp]) -> _Float2D:
        """Total entropy in bits after a cut between any neighbours of sorted rows, of shape ``(d, n)``."""
        hit = np.cumsum(np.where(self.positive, self.weights, 0)[order], axis=1)
        if self.weights.min() == self.weights.max() == 1:
            weight = np.arange(1, order.shape[1] + 1)[None]
        else:
            weight = np.cumsum(self.weights[order], axis=1)
        if weight.dtype == hit.dtype == np.intp:
            left: _Float2D = _both(weight) - _both(hit) - _both(weight - hit)
            return left
        below, above, some = weight[:, :-1], weight[:, -1:] - weight[:, :-1], hit[:, :-1]
        return _entropy(some, below - some) + _entropy(hit[:, -1:] - some, above - (hit[:, -1:] - some))


def _both(weight: NDArray[np.intp]) -> _Float2D:
    """Sum of w log2 w of the weights on either side of all cuts, looked up, by cumulative sums of shape ``(d, n)``."""
    known = np.arange(int(weight[:, -1].max()) + 1.0)
    known *= np.log2(np.maximum(known, 1.0))
    both: _Float2D = known[weight[:, :-1]] + known[weight[:, -1:] - weight[:, :-1]]
    return both


def _entropy(positive: NDArray[np.float64], negative: NDArray[np.float64]) -> NDArray[np.float64]:
    """Total entropy in bits of groups with these weights: sum of ``-w log2(share)``, which large weights don't blur."""
    total = np.maximum(positive + negative, float(np.finfo(np.float64).tiny))
    parts = [np.maximum(part, 0.0) for part in (positive, negative)]
    bits = [-part * np.log2(np.where(part > 0, part / total, 1.0)) for part in parts]
    total_bits: NDArray[np.float64] = bits[0] + bits[1]
    return total_bits


def _gaps(values: _Float1D, near: NDArray[np.intp]) -> tuple[_Float1D, _Float1D]:
    """Of cuts behind these places of a sorted column: gaps relative to its range, and thresholds."""
    finite = int(np.isfinite(values).sum())
    lower, higher = values[near], values[near + 1]
    upper = np.where(near + 1 < finite, higher, lower)
    with np.errstate(invalid="ignore"):  # a value may be infinite
        span = float(values[max(finite - 1, 0)] - values[0])
        middle = lower + (upper - lower) / 2
        gaps = (upper - lower) / (span or 1.0)
    # Rounding must not move the midpoint onto the upper value, or the test would change sides.
    return gaps, np.where(middle < upper, middle, lower)


def _pruned(node: _Node, columns: int) -> tuple[_Node, float]:
    """The cheapest pruning of a subtree and its description length in bits (Quinlan and Rivest, 1989)."""
    leaf_bits = 1.0 + _exception_bits(node.positive, node.negative)
    if node.children is None:
        return node, leaf_bits
    below, below_bits = _pruned(node.children[0], columns)
    above, above_bits = _pruned(node.children[1], columns)
    split_bits = 1.0 + math.log2(max(node.cuts, columns, 1)) + below_bits + above_bits
    if leaf_bits <= split_bits:
        return _Node(node.positive, node.negative), leaf_bits
    node.children = below, above
    return node, split_bits


def _exception_bits(positive: float, negative: float) -> float:
    """Bits that name the exceptions among all examples of a leaf: their number, then which ones."""
    total, few = positive + negative, min(positive, negative)
    choose = math.lgamma(total + 1) - math.lgamma(few + 1) - math.lgamma(total - few + 1)
    return math.log2(total / 2 + 1) + choose / math.log(2)


def _flatten(node: _Node, nodes: list[_Node], links: list[tuple[int, int]]) -> int:
    at = len(nodes)
    nodes.append(node)
    links.append((at, at))
    if node.children is not None:
        below = _flatten(node.children[0], nodes, links)
        links[at] = below, _flatten(node.children[1], nodes, links)
    return at
