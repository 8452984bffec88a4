"""Examples as arrays, and as the facts that FOIL and the clauses' evaluation take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import (
    Bools,
    ExampleBatch,
    Floats,
    Vocabulary,
    consequence,
    difference,
    mode_value,
    turned,
)
from relgym.classification.exemplars import Exemplars
from relgym.classification.rows import Gathered
from relgym.config import ClassificationConfig
from relgym.logic.clause import Clause
from relgym.logic.csp import matches
from relgym.logic.facts import Facts

__all__ = ["CONTEXTS", "Context", "Scope", "View", "bound_features", "lift", "projection"]

Context: TypeAlias = Literal["approached", "touching", "all"]
"""Which objects clauses may mention: what the target approaches fastest, those close to it, or every one."""

CONTEXTS: Final[tuple[Context, ...]] = ("approached", "touching", "all")
"""All contexts, the narrowest first."""

_Rows: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Scope:
    """Names that one pair of modes may use, after the config's switches.

    Parameters
    ----------
    relations, unary, pair, own
        (name, column in the example's arrays).
    modes
        Ids of the two modes if their functions are features, else none.
    follows
        (name, column among the own features, k): see `Vocabulary.follows`.
    present
        (name, column among the own features) of `Vocabulary.present`, if there is one.
    """

    relations: tuple[tuple[str, int], ...]
    unary: tuple[tuple[str, int], ...]
    pair: tuple[tuple[str, int], ...]
    own: tuple[tuple[str, int], ...]
    modes: tuple[int, ...] = ()
    follows: tuple[tuple[str, int, float], ...] = ()
    present: tuple[tuple[str, int], ...] = ()

    @classmethod
    def of(cls, vocabulary: Vocabulary, config: ClassificationConfig, modes: Sequence[int] = ()) -> Scope:
        """What the config offers of a vocabulary to a pair of modes."""
        hidden = frozenset() if config.contact_facts else vocabulary.contact

        def offered(names: tuple[str, ...]) -> tuple[tuple[str, int], ...]:
            return tuple((name, column) for column, name in enumerate(names) if name not in hidden)

        v = vocabulary
        follows = tuple((name, v.own.index(name), k) for name, k in v.follows)
        present = tuple((name, v.own.index(name)) for name in (v.present,) if name)
        facts = (offered(v.relations), offered(v.unary), offered(v.pair), offered(v.own))
        return cls(*facts, tuple(modes), follows, present)

    @property
    def scalars(self) -> tuple[str, ...]:
        """Names of the numbers that belong to no other object: own features and mode functions."""
        return tuple(name for name, _ in self.own) + self._mode_names

    @property
    def _mode_names(self) -> tuple[str, ...]:
        if not self.modes:
            return ()
        i, j = self.modes
        ahead = [consequence(name, k, mode) for name, _, k in self.follows for mode in self.modes]
        back = [turned(mode, name) for name, _ in self.present for mode in self.modes]
        return mode_value(i), mode_value(j), difference(i, j), *ahead, *back


@dataclass(frozen=True, eq=False)
class View:
    """n examples as arrays; the columns of `values` belong to `modes`.

    Parameters
    ----------
    table, unary, exists, approached, close, pair, own
        As in `Example`, with a leading axis.
    target
        Shape ``(n,)``.
    modes
        Mode ids.
    values
        Predictions of the modes' functions, shape ``(n, len(modes))``.
    """

    table: Bools
    unary: Bools
    exists: Bools
    approached: Bools
    close: Bools
    pair: Floats
    own: Floats | Gathered
    target: _Rows
    modes: tuple[int, ...]
    values: Floats
    _facts: dict[tuple[Context, Scope], Facts] = field(default_factory=dict, repr=False)

    @classmethod
    def of_exemplars(cls, exemplars: Exemplars) -> View:
        """All exemplars, as views of their arrays: valid until they change."""
        c = exemplars.columns
        return cls(
            *(
                c["table"],
                c["unary"],
                c["exists"],
                c["approached"],
                c["close"],
                c["pair"],
                exemplars.own,
                c["target"],
            ),
            modes=exemplars.modes,
            values=c["values"],
        )

    @classmethod
    def of_batch(cls, batch: ExampleBatch, modes: tuple[int, ...], values: Floats) -> View:
        """A batch of queries."""
        b = batch
        exists = np.ones(b.close.shape, dtype=np.bool_)
        target = np.full(len(b), b.target, dtype=np.int64)
        return cls(b.table, b.unary, exists, b.struck, b.close, b.pair, b.own, target, modes, values)

    def __len__(self) -> int:
        return len(self.table)

    def take(self, rows: NDArray[np.integer[Any]]) -> View:
        """Some of the examples."""
        contexts = (self.exists[rows], self.approached[rows], self.close[rows])
        numbers = (self.pair[rows], self.own[rows], self.target[rows])
        return View(self.table[rows], self.unary[rows], *contexts, *numbers, self.modes, self.values[rows])

    def shown(self, context: Context) -> Bools:
        """Which objects a context shows, shape ``(n, K)``."""
        return {"approached": self.approached, "touching": self.close, "all": self.exists}[context]

    def tuples(self, rows: _Rows) -> _Rows:
        """FOIL's target tuples (world, target object) of some rows, shape ``(len(rows), 2)`` (§3.4.2)."""
        return np.column_stack([rows, self.target[rows]])

    def facts(self, context: Context, scope: Scope) -> Facts:
        """Relations of a context and the numbers that a scope offers; relations are shared between scopes."""
        found = self._facts.get((context, scope))
        if found is None:
            numeric = {name: self.pair[:, :, column] for name, column in scope.pair}
            numeric |= dict(zip(scope.scalars, self.scalars(scope).T, strict=True))
            relative = frozenset(name for name, _ in scope.pair)
            found = self._relational(context, scope).with_numeric(numeric, relative)
            self._facts[context, scope] = found
        return found

    def _relational(self, context: Context, scope: Scope) -> Facts:
        bare = Scope(scope.relations, scope.unary, (), ())
        found = self._facts.get((context, bare))
        if found is None:
            relations = {name: self.table[:, column] for name, column in scope.relations}
            relations |= {name: self.unary[:, column] for name, column in scope.unary}
            # Facts masks what doesn't "exist": in the touching context, everything that isn't close (§3.4.2).
            found = Facts(relations, self.shown(context))
            self._facts[context, bare] = found
        return found

    def scalars(self, scope: Scope) -> Floats:
        """Values of ``scope.scalars``, shape ``(n, len(scope.scalars))``."""
        parts = [self.own[:, [column for _, column in scope.own]]]
        if scope.modes:
            i, j = (self.values[:, self.modes.index(mode)] for mode in scope.modes)
            ahead = [self.own[:, column] + k * value for _, column, k in scope.follows for value in (i, j)]
            back = [self.own[:, column] * value for _, column in scope.present for value in (i, j)]
            parts.append(np.column_stack([i, j, i - j, *ahead, *back]))
        return np.concatenate(parts, axis=1)


def lift(clause: Clause, variable: int) -> Clause:
    """The clause with one existential variable made a second argument of the target."""
    others = [v for v in range(1, clause.variables) if v != variable]
    names = {0: 0, variable: 1} | {v: at + 2 for at, v in enumerate(others)}
    return Clause(tuple(literal.rename(names) for literal in clause.literals), 2)


def projection(clause: Clause, variable: int, facts: Facts, tuples: _Rows) -> Bools:
    """Objects that a variable can stand for while the clause holds, shape ``(len(tuples), K)``."""
    objects = facts.objects
    every = np.repeat(tuples, objects, axis=0)
    slots = np.tile(np.arange(objects), len(tuples))
    exists = facts.exists[every[:, 0], slots]
    found = np.zeros(len(every), dtype=np.bool_)
    found[exists] = matches(lift(clause, variable), facts, np.column_stack([every, slots])[exists])
    return found.reshape(len(tuples), objects)


def bound_features(clause: Clause, view: View, facts: Facts, scope: Scope, rows: _Rows) -> Floats:
    """Pair features of the objects that a clause binds, shape ``(len(rows), variables * features)``.

    Where several objects fit a variable, the least defined value counts: it doesn't depend on their order.
    """
    columns = [column for _, column in scope.pair]
    parts = []
    for variable in range(1, clause.variables):
        fits = projection(clause, variable, facts, view.tuples(rows))
        values = view.pair[rows][:, :, columns]
        values = np.where(fits[:, :, None] & ~np.isnan(values), values, np.inf).min(axis=1)
        parts.append(np.where(np.isinf(values), np.nan, values))
    return np.concatenate(parts, axis=1) if parts else np.empty((len(rows), 0))
