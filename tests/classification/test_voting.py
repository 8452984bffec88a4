"""Votes counted by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_situations import BALL_VOCABULARY, ball_stream

from relgym.classification.binary import VOTE_UNIT, BinaryClassifier
from relgym.classification.examples import ExampleBatch
from relgym.classification.familiarity import Familiarity
from relgym.classification.ranking import Ranking
from relgym.classification.views import Scope
from relgym.classification.voting import Voting, run_off_batch
from relgym.config import ClassificationConfig
from relgym.logic.clause import Clause, Definition, Literal

_ITEM = next(ball_stream(1, rng=np.random.default_rng(0)))
_COUNTS = {1: 10.0, 2: 30.0, 3: 20.0}
_NOTHING_SEEN = Familiarity((), [])
_EVERYTHING_SEEN = Familiarity((), [0])


def _pair(i: int, j: int, counts: list[list[float]], fires: bool) -> BinaryClassifier:
    scope = Scope.of(BALL_VOCABULARY, ClassificationConfig(), (i, j))
    clause = Clause((Literal("vx", (), op="<=", threshold=9.0 if fires else -9.0),))
    return BinaryClassifier(i, j, scope, "touching", Definition((clause,)), counts=counts)


def _voting() -> Voting:
    voting = Voting(BALL_VOCABULARY, (1, 2, 3))
    # 1 beats 2 for sure; 3 narrowly beats 1; 2 narrowly beats 3.
    pairs = [
        _pair(1, 2, [[98.0, 0.0], [0.0, 98.0]], fires=True),
        _pair(1, 3, [[9.0, 1.0], [4.0, 5.0]], fires=False),
        _pair(2, 3, [[5.0, 4.0], [0.0, 9.0]], fires=True),
    ]
    voting.set_pairs(pairs)
    return voting


def test_in_a_run_off_the_pairs_of_modes_that_dropped_out_are_not_heard() -> None:
    ranking = _voting().rank(_ITEM.example, [0.0] * 3, _COUNTS, _EVERYTHING_SEEN)
    assert ranking.modes == (3, 1, 2)  # 2 loses most by far; without it, 3 beats 1
    assert ranking.margin == pytest.approx(math.log(6 / 5), abs=1e-9)


def test_votes_by_hand() -> None:
    # Laplace: 1 and 2 are told apart 99 to 1; of 1 and 3 none fires, 5 to 6; of 2 and 3 6 to 5.
    ranking = _voting().rank(_ITEM.example, [0.0] * 3, _COUNTS, _EVERYTHING_SEEN)
    expected = {
        1: math.log(99 / 100) + math.log(5 / 11),
        2: math.log(1 / 100) + math.log(6 / 11),
        3: math.log(6 / 11) + math.log(5 / 11),
    }
    assert dict(zip(ranking.modes, ranking.scores, strict=True)) == pytest.approx(expected, abs=1e-9)
    # The most votes in the first count are mode 1's: they come from the pair with a mode that drops out.
    assert max(expected, key=lambda mode: expected[mode]) == 1 != ranking.modes[0]


def test_of_two_modes_their_pair_decides() -> None:
    voting = Voting(BALL_VOCABULARY, (5, 2))
    voting.set_pairs([_pair(2, 5, [[2.0, 7.0], [0.0, 0.0]], fires=True)])
    ranking = voting.rank(_ITEM.example, [0.0] * 2, {2: 9.0, 5: 1.0}, _EVERYTHING_SEEN)
    assert ranking.modes == (5, 2)
    assert ranking.scores == pytest.approx((math.log(8 / 11), math.log(3 / 11)), abs=1e-9)
    assert ranking.margin == pytest.approx(math.log(8 / 3), abs=1e-9)
    voting.set_pairs([_pair(2, 5, [[2.0, 5.0], [0.0, 0.0]], fires=True)])
    voting._classifiers[0].counts[0][0] = 7.0  # read again when it is told to
    assert voting.rank(_ITEM.example, [0.0] * 2, {2: 9.0, 5: 1.0}, _EVERYTHING_SEEN).modes == (5, 2)
    voting.recount(0)
    ranking = voting.rank(_ITEM.example, [0.0] * 2, {2: 9.0, 5: 1.0}, _EVERYTHING_SEEN)
    assert (ranking.modes, ranking.margin) == ((2, 5), pytest.approx(math.log(8 / 6), abs=1e-9))


def test_of_equals_the_one_with_more_examples_wins_then_the_older() -> None:
    voting = Voting(BALL_VOCABULARY, (3, 1, 2))
    even = [[4.0, 4.0], [4.0, 4.0]]
    voting.set_pairs([_pair(i, j, even, fires=True) for i, j in ((1, 2), (1, 3), (2, 3))])
    for counts, order in (({1: 5.0, 2: 9.0, 3: 7.0}, (2, 3, 1)), ({1: 5.0, 2: 5.0, 3: 5.0}, (1, 2, 3))):
        ranking = voting.rank(_ITEM.example, [0.0] * 3, counts, _EVERYTHING_SEEN)
        assert (ranking.modes, ranking.margin) == (order, 0.0)
        batch = voting.rank_batch(ExampleBatch.of(_ITEM.example), np.zeros((1, 3)), counts, _EVERYTHING_SEEN)
        assert batch[0] == ranking


def test_one_mode_wins_without_a_vote() -> None:
    voting = Voting(BALL_VOCABULARY, (4,))
    ranking = voting.rank(_ITEM.example, [0.0], {4: 1.0}, _NOTHING_SEEN)
    assert ranking == Ranking((4,), (0.0,), math.inf, False, False)
    assert (
        voting.rank_batch(ExampleBatch.of(_ITEM.example), np.zeros((1, 1)), {4: 1.0}, _NOTHING_SEEN)[0]
        == ranking
    )


# ---------------------------------------------------------------------- the run-off itself
def test_a_run_off_by_hand() -> None:
    # Leads of a over b 6, b over c 5, c over a 4, d loses to all by 1. In all: a 6 - 4 + 1 = 3, b -6 + 5 + 1 = 0,
    # c -5 + 4 + 1 = 0, d -3. First d drops out; then a has 2, b -1, c -1, and of equals the last by ties, b; then
    # c beats a by 4.
    lead = np.zeros((1, 4, 4), dtype=np.int64)
    for (winner, loser), votes in {(0, 1): 6, (1, 2): 5, (2, 0): 4, (0, 3): 1, (1, 3): 1, (2, 3): 1}.items():
        lead[0, winner, loser], lead[0, loser, winner] = votes, -votes
    order, margin = run_off_batch(lead, (2, 0, 1, 3))
    assert (order.tolist(), margin.tolist()) == ([[2, 0, 1, 3]], [4])
    # If c is the last of the two, it drops out, and a beats b by 6.
    order, margin = run_off_batch(lead, (1, 0, 2, 3))
    assert (order.tolist(), margin.tolist()) == ([[0, 1, 2, 3]], [6])


@given(st.integers(1, 6), st.integers(0, 3), st.integers(0, 2**32 - 1))
def test_one_by_one_a_run_off_ends_as_in_a_batch(modes: int, most: int, seed: int) -> None:
    """Against Baldwin's method told plainly, with many ties."""
    rng = np.random.default_rng(seed)
    lead = np.triu(rng.integers(-most, most + 1, (5, modes, modes)), 1)
    lead -= lead.transpose(0, 2, 1)
    by_tie = rng.permutation(modes).tolist()
    order, margin = run_off_batch(lead, by_tie)
    voting = Voting(BALL_VOCABULARY, tuple(range(modes)))
    voting._places = [(a, b) for a in range(modes) for b in range(a + 1, modes)]
    for k in range(5):
        alive, out = list(by_tie), list[int]()
        while len(alive) > 1:
            sums = [(sum(int(lead[k, m, o]) for o in alive), -by_tie.index(m), m) for m in alive]
            out.append(min(sums)[2])
            alive.remove(out[-1])
        expected = [*alive, *reversed(out)]
        assert order[k].tolist() == expected
        won = int(lead[k, expected[0], expected[1]]) if modes > 1 else 0
        assert margin[k] == won >= 0
        cast = [(int(lead[k, a, b]), 0) for a, b in voting._places]
        assert voting._run_off(cast, by_tie) == (expected, won if modes > 1 else None)


