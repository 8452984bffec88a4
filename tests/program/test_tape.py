"""The tape of a program: what stands where, what is read, and what there is no room for."""

from __future__ import annotations

import itertools
import math
from base64 import b64encode
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_programs import by_kernel, empty

from relgym.program import records as ir
from relgym.program import tape as tapes
from relgym.program.tape import encoded, kind_of, ordered


def belief(outcome: int = 0, winner: int = 1, lead: int = 0, able: int = 1, speaker: int = 0) -> ir.Belief:
    return ir.Belief(outcome, winner, lead, able, speaker, 0.5, 0.1, True)


def halving(**fields: Any) -> ir.Program:
    """x' = 1 + x / 2, of one object with x and y."""
    mode = ir.Mode(3, 7, ir.Sum(((ir.CONSTANT, 1.0), (0, 0.5))))
    return empty(2, 8, answers=(ir.Answer("o", "p0", 0, 0, (), -1, modes=(mode,)),), **fields)


def test_one_function_by_hand() -> None:
    told = by_kernel(halving(), np.array([[4.0, 9.0], [-2.0, 0.0]]))
    np.testing.assert_array_equal(told.after, [[3.0, 9.0], [0.0, 0.0]])
    assert told.outcomes.tolist() == [[0], [0]] and told.modes.tolist() == [[3], [3]]
    assert told.margins.tolist() == [[math.inf], [math.inf]]


def test_places_follow_their_rates_once_these_are_known() -> None:
    program = halving(kinematics=((1, 0.5, 2),))  # y' = y + x' / 2
    told = by_kernel(program, np.array([[4.0, 9.0]]))
    np.testing.assert_array_equal(told.after, [[3.0, 10.5]])


def test_angles_come_back_between_minus_pi_and_pi() -> None:
    program = halving(angles=(0,))
    told = by_kernel(program, np.array([[8.0, 0.0], [4.0, 0.0]]))
    np.testing.assert_allclose(told.after[:, 0], [5.0 - 2 * math.pi, 3.0], rtol=1e-15)


def test_next_values_that_a_step_reads_or_writes() -> None:
    mode = ir.Mode(1, 11, ir.Sum(((6, 1.0), (1, 1.0))))  # reads p2', and p1 as it is
    answer = ir.Answer("o", "p0", 0, 0, (), -1, modes=(mode,))
    tape = encoded(empty(4, 12, answers=(answer,), kinematics=((3, 1.0, 0),)))
    at = tape.code[tapes.AT_NEXTS]
    assert tape.code[at : at + tape.code[tapes.NEXTS]].tolist() == [0, 2, 3]


def test_votes_stand_where_the_tape_says() -> None:
    """Two modes, of which x > 0 decides; votes written over there change who wins."""
    modes = tuple(ir.Mode(k + 1, 5 + k, ir.Sum(((ir.CONSTANT, float(k)),))) for k in range(2))
    stages = (
        ir.Stage(ir.Clause(1, 1, ()), (ir.Test(0, -1, False, 0.0, False),), None, (0,)),
        ir.Stage(None, (), None, (1,)),
    )
    vote = ir.Vote((ir.Contest(0, 1, 0, stages, ((0, -(1 << 32)), (-(1 << 33), 0))),), (0, 1), None)
    program = empty(1, 7, answers=(ir.Answer("o", "p0", 0, 0, (), -1, modes=modes, vote=vote),))
    tape = encoded(program)
    told = by_kernel(program, np.array([[1.0], [-1.0]]), tape=tape)
    assert told.modes.ravel().tolist() == [1, 2] and told.margins.ravel().tolist() == [1.0, 2.0]
    ((places, by_tie),) = tape.votes
    assert tape.code[places[0] : places[0] + 4].tolist() == [0, -(1 << 32), -(1 << 33), 0]
    assert tape.code[by_tie : by_tie + 2].tolist() == [0, 1]
    tape.code[places[0] : places[0] + 4] = 0
    told = by_kernel(program, np.array([[1.0], [-1.0]]), tape=tape)
    assert told.modes.ravel().tolist() == [1, 1] and told.margins.ravel().tolist() == [0.0, 0.0]
    tape.code[by_tie : by_tie + 2] = 1, 0
    assert by_kernel(program, np.array([[1.0]]), tape=tape).modes.tolist() == [[2]]


