"""Fast evaluation of all pairs on one example: what relations alone decide is worked out once per state.

A *plan* belongs to a relational state. For every pair it holds the clauses that the state admits, with the
objects that their variables can stand for; what is left to a query are the numeric tests. Plans are memoised;
they give exactly what `BinaryClassifier.decide_batch` gives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import (
    Bools,
    Example,
    Vocabulary,
    consequence,
    difference,
    mode_value,
    turned,
)
from relgym.classification.views import Context
from relgym.config.constants import ANSWERS, MOST_BYTES
from relgym.logic.clause import ANY, Clause, Literal
from relgym.logic.csp import World, solutions
from relgym.numeric.tree import DecisionTree

__all__ = ["Key", "Plan", "Planner"]

Key: TypeAlias = tuple[int, bytes, bytes, bytes, bytes]
"""Target, approached and close objects, binary and unary relations of an example."""

_SOME: Final = "some object"  # stands for a numeric test of a variable while objects are looked for
_NAN: Final = float("nan")

_Binding: TypeAlias = tuple[int, ...]
_Pairs: TypeAlias = list[list[float]]


class _Test(NamedTuple):
    """``value <= threshold`` or ``>``, of a scalar, a difference of two scalars, or a feature of a pair."""

    column: int
    minus: int  # scalar to subtract, or -1
    variable: int  # whose pair feature it is; 0: a scalar, ANY: no object may pass
    at_most: bool
    threshold: float
    negated: bool


class _Program(NamedTuple):
    """One stage of one pair's waterfall."""

    clause: Clause | None  # its relational part; none: the fall-through
    scalar_tests: tuple[_Test, ...]
    object_tests: tuple[_Test, ...]
    tree: DecisionTree | None
    columns: tuple[tuple[int, int], ...]  # the tree's scalars: (column, minus)
    pair_columns: tuple[int, ...]  # the tree's pair features
    outcomes: dict[int, int]  # by leaf; -1: no tree


class _Alternative(NamedTuple):
    """A stage that a relational state admits."""

    program: _Program
    bindings: tuple[_Binding, ...]


@dataclass(slots=True)
class _Pair:
    classifier: BinaryClassifier
    programs: tuple[_Program, ...]
    version: int


@dataclass(slots=True)
class Plan:
    """What a relational state leaves open: per pair an outcome's number, or the stages to try.

    `key` identifies the state, as far as pairs can see it.
    """

    key: Key
    worlds: dict[Context, World]
    objects: dict[Context, tuple[int, ...]]
    target: int
    version: int = -1
    versions: list[int] = field(default_factory=list)
    stages: list[int | list[_Alternative]] = field(default_factory=list)


