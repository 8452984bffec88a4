"""Numbers that look random: the generator's own, one by one and together."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from relgym.mixing import GOLDEN, mixed, mixed_one

WORD = st.integers(0, 2**64 - 1)


def test_outputs_of_the_published_generator() -> None:
    """From the state 1234567, as Vigna's program prints them."""
    assert [mixed_one(1234567 + k * GOLDEN) for k in range(1, 6)] == [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]


@given(st.lists(WORD, max_size=9))
def test_many_are_mixed_as_one_by_one(numbers: list[int]) -> None:
    given_ = np.array(numbers, dtype=np.uint64)
    found = mixed(given_)
    assert found.dtype == np.uint64
    assert found.tolist() == [mixed_one(number) for number in numbers]
    assert given_.tolist() == numbers


@given(st.sets(WORD, max_size=50))
def test_different_numbers_stay_different(numbers: set[int]) -> None:
    assert len({mixed_one(number) for number in numbers}) == len(numbers)


def test_half_of_the_bits_are_set() -> None:
    bits = np.unpackbits(mixed(np.arange(1, 4097, dtype=np.uint64)).view(np.uint8)).reshape(-1, 64)
    assert abs(bits.mean(axis=0) - 0.5).max() < 4.5 * 0.5 / 64.0
