"""The tuples of one learning problem, laid out for counting.

FOIL asks the same question of every candidate literal: given the bindings of the clause so far, how many are
left, and of how many tuples? All literals that fill their arguments in the same *pattern* (targets,
existential variables, a new variable) are stacked, so that numpy answers for all of them at once. The tuples
are the last axis, contiguous in memory; positives come first.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.logic.clause import ANY, Literal
from relgym.logic.facts import Bool, Facts, Int, compare
from relgym.logic.thresholds import Bins, bin_values

__all__ = ["NEW", "NumericStack", "Stack", "Tables", "Template"]

NEW: Final = ANY
"""Pattern code of a new variable; the same argument of the negated literal is universal."""

_FIRST: Final = NEW - 1
"""Pattern code of the first existential variable; the second is one less, and so on."""


@dataclass(frozen=True, order=True)
class Template:
    """A relation or function and a pattern for its arguments.

    `slots` holds, per argument, the number of a target variable, `NEW`, or a code below `NEW` for an
    existential variable that is yet to be chosen.
    """

    name: str
    slots: tuple[int, ...]

    @cached_property
    def existentials(self) -> int:
        """How many existing existential variables the pattern takes."""
        return sum(code < NEW for code in self.slots)

    @cached_property
    def fresh(self) -> int:
        """How many new variables the pattern introduces."""
        return sum(code == NEW for code in self.slots)

    def literal(
        self,
        variables: Sequence[int],
        fresh: int,
        negated: bool,
        op: str | None = None,
        threshold: float = 0.0,
    ) -> Literal:
        """Return the literal for chosen existential variables and the number of the first new one."""
        args, unused = [], itertools.count(fresh)
        for code in self.slots:
            if code == NEW:
                args.append(ANY if negated else next(unused))
            else:
                args.append(code if code >= 0 else variables[_FIRST - code])
        return Literal(self.name, tuple(args), negated, op, threshold)


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
        self._bases: dict[str, NDArray[np.generic]] = {}
        self._stacks: dict[int, Stack] = {}
        self._numeric: dict[int, NumericStack] = {}

    @cached_property
    def widths(self) -> list[int]:
        """Numbers of existential variables that some relation's pattern takes, in increasing order."""
        return sorted(
            {
                template.existentials
                for template in self._templates(sorted(self.facts.relations), self._max_new)
            }
        )

    @cached_property
    def numeric_widths(self) -> list[int]:
        """The same for numeric functions."""
        return sorted({template.existentials for template in self._templates(self.functions, 0)})

    def stack(self, width: int) -> Stack:
        """Return the relational templates with `width` existential variables; of equal ones the first."""
        found = self._stacks.get(width)
        if found is None:
            names = sorted(self.facts.relations)
            templates = [each for each in self._templates(names, self._max_new) if each.existentials == width]
            found = self._stacks[width] = self._stack(templates, width)
        return found

    def numeric_stack(self, width: int) -> NumericStack:
        """Return the numeric templates with `width` existential variables."""
        found = self._numeric.get(width)
        if found is None:
            templates = [each for each in self._templates(self.functions, 0) if each.existentials == width]
            values = np.stack([self._array(each) for each in templates]).astype(np.float64)
            exists = self._existing(width)
            bins = bin_values(np.where(exists, values, np.nan), self.split)
            found = self._numeric[width] = NumericStack(tuple(templates), bins)
        return found

    def truth(self, literal: Literal) -> Bool:
        """Return where a literal holds, negation included.

        One axis K per existential variable, in the order of the arguments, then the axis of tuples.
        """
        slots: list[int] = []
        axes: list[bool] = []
        for arg in literal.args:
            slots.append(arg if NEW <= arg < self.arity else _FIRST - len(axes))
            axes += [arg == ANY] if not 0 <= arg < self.arity else []
        values = self._array(Template(literal.relation, tuple(slots)))
        truth = values.astype(np.bool_) if literal.op is None else compare(values.astype(np.float64), literal)
        truth = truth & self._existing(len(axes))
        quantified = tuple(axis for axis, universal in enumerate(axes) if universal)
        return np.asarray(truth.any(axis=quantified) if quantified else truth) ^ literal.negated

    def _templates(self, names: Sequence[str], max_new: int) -> Iterator[Template]:
        for name in names:
            relative = name in self.facts.relative
            stored = self.facts.arity(name) - relative
            targets = range(1 if relative else 0, self.arity)
            for slots in _patterns(stored, targets, max_new):
                bound = relative or stored <= 1 or any(code != NEW for code in slots)
                if bound:  # a literal joins the clause by at least one argument; r(B) alone may float
                    yield Template(name, (0, *slots) if relative else slots)

    def _stack(self, templates: Sequence[Template], width: int) -> Stack:
        kept: dict[bytes, tuple[Template, NDArray[np.float32]]] = {}
        for template in templates:
            array = self._array(template)
            new = [code == NEW for code in template.slots if not 0 <= code]
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
            objects = self.tuples[:, 1 + code].reshape(*[1] * (found.ndim - 1), -1)
            found = np.take_along_axis(found, objects, axis=axis).squeeze(axis)
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


def _patterns(arity: int, targets: Sequence[int], max_new: int) -> Iterator[tuple[int, ...]]:
    """Yield all ways to fill `arity` arguments without repeating a target variable."""
    for slots in itertools.product([*targets, _FIRST, NEW], repeat=arity):
        chosen = [code for code in slots if code >= 0]
        if len(set(chosen)) == len(chosen) and slots.count(NEW) <= max_new:
            numbers = itertools.count()
            yield tuple(_FIRST - next(numbers) if code == _FIRST else code for code in slots)
