"""Observations that are numbers: objects, angles, and back."""

from __future__ import annotations

import json
import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from relgym.envs.views import Angle, NumbersView, Part, Static, view_from_json
from relgym.errors import ConfigError, ObservationError
from relgym.scene.shapes import Box, Sphere

PLANE = spaces.Box(-np.inf, np.inf, (4,), np.float64)
PUSH = spaces.Discrete(2)
PAIR = spaces.Box(-1.0, 1.0, (2,), np.float32)


def flat(space: spaces.Space[Any] = PLANE, **arguments: Any) -> NumbersView:
    return NumbersView(space, PUSH, **arguments)


# ---------------------------------------------------------------------- whose numbers
def test_a_box_is_one_object_with_its_numbers_in_float64() -> None:
    view = flat(spaces.Box(-9.0, 9.0, (2,), np.float32), names=("x", "v"))
    scene = view.scene(np.array([0.1, 2.0], np.float32))
    assert scene.values().keys() == {"self"}
    assert scene["self"].type.properties == ("x", "v")
    assert scene["self"]["x"] == float(np.float32(0.1))
    assert scene.vector.dtype == np.float64


@pytest.mark.parametrize(
    ("space", "observation", "expected"),
    [
        (spaces.Discrete(500), np.int64(314), {"self": {"x": 314.0}}),
        (spaces.Discrete(5, start=-2), -1, {"self": {"x": -1.0}}),
        (spaces.MultiDiscrete([3, 4]), np.array([2, 3]), {"self": {"x0": 2.0, "x1": 3.0}}),
        (spaces.MultiBinary(2), np.array([0, 1], np.int8), {"self": {"x0": 0.0, "x1": 1.0}}),
        (
            spaces.Tuple([spaces.Discrete(32), spaces.Box(0, 9, (2,), np.float64)]),
            (11, np.array([1.5, 2.5])),
            {"self": {"x0": 11.0, "x1": 1.5, "x2": 2.5}},
        ),
        (
            spaces.Dict({"leg": spaces.Box(0, 9, (2,), np.float64), "foot 2": spaces.Discrete(3)}),
            {"leg": np.array([1.0, 2.0]), "foot 2": 2},
            {"leg": {"x0": 1.0, "x1": 2.0}, "foot_2": {"x": 2.0}},
        ),
    ],
)
def test_every_flat_space_has_objects_and_comes_back(space: Any, observation: Any, expected: Any) -> None:
    view = flat(space)
    scene = view.scene(observation)
    assert {o.name: dict(zip(o.type.properties, o.values.tolist(), strict=True)) for o in scene} == expected
    back = view.observation(scene)
    assert back in space
    assert str(back).replace("np.int64(11)", "11") == str(observation) or isinstance(observation, dict)
    assert view.scene(back) == scene


def test_parts_take_numbers_and_share_types() -> None:
    view = flat(
        names=("x", "left", "v", "right"),
        parts=[
            Part("leg1", {"contact": "left"}, type="leg"),
            Part("leg2", {"contact": "right"}, type="leg"),
        ],
    )
    scene = view.scene(np.array([1.0, 2.0, 3.0, 4.0]))
    assert [(o.name, o.type.name, o.values.tolist()) for o in scene] == [
        ("leg1", "leg", [2.0]),
        ("leg2", "leg", [4.0]),
        ("self", "self", [1.0, 3.0]),
    ]
    np.testing.assert_array_equal(view.observation(scene), [1.0, 2.0, 3.0, 4.0])


def test_names_of_a_dict_go_by_key() -> None:
    space = spaces.Dict(
        {"cart": spaces.Box(-9, 9, (2,), np.float64), "wind": spaces.Box(-9, 9, (1,), np.float64)}
    )
    view = flat(space, names={"cart": ("x", "v")}, parts=[Part("air", {"speed": "wind.x"})])
    scene = view.scene({"cart": np.array([1.0, 2.0]), "wind": np.array([3.0])})
    assert (scene["cart"]["v"], scene["air"]["speed"]) == (2.0, 3.0)