def test_a_batch_is_ranked_as_each_of_its_examples() -> None:
    voting = _voting()
    one = voting.rank(_ITEM.example, [0.0] * 3, _COUNTS, _EVERYTHING_SEEN)
    batch = voting.rank_batch(ExampleBatch.of(_ITEM.example), np.zeros((1, 3)), _COUNTS, _EVERYTHING_SEEN)
    assert batch[0] == one


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_a_mode_that_wins_all_its_pairs_wins_the_run_off(modes: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    lead = np.triu(rng.integers(-5, 6, (20, modes, modes)), 1)
    lead[:, 0, 1:] = rng.integers(1, 3, (20, modes - 1))
    lead -= lead.transpose(0, 2, 1)
    order, margin = run_off_batch(lead, tuple(rng.permutation(modes).tolist()))
    assert (order[:, 0] == 0).all()
    assert (np.sort(order, axis=1) == np.arange(modes)).all()
    assert ((margin > 0) == (modes > 1)).all()


def test_votes_are_whole_units() -> None:
    for pair in _voting()._classifiers:
        for votes in pair.votes:
            assert all(isinstance(vote, int) and -10 * VOTE_UNIT < vote < 0 for vote in votes)


def test_familiar_is_what_was_seen_or_what_a_clause_speaks_for() -> None:
    voting = _voting()
    values = [0.0] * 3
    assert not voting.rank(_ITEM.example, values, _COUNTS, _NOTHING_SEEN).seen
    sure = [[9.0, 0.0], [0.0, 9.0]]
    voting.set_pairs([_pair(i, j, sure, fires=True) for i, j in ((1, 2), (1, 3), (2, 3))])
    assert voting.rank(
        _ITEM.example, values, _COUNTS, _NOTHING_SEEN
    ).familiar  # a clause spoke for the winner
    voting.set_pairs([_pair(i, j, sure, fires=False) for i, j in ((1, 2), (1, 3), (2, 3))])
    abstained = voting.rank(_ITEM.example, values, _COUNTS, _NOTHING_SEEN)
    assert abstained.modes[0] == 3
    assert not abstained.familiar
    assert voting.rank(_ITEM.example, values, _COUNTS, _EVERYTHING_SEEN).familiar


def test_no_modes_no_winner() -> None:
    voting = Voting(BALL_VOCABULARY, ())
    assert voting.rank(_ITEM.example, [], {}, _NOTHING_SEEN).modes == ()
    batch = voting.rank_batch(ExampleBatch.of(_ITEM.example), np.empty((1, 0)), {}, _NOTHING_SEEN)
    assert batch.modes.shape == (1, 0)
    assert batch[0] == voting.rank(_ITEM.example, [], {}, _NOTHING_SEEN)


def test_verdicts_give_clause_counts_and_probability() -> None:
    voting = _voting()
    first, second = voting.verdicts(_ITEM.example, [0.0] * 3, (1, 2, 3))
    assert (first.winner, first.runner_up, str(first.clause)) == (1, 2, "vx <= 9")
    assert (first.correct, first.incorrect, first.probability) == (98.0, 0.0, 99 / 100)
    assert (second.winner, second.runner_up, second.clause) == (3, 1, None)
    assert (second.correct, second.incorrect) == (5.0, 4.0)
