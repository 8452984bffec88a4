"""Numbers in the dtypes of spaces: rounded where they must be, refused where they don't fit."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from relgym.envs.views.base import as_shown, cast_to
from relgym.envs.views.leaves import Numbers
from relgym.errors import ObservationError


def test_whole_numbers_are_the_nearest() -> None:
    assert as_shown(np.array([2.6, -1.4, 0.0]), np.int64).tolist() == [3, -1, 0]
    assert as_shown(np.array([0.4, 0.6]), np.bool_).tolist() == [False, True]
    shown = as_shown(np.array([0.1]), np.float32)
    assert (shown.dtype, shown[0]) == (np.float32, np.float32(0.1))


@pytest.mark.parametrize(
    ("dtype", "number"),
    [
        (np.uint8, 256.0),
        (np.uint8, -1.0),
        (np.int8, float("nan")),
        (np.int64, 2.0**63),
        (np.float16, 1e5),
        (np.float32, 1e39),
        (np.float32, float("inf")),
        (np.float64, float("nan")),
        (np.bool_, 2.0),
    ],
)
def test_what_does_not_fit_is_refused(dtype: type, number: float) -> None:
    with pytest.raises(ObservationError, match=r"left what .* can hold"):
        as_shown(np.array([0.0, number]), dtype)
    shown, fits = cast_to(np.array([[0.0], [number]]), dtype)
    assert fits.tolist() == [[True], [False]]
    assert shown.tolist() == [[0], [0]]


SPACES = (
    spaces.Box(-2.0, 2.0, (2,), np.float32),
    spaces.Box(-np.inf, np.inf, (3,), np.float64),
    spaces.Box(0, 255, (2,), np.uint8),
    spaces.Discrete(3, start=-1),
    spaces.MultiDiscrete([2, 3]),
    spaces.MultiBinary(2),
    spaces.Dict({"a": spaces.Box(-1.0, 1.0, (1,), np.float32), "b": spaces.Discrete(2)}),
    spaces.Tuple((spaces.Discrete(2), spaces.Box(-1.0, 1.0, (2,), np.float64))),
)


@pytest.mark.parametrize("space", SPACES, ids=str)
@given(data=st.data())
def test_many_observations_are_written_as_one_is(space: spaces.Space, data: st.DataObject) -> None:
    numbers = Numbers(space)
    some = st.one_of(st.floats(-4.0, 4.0), st.sampled_from([1e300, 256.0, 0.5, 1.5, -0.5]))
    rows = data.draw(hnp.arrays(np.float64, (5, numbers.width), elements=some))
    shown, inside = numbers.write_all(rows)
    for k, row in enumerate(rows):
        try:
            one = numbers.write(row)
        except ObservationError:
            assert not inside[k]
            continue
        assert inside[k] == space.contains(one)
        if isinstance(space, spaces.Dict):
            assert all(np.array_equal(shown[key][k], part) for key, part in one.items())
        elif isinstance(space, spaces.Tuple):
            assert all(np.array_equal(whole[k], part) for whole, part in zip(shown, one, strict=True))
        else:
            np.testing.assert_array_equal(shown[k], one)
            assert shown.dtype == space.dtype
