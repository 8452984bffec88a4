"""Roles: cut out of weight vectors (§3.2.3), and bound to objects (§3.2.4)."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from streams import BALL, mode_of

from relgym.clustering.columns import SlotSignature
from relgym.clustering.mode import Role
from relgym.clustering.roles import bind, identify_roles
from relgym.numeric.stepwise import LinearFit
from relgym.scene.objects import ObjectType
from relgym.scene.shapes import Box

BOX = ObjectType("box", ("friction", "mass"), Box())
THREE = SlotSignature((BALL, BOX, BOX, BOX))


def friction(weight: float) -> Role:
    return Role("box", (("friction", weight),))


def row(v: float, *frictions: float) -> np.ndarray:
    """A row of `THREE`: v, w, then friction and mass of each box."""
    return np.array([v, 0.0, *[each for f in frictions for each in (f, 1.0)]])


def test_a_segment_with_weights_is_a_role() -> None:
    # Figure 3.3: columns v w | friction mass | friction mass | friction mass.
    roles = identify_roles(LinearFit((0, 2, 6, 7), (1.0, -2.5, -5.0, 0.5), 0.0, 0.0), THREE)
    assert roles == (
        Role("ball", (("v", 1.0),)),
        Role("box", (("friction", -5.0), ("mass", 0.5))),
        Role("box", (("friction", -2.5),)),
    )


def test_the_target_is_a_role_even_without_weights() -> None:
    assert identify_roles(LinearFit((), (), 3.0, 0.0), THREE) == (Role("ball", ()),)


def test_the_order_of_slots_makes_no_other_roles() -> None:
    one = identify_roles(LinearFit((2, 4), (-5.0, -2.5), 0.0, 0.0), THREE)
    assert one == identify_roles(LinearFit((2, 4), (-2.5, -5.0), 0.0, 0.0), THREE)


def test_the_only_object_of_a_type_is_forced() -> None:
    binding = bind(mode_of(("v", 1.0), others=[friction(-2.0)]), SlotSignature((BALL, BOX)))
    assert binding is not None
    assert binding.open == ()
    assert binding.forced == (1,)
    assert binding.value([3.0, 0.0, 0.25, 1.0]) == 2.5


def test_a_role_whose_columns_are_missing_cannot_be_played() -> None:
    mode = mode_of(("v", 1.0), others=[Role("box", (("friction'", 1.0),))])
    assert bind(mode, THREE) is None
    assert bind(mode, SlotSignature((BALL, BOX), given=(("box", "friction"),))) is not None


def test_every_object_may_play_an_open_role() -> None:
    binding = bind(mode_of(("v", 1.0), others=[friction(-2.0)]), THREE)
    assert binding is not None
    assert binding.assignments.tolist() == [[1], [2], [3]]
    assert binding.values(row(1.0, 0.1, 0.2, 0.3)[None]).tolist() == [[0.8, 0.6, 0.4]]


def test_different_roles_are_played_by_different_objects() -> None:
    binding = bind(mode_of(others=[friction(-5.0), friction(-2.5)]), THREE)
    assert binding is not None
    assert sorted(map(tuple, binding.assignments.tolist())) == sorted(permutations((1, 2, 3), 2))


def test_equal_roles_are_interchangeable() -> None:
    binding = bind(mode_of(others=[friction(-2.5)] * 3), THREE)
    assert binding is not None
    assert binding.assignments.tolist() == [[1, 2, 3]]


@pytest.mark.parametrize("count", [0, 1])
def test_a_role_without_an_object_leaves_the_mode_unbound(count: int) -> None:
    mode = mode_of(others=[friction(-5.0), friction(-2.5)])
    assert bind(mode, SlotSignature((BALL, *[BOX] * count))) is None


def test_the_closest_assignment_explains_and_ties_go_to_the_first() -> None:
    binding = bind(mode_of(("v", 1.0), others=[friction(-2.0)]), THREE)
    assert binding is not None
    x = np.array([row(1.0, 0.1, 0.2, 0.3), row(1.0, 0.4, 0.3, 0.3)])
    error, assignment = binding.closest(x, np.array([0.6, 0.4]), slack=1e-12)
    assert error == pytest.approx([0.0, 0.0], abs=1e-15)
    assert [binding.roles_of(int(a)) for a in assignment] == [(2,), (2,)]


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2]), st.sampled_from([0.0, 0.3]))
def test_the_closest_assignment_of_one_row(seed: int, roles: int, slack: float) -> None:
    rng = np.random.default_rng(seed)
    binding = bind(mode_of(("v", 1.0), others=[friction(-0.3 * (k + 1)) for k in range(roles)]), THREE)
    assert binding is not None
    x, y = rng.normal(size=(1, 8)), rng.normal(size=1)
    x[rng.random(x.shape) < 0.05] = np.nan
    (error,), (assignment,) = binding.closest(x, y, slack)
    np.testing.assert_array_equal(binding.closest_one(x[0].tolist(), float(y[0]), slack), (error, assignment))
    slots = tuple(binding.slots[assignment].tolist())
    assert binding.roles_of(int(assignment)) == slots


@given(st.integers(0, 2**32 - 1))
def test_one_row_gives_the_same_bits_as_many(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mode = mode_of(
        ("v", rng.normal()), ("w", rng.normal()), others=[friction(0.3), friction(-1.7)], constant=0.1
    )
    binding = bind(mode, THREE)
    assert binding is not None
    x = rng.normal(size=(7, 8))
    expected = [[binding.value(r, tuple(a)) for a in binding.assignments.tolist()] for r in x.tolist()]
    assert binding.values(x).tolist() == expected


def test_values_with_the_same_players_are_single_values_to_the_last_bit() -> None:
    rng = np.random.default_rng(0)
    heavy = Role("box", (("friction", 0.1), ("mass", -1.7)))
    binding = bind(mode_of(("v", 0.3), others=(heavy, friction(2.9)), constant=0.7), THREE)
    assert binding is not None and len(binding.open) == 2
    x = rng.normal(size=(50, len(THREE.columns)))
    for slots in ((1, 2), (3, 1)):
        expected = [binding.value(row.tolist(), slots) for row in x]
        np.testing.assert_array_equal(binding.values_as(x, slots), expected)
