"""FOIL (§3.4.1, Algorithm 2), as printed and as the program has it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.thesis.facts import Facts
from relgym.thesis.settings import ThesisSettings

__all__ = ["Clause", "Literal", "holds", "learn_clauses"]

Bools: TypeAlias = NDArray[np.bool_]
Weights: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Literal:
    """A relation between variables, or its negation; a variable that is new in a negation is universal (``*``).

    Attributes
    ----------
    name
        Of the relation or type.
    arguments
        Numbers of variables; those of named objects come first.
    positive
        Whether it isn't negated.
    """

    name: str
    arguments: tuple[int, ...]
    positive: bool


@dataclass(frozen=True, slots=True)
class Clause:
    """A conjunction.

    Attributes
    ----------
    literals
        In the order in which they were chosen.
    named
        How many variables are objects that are given: 1 (A), or 2 (A, and B of a role).
    """

    literals: tuple[Literal, ...]
    named: int = 1

    def __str__(self) -> str:
        known = set(range(self.named))
        parts = []
        for literal in self.literals:
            names = ["*" if v < 0 else chr(ord("A") + v) for v in literal.arguments]
            known.update(v for v in literal.arguments if v >= 0)
            parts.append(f"{'' if literal.positive else '¬'}{literal.name}({', '.join(names)})")
        return " ∧ ".join(parts) or "always"


STAR = -1
"""A universal variable."""


# ------------------------------------------------------------------ what holds where
def _placed(facts: Facts, literal: Literal, variables: int) -> tuple[Bools, int]:
    """Truth of the relation over states and bindings, shape ``(states, K or 1, …)``; how many axes it has for ``*``.

    Axes are those of the variables that aren't named, then universal ones.
    """
    named = facts.fixed.shape[1]
    every = np.arange(len(facts))
    if len(literal.arguments) == 1:
        table: Bools = facts.unary[:, facts.types.index(literal.name)]
    else:
        table = facts.binary[:, facts.relations.index(literal.name)]
    axes: list[int] = []
    star = 0
    # Named objects are looked up, from the last argument on, so that the numbers of the others stay.
    for place in reversed(range(len(literal.arguments))):
        variable = literal.arguments[place]
        if 0 <= variable < named:
            moved = np.moveaxis(table, place + 1, 1)
            table = moved[every, facts.fixed[:, variable]]
        else:
            axes.insert(0, variables + star if variable == STAR else variable - named)
            star += variable == STAR
    total = variables + star
    order = np.argsort(axes)
    table = np.transpose(table, [0, *(1 + order)])
    shape = [len(facts)] + [1] * total
    for k, axis in enumerate(sorted(axes)):
        shape[1 + axis] = table.shape[1 + k]
    return table.reshape(shape), star


def _extended(facts: Facts, bindings: Bools, literal: Literal, variables: int) -> Bools:
    """Bindings that a literal leaves; a positive one with a new variable adds an axis."""
    named = facts.fixed.shape[1]
    new = max(literal.arguments) - named + 1 - variables
    if literal.positive and new > 0:
        truth, _ = _placed(facts, literal, variables + new)
        return bindings.reshape(*bindings.shape, *[1] * new) & truth
    truth, star = _placed(facts, literal, variables)
    if star:
        truth = np.asarray(truth.any(axis=tuple(range(-star, 0))))
    return bindings & (truth if literal.positive else ~truth)


def _covered(bindings: Bools) -> Bools:
    return np.asarray(bindings.reshape(len(bindings), -1).any(axis=1))


def _bindings(facts: Facts, literals: Sequence[Literal]) -> Bools:
    bindings: Bools = np.ones(len(facts), dtype=np.bool_)
    for literal in literals:
        bindings = _extended(facts, bindings, literal, bindings.ndim - 1)
    return bindings


def holds(clause: Clause, facts: Facts) -> Bools:
    """In which states a clause can be satisfied, shape ``(states,)``.

    Notes
    -----
    All bindings are looked at together; a backtracking solver finds the same (§3.4.3).
    """
    return _covered(_bindings(facts, clause.literals))


# ------------------------------------------------------------------ candidates
def _candidates(facts: Facts, variables: int, settings: ThesisSettings) -> Iterator[Literal]:
    """All literals over the bound variables and one new one, alphabetically; positive ones first."""
    named = facts.fixed.shape[1]
    bound = list(range(named + variables))
    may = variables < settings.max_variables
    fresh = named + variables
    names = sorted([*((n, 2) for n in facts.relations), *((n, 1) for n in facts.types)])
    for positive in (True, False):
        new = fresh if positive else STAR
        for name, places in names:
            if places == 1:
                for v in bound:
                    yield Literal(name, (v,), positive)
                if may or not positive:
                    yield Literal(name, (new,), positive)
                continue
            for a in bound:
                for b in bound:
                    if a != b:
                        yield Literal(name, (a, b), positive)
                if may or not positive:
                    yield Literal(name, (a, new), positive)
                    yield Literal(name, (new, a), positive)


@dataclass(frozen=True)
class _Choice:
    key: tuple[Any, ...]
    literal: Literal
    bindings: Bools
    gain: float


def _choose(
    facts: Facts, bindings: Bools, positive: Weights, negative: Weights, settings: ThesisSettings
) -> _Choice | None:
    """ChooseLiteral: what filters out most negatives (Algorithm 2), or what gains most information (the program)."""
    variables = bindings.ndim - 1
    before = _covered(bindings)
    had = int(negative[before].sum())
    count = bindings.reshape(len(bindings), -1).sum(axis=1)
    bits = _bits(int(positive @ count), int(negative @ count))
    best: _Choice | None = None
    for number, literal in enumerate(_candidates(facts, variables, settings)):
        after = _extended(facts, bindings, literal, variables)
        covered = _covered(after)
        kept = int(positive[covered].sum())
        if not kept:
            continue
        if settings.literal == "negatives":
            removed = had - int(negative[covered].sum())
            gain = float(removed)
            key: tuple[Any, ...] = (removed, kept, literal.positive, -number)
        else:
            tuples = after.reshape(len(after), -1).sum(axis=1)
            gain = kept * (bits - _bits(int(positive @ tuples), int(negative @ tuples)))
            key = (round(gain, 9), literal.positive, after.ndim - bindings.ndim, -number)
        if best is None or key > best.key:
            best = _Choice(key, literal, after, gain)
    return best


def _bits(positive: int, negative: int) -> float:
    return -math.log2(positive / (positive + negative)) if positive else math.inf


# ------------------------------------------------------------------ Algorithm 2
def learn_clauses(
    facts: Facts, positive: Weights, negative: Weights, settings: ThesisSettings, rng: np.random.Generator
) -> list[tuple[Clause, int, int]]:
    """Clauses that cover positive examples and no negative ones.

    Parameters
    ----------
    facts
        Relational states.
    positive, negative
        How many examples of each class are in each state, shape ``(states,)``.
    settings, rng
        Which rules, and the draws of those that part the examples.

    Returns
    -------
    Clauses with the positive and the negative examples that each was seen to cover: of the positives those that no
    clause before covers; of the negatives those that evaluated it.
    """
    found: list[tuple[Clause, int, int]] = []
    left = positive.copy()
    named = facts.fixed.shape[1]
    while left.any():
        grow_pos, test_pos = _parted(left, settings, rng)
        grow_neg, test_neg = _parted(negative, settings, rng)
        literals = _grown(facts, grow_pos, grow_neg, settings)
        if settings.prune:
            literals = _pruned(facts, literals, test_neg)
        clause = Clause(_starred(literals, named), named)
        if not literals:
            break
        covered = holds(clause, facts)
        true, false = int(test_pos[covered].sum()), int(test_neg[covered].sum())
        wholly = int(left[covered].sum())
        if settings.grow_share < 1.0:
            if true + false == 0 or false / (true + false) >= settings.max_false:
                break
        elif wholly <= false:
            break
        found.append((clause, wholly, false))
        left[covered] = 0
    return found


def _parted(counts: Weights, settings: ThesisSettings, rng: np.random.Generator) -> tuple[Weights, Weights]:
    """Examples to grow clauses on and examples to test them by."""
    if settings.grow_share == 1.0:
        return counts, counts
    total = int(counts.sum())
    take = max(1, round(settings.grow_share * total)) if total else 0
    grow = rng.multivariate_hypergeometric(counts, take, method="marginals") if total else counts
    return grow, counts - grow


def _grown(facts: Facts, positive: Weights, negative: Weights, settings: ThesisSettings) -> list[Literal]:
    bindings: Bools = np.ones(len(facts), dtype=np.bool_)
    literals: list[Literal] = []
    gains: list[float] = []
    while negative[_covered(bindings)].any() and len(literals) < settings.max_literals:
        choice = _choose(facts, bindings, positive, negative, settings)
        if choice is None or choice.literal in literals:
            break
        if choice.gain < 0.0 or (settings.literal == "negatives" and choice.gain == 0.0):
            break
        literals.append(choice.literal)
        gains.append(choice.gain)
        bindings = choice.bindings
    while gains and gains[-1] <= 0.0:
        gains.pop()
        literals.pop()
    return literals


def _pruned(facts: Facts, literals: list[Literal], negative: Weights) -> list[Literal]:
    """From the last to the first, literals without which no more testing negatives are covered are dropped."""
    named = facts.fixed.shape[1]
    kept = list(literals)
    for literal in reversed(literals):
        without = [other for other in kept if other is not literal]
        before = int(negative[_loose(facts, kept, named)].sum())
        if without and int(negative[_loose(facts, without, named)].sum()) <= before:
            kept = without
    return kept


def _loose(facts: Facts, literals: Sequence[Literal], named: int) -> Bools:
    """Where literals hold whose variables may have lost the one that introduced them."""
    return _covered(_bindings(facts, _starred(literals, named)))


def _starred(literals: Sequence[Literal], named: int) -> tuple[Literal, ...]:
    """Number variables anew, as positive literals bring them up; one that is left in negations only is ``*``."""
    numbers = {v: v for v in range(named)}
    for literal in literals:
        if literal.positive:
            for v in literal.arguments:
                numbers.setdefault(v, len(numbers))
    # What introduces a variable comes before what tests it.
    ordered = sorted(literals, key=lambda each: not each.positive) if _late(literals, named) else literals
    return tuple(
        Literal(each.name, tuple(numbers.get(v, STAR) for v in each.arguments), each.positive)
        for each in ordered
    )


def _late(literals: Sequence[Literal], named: int) -> bool:
    """Whether a negation tests a variable that a later literal introduces."""
    known = set(range(named)) | {STAR}
    for literal in literals:
        if not literal.positive and not set(literal.arguments) <= known:
            return True
        known |= set(literal.arguments)
    return False
