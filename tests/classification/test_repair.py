"""Mending beats learning anew where one change is enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_situations import BALL_VOCABULARY, BOUNCE, FLY, ball_stream

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import ExampleBatch
from relgym.classification.learning import Lesson
from relgym.classification.repair import mend
from relgym.classification.views import Scope, View
from relgym.config import ClassificationConfig
from relgym.logic.clause import Clause, Definition, Literal

_CONFIG = ClassificationConfig()
_SCOPE = Scope.of(BALL_VOCABULARY, _CONFIG, (FLY, BOUNCE))
_APPROACH = Literal("approach", (0, 1), op="<=", threshold=0.0)
_SIDE = (Literal("y-greater-than", (0, 1), negated=True),)


@pytest.fixture(scope="module")
def lesson() -> Lesson:
    items = [
        i for i in ball_stream(2500, rng=np.random.default_rng(0), ramp_share=0.0) if i.mode in (FLY, BOUNCE)
    ]
    view = View.of_batch(
        ExampleBatch.stack([i.example for i in items]), tuple(range(6)), np.array([i.values for i in items])
    )
    return Lesson(view, np.arange(len(items)), np.array([i.mode == FLY for i in items]), np.ones(len(items)))


def _classifier(*clauses: Clause) -> BinaryClassifier:
    return BinaryClassifier(FLY, BOUNCE, _SCOPE, "touching", Definition(clauses, negated=True))


def _errors(classifier: BinaryClassifier, lesson: Lesson) -> int:
    return int(np.sum(classifier.says_i_batch(lesson.view, lesson.rows) != lesson.is_i))


def _good() -> Clause:
    return Clause((_APPROACH, *_SIDE))


def test_the_reference_definition_is_faultless(lesson: Lesson) -> None:
    assert _errors(_classifier(_good()), lesson) == 0


@pytest.mark.parametrize("threshold", [-0.1, 0.15])
def test_a_threshold_of_a_bound_object_is_moved_into_the_gap(lesson: Lesson, threshold: float) -> None:
    broken = _classifier(Clause((replace(_APPROACH, threshold=threshold), *_SIDE)))
    assert _errors(broken, lesson) > 10
    mended = mend(broken, lesson, 0.0, _CONFIG)
    assert mended is not None
    assert abs(mended.definition.clauses[0].literals[0].threshold) < 0.01
    assert _errors(mended, lesson) == 0
    assert 0 < mended.work < 20 * len(lesson.rows)


def test_a_threshold_of_a_scalar_is_moved(lesson: Lesson) -> None:
    fast = lesson.view.own[:, 0] > 0.1
    renamed = Lesson(lesson.view, lesson.rows, ~fast, lesson.weights)
    broken = _classifier(Clause((Literal("vx", (), op=">", threshold=0.2),)))
    mended = mend(broken, renamed, 0.0, _CONFIG)
    assert mended is not None
    assert mended.definition.clauses[0].literals[0].threshold == pytest.approx(0.1, abs=0.01)
    assert _errors(mended, renamed) == 0


def test_a_clause_that_does_harm_is_dropped(lesson: Lesson) -> None:
    broken = _classifier(Clause((Literal("box", (1,)),)), _good())
    mended = mend(broken, lesson, 0.0, _CONFIG)
    assert mended is not None
    assert mended.definition.clauses == (_good(),)


def test_a_missing_clause_is_added(lesson: Lesson) -> None:
    walls_only = Clause((Literal("wall", (1,)), _APPROACH))
    mended = mend(_classifier(walls_only), lesson, 0.0, _CONFIG)
    assert mended is not None
    assert mended.definition.clauses[0] == walls_only
    assert len(mended.definition.clauses) == 2
    assert _errors(mended, lesson) == 0


def test_what_takes_more_than_one_change_is_left(lesson: Lesson) -> None:
    flipped = Lesson(lesson.view, lesson.rows, lesson.is_i ^ (lesson.rows % 7 == 0), lesson.weights)
    assert mend(_classifier(_good()), flipped, 0.0, _CONFIG) is None
    assert mend(_classifier(_good()), flipped, float(len(lesson.rows)), _CONFIG) is not None
