"""What is refused of a field, and in which words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.config.checks import at_least, at_most, checked_count, one_of, plain, unit
from relgym.errors import ConfigError


@dataclass(frozen=True)
class Record:
    """One field of each kind."""

    flag: bool = False
    count: int = 3
    size: float = 0.5
    word: str = "a"


@pytest.mark.parametrize(
    ("given_", "said"),
    [
        ({"flag": 1}, "flag must be True or False, got 1"),
        ({"flag": None}, "flag must be True or False, got None"),
        ({"count": True}, "count must be a whole number, got True"),
        ({"count": 2.0}, "count must be a whole number, got 2.0"),
        ({"size": "0.5"}, "size must be a number, got '0.5'"),
        ({"size": False}, "size must be a number, got False"),
        ({"size": float("nan")}, "size must be finite, got nan"),
        ({"size": float("-inf")}, "size must be finite, got -inf"),
        ({"count": 2**63}, r"count must lie within ±2\*\*63, got a number of 64 bits"),
        ({"count": -(2**80)}, r"count must lie within ±2\*\*63, got a number of 81 bits"),
        ({"size": 10**400}, r"size must lie within ±2\*\*63, got a number of 1329 bits"),
    ],
)
def test_fields_are_plain_numbers(given_: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=f"^{said}$"):
        plain(Record(**given_))


def test_numpys_numbers_become_plain_ones() -> None:
    record = Record(flag=np.bool_(True), count=np.int32(7), size=np.float32(0.25))  # type: ignore[arg-type]
    plain(record)
    assert record == Record(True, 7, 0.25)
    assert [type(v) for v in (record.flag, record.count, record.size)] == [bool, int, float]
    whole = Record(size=2, count=2**63 - 1)
    plain(whole)
    assert type(whole.size) is int  # a whole number is a number


def test_ranges_hold_at_their_ends() -> None:
    record = Record(count=3, size=1.0)
    at_least(record, 3, "count")
    at_most(record, count=3, size=1.0)
    unit(record, "size")
    unit(Record(size=0.0), "size")
    one_of(record, word=("a", "b"))
    for check, said in (
        (lambda: at_least(record, 4, "size", "count"), "size must be at least 4, got 1.0"),
        (lambda: at_most(record, count=2), "count must be at most 2, got 3"),
        (lambda: at_most(Record(count=9_999), count=2_000), "count must be at most 2,000, got 9999"),
        (lambda: unit(Record(size=1.0001), "size"), r"size must lie in \[0, 1\], got 1.0001"),
        (lambda: unit(Record(size=-1e-9), "size"), r"size must lie in \[0, 1\], got -1e-09"),
        (lambda: one_of(record, word=("b", "c")), r"word must be one of \('b', 'c'\), got 'a'"),
    ):
        with pytest.raises(ConfigError, match=f"^{said}$"):
            check()


@given(st.integers(-(2**70), 2**70), st.integers(-5, 5), st.integers(0, 10))
def test_counts_are_whole_numbers_within_limits(count: int, least: int, room: int) -> None:
    if least <= count <= least + room:
        assert checked_count("n", count, least, least + room) == count
    else:
        with pytest.raises(
            ConfigError, match=f"^n={count}: expected a whole number from {least} to {least + room}$"
        ):
            checked_count("n", count, least, least + room)


@pytest.mark.parametrize("bad", [True, 2.0, "2", None, np.float64(2.0)])
def test_nothing_else_is_a_count(bad: object) -> None:
    with pytest.raises(ConfigError, match="expected a whole number from 1 to 5"):
        checked_count("n", bad, 1, 5)
    found = checked_count("n", np.int16(2), 1, 5)
    assert (found, type(found)) == (2, int)