def test_parts_may_have_bodies_beside_static_ones() -> None:
    ball = Part(
        "ball", ("x", "y"), shape=Sphere(), pose={"px": "x", "py": "y"}, constants={"sx": 2.0, "sy": 2.0}
    )
    floor = Static("floor", {"py": -1.0, "sx": 99.0, "sy": 1.0}, shape=Box())
    view = flat(names=("x", "y", "vx", "vy"), parts=[ball], static=[floor])
    scene = view.scene(np.array([3.0, 4.0, 0.0, 0.0]))
    np.testing.assert_array_equal(scene.pose()[:, :2], [[3.0, 4.0], [0.0, -1.0]])
    np.testing.assert_array_equal(scene.pose()[:, 6], [2.0, 99.0])


# ---------------------------------------------------------------------- angles
def test_angles_are_recognised_in_first_observations_only_where_both_reach_from_minus_one_to_one() -> None:
    env = gym.make("Acrobot-v1")
    view = NumbersView(env.observation_space, env.action_space)
    assert view.open and view.angles == ()
    first, _ = env.reset(seed=0)
    final = view.settled([first])
    assert final.angles == (Angle("x0", "x1"), Angle("x2", "x3"))
    assert final.schema.type("self").properties == ("angle_x0", "angle_x2", "x4", "x5")
    assert not final.open
    np.testing.assert_allclose(final.observation(final.scene(first)), first, rtol=0, atol=1e-6)


def test_numbers_off_the_circle_are_no_angle() -> None:
    assert flat(PAIR).settled([np.array([0.6, 0.8]), np.array([0.6, 0.9])]).angles == ()
    assert flat(PAIR).settled([np.array([0.6, 0.8]), np.array([0.8, 0.6])]).angles != ()
    # Unbounded numbers often begin at 0 and 1: that proves nothing.
    unbounded = spaces.Box(-np.inf, np.inf, (2,), np.float64)
    assert flat(unbounded).settled([np.array([1.0, 0.0])]).angles == ()
    assert flat(unbounded).settled([np.array([0.6, 0.8])]).angles != ()


def test_pairs_do_not_overlap() -> None:
    same = math.sqrt(0.5)
    view = flat(spaces.Box(-1.0, 1.0, (4,), np.float64)).settled([np.full(4, same)])
    assert view.angles == (Angle("x0", "x1"), Angle("x2", "x3"))


def test_declared_angles_and_their_names() -> None:
    view = flat(names=("cos_t", "sin_t", "c", "s"), angles=[("cos_t", "sin_t"), Angle("c", "s", "phi")])
    assert view.schema.type("self").properties == ("t", "phi")
    scene = view.scene(np.array([0.0, 1.0, -1.0, 0.0]))
    assert scene["self"]["t"] == pytest.approx(math.pi / 2, abs=1e-15)
    assert not view.open
    assert flat(PAIR, angles=()).schema.type("self").properties == ("x0", "x1")


