"""Single evaluation through plans gives exactly what batch evaluation gives, for any clauses and trees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_situations import BALL_VOCABULARY, ball_stream

from relgym.classification.binary import BinaryClassifier, tree_columns, tree_features
from relgym.classification.examples import ExampleBatch
from relgym.classification.plans import Planner
from relgym.classification.views import Context, Scope, View
from relgym.config import ClassificationConfig
from relgym.logic.clause import ANY, Clause, Definition, Literal
from relgym.numeric.tree import DecisionTree, learn_tree

_ITEMS = list(ball_stream(300, rng=np.random.default_rng(5)))
_BATCH = ExampleBatch.stack([item.example for item in _ITEMS])
_VALUES = np.array([item.values for item in _ITEMS])
_MODES = tuple(range(6))
_ROWS = np.arange(len(_ITEMS))
_VOCABULARY = replace(BALL_VOCABULARY, follows=(("vy", 0.5),), present="vx")
_SCOPE = Scope.of(_VOCABULARY, ClassificationConfig(), (1, 3))
_VIEW = View.of_batch(_BATCH, _MODES, _VALUES)


@st.composite
def _literals(draw: st.DrawFn) -> Literal:
    negated = draw(st.booleans())
    variables = st.sampled_from((1, 2, ANY) if negated else (1, 2))
    kind = draw(st.sampled_from(["binary", "unary", "pair", "scalar"]))
    if kind == "binary":
        a, b = draw(st.sampled_from([(0, None), (None, 0), (1, 2)]))
        args = tuple(draw(variables) if v is None else v for v in (a, b))
        return Literal(draw(st.sampled_from(BALL_VOCABULARY.relations)), args, negated)
    if kind == "unary":
        return Literal(draw(st.sampled_from(BALL_VOCABULARY.unary)), (draw(variables),), negated)
    threshold, op = draw(st.floats(-0.3, 0.3)), draw(st.sampled_from(["<=", ">"]))
    if kind == "pair":
        return Literal(
            draw(st.sampled_from(BALL_VOCABULARY.pair)), (0, draw(variables)), negated, op, threshold
        )
    return Literal(draw(st.sampled_from(_SCOPE.scalars)), (), negated, op, threshold)


@st.composite
def _classifiers(draw: st.DrawFn) -> BinaryClassifier:
    bodies = draw(st.lists(st.lists(_literals(), min_size=1, max_size=4), min_size=0, max_size=3))
    definition = Definition(tuple(Clause.of(body) for body in bodies), negated=draw(st.booleans()))
    context: Context = draw(st.sampled_from(["touching", "all"]))
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    clauses = [*definition.clauses, None]
    trees = [_tree(context, clause, rng) if draw(st.booleans()) else None for clause in clauses]
    return BinaryClassifier(1, 3, _SCOPE, context, definition, tuple(trees[:-1]), trees[-1])


def _tree(context: Context, clause: Clause | None, rng: np.random.Generator) -> DecisionTree:
    rows = rng.integers(0, len(_ITEMS), size=60)
    x = tree_features(_VIEW, _SCOPE, context, clause, rows)
    columns = tree_columns(_SCOPE, 1 if clause is None else clause.variables)
    return learn_tree(x, rng.random(60) < 0.5, columns=columns, prune=False)


@settings(max_examples=150, deadline=None)
@given(st.lists(_classifiers(), min_size=1, max_size=3))
def test_single_and_batch_take_the_same_way(classifiers: list[BinaryClassifier]) -> None:
    planner = Planner(_VOCABULARY, _MODES)
    planner.set_pairs(classifiers)
    single = [planner.outcomes(item.example, item.values.tolist()) for item in _ITEMS[:60]]
    batch = np.column_stack([c.decide_batch(_VIEW, _ROWS[:60]) for c in classifiers])
    np.testing.assert_array_equal(single, batch)


def test_changed_pairs_are_worked_out_anew_and_others_kept() -> None:
    touching = Definition((Clause((Literal("intersect", (0, 1)),)),))
    ramp = Definition((Clause((Literal("ramp", (1,)),)),))
    first, second = (BinaryClassifier(1, 3, _SCOPE, "touching", d) for d in (touching, ramp))
    planner = Planner(_VOCABULARY, _MODES)
    for pairs in ([first, first], [first, second], [second, first], [second]):
        planner.set_pairs(pairs)
        for at in range(40):
            found = planner.outcomes(_ITEMS[at].example, _ITEMS[at].values.tolist())
            assert found == [int(c.decide_batch(_VIEW, _ROWS[at : at + 1])[0]) for c in pairs]


@pytest.mark.parametrize("position", [0, 2, 5])
def test_the_order_of_objects_is_irrelevant(position: int) -> None:
    bounce = Clause((Literal("intersect", (0, 1)), Literal("approach", (0, 1), op="<=", threshold=0.0)))
    classifier = BinaryClassifier(1, 3, _SCOPE, "touching", Definition((bounce,)))
    planner = Planner(_VOCABULARY, _MODES)
    planner.set_pairs([classifier])
    order = np.roll(np.arange(6), position)
    for item in _ITEMS[:50]:
        e = item.example
        table, unary = e.table[:, order][:, :, order], e.unary[:, order]
        target = int(np.flatnonzero(order == 0)[0])
        moved = type(e)(table, unary, e.close[order], e.pair[order], e.own, target)
        values = item.values.tolist()
        assert planner.outcomes(moved, values) == planner.outcomes(e, values)
