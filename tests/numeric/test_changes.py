"""From when on something was wrong more often than before."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.numeric.changes import changed_at


@pytest.mark.parametrize(
    ("wrong", "since"),
    [
        ([], None),
        ([True], None),
        ([True] * 60, None),
        ([False] * 60, None),
        ([True] * 30 + [False] * 30, None),  # it got better
        (
            [False] * 59 + [True],
            None,
        ),  # 60 steps of which one is wrong: log2(60) bits, and as many to say when it began
        ([False] * 57 + [True] * 3, 57),
        ([False] * 1_000 + [True] * 20, 1_000),
        ([False, False, False, True] * 20 + [True] * 30, 79),
    ],
)
def test_from_when_on_it_was_wrong_more_often(wrong: list[bool], since: int | None) -> None:
    assert changed_at(wrong) == since


@given(st.lists(st.booleans(), max_size=60))
def test_what_follows_a_change_is_wrong_more_often_than_what_was_before(wrong: list[bool]) -> None:
    if (since := changed_at(wrong)) is not None:
        assert np.mean(wrong[:since]) < np.mean(wrong[since:])
