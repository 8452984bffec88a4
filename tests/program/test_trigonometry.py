"""Sines and cosines in plain arithmetic are those of the library, to a unit in the last place."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from relgym.program.trigonometry import cosine, sine


@given(st.floats(-1e6, 1e6))
def test_they_are_those_of_the_library(angle: float) -> None:
    for mine, its in ((sine, math.sin), (cosine, math.cos)):
        assert abs(mine(angle) - its(angle)) <= np.spacing(abs(its(angle)))


def test_by_hand() -> None:
    assert (sine(0.0), cosine(0.0)) == (0.0, 1.0)
    assert (sine(math.pi / 2), cosine(math.pi / 2)) == (1.0, math.cos(math.pi / 2))
    assert sine(-1.25) == -sine(1.25) and cosine(-1.25) == cosine(1.25)