def test_a_run_off_among_three() -> None:
    """Mode 1 wins by most votes in all, yet mode 3 beats it once mode 2, who lost to it by much, has dropped out."""
    modes = tuple(ir.Mode(k + 1, 5 + k, ir.Sum(((ir.CONSTANT, float(k)),))) for k in range(3))
    one = 1 << 32
    votes = {(0, 1): (0, -8 * one), (0, 2): (-one, 0), (1, 2): (0, -one)}
    contests = tuple(
        ir.Contest(a, b, 0, (ir.Stage(None, (), None, (0,)),), (each,)) for (a, b), each in votes.items()
    )
    vote = ir.Vote(contests, (0, 1, 2), None)
    program = empty(1, 8, answers=(ir.Answer("o", "p0", 0, 0, (), -1, modes=modes, vote=vote),))
    told = by_kernel(program, np.array([[0.0]]))
    assert told.modes.tolist() == [[3]] and told.margins.tolist() == [[1.0]]
    assert told.after.tolist() == [[2.0]]


def _many(**fields: Any) -> ir.Program:
    return replace(halving(), **fields)


def _modes(count: int) -> ir.Program:
    (answer,) = halving().answers
    modes = tuple(ir.Mode(k + 1, 7, ir.Sum(())) for k in range(count))
    return _many(answers=(replace(answer, modes=modes),))


def _answers(count: int, *, keys: int = 1) -> ir.Program:
    (answer,) = halving().answers
    return _many(answers=tuple(replace(answer, key=k % keys) for k in range(count)))


def _terms(count: int) -> ir.Program:
    (answer,) = halving().answers
    mode = ir.Mode(1, 7, ir.Sum(((0, 1.0),) * count))
    return _many(answers=(replace(answer, modes=(mode,)),))


@pytest.mark.parametrize(
    ("make", "most", "what"),
    [
        (lambda n: _many(registers=n), tapes.MOST.registers, "numbers"),
        (lambda n: _many(relations=("intersect",) * n), tapes.MOST.relations, "relations"),
        (lambda n: _many(facts=("distance",) * n), tapes.MOST.features, "features of pairs"),
        (_modes, tapes.MOST.modes, "modes"),
        (_answers, tapes.MOST.answers, "answers"),
        (lambda n: _answers(n, keys=n), tapes.MOST.keys, "properties"),
    ],
)
def test_what_there_is_no_room_for(make: Any, most: int, what: str) -> None:
    encoded(make(most))
    with pytest.raises(ir.BeyondError, match=f"{most + 1} {what}, of which there may be {most}"):
        encoded(make(most + 1))


def _regressed(width: int) -> ir.Program:
    """A program with a regression on so many columns."""
    spread = b64encode(bytes(2 * width * (width + 1))).decode()
    return _many(fits=(ir.Fit(((0, 0.0, 1.0),) * width, (ir.Leverage((0.0,) * width, spread),)),))


def test_there_is_room_for_so_many_constants() -> None:
    encoded(_regressed(tapes.MOST.shown - 4))
    with pytest.raises(ir.BeyondError, match="constants, of which there may be 131072"):
        encoded(_regressed(tapes.MOST.shown))


def test_there_is_room_for_regressions_on_so_many_columns() -> None:
    with pytest.raises(ir.BeyondError, match="513 columns of regressions, of which there may be 512"):
        encoded(_regressed(tapes.MOST.shown + 1))


@given(st.integers(0, 6), st.integers(-4, 1 << 40), st.integers(-2, 7), st.integers(0, 15))
def test_a_kind_is_read_back_from_its_number(outcome: int, winner: int, lead: int, able: int) -> None:
    number = tapes._kind(belief(outcome, winner, lead, able))
    assert kind_of(number) == (outcome, winner, lead)