class Planner:
    """Evaluates a fixed order of pairs on single examples.

    Parameters
    ----------
    vocabulary
        Names of what examples hold.
    modes
        Mode ids in the order of the values that come with an example.

    Notes
    -----
    Cost: some 10 µs per example plus 1 µs per numeric pair if the state is known; a few µs per clause if it's
    new.
    """

    def __init__(self, vocabulary: Vocabulary, modes: tuple[int, ...]) -> None:
        self.vocabulary = vocabulary
        self.modes = modes
        own = {name: (column, -1) for column, name in enumerate(vocabulary.own)}
        first = len(vocabulary.own)
        places = {mode: first + at for at, mode in enumerate(modes)}
        single = {mode_value(mode): (place, -1) for mode, place in places.items()}
        both = {difference(i, j): (places[i], places[j]) for i in modes for j in modes if i < j}
        self._follows = tuple((vocabulary.own.index(name), k) for name, k in vocabulary.follows)
        ahead = [consequence(name, k, mode) for name, k in vocabulary.follows for mode in modes]
        self._present = tuple(vocabulary.own.index(name) for name in (vocabulary.present,) if name)
        back = [turned(mode, vocabulary.present) for _ in self._present for mode in modes]
        behind = first + len(modes)
        known = {name: (behind + at, -1) for at, name in enumerate([*ahead, *back])}
        self._scalars: dict[str, tuple[int, int]] = own | single | both | known
        self._pairs: list[_Pair] = []
        self._version = 0
        self._everything = False
        self._plans: dict[Key, Plan] = {}
        self._latest: tuple[Example, Plan] | None = None  # one example is asked of several times
        self._memory = 0

    def set_pairs(self, classifiers: Sequence[BinaryClassifier]) -> None:
        """Set the pairs, in order; those that are the same objects as before keep what is known of them."""
        self._version += 1
        self._latest = None
        known = {id(pair.classifier): pair for pair in self._pairs}
        self._pairs = [known.get(id(c)) or _Pair(c, self._compile(c), self._version) for c in classifiers]
        everything = any(c.context == "all" for c in classifiers)
        if everything != self._everything:
            self._everything = everything
            self._plans.clear()
            self._memory = 0

    def outcomes(self, example: Example, values: Sequence[float]) -> list[int]:
        """Number of the outcome of every pair.

        Parameters
        ----------
        example
            The example.
        values
            What the modes' functions predict for it, in the order of `modes`.
        """
        return self.run(self.plan(example), example, values)

    def run(self, plan: Plan, example: Example, values: Sequence[float]) -> list[int]:
        """The same, for a caller that has the example's plan already."""
        scalars = [*example.own.tolist(), *values]
        if self._follows:
            scalars += [scalars[column] + k * value for column, k in self._follows for value in values]
        if self._present:
            present = scalars[self._present[0]]
            scalars += [present * value for value in values]
        pair = example.pair.tolist()
        return [stage if isinstance(stage, int) else _run(stage, scalars, pair) for stage in plan.stages]

    def plan(self, example: Example) -> Plan:
        """The plan of an example's relational state, objects in their order."""
        if self._latest is not None and self._latest[0] is example:
            return self._latest[1]
        close, table, unary = example.close, example.table, example.unary
        if not self._everything:
            table, unary = table & (close[:, None] & close), unary & close
        struck = example.struck
        key = (example.target, struck.tobytes(), close.tobytes(), table.tobytes(), unary.tobytes())
        plan = self._plans.get(key)
        if plan is None:
            # A plan has tables twice: in its key, and as what clauses are asked of.
            memory = 2 * (table.nbytes + unary.nbytes)
            self._memory += memory
            if len(self._plans) >= ANSWERS or self._memory > MOST_BYTES:
                self._plans.clear()
                self._memory = memory
            plan = self._plans[key] = self._new_plan(key, table, unary, (struck, close))
        if plan.version != self._version:
            self._update(plan)
        self._latest = (example, plan)
        return plan

    def _new_plan(self, key: Key, table: Bools, unary: Bools, near: tuple[Bools, Bools]) -> Plan:
        v = self.vocabulary
        # Copies: a query's arrays may be views of a large batch that should not be kept alive.
        relations = dict(zip(v.relations, table.copy(), strict=True)) | dict(
            zip(v.unary, unary.copy(), strict=True)
        )
        struck, close = near
        every = np.ones(len(close), dtype=np.bool_)
        exists: dict[Context, Bools] = {"approached": struck.copy(), "touching": close.copy(), "all": every}
        worlds = {context: World(relations | {_SOME: mask}, mask) for context, mask in exists.items()}
        objects = {context: tuple(np.flatnonzero(mask).tolist()) for context, mask in exists.items()}
        return Plan(key, worlds, objects, target=key[0])

    def _update(self, plan: Plan) -> None:
        """Work out anew the stages of pairs that changed since the plan was last used."""
        versions = [pair.version for pair in self._pairs]
        if len(plan.versions) != len(versions):
            plan.versions, plan.stages = [-1] * len(versions), [0] * len(versions)
        for at, pair in enumerate(self._pairs):
            if plan.versions[at] != pair.version:
                plan.stages[at] = _stages(plan, pair)
        plan.versions, plan.version = versions, self._version

    def _compile(self, classifier: BinaryClassifier) -> tuple[_Program, ...]:
        c, last = classifier, len(classifier.definition.clauses)
        columns = tuple(self._scalars[name] for name in c.scope.scalars)
        pair_columns = tuple(column for _, column in c.scope.pair)
        programs = []
        for stage, clause in enumerate((*c.definition.clauses, None)):
            tree = c.fall_through_tree if stage == last else c.clause_trees[stage]
            outcomes = {leaf: number for (s, leaf), number in c.outcome_of.items() if s == stage}
            tests = [self._test(literal) for literal in clause or () if literal.op is not None]
            scalar = tuple(test for test in tests if test.variable == 0)
            bound = tuple(test for test in tests if test.variable != 0)
            relational = None if clause is None else _relational(clause)
            programs.append(_Program(relational, scalar, bound, tree, columns, pair_columns, outcomes))
        return tuple(programs)

    def _test(self, literal: Literal) -> _Test:
        at_most, threshold, negated = literal.op == "<=", literal.threshold, literal.negated
        if not literal.args:
            return _Test(*self._scalars[literal.relation], 0, at_most, threshold, negated)
        column = self.vocabulary.pair.index(literal.relation)
        return _Test(column, -1, literal.args[1], at_most, threshold, negated)


