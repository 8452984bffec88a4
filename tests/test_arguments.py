"""Arguments compared with annotations: what fits, what doesn't, and that defects stay what they are."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from relgym.arguments import array_of, misfit, refusing, refusing_calls, refusing_fields, unfit, whole
from relgym.errors import ConfigError, QueryError, SchemaError


@pytest.mark.parametrize(
    ("value", "hint"),
    [
        (1, int),
        (np.int64(3), int),
        (1, float),
        (2.5, float | None),
        (None, float | None),
        ("a", str),
        (Ellipsis, Any),
        ("x", Literal["x", "y"]),
        (["a", "b"], tuple[str, ...]),
        (("a", 1), tuple[str, int]),
        ({"a": 1.0}, Mapping[str, float]),
        ({"a"}, Iterable[str]),
        (np.zeros(3), Sequence[float]),
        ([1, 2], NDArray[np.float64]),
        (len, Callable[[Any], int]),
        ("file", str | os.PathLike[str]),
        (np.True_, bool),
    ],
)
def test_what_fits(value: Any, hint: Any) -> None:
    assert misfit(value, hint) == ""


@pytest.mark.parametrize(
    ("value", "hint", "said"),
    [
        (True, int, "a whole number"),
        (2**40, int, "31 bits"),
        (10**400, float, "a finite number"),
        (float("nan"), float, "a finite number"),
        ("1", float | None, "a finite number or None"),
        ("\ud800", str, "printable text"),
        ("z", Literal["x", "y"], "one of ('x', 'y')"),
        ([], Literal["x"], "one of"),
        ("ab", tuple[str, ...], "a sequence"),
        (["a", 1], tuple[str, ...], "printable text"),
        (("a",), tuple[str, int], "a tuple of 2"),
        ([("a", 1)], Mapping[str, int], "a dict"),
        ({1: 1.0}, Mapping[str, float], "a dict whose keys are printable text"),
        ({"a": None}, Mapping[str, float], "a dict whose values are a finite number"),
        ({"a"}, Sequence[str], "a sequence"),
        (np.array(["a"]), NDArray[np.float64], "an array of numbers"),
        ([np.inf], NDArray[np.float64], "an array of finite numbers"),
        (3, Callable[[Any], int], "a function"),
        (b"file", str | os.PathLike[str], "a path"),
        (3, ConfigError, "an object of type ConfigError"),
    ],
)
def test_what_does_not_fit(value: Any, hint: Any, said: str) -> None:
    assert said in misfit(value, hint)


def test_an_argument_that_does_not_fit_is_named() -> None:
    @refusing(ConfigError)
    def ratio(a: float, b: float) -> float:
        return a / b

    assert ratio(1, 2) == 0.5
    with pytest.raises(ConfigError, match="b='x': expected a finite number") as found:
        ratio(1, "x")  # type: ignore[arg-type]
    assert isinstance(found.value.__cause__, TypeError)
    with pytest.raises(ConfigError, match="missing a required argument: 'b'"):
        ratio(1)  # type: ignore[call-arg]
    with pytest.raises(ZeroDivisionError):  # a defect of its own
        ratio(1, 0)


def test_records_are_checked_when_they_are_made_or_when_they_fail() -> None:
    @refusing_fields(SchemaError, always=True)
    @dataclass(frozen=True)
    class Eager:
        name: str

    @refusing_fields(SchemaError)
    @dataclass(frozen=True)
    class Lazy:
        name: str

        def __post_init__(self) -> None:
            self.name.lower()

    with pytest.raises(SchemaError, match="name=3: expected printable text"):
        Eager(3)  # type: ignore[arg-type]
    with pytest.raises(SchemaError, match="name=3: expected printable text"):
        Lazy(3)  # type: ignore[arg-type]
    assert Lazy("a").name == Eager("a").name


@dataclass
class Point:
    """A record."""

    x: float
    name: str = ""


def test_the_first_field_that_does_not_fit() -> None:
    assert unfit(Point(1.0)) == ""
    assert unfit(Point(float("nan"))) == "x=nan: expected a finite number"


def test_whole_numbers_within_limits() -> None:
    assert whole("n", np.int64(3), 0, 4, QueryError) == 3
    for bad in (4, -1, True, 2.0, None, "1"):
        with pytest.raises(QueryError, match="expected a whole number from 0 to 3"):
            whole("n", bad, 0, 4, QueryError)


def test_every_public_call_of_a_class_refuses() -> None:
    @refusing_calls(ConfigError)
    class Share:
        def __init__(self, whole: float) -> None:
            self.whole = 1.0 / whole

        def of(self, part: float) -> float:
            return part * self.whole

        @classmethod
        def full(cls, size: float) -> Share:
            return cls(size)

        @staticmethod
        def half(size: float) -> float:
            return size / 2

        def _own(self, part: float) -> float:
            return part / self.whole

    assert Share(4).of(2) == 0.5 and Share.full(2).of(1) == 0.5 and Share.half(3) == 1.5
    bad: list[tuple[str, Callable[[], object]]] = [
        ("whole='x'", lambda: Share("x")),  # type: ignore[arg-type]
        ("part='x'", lambda: Share(4).of("x")),  # type: ignore[arg-type]
        ("whole='x'", lambda: Share.full("x")),  # type: ignore[arg-type]
        ("size='x'", lambda: Share.half("x")),  # type: ignore[arg-type]
    ]
    for said, call in bad:
        with pytest.raises(ConfigError, match=said):
            call()
    with pytest.raises(TypeError):  # nobody else's business
        Share(4)._own("x")  # type: ignore[arg-type]
    with pytest.raises(ZeroDivisionError):  # it fits, so that is a defect
        Share(0)


@pytest.mark.parametrize(
    ("value", "shape"), [([1, 2], (2,)), ([[1.0], [2.0]], (None, 1)), (np.zeros((0, 3)), (None, 3)), (1, ())]
)
def test_arrays_of_a_shape(value: Any, shape: tuple[int | None, ...]) -> None:
    found = array_of("x", value, shape, ConfigError)
    assert found.dtype == np.float64 and found.shape == np.shape(value)


@pytest.mark.parametrize(
    ("value", "shape", "said"),
    [
        ("a", (1,), "an array of numbers"),
        ([1, 2], (3,), r"shape \(3,\), got shape \(2,\)"),
        ([1, 2], (None, 2), r"shape \(n, 2\), got shape \(2,\)"),
        ([1, np.inf], (2,), "aren't finite"),
        ([10**400], (1,), "an array of numbers"),
    ],
)
def test_arrays_of_no_such_shape(value: Any, shape: tuple[int | None, ...], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        array_of("x", value, shape, ConfigError)
