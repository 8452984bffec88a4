"""How two moving bodies share what passes between them."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.laws.records import Share
from relgym.laws.shares import find_share, share_values

N = 40
Columns = dict[str, np.ndarray]


def collisions(rng: np.random.Generator, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Changes of the first body's and of the relative velocity."""
    change = rng.normal(size=(2, N))
    return share * change, change


def bodies(rng: np.random.Generator) -> tuple[Columns, Columns]:
    one, two = (
        {"mass": rng.uniform(1, 3, N), "extent": rng.uniform(1, 2, N), "v": np.zeros(N)} for _ in "ab"
    )
    return one, two


def found(
    rng: np.random.Generator, share: np.ndarray, a: Columns, b: Columns, *, alike: bool
) -> Share | None:
    mine, change = collisions(rng, share)
    return find_share(mine, change, a, b, alike=alike, tolerance=1e-12)


@pytest.mark.parametrize(("name", "power"), [("mass", 1), ("extent", 3)])
def test_a_property_decides(name: str, power: int, rng: np.random.Generator) -> None:
    a, b = bodies(rng)
    share = b[name] ** power / (a[name] ** power + b[name] ** power)
    assert found(rng, share, a, b, alike=True) == Share(name, power)


def test_halves_come_first(rng: np.random.Generator) -> None:
    a, b = bodies(rng)
    assert found(rng, np.full(N, 0.5), a, b, alike=True) == Share(constant=0.5)


def test_a_constant_needs_types_that_differ(rng: np.random.Generator) -> None:
    a, b = bodies(rng)
    assert found(rng, np.full(N, 0.25), a, b, alike=True) is None
    constant = found(rng, np.full(N, 0.25), a, b, alike=False)
    assert constant is not None
    assert (constant.property, constant.constant) == ("", pytest.approx(0.25))


def test_nothing_is_known_of_what_no_property_tells(rng: np.random.Generator) -> None:
    a, b = bodies(rng)
    assert np.isnan(share_values(Share("v"), a, b)).all()
    assert found(rng, rng.uniform(0.1, 0.9, N), a, b, alike=False) is None


def test_too_few_collisions_tell_nothing(rng: np.random.Generator) -> None:
    a, b = bodies(rng)
    mine, change = np.zeros((2, N)), np.zeros((2, N))
    mine[:, :2], change[:, :2] = 0.5, 1.0
    assert find_share(mine, change, a, b, alike=True, tolerance=1e-12) is None
