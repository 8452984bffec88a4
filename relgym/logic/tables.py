"""The tuples of one learning problem, laid out for counting.

FOIL asks the same question of every candidate literal: given the bindings of the clause so far, how many are
left, and of how many tuples? All literals that fill their arguments in the same *pattern* (targets,
existential variables, a new variable) are stacked, so that numpy answers for all of them at once. The tuples
are the last axis, contiguous in memory; positives come first.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.logic.clause import ANY, Literal, Slot
from relgym.logic.facts import Bool, Facts, Int, compare
from relgym.logic.templates import Template, templates
from relgym.logic.thresholds import Bins, bin_values

__all__ = ["Defined", "NumericStack", "Stack", "Tables"]


@dataclass(frozen=True, slots=True)
class Stack:
    """All relational templates with e existential variables, sorted by name.

    `truth` has shape (F, K, …, K, n) with e axes K: for how many objects in the place of the new variables
    the relation holds, cut off at 1; `counts` has the same numbers uncut for the rows in `fresh`.
    """

    templates: tuple[Template, ...]
    truth: NDArray[np.float32]
    fresh: Int
    counts: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class NumericStack:
    """All numeric templates with e existential variables, sorted by name, and their histogram bins."""

    templates: tuple[Template, ...]
    bins: Bins
    defined: tuple[Defined, Defined]

    @staticmethod
    def of(templates: Sequence[Template], bins: Bins, split: int) -> NumericStack:
        """List the defined values of the first `split` tuples and of the others."""
        index = bins.index.reshape(len(bins.index), -1, bins.index.shape[-1])
        parts = (index[..., :split], index[..., split:])
        first, second = (Defined.of(part, bins.count) for part in parts)
        return NumericStack(tuple(templates), bins, (first, second))


@dataclass(frozen=True, slots=True)
class Defined:
    """The defined values of F functions for one class of tuples, for histograms.

    `place` is function x (B + 1) + bin, `cell` the index of the value's objects and tuple in a flat array of
    shape (K, …, K, tuples of this class).
    """

    place: Int
    cell: Int

    @staticmethod
    def of(index: NDArray[np.int16], count: int) -> Defined:
        """List the values with a bin; `index` has shape (F, M, n)."""
        function, row, column = np.nonzero(index < count)
        place = function * (count + 1) + index[function, row, column]
        return Defined(place, row * index.shape[-1] + column)


class Tables:
    """Arrays of one learning problem, built when first asked for.

    Parameters
    ----------
    facts
        The worlds.
    positives, negatives
        Integers of shape (p, 1 + arity) and (q, 1 + arity): a world, then the target's objects.
    max_new
        Most new variables that one literal may introduce.
    numeric
        Whether numeric functions are offered.
    """

    def __init__(self, facts: Facts, positives: Int, negatives: Int, max_new: int, numeric: bool) -> None:
        self.facts = facts
        self.tuples: Int = np.concatenate([positives, negatives])
        self.split = len(positives)
        self.size = len(self.tuples)
        self.arity = self.tuples.shape[1] - 1
        self.exists: Bool = np.ascontiguousarray(facts.exists[self.tuples[:, 0]].T)
        self.functions = sorted(facts.numeric) if numeric else []
        self._max_new = max_new
        self._relational = _by_width(templates(facts, sorted(facts.relations), self.arity, max_new))
        self._functional = _by_width(templates(facts, self.functions, self.arity, 0))
        self._bases: dict[str, NDArray[np.generic]] = {}
        self._stacks: dict[int, Stack] = {}
        self._numeric: dict[int, NumericStack] = {}

    @property
    def widths(self) -> list[int]:
        """Numbers of existential variables that some relation's pattern takes, in increasing order."""
        return sorted(self._relational)

    @property
    def numeric_widths(self) -> list[int]:
        """The same for numeric functions."""
        return sorted(self._functional)

    def restricted(self, kept: Bool) -> Tables:
        """Return the tables of some of the tuples, `kept` of shape (n,)."""
        first, second = self.tuples[: self.split], self.tuples[self.split :]
        first, second = first[kept[: self.split]], second[kept[self.split :]]
        return Tables(self.facts, first, second, self._max_new, bool(self.functions))

    def stack(self, width: int) -> Stack:
        """Return the relational templates with `width` existential variables; of equal ones the first."""
        found = self._stacks.get(width)
        if found is None:
            found = self._stacks[width] = self._stack(self._relational[width], width)
        return found

    def numeric_stack(self, width: int) -> NumericStack:
        """Return the numeric templates with `width` existential variables."""
        found = self._numeric.get(width)
        if found is None:
            chosen = self._functional[width]
            values = np.stack([self._array(each) for each in chosen]).astype(np.float64)
            bins = bin_values(np.where(self._existing(width), values, np.nan), self.split)
            found = self._numeric[width] = NumericStack.of(chosen, bins, self.split)
        return found

    def truth(self, literal: Literal) -> Bool:
        """Return where a literal holds, negation included.

        One axis K per existential variable, in the order of the arguments, then the axis of tuples.
        """
        slots: list[int] = []
        axes: list[bool] = []
        for arg in literal.args:
            slots.append(arg if Slot.NEW <= arg < self.arity else Slot.OLD - len(axes))
            axes += [arg == ANY] if not 0 <= arg < self.arity else []
        values = self._array(Template(literal.relation, tuple(slots)))
        truth = values.astype(np.bool_) if literal.op is None else compare(values.astype(np.float64), literal)
        truth = truth & self._existing(len(axes))
        quantified = tuple(axis for axis, universal in enumerate(axes) if universal)
        return np.asarray(truth.any(axis=quantified) if quantified else truth) ^ literal.negated

    def _stack(self, templates: Sequence[Template], width: int) -> Stack:
        kept: dict[bytes, tuple[Template, NDArray[np.float32]]] = {}
        for template in templates:
            array = self._array(template)
            new = [code == Slot.NEW for code in template.slots if not 0 <= code]
            axes = tuple(axis for axis, is_new in enumerate(new) if is_new)
            count = array.sum(axis=axes, dtype=np.float32) if axes else array.astype(np.float32)
            key = bytes([template.fresh]) + count.tobytes()
            kept.setdefault(key, (template, count))  # symmetric relations and converses say the same
        chosen = [template for template, _ in kept.values()]
        shape = (0, *[self.facts.objects] * width, self.size)
        counts = np.stack([count for _, count in kept.values()]) if kept else np.zeros(shape, np.float32)
        fresh = np.array([row for row, template in enumerate(chosen) if template.fresh], dtype=np.int64)
        return Stack(tuple(chosen), np.minimum(counts, np.float32(1)), fresh, counts[fresh])

    def _array(self, template: Template) -> NDArray[np.generic]:
        """Return a template's raw values: one axis per argument but target variables, then the tuples."""
        found = self._base(template.name)
        slots = template.slots[1:] if template.name in self.facts.relative else template.slots
        axis = 0
        for code in slots:
            if code < 0:
                axis += 1
                continue
            objects = self.tuples[:, 1 + code]
            if (objects == objects[0]).all():  # usual: the target comes first in every world
                found = found.take(objects[0], axis=axis)
            else:
                index = objects.reshape(*[1] * (found.ndim - 1), -1)
                found = np.take_along_axis(found, index, axis=axis).squeeze(axis)
        return found

    def _base(self, name: str) -> NDArray[np.generic]:
        found = self._bases.get(name)
        if found is None:
            relation = name in self.facts.relations
            stored = self.facts.relation(name) if relation else self.facts.numeric[name]
            found = self._bases[name] = np.ascontiguousarray(np.moveaxis(stored[self.tuples[:, 0]], 0, -1))
        return found

    def _existing(self, width: int) -> Bool:
        """Which combinations of `width` objects exist: shape (K, …, K, n)."""
        found = np.ones((*[1] * width, self.size), dtype=np.bool_)
        for axis in range(width):
            shape = [self.facts.objects if axis == place else 1 for place in range(width)]
            found = found & self.exists.reshape(*shape, self.size)
        return found


def _by_width(found: Iterable[Template]) -> dict[int, list[Template]]:
    """Sort templates by their number of existential variables."""
    grouped: dict[int, list[Template]] = {}
    for template in found:
        grouped.setdefault(template.existentials, []).append(template)
    return grouped
