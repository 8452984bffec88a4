"""When a pair is learned anew, what teaches it, and which mode covers which."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from toy_situations import BALL_VOCABULARY, ball_stream

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import NOISE, ExampleBatch
from relgym.classification.learning import Lesson
from relgym.classification.pairs import PairState, covered_by, pair_labels
from relgym.classification.views import Scope, View
from relgym.config import ClassificationConfig
from relgym.logic.clause import Clause, Definition, Literal

_CONFIG = ClassificationConfig()
_SCOPE = Scope.of(BALL_VOCABULARY, _CONFIG)
_ITEM = next(ball_stream(1, rng=np.random.default_rng(0)))
_SLOW = Definition((Clause((Literal("vx", (), op="<=", threshold=0.1),)),))


def _lesson(speeds: list[float], is_i: list[bool]) -> Lesson:
    examples = [replace(_ITEM.example, own=np.array([x, 0.0])) for x in speeds]
    view = View.of_batch(ExampleBatch.stack(examples), (), np.empty((len(examples), 0)))
    return Lesson(view, np.arange(len(examples)), np.array(is_i), np.ones(len(examples)))


def _pair(errors: float = 0.0, *, definition: Definition = _SLOW) -> PairState:
    """Learned from ten examples of mode 4 and six of 7."""
    classifier = BinaryClassifier(4, 7, _SCOPE, "touching", definition)
    return PairState(classifier, [10.0, 6.0], (10.0, 6.0), errors)


def _times(pair: PairState, number: int, outcome: int, *, is_i: bool) -> list[bool]:
    return [pair.observe(outcome, is_i, 1.5) for _ in range(number)]


# ---------------------------------------------------------------------- when it becomes stale
def test_one_contradiction_more_than_errors_makes_a_pair_stale() -> None:
    for errors in (0.0, 2.0):
        pair = _pair(errors)
        assert _times(pair, int(errors), 0, is_i=False) == [True] * int(errors)
        assert not pair.stale
        assert _times(pair, 1, 1, is_i=True) == [True]
        assert pair.stale
        assert pair.contradictions == errors + 1.0


def test_examples_that_agree_make_none_stale_but_an_imperfect_one_grows_old() -> None:
    # 1.5 times six of the rarer mode are nine: three more.
    for pair, grows in ((_pair(), False), (_pair(1.0), True), (_pair(), True)):
        pair.mended = grows and not pair.errors
        assert _times(pair, 2, 1, is_i=False) == [False] * 2
        assert not pair.stale
        _times(pair, 1, 1, is_i=False)
        assert pair.stale is grows
        assert pair.seen == [10.0, 9.0]
    long = Clause(tuple(Literal(name, (1,)) for name in ("ball", "box", "floor", "wall")))
    pair = _pair(definition=Definition((long,)))
    _times(pair, 3, 1, is_i=False)
    assert pair.stale  # a long definition may be shorter now


def test_of_which_is_urgent() -> None:
    often, seldom, begun = _pair(9.0), _pair(9.0), _pair(9.0)
    often.contradictions, seldom.contradictions = 3.0, 1.0
    begun.draft = object()  # type: ignore[assignment]
    larger = _pair(9.0)
    larger.contradictions, larger.seen = 1.0, [7.0, 8.0]
    order = sorted([seldom, larger, often, begun], key=lambda pair: pair.urgency)
    assert [order.index(pair) for pair in (begun, often, larger, seldom)] == [0, 1, 2, 3]
    assert seldom.modes == (4, 7)


def test_a_new_pair_votes_for_the_mode_with_more_examples() -> None:
    pair = PairState.new(4, 7, _SCOPE, _lesson([0.0, 1.0, 2.0], [True, False, False]))
    assert pair.classifier.for_i == (False,)
    assert (pair.seen, pair.errors, pair.stale, pair.unlearned) == ([1.0, 2.0], 1.0, True, True)
    alone = PairState.new(4, 7, _SCOPE, _lesson([0.0, 1.0], [True, True]))
    assert (alone.errors, alone.stale) == (0.0, False)  # nothing to tell apart


def test_checked_after_examples_changed_labels() -> None:
    pair = _pair(1.0)
    pair.check(_lesson([0.0, 0.0, 0.5], [True, False, False]))  # one is wrong, as it was when it was learned
    assert (pair.seen, pair.stale, pair.contradictions) == ([1.0, 2.0], False, 0.0)
    pair.check(_lesson([0.0, 0.5, 0.5], [False, True, True]))
    assert (pair.seen, pair.stale, pair.contradictions) == ([2.0, 1.0], True, 2.0)
    assert pair.classifier.counts == [[0.0, 1.0], [2.0, 0.0]]
    fresh = PairState(BinaryClassifier(4, 7, _SCOPE, "touching", Definition(())), errors=9.0)
    fresh.check(_lesson([0.0, 0.5], [True, True]))
    assert not fresh.stale
    fresh.check(_lesson([0.0, 0.5], [True, False]))
    assert fresh.stale  # now there is something to be told apart


def test_it_is_learned_and_then_perfect() -> None:
    lesson = _lesson([0.0, 0.02, 0.04, 0.06, 0.3, 0.32, 0.34, 0.36], [True] * 4 + [False] * 4)
    pair = PairState.new(4, 7, _SCOPE, lesson)
    assert pair.refresh(lesson, _CONFIG, 1e9) > 0
    assert (pair.stale, pair.errors, pair.contradictions, pair.draft) == (False, 0.0, 0.0, None)
    assert pair.learned == (4.0, 4.0) and not pair.unlearned
    assert pair.classifier.says_i_batch(lesson.view, lesson.rows).tolist() == lesson.is_i.tolist()


def test_in_pieces_it_is_learned_as_at_once() -> None:
    rng = np.random.default_rng(3)
    speeds = rng.uniform(-1.0, 1.0, 40)
    lesson = _lesson(speeds.tolist(), ((speeds > -0.3) & (speeds < 0.4)).tolist())
    learned = []
    for budget in (1e9, 1.0):
        pair = PairState.new(4, 7, _SCOPE, lesson)
        steps = 0
        while pair.stale:
            pair.refresh(lesson, _CONFIG, budget)
            steps += 1
        learned.append((pair.classifier.to_dict(), pair.errors))
        assert (steps > 1) is (budget == 1.0)
    assert learned[0] == learned[1]


def test_what_is_read_is_what_was_saved() -> None:
    pair = _pair(2.0)
    _times(pair, 2, 0, is_i=False)
    again = PairState.from_dict(json.loads(json.dumps(pair.to_dict())), _SCOPE)
    assert again.to_dict() == pair.to_dict()
    assert _times(again, 1, 0, is_i=False) == [True] and again.stale


# ---------------------------------------------------------------------- what teaches it
def test_whose_examples_teach_a_pair_by_hand() -> None:
    # Modes 1, 2, 3; 2 covers 3. Pair (1, 2).
    assigned = np.array([1, 2, 3, 1, 2, NOISE, 1])
    owners = np.array([1, 2, 3, 1, 2, NOISE, 2])
    fits = np.array(
        [
            [1, 0, 0],  # for 1
            [0, 1, 0],  # for 2
            [0, 1, 1],  # of 3, which 2 covers: for 2
            [1, 1, 0],  # of 1, and 2 explains it: not used
            [1, 1, 0],  # of 2, and 1 explains it: not used
            [1, 0, 0],  # nobody's
            [0, 1, 0],  # belongs to 2, but was assigned to 1, which therefore explains it: not used
        ],
        dtype=bool,
    )
    found = pair_labels(assigned, owners, fits, (1, 2, 3), [(1, 2), (1, 3)])
    assert found[1, 2].tolist() == [1, -1, -1, 0, 0, 0, 0]
    # For the pair (1, 3) what 2 covers is 3's own.
    assert found[1, 3].tolist() == [1, 0, -1, 1, 0, 0, 0]


@pytest.mark.parametrize(("missed", "covered"), [(2, [3, 5]), (3, [5])])
def test_a_mode_covers_those_nearly_all_of_whose_examples_it_explains(
    missed: int, covered: list[int]
) -> None:
    """Nine of ten are enough; noise is covered by none."""
    assigned = np.array([3] * 20 + [5] * 2 + [NOISE] * 4 + [2] * 2)
    explained = np.ones(28, dtype=bool)
    explained[:missed] = explained[26] = False
    assert covered_by(assigned, explained) == covered


def test_of_no_examples_none_is_covered() -> None:
    assert covered_by(np.empty(0, dtype=int), np.empty(0, dtype=bool)) == []