def test_no_two_kinds_share_a_number() -> None:
    kinds = itertools.product(range(7), range(-3, 4), range(-2, 8), range(0, 16, 3))
    some = [belief(*kind) for kind in kinds]
    assert len({tapes._kind(b) for b in some}) == len(some)


@given(st.permutations([belief(o, w, lead) for o in (0, 2) for w in (-1, 0, 1) for lead in (-2, -1, 0, 7)]))
def test_beliefs_are_put_in_the_order_of_their_numbers(some: list[ir.Belief]) -> None:
    numbers = [tapes._kind(b) for b in ordered(some)]
    assert numbers == sorted(numbers) and set(ordered(some)) == set(some)


def _vote(*literals: ir.Literal, **fields: Any) -> ir.Vote:
    stage = ir.Stage(ir.Clause(1, 2, literals), fields.get("tests", ()), fields.get("tree"), (0,))
    contest = ir.Contest(0, 1, fields.get("context", 2), (stage,), ((0, 0),))
    return ir.Vote((contest,), (0, 1), fields.get("experience"))


RELATED, IS_A = ir.Related(0, 0, 1, False), ir.IsA(1, 1, False)
PAIR, TEST = ir.PairTest(0, 1, True, 0.0, False), ir.Test(0, -1, True, 0.0, False)


@pytest.mark.parametrize(
    ("vote", "relational", "narrow"),
    [
        (_vote(RELATED, IS_A), True, False),
        (_vote(RELATED, context=0), True, True),
        (_vote(RELATED, context=1), True, True),
        (_vote(RELATED, tests=(TEST,)), False, False),
        (_vote(PAIR), False, True),
        (_vote(tree=ir.Tree((ir.Sight(0),), ((0, 0.0, 0, 0),))), False, False),
        (_vote(tree=ir.Tree((ir.Sight(-1, -1, 1, 0),), ((0, 0.0, 0, 0),))), False, True),
        (_vote(RELATED, experience=ir.Experience(((1, (0,), ()),), ())), True, True),
        (_vote(RELATED, experience=ir.Experience(((2, (0,), ()),), ())), True, False),
    ],
)
def test_what_a_vote_looks_at(vote: ir.Vote, relational: bool, narrow: bool) -> None:
    """Relations alone: its answer is remembered. What is near isn't worked out where nobody asks."""
    assert (tapes._relational(vote), tapes._narrow(vote)) == (relational, narrow)


def test_another_tape_in_the_same_space_leaves_nothing_behind() -> None:
    space = encoded(halving()).space()
    space["memory_keys"], space["believed"] = 5, 5
    (answer,) = halving().answers
    other = encoded(_many(answers=(replace(answer, state="none", modes=()),)))
    other.lay(space)
    np.testing.assert_array_equal(space["code"][0, : len(other.code)], other.code)
    np.testing.assert_array_equal(space["numbers"][0, : len(other.numbers)], other.numbers)
    assert not space["memory_keys"].any() and (space["believed"] == tapes.NOBODY).all()


def test_what_a_wall_reads_is_there_in_every_scene() -> None:
    """A stop that looks at p1', which nobody else reads or writes: it is p1 of this scene, not of the one before."""
    (answer,) = halving().answers
    stop = ir.Stop(5, -1.0, 3, 0.0, 10.0, 1.0)  # where p1' >= 10
    program = _many(answers=(replace(answer, stops=(stop,)),))
    told = by_kernel(program, np.array([[4.0, 20.0], [4.0, 0.0], [4.0, 10.0]]))
    assert told.modes.ravel().tolist() == [5, 3, 5] and told.after[:, 0].tolist() == [-1.0, 3.0, -1.0]
    landing = ir.Landing(6, -2.0, 3, 7.0, 0.5)
    told = by_kernel(_many(answers=(replace(answer, stops=(landing,)),)), np.array([[4.0, 7.5], [4.0, 7.6]]))
    assert told.modes.ravel().tolist() == [6, 3]
