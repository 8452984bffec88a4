"""Situations: what makes two of them the same."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_situations import TRUCK_VOCABULARY, truck_stream

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import Example, ExampleBatch
from relgym.classification.familiarity import Familiarity, Used, situations, used_by
from relgym.classification.views import Scope, View
from relgym.config import ClassificationConfig
from relgym.logic.clause import Clause, Definition, Literal

_EVERYTHING: Used = (("all", (0, 1, 2, 3, 4), (0, 1)),)


def _situation(example: Example, used: Used = _EVERYTHING) -> int:
    view = View.of_batch(ExampleBatch.of(example), (), np.empty((1, 0)))
    return int(situations(view, used)[0])


def _reordered(example: Example, order: list[int]) -> Example:
    o = np.array(order)
    table, unary = example.table[:, o][:, :, o], example.unary[:, o]
    return Example(table, unary, example.close[o], example.pair[o], example.own, order.index(0))


@settings(max_examples=30, deadline=None)
@given(st.permutations(range(4)), st.integers(0, 15))
def test_order_of_objects_is_irrelevant(order: list[int], episode: int) -> None:
    example = list(truck_stream(16, rng=np.random.default_rng(0)))[10 * episode].example
    assert _situation(_reordered(example, order)) == _situation(example)


def test_the_four_layouts_differ() -> None:
    examples = [item.example for item in truck_stream(4, rng=np.random.default_rng(0))][::10]
    assert len({_situation(example) for example in examples}) == 4


def test_one_more_object_like_another_changes_nothing() -> None:
    first, second = (
        next(truck_stream(1, rng=np.random.default_rng(0), bystanders=n)).example for n in (2, 3)
    )
    relations: Used = (
        ("all", (1, 3), (0, 1)),
    )  # on-top and y-aligned: they don't tell one bystander from another
    assert _situation(first, relations) == _situation(second, relations)
    assert _situation(first) != _situation(second)


def test_only_relations_that_clauses_use_count() -> None:
    scope = Scope.of(TRUCK_VOCABULARY, ClassificationConfig())
    clause = Clause(
        (Literal("y-aligned", (0, 1)), Literal("box", (1,)), Literal("vx", (), op=">", threshold=0.0))
    )
    classifier = BinaryClassifier(1, 2, scope, "touching", Definition((clause,)))
    assert used_by([classifier], TRUCK_VOCABULARY) == (("touching", (3,), (0,)),)
    assert used_by([], TRUCK_VOCABULARY) == ()


def test_touching_context_ignores_what_is_not_close() -> None:
    near: Used = (("touching", (0, 1, 2, 3, 4), (0, 1)),)
    first, second = (
        next(truck_stream(1, rng=np.random.default_rng(0), bystanders=n)).example for n in (1, 4)
    )
    assert first.close.sum() == second.close.sum() == 2
    assert _situation(first, near) == _situation(second, near)


def test_seen_situations_are_remembered() -> None:
    one, other = [item.example for item in truck_stream(4, rng=np.random.default_rng(0))][::10][:2]
    known = Familiarity(_EVERYTHING, [])
    key = (0, b"", b"", b"one")
    assert not known.is_seen(one, key)
    known.add(one, key)
    assert known.is_seen(one, key)
    assert not known.is_seen(other, (0, b"", b"", b"other"))
    batch = View.of_batch(ExampleBatch.stack([one, other]), (), np.empty((2, 0)))
    np.testing.assert_array_equal(known.is_seen_batch(batch), [True, False])
