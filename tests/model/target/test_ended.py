"""Modes that have ended: what is news depends on whether they used to leave and come back."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from relgym.model.target.ended import ended


def over(*held: int, away: int) -> bool:
    """Whether mode 1, which held for such runs with another one for the even ones between, has ended now."""
    labels = np.concatenate([np.full(run, 1 + k % 2) for k, run in enumerate(held)] + [np.full(away, 2)])
    return ended(labels, [1, 2], lambda mode: mode == 1, {1: [2], 2: [1]}.__getitem__) == {1}


def test_what_never_left_has_ended_after_ten_examples_of_another() -> None:
    assert not over(300, away=9)
    assert over(300, away=10)


def test_what_came_back_is_waited_for_longer_than_it_was_away() -> None:
    assert not over(300, 300, 300, away=300)
    # One return in 300 examples: a rate of 1.5 / 301, of which each example tells .0072 bits.
    assert not over(300, 300, 300, away=1_387)
    assert over(300, 300, 300, away=1_388)


def test_what_comes_and_goes_every_few_steps_is_missed_soon() -> None:
    runs = [3, 5] * 40 + [3]
    assert not over(*runs, away=30)
    assert over(*runs, away=32)


@given(st.lists(st.integers(1, 50), min_size=1, max_size=9).filter(lambda runs: len(runs) % 2 == 1))
def test_the_longer_it_is_away_the_more_surely_it_has_ended(runs: list[int]) -> None:
    found = [over(*runs, away=away) for away in range(0, 400, 20)]
    assert found == sorted(found)
    assert not found[0]


def test_what_is_told_apart_is_not_missed_while_the_other_holds() -> None:
    labels = np.array([1, 1, 3, 3, 3] * 20 + [3] * 300 + [2] * 9 + [3] * 300)
    alike = {1: [2], 2: [1], 3: []}
    assert ended(labels, [1, 2, 3], lambda mode: mode == 1, alike.__getitem__) == set()
    assert ended(np.append(labels, 2), [1, 2, 3], lambda mode: mode == 1, alike.__getitem__) == {1}


def test_of_all_modes_not_every_one_has_ended() -> None:
    labels = np.array([1] * 40 + [2] * 40 + [3] * 40)
    alike = {1: [2, 3], 2: [1, 3], 3: [1, 2]}
    assert ended(labels, [1, 2, 3], lambda mode: True, alike.__getitem__) == {1, 2}
    assert ended(labels, [1, 2], lambda mode: True, alike.__getitem__) == set()
