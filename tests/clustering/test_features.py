"""Non-linear features: what a library offers, what it is called and what it is worth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.clustering import features
from relgym.clustering.columns import SlotSignature
from relgym.clustering.features import (
    Atom,
    Library,
    check_entries,
    features_for,
    functions_of,
    library_of,
    register_function,
    switched_on,
)
from relgym.clustering.mode import Mode, Role
from relgym.clustering.roles import bind
from relgym.errors import ConfigError
from relgym.scene.objects import ACTION, TASK, ObjectType, Target

CART = ObjectType("cart", ("x", "v"))
PUSH = ObjectType(ACTION, ("a",))


def names(*kinds: str, angles: tuple[str, ...] = ()) -> list[str]:
    found = Library(kinds, angles).features(("x", "v", "action.a"), (True, True, False))
    return [feature.name for feature in found]


def test_sines_and_cosines_of_own_properties_at_three_frequencies() -> None:
    assert names("trig")[:6] == ["sin(x)", "cos(x)", "sin(2 x)", "cos(2 x)", "sin(3 x)", "cos(3 x)"]
    assert not any("action" in name for name in names("trig"))
    assert len(names("trig")) == 12


def test_named_angles_are_the_only_ones_to_turn() -> None:
    assert {name[4:-1].split()[-1] for name in names("trig", angles=("x",))} == {"x"}


def test_squares_products_and_higher_degrees() -> None:
    assert names("squares") == ["x^2", "v^2", "action.a^2"]
    assert names("products") == ["x^2", "x v", "x action.a", "v^2", "v action.a", "action.a^2"]
    assert "x^2 v" in names("degree3")
    assert "x^2 v^2" in names("degree4")
    assert "v sin(x)" in names("trig", "products", angles=("x",))


def test_next_values_enter_products_of_two_only() -> None:
    found = Library(("degree3",)).features(("x", "v'"), (True, True))
    assert "x v'" in {f.name for f in found}
    assert not any("v'" in f.name and f.name.count("x") > 1 for f in found if len(f.atoms) > 2)


def test_a_value_is_the_product_of_its_factors() -> None:
    found = {f.name: f for f in Library(("trig", "products")).features(("x", "v"), (True, True))}
    x = np.array([[0.5, -2.0], [1.5, 3.0]])
    assert found["v cos(x)"].values(x) == pytest.approx(x[:, 1] * np.cos(x[:, 0]))
    assert found["v^2"].values(x).tolist() == [4.0, 9.0]


def test_a_registered_function_is_a_feature() -> None:
    register_function("cube", lambda x: x**3)
    library = library_of(("cube",), "cart", ())
    found = {f.name: f for f in library.features(("x",), (True,))}
    assert found["cube(x)"].values(np.array([[2.0]])).tolist() == [8.0]


def test_functions_that_entries_name_are_found() -> None:
    register_function("cube", lambda x: x**3)
    assert list(functions_of(("trig", "cart:cube", "products"))) == ["cube"]
    assert functions_of(("trig",)) == {}


def test_a_function_that_is_not_known_here_is_never_left_out_silently(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A model of another process, or of a file, may name one."""
    register_function("cube", lambda x: x**3)
    library = library_of(("cube",), "cart", ())
    monkeypatch.setattr(features, "_functions", {})
    for ask in (
        lambda: library.features(("x",), (True,)),
        lambda: library.size(("x",), (True,)),
        lambda: Atom(0, "cube").values(np.zeros((1, 1))),
    ):
        with pytest.raises(ConfigError, match=r"call register_function\('cube', ...\) first"):
            ask()


@pytest.mark.parametrize("entry", ["sines", "trig(", "tan", "", "products(x)", "t"])
def test_an_unknown_kind_is_refused_with_what_there_is(entry: str) -> None:
    with pytest.raises(ConfigError, match="expected 'trig'"):
        library_of((entry,), "cart", ())


@pytest.mark.parametrize("name", ["trig", "two words", "cos", "products"])
def test_a_function_needs_a_name_of_its_own(name: str) -> None:
    with pytest.raises(ConfigError, match="identifier"):
        register_function(name, np.abs)