def _relational(clause: Clause) -> Clause:
    """The clause without its thresholds; variables that only a threshold binds may stand for any object."""
    literals: list[Literal] = []
    for literal in clause:
        if literal.op is None:
            literals.append(literal)
        elif literal.args and literal.args[1] != ANY:
            literals.append(Literal(_SOME, (literal.args[1],)))
    return Clause(tuple(literals), clause.arity)


def _stages(plan: Plan, pair: _Pair) -> int | list[_Alternative]:
    """The outcome, if relations alone decide; else the stages to try."""
    context = pair.classifier.context
    world, found = plan.worlds[context], []
    for program in pair.programs:
        bindings = _bindings(program, world, plan.target)
        if not bindings:
            continue
        if any(test.variable == ANY for test in program.object_tests):
            program = program._replace(object_tests=_spelled_out(program, plan.objects[context]))
        found.append(_Alternative(program, bindings))
        if not program.scalar_tests and not program.object_tests and program.tree is None:
            break
    first = found[0].program
    plain = not first.scalar_tests and not first.object_tests and first.tree is None
    return first.outcomes[-1] if plain else found


def _bindings(program: _Program, world: World, target: int) -> tuple[_Binding, ...]:
    if program.clause is None:
        return ((),)
    found = solutions(program.clause, world, (target,))
    if program.object_tests or program.tree is not None:
        return tuple(sorted(found))
    return tuple(islice(found, 1))  # nothing will be asked of the objects: that there are some is enough


def _spelled_out(program: _Program, objects: Sequence[int]) -> tuple[_Test, ...]:
    """Universal tests as one test per object; its number is encoded as ``ANY - 1 - object``."""
    tests = [test for test in program.object_tests if test.variable != ANY]
    for test in program.object_tests:
        if test.variable == ANY:
            tests += [test._replace(variable=ANY - 1 - each) for each in objects]
    return tuple(tests)


def _run(stages: list[_Alternative], scalars: list[float], pair: _Pairs) -> int:
    for program, bindings in stages:
        _, scalar_tests, object_tests, tree, columns, pair_columns, outcomes = program
        if scalar_tests and not _scalars_pass(scalar_tests, scalars):
            continue
        if object_tests:
            bindings = tuple([b for b in bindings if _objects_pass(object_tests, b, pair)])
            if not bindings:
                continue
        if tree is None:
            return outcomes[-1]
        leaf = tree.leaf_one(_features(columns, pair_columns, bindings, scalars, pair))
        if leaf in outcomes:
            return outcomes[leaf]
    raise AssertionError("the fall-through always has an outcome")


def _scalars_pass(tests: tuple[_Test, ...], scalars: list[float]) -> bool:
    for column, minus, _, at_most, threshold, negated in tests:
        x = scalars[column] if minus < 0 else scalars[column] - scalars[minus]
        if (x <= threshold if at_most else x > threshold) == negated:
            return False
    return True


def _objects_pass(tests: tuple[_Test, ...], binding: _Binding, pair: _Pairs) -> bool:
    for column, _, variable, at_most, threshold, negated in tests:
        x = pair[binding[variable] if variable > 0 else ANY - 1 - variable][column]
        if (x <= threshold if at_most else x > threshold) == negated:
            return False
    return True


def _features(
    columns: tuple[tuple[int, int], ...],
    pair_columns: tuple[int, ...],
    bindings: tuple[_Binding, ...],
    scalars: list[float],
    pair: _Pairs,
) -> list[float]:
    """As `tree_features`: scalars, then per variable the least defined value of every pair feature."""
    row = [scalars[c] if m < 0 else scalars[c] - scalars[m] for c, m in columns]
    for variable in range(1, len(bindings[0])):
        objects = sorted({binding[variable] for binding in bindings})
        for column in pair_columns:
            row.append(min([x for o in objects if (x := pair[o][column]) == x], default=_NAN))
    return row