@given(turn=st.floats(-9.0, 9.0))
def test_angles_lie_within_a_turn_and_the_model_knows_them(turn: float) -> None:
    view = flat(spaces.Box(-1.0, 1.0, (2,), np.float64), angles=[("x0", "x1")])
    assert view.schema.type("self").angles == ("angle_x0",)
    seen = np.array([math.cos(turn), math.sin(turn)])
    angle = view.scene(seen)["self"]["angle_x0"]
    assert -math.pi <= angle <= math.pi
    assert math.remainder(angle - turn, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(view.observation(view.scene(seen)), seen, rtol=0, atol=1e-12)


def test_angles_of_float32_numbers_show_their_precision() -> None:
    view = flat(PAIR, angles=[("x0", "x1")])
    angle = view.scene(np.array([math.cos(2.0), math.sin(2.0)], np.float32))["self"]["angle_x0"]
    assert angle == float(np.float32(angle)) == pytest.approx(2.0, abs=1e-6)
    assert view.precision == pytest.approx(4.8e-7, rel=0.01)
    assert flat().precision == 0.0


def test_a_guess_is_taken_back_when_an_observation_refutes_it() -> None:
    view = flat(PAIR).settled([np.array([-1.0, 0.0], np.float32)])
    assert view.angles == (Angle("x0", "x1"),)
    for no_news in (np.array([0.6, 0.8], np.float32), np.array([np.nan, 0.0]), np.zeros(3), None):
        assert view.upheld(no_news) is view
    plain = view.upheld(np.array([-0.9, 0.0], np.float32))
    assert plain.schema.type("self").properties == ("x0", "x1")
    assert plain.upheld(np.array([0.1, 0.1], np.float32)) is plain
    assert not plain.open  # it isn't guessed again


def test_another_guess_that_was_as_good_takes_its_place() -> None:
    """Of (1, 0, 1) either pair may be an angle; the first one moves off the circle, the second doesn't."""
    view = flat(spaces.Box(-1.0, 1.0, (3,), np.float64)).settled([np.array([1.0, 0.0, 1.0])])
    assert view.angles == (Angle("x0", "x1"),)
    turned = np.array([1.0, 0.6, 0.8])
    assert view.upheld(turned).angles == (Angle("x1", "x2"),)
    assert view.upheld(turned).upheld(np.array([1.0, 0.6, 0.6])).angles == ()


def test_declared_angles_are_no_guess() -> None:
    view = flat(PAIR, angles=[("x0", "x1")])
    assert view.upheld(np.array([0.5, 0.5], np.float32)) is view


def test_what_is_no_observation_settles_nothing() -> None:
    view = flat(PAIR)
    assert view.settled([np.full(2, np.nan), np.zeros(3)]) is view
    assert view.open
    assert view.settled([np.full(2, np.nan), np.array([0.6, 0.8])]).angles == (Angle("x0", "x1"),)


def test_an_angle_that_leaves_the_circle_was_none() -> None:
    view = flat(PAIR).settled([np.array([1.0, 0.0], np.float32)])
    assert view.angles
    with pytest.raises(ObservationError, match=r"'x0' and 'x1' were taken for cosine and sine.*angles=\(\)"):
        view.scene(np.array([1.0, 0.5], np.float32))


# ---------------------------------------------------------------------- bad input
@pytest.mark.parametrize(
    ("observation", "message"),
    [
        (np.array([1.0, np.nan, 0.0, 0.0]), "'self', number 'x1': expected a finite number, got nan"),
        (np.array([1.0, 0.0, -np.inf, 0.0]), "number 'x2': expected a finite number, got -inf"),
        (np.zeros(3), r"expected 4 numbers.*got an array of shape \(3,\); fix the env's observation_space"),
        (np.zeros((2, 2)), r"shape \(2, 2\)"),
        ("four", "expected numbers, got 'four'"),
        (None, "expected"),
    ],
)
def test_bad_observations_are_named(observation: Any, message: str) -> None:
    with pytest.raises(ObservationError, match=message):
        flat().scene(observation)


def test_keys_that_come_or_go_are_refused_with_a_remedy() -> None:
    view = flat(spaces.Dict({"a": spaces.Discrete(2), "b": spaces.Discrete(2)}))
    for observation in ({"a": 1}, {"a": 1, "b": 0, "c": 0}, 7):
        with pytest.raises(ObservationError, match=r"keys \['a', 'b'\].*FunctionView, or a TableView"):
            view.scene(observation)
    with pytest.raises(ObservationError, match="a tuple of 2 parts"):
        flat(spaces.Tuple([spaces.Discrete(2), spaces.Discrete(2)])).scene((1, 0, 1))


@pytest.mark.parametrize(
    ("space", "message"),
    [
        (spaces.Box(0, 255, (84, 84, 3), np.uint8), "is an image.*FunctionView"),
        (spaces.Box(0, 255, (84, 84), np.uint8), "is an image"),
        (spaces.Box(-1, 1, (5, 4), np.float32), r"is a table of shape \(5, 4\).*view=TableView"),
        (
            spaces.Dict({"a": spaces.Dict({"b": spaces.Discrete(2)})}),
            "part 'a' .* is nested.*FlattenObservation",
        ),
        (spaces.Tuple([spaces.Tuple([spaces.Discrete(2)])]), "part 0 .* is nested"),
        (spaces.Dict({"eye": spaces.Box(0, 255, (8, 8, 3), np.uint8)}), "part 'eye' .* is an image"),
        (spaces.Text(3), "expected Box, Discrete, MultiDiscrete, MultiBinary.*FunctionView"),
        (spaces.Sequence(spaces.Discrete(2)), "expected Box, Discrete"),
    ],
)
def test_spaces_that_say_nothing_of_objects_are_refused_with_a_remedy(space: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        flat(space)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"names": ("x", "v")}, "expected 4 different Python identifiers"),
        ({"names": ("x", "x", "y", "z")}, "expected 4 different"),
        ({"names": {"a": ("x",)}}, "expected a sequence of 4 names"),
        ({"parts": [Part("leg", ("x9",))]}, r"numbers \['x9'\] that the observation lacks"),
        ({"parts": [Part("a", ("x0",)), Part("b", ("x0",))]}, r"\['x0'\] are claimed by several"),
        ({"parts": [Part("a", {"p": "x0"}, type="t"), Part("b", {"q": "x1"}, type="t")]}, "type 't' differ"),
        ({"parts": [Part("action", ("x0",))]}, "can't be called 'action'"),
        ({"parts": [Part("task", ("x0",))]}, "can't be called 'task': that is what a step brings"),
        ({"parts": [Part("a", ("x0",), constants={"x0": 1.0})]}, "columns and constants at once"),
        ({"parts": [Part("a", ("x0",))], "angles": [("x0", "x1")]}, "must belong to the same object"),
        ({"angles": [("x0", "x7")]}, r"no numbers \['x7'\]"),
        ({"angles": ["x0x1"]}, "expected pairs of names"),
        ({"angles": "all"}, "expected 'auto' or pairs"),
        ({"angles": [Angle("x0", "x1", "x2")]}, "two properties 'x2'"),
        ({"static": [Static("self", {"px": 1.0})]}, "names of the objects"),
    ],
)
def test_declarations_that_do_not_fit_are_refused(arguments: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        flat(**arguments)


def test_names_for_keys_that_are_not_there_are_refused() -> None:
    space = spaces.Dict({"a": spaces.Discrete(2)})
    with pytest.raises(ConfigError, match=r"no keys \['b'\]"):
        flat(space, names={"b": ("x",)})
    with pytest.raises(ConfigError, match="names by key"):
        flat(space, names=("x",))


# ---------------------------------------------------------------------- files
LEAVES = st.one_of(
    st.builds(
        lambda n, dtype: spaces.Box(-5.0, 5.0, (n,), dtype),
        st.integers(1, 4),
        st.sampled_from([np.float32, np.float64]),
    ),
    st.builds(lambda n, start: spaces.Discrete(n, start=start), st.integers(1, 9), st.integers(-3, 3)),
    st.builds(lambda n: spaces.MultiDiscrete([n, n + 1]), st.integers(1, 5)),
    st.builds(spaces.MultiBinary, st.integers(1, 4)),
)
SPACES = st.one_of(
    LEAVES,
    st.lists(LEAVES, min_size=1, max_size=3).map(spaces.Tuple),
    st.dictionaries(st.sampled_from(["a", "b", "see it"]), LEAVES, min_size=1).map(spaces.Dict),
)


@given(space=SPACES, seed=st.integers(0, 2**16))
def test_views_read_from_json_see_the_same_and_show_it_again(space: Any, seed: int) -> None:
    space.seed(seed)
    observation = space.sample()
    view = flat(space, angles=())
    again = view_from_json(json.loads(json.dumps(view.to_json(), sort_keys=True)))
    scene = view.scene(observation)
    assert again.schema == view.schema
    assert again.scene(observation) == scene
    back = again.observation(scene)
    assert back in space
    assert again.scene(back) == scene


def test_all_declarations_survive_json() -> None:
    view = flat(
        names=("cos_t", "sin_t", "x", "y"),
        parts=[
            Part(
                "ball",
                ("x", "y"),
                "round",
                Sphere(),
                {"px": "x", "py": "y"},
                constants={"sy": 1.0, "sx": 1.0},
                angles=("y",),
            )
        ],
        angles=[("cos_t", "sin_t")],
        actions=("wait", "go"),
        static=[Static("wall", {"px": 3.0}, "thing", Box())],
        up="z",
        planar=False,
    )
    again = view_from_json(json.loads(json.dumps(view.to_json(), sort_keys=True)))
    assert again.schema == view.schema
    assert again.to_json() == view.to_json()