@pytest.mark.parametrize(
    ("function", "message"), [(math.exp, "can't be worked out"), (np.sum, "gives shape")]
)
def test_a_function_maps_arrays(function: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        register_function("broken", function)
    with pytest.raises(ConfigError, match="'broken' is unknown"):
        library_of(("broken",), "cart", ())


def test_an_entry_may_be_for_one_type_or_one_property() -> None:
    entries = ("cart:products", "trig(th)")
    assert library_of(entries, "cart", ()) == Library(("products", "trig"), ("th",))
    assert library_of(entries, "pole", ()) == Library(("trig",), ("th",))
    assert library_of(("trig",), "pole", ("phi",)) == Library(("trig",), ("phi",))


def test_an_entry_of_all_properties_is_not_narrowed_by_one_that_names_some() -> None:
    assert library_of(("trig(th)", "pole:trig"), "pole", ()) == Library(("trig",))
    assert library_of(("trig(th)", "pole:trig"), "cart", ()) == Library(("trig",), ("th",))
    assert library_of(("trig(th)", "pole:trig"), "pole", ("phi",)) == Library(("trig",), ("phi", "th"))


def test_switching_on_keeps_what_is_on() -> None:
    on = ("trig(th)", "hill:degree3", "products")
    assert switched_on(on, "hill", ("trig", "products")) == (*on, "hill:trig")
    assert switched_on((), "hill", ("trig",), alone=True) == ("trig",)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("crat:trig", r"is for type 'crat'; expected one of \['cart', 'pole'\]"),
        ("trig(nope)", r"names the properties \['nope'\]; expected some of \['th', 'x'\]"),
        ("pole:trig(th, nope)", r"\['nope'\]"),
        ("trgi", "is unknown"),
    ],
)
def test_an_entry_that_would_be_offered_to_nobody_is_refused(entry: str, message: str) -> None:
    types = {"cart": ("x",), "pole": ("th",)}
    check_entries(("trig", "trig(th)", "pole:trig(x)", "cart:products"), types)
    with pytest.raises(ConfigError, match=message):
        check_entries(("trig", entry), types)


def test_features_are_columns_behind_those_that_a_row_holds() -> None:
    slots = SlotSignature((CART, PUSH), nonlinear=Library(("products",)))
    assert len(slots.columns) == 3
    assert slots.named(slots.column(0, "x v")) == "x v"
    x = np.array([[2.0, 3.0, 1.0]])
    assert slots.matrix(x, [0, slots.column(0, "x v")]).tolist() == [[2.0, 6.0]]
    order, stages = slots.preference(Target("cart", "v"))
    assert [slots.named(int(k)) for k in order[:3]] == ["v", "x", "action.a"]
    assert stages == (3, 9)


def test_reward_is_no_cause_and_has_none_of_its_own() -> None:
    slots = SlotSignature((CART, PUSH, ObjectType(TASK, ("reward",))), nonlinear=Library(("products",)))
    order, _ = slots.preference(Target("cart", "v"))
    assert not any("reward" in slots.named(int(k)) for k in order)


@given(st.lists(st.tuples(*[st.floats(-3.0, 3.0)] * 3), min_size=1, max_size=9))
def test_one_row_and_many_give_the_same_bits(rows: list[tuple[float, float, float]]) -> None:
    slots = SlotSignature((CART, PUSH), nonlinear=Library(("trig", "degree3")))
    own = Role("cart", (("cos(3 x)", -0.0025), ("v", 1.0), ("x v action.a", 0.3)))
    binding = bind(Mode(1, Target("cart", "v"), (own,), 0.1), slots)
    assert binding is not None
    x = np.array(rows)
    assert binding.values(x)[:, 0].tolist() == [binding.value(list(row)) for row in rows]
    assert binding.values_as(x, ()).tolist() == binding.values(x)[:, 0].tolist()


def test_a_mode_stands_aside_where_its_feature_lacks_an_object() -> None:
    own = Role("cart", (("v action.a", 1.0),))
    mode = Mode(1, Target("cart", "v"), (own,), 0.0)
    assert bind(mode, SlotSignature((CART,), nonlinear=Library(("products",)))) is None


def test_the_size_of_a_library_is_known_before_it_is_built() -> None:
    for kinds in (("trig",), ("products",), ("squares",), ("trig", "degree3"), ("degree4",)):
        names, own = ["x", "v", "v'", "action.a"], [True, True, True, False]
        library = Library(kinds)
        assert len(library.features(names, own)) <= library.size(names, own) <= 200
    assert Library().size(["x"], [True]) == 0


def test_a_library_too_large_is_refused_with_a_remedy() -> None:
    names = [f"x{k}" for k in range(28)]
    with pytest.raises(ConfigError, match=r"at most 6,000; ask for a lower degree"):
        Library(("trig", "degree4")).features(names, [True] * 28)


def test_features_for_a_type_are_those_of_all_and_its_own() -> None:
    entries = ("trig", "self:trig(x, v)", "ball:products")
    assert features_for(entries, "self") == ("trig", "self:trig(x, v)")
    assert features_for(entries, "ball") == ("trig", "ball:products")
    assert features_for(entries[1:], "ramp") == ()
