"""Tables, broken lines and plain data."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

from hypothesis import given
from hypothesis import strategies as st

from relgym.model.reports.text import amount, indented, plain, table, wrapped

WORDS = st.text(st.characters(categories=("L", "N")), min_size=1, max_size=12)


def test_numbers_stand_right_and_words_left() -> None:
    assert table(["name", "count"], [["a", 1], ["across the table"][0], ["bb", 12345]]) == (
        "name   count\na          1\nacross the table\nbb    12,345"
    )


def test_a_table_without_rows_is_its_heading() -> None:
    assert table(["name", "count"], []) == "name  count"


def test_floats_are_short() -> None:
    assert table(["x"], [[1.0], [0.12345678]]) == "       x\n       1\n0.123457"


@given(
    st.lists(st.lists(WORDS, min_size=1, max_size=4).map(" ".join), min_size=1, max_size=6),
    st.integers(1, 60),
)
def test_broken_lines_lose_nothing(parts: list[str], width: int) -> None:
    text = " ∧ ".join(parts)
    lines = wrapped(text, width, "∧")
    assert " ".join(lines) == text
    assert all(len(line) <= width or " ∧ " not in line for line in lines)


def test_only_lines_with_text_are_indented() -> None:
    assert indented("a\n\nb") == "  a\n\n  b"


def test_amounts() -> None:
    assert [amount(n, "mode") for n in (0, 1, 16000)] == ["0 modes", "1 mode", "16,000 modes"]


def test_records_become_json() -> None:
    @dataclass(frozen=True)
    class Record:
        values: tuple[float, ...]

    assert json.loads(json.dumps(plain({("a", 1): Record((1.5, math.inf))}))) == {
        "('a', 1)": {"values": [1.5, None]}
    }
