"""Spreads in words."""

from __future__ import annotations

import pytest

from relgym.model.reports.spread_text import labels, spread_text
from relgym.model.target.spread import Spread

NAMES = ("a", "left", "right")
LEFT, RIGHT = (0.0, 1.0, 0.0), (1.0, 0.0, 1.0)


def test_one_for_all() -> None:
    assert spread_text(Spread(0.123), NAMES) == "± 0.12"


def test_much_alike_is_one_for_all() -> None:
    assert spread_text(Spread(0.2, {LEFT: 0.1, RIGHT: 0.2}), NAMES) == "± 0.2"
    assert spread_text(Spread(0.2, {LEFT: 0.1, RIGHT: 0.201}), NAMES) == "± 0.1 after left; ± 0.2 after right"


def test_too_many_to_be_told_apart() -> None:
    text = spread_text(Spread(0.5, {LEFT: 0.1, RIGHT: 0.9}, pooled=True), NAMES)
    assert text == "± 0.5 over all actions: more than are told apart"


def test_many_actions_in_groups_of_which_the_largest_goes_last() -> None:
    """0.1 to 0.2 are alike, 0.201 isn't, nor is 8; within a group: the root mean square."""
    known = {(float(k),): s for k, s in enumerate((0.1, 0.2, 0.1, 0.2, 0.1, 0.2, 0.201, 8.0, 8.0))}
    assert spread_text(Spread(1.0, known), ("force",)) == (
        "± 0.2 after 6; ± 8 after 7 or 8; ± 0.16 after any other"  # sqrt((0.01 + 0.04) / 2) = 0.158
    )


@pytest.mark.parametrize(
    ("actions", "names", "told"),
    [
        ([LEFT, RIGHT], NAMES, ["left", "right"]),
        ([LEFT, RIGHT], ("a", "a_is_0", "a_is_1"), ["0", "1"]),
        ([(3.0, 1.0, 0.0), (4.0, 0.0, 1.0)], NAMES, ["left", "right"]),  # counted from 3
        ([(0.0, 0.0, 1.0), (1.0, 1.0, 0.0)], NAMES, ["0, 0, 1", "1, 1, 0"]),  # no choice: from 1 and from -1
        ([(0.0, 1.0, 1.0)], NAMES, ["0, 1, 1"]),
        ([(0.25,), (-1.0,)], ("force",), ["0.25", "-1"]),
        ([(1.0, 2.0)], ("only one",), ["1, 2"]),  # names of something else
        ([], (), []),
    ],
)
def test_actions_for_people(
    actions: list[tuple[float, ...]], names: tuple[str, ...], told: list[str]
) -> None:
    assert list(labels(actions, names).values()) == told
