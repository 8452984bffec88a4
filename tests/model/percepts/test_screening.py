"""Gross errors are set aside, and what comes again is believed."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.config.constants import ALIKE, ENOUGH, OUTLYING, REPEATED
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.percepts.screening import MOST, Screen
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Scene, SceneLayout, Target, Transition
from relgym.scene.schema import SceneSchema

CART = ObjectType("cart", ("x", "v"))
SCHEMA = SceneSchema((CART,), (("c", "cart"),), targets=(Target("cart", "v"), Target("cart", "x")))


def layout() -> SceneLayout:
    return SCHEMA.layout(("c",))


def accustomed(steps: int = 100) -> Screen:
    screen, rng = Screen(), np.random.default_rng(0)
    for _ in range(steps):
        assert screen.admits(layout(), rng.uniform(-10, 10, 2), rng.uniform(-10, 10, 2))
    return screen


def admits(screen: Screen, x: float, v: float = 1.0) -> bool:
    return screen.admits(layout(), np.array([1.0, v]), np.array([x, v]))


@given(st.floats(1e3, 1e300), st.sampled_from((-1.0, 1.0)))
def test_a_single_outlier_is_set_aside_and_changes_no_limit(size: float, sign: float) -> None:
    screen = accustomed()
    assert not admits(screen, sign * size)
    assert not screen.admits(layout(), np.array([sign * size, 1.0]), np.array([1.0, 1.0]))
    assert admits(screen, 9.0)
    assert not admits(screen, sign * 400.0)
    assert screen.set_aside == 3


def test_what_grows_gradually_is_no_error() -> None:
    screen, x = Screen(), 1e-3
    for _ in range(60):
        assert admits(screen, x, v=0.0)
        x *= 2.0


def test_another_scale_is_believed_after_some_steps() -> None:
    screen = accustomed()
    taken = [screen.admits(layout(), np.array([1e6 + k, 1.0]), np.array([1e6 + k, 1.0])) for k in range(20)]
    assert taken == [False] * (REPEATED - 1) + [True] * (21 - REPEATED)
    assert admits(screen, 5.0)


def test_a_rare_event_of_about_the_same_size_is_believed() -> None:
    screen, rng, taken = accustomed(), np.random.default_rng(1), []
    for _ in range(40):
        taken.append(admits(screen, 1e4 * rng.uniform(1.0, 2.0)))
        assert admits(screen, 3.0)
    assert taken == [False] * (ENOUGH - 1) + [True] * (41 - ENOUGH)


def test_a_rare_reward_is_believed_sooner_and_huge_numbers_never() -> None:
    screen = accustomed()
    assert next(k for k in range(10) if admits(screen, 1e4) or not admits(screen, 2.0)) == 4
    assert not any(admits(screen, 1e101) for _ in range(100))


def test_an_outlier_among_the_first_scenes_leaves_no_trace() -> None:
    screen, rng = Screen(), np.random.default_rng(0)
    admits(screen, 1e5)
    screen.admits(layout(), np.array([1e5, 1.0]), np.array([1.0, 1.0]))
    for _ in range(30):
        assert screen.admits(layout(), rng.uniform(-10, 10, 2), rng.uniform(-10, 10, 2))
    assert not admits(screen, OUTLYING * 10.1)


def test_plain_data_bring_it_back() -> None:
    screen = accustomed()
    admits(screen, 1e7)
    twin = Screen()
    twin.restore(json.loads(json.dumps(screen.to_json())))
    assert twin.to_json() == screen.to_json() == copy.deepcopy(screen).to_json()
    assert twin.plausible(layout(), np.array([9.0, 9.0]))
    assert not twin.plausible(layout(), np.array([1e6, 9.0]))
    both = accustomed()
    both.absorb(screen)
    assert both.set_aside == 1
    assert not admits(both, 1e4)


def seen(*scenes: tuple[float, float]) -> Screen:
    """A screen that took in transitions between equal scenes."""
    screen = Screen()
    for x, v in scenes:
        screen.admits(layout(), np.array([x, v]), np.array([x, v]))
    return screen


def limits(screen: Screen) -> list[float]:
    """Largest x and v that are admitted."""
    places = screen._places(layout())
    return screen._limit()[places].tolist()


def test_limits_by_hand() -> None:
    # The fifth largest of each property counts, where a scene that stays is seen before and after its step.
    assert limits(Screen()) == [1.0 / ALIKE] * 2
    assert (
        limits(seen((2.0, 0.5), (3.0, 0.0), (4.0, 0.25))) == [2.0 / ALIKE] * 2
    )  # 2 2 3 3 4 4: the fifth is 2
    screen = seen(*[(4.0, 0.5)] * ENOUGH)
    # The median of 4 and 0.5 is 2.25, and v is allowed as much as a property usually is.
    assert limits(screen) == [OUTLYING * 4.0, OUTLYING * 2.25]
    still = seen(*[(4.0, 0.0)] * ENOUGH)
    assert limits(still) == [OUTLYING * 4.0] * 2  # never moved: the largest of all others stands in
    assert limits(seen(*[(0.0, 0.0)] * ENOUGH)) == [1.0 / ALIKE] * 2
    assert (
        limits(seen(*[(1e-3, 1e-4)] * (ENOUGH - 1))) == [1.0 / ALIKE] * 2
    )  # of the first scenes 1 is the least


def test_at_the_limit_a_number_is_admitted_and_beyond_it_not() -> None:
    screen = seen(*[(4.0, 4.0)] * ENOUGH)
    at = OUTLYING * 4.0
    assert screen.plausible(layout(), np.array([at, -at]))
    assert not screen.plausible(layout(), np.array([np.nextafter(at, np.inf), 0.0]))
    assert not screen.plausible(layout(), np.array([0.0, -np.nextafter(at, np.inf)]))
    assert not screen.plausible(layout(), np.array([np.nan, 0.0]))
    assert screen.to_json() == seen(*[(4.0, 4.0)] * ENOUGH).to_json()  # it took note of nothing


def test_equal_numbers_are_believed_the_fifth_time_though_others_come_between() -> None:
    screen = seen(*[(4.0, 4.0)] * ENOUGH)
    taken = []
    for k in range(6):
        taken.append(screen.admits(layout(), np.array([4.0, 4.0]), np.array([4.0, 1e4])))
        screen.admits(layout(), np.array([4.0, 4.0]), np.array([4.0 + k, 4.0]))
    assert taken == [False] * 4 + [True] * 2
    assert screen.set_aside == 4
    assert limits(screen)[1] == OUTLYING * 1e4


def test_the_run_is_broken_by_what_is_plain() -> None:
    screen = seen(*[(4.0, 4.0)] * ENOUGH)
    taken = []
    for k in range(3 * REPEATED):
        taken.append(screen.admits(layout(), np.array([4.0, 4.0]), np.array([1e4 * 5.0**k, 4.0])))
        if k % (REPEATED - 1) == REPEATED - 2:
            assert screen.admits(layout(), np.array([4.0, 4.0]), np.array([4.0, 4.0]))
    assert not any(taken)


def test_what_two_screens_know_is_the_largest_of_both() -> None:
    one, other = seen(*[(4.0, 1.0)] * 10), seen(*[(2.0, 3.0)] * 10)
    other.set_aside = 3
    one.absorb(other)
    assert limits(one) == [OUTLYING * 4.0, OUTLYING * 3.5]  # at least the median of 4 and 3
    assert one.set_aside == 3


def test_another_scale_however_large_is_learned_and_saved(tmp_path: Path) -> None:
    """What is believed doesn't overflow, nor make a file that can't be read."""
    model, rng = WorldModel(SCHEMA), np.random.default_rng(2)
    for k in range(90):
        size = 1.0 if k < 60 else 1e70
        x, v, noise = size * rng.normal(size=3)
        now = scene(x, v)
        compare_and_learn(
            model, Transition(now, scene(x + np.tanh(v / size) * size, noise)), model.predict_one(now)
        )
    assert model.set_aside == REPEATED - 1
    model.save(tmp_path / "model.relgym", history=True)
    again = WorldModel.load(tmp_path / "model.relgym")
    asked = scene(0.3e70, -0.2e70)
    assert again.predict_one(asked).scene == model.predict_one(asked).scene


def test_the_largest_that_may_come_can_be_squared_twice() -> None:
    rows = np.full((4_000, 2), MOST)
    with np.errstate(all="raise"):
        assert np.isfinite(np.square((rows[:, 0] * rows[:, 1]).sum()))


def stream(steps: int) -> list[Transition]:
    rng = np.random.default_rng(3)
    found = []
    for _ in range(steps):
        x, v = rng.uniform(-10, 10, 2)
        found.append(Transition(scene(x, v), scene(x + 0.9 * v, 0.9 * v)))
    return found


def scene(x: float, v: float) -> Scene:
    return SCHEMA.scene({"c": [x, v]})


@pytest.mark.parametrize("wild", [1e6, 1e200, 1e308, -1e308, 5e-324])
def test_one_wild_number_changes_no_prediction(wild: float) -> None:
    clean, dirty = WorldModel(SCHEMA), WorldModel(SCHEMA)
    for k, transition in enumerate(stream(60)):
        clean.learn_one(transition)
        dirty.learn_one(transition)
        if k in (20, 40):
            report: Any = dirty.learn_one(Transition(scene(1.0, wild), scene(wild, 0.5)))
            dirty.look_back(dirty.predict_one(scene(1.0, wild)), {("c", "x"): wild})
            assert report.set_aside == (abs(wild) > 1.0)
    assert dirty.seen + dirty.set_aside == 62
    asked = [scene(3.0, -2.0), scene(0.1, 7.0)]
    assert [clean.predict_one(s).scene for s in asked] == [dirty.predict_one(s).scene for s in asked]
    assert dirty.predict_one(scene(wild, wild)).scene is not None
    assert clean.modes("cart", "v")[0].sigma == pytest.approx(
        dirty.modes("cart", "v")[0].sigma, rel=0.5, abs=1e-14
    )


def test_constants_and_subnormal_numbers_do_no_harm() -> None:
    model = WorldModel(SCHEMA)
    for k in range(40):
        model.learn_one(Transition(scene(5e-324 * k, 0.0), scene(5e-324 * (k + 1), 0.0)))
    for transition in stream(60):
        model.learn_one(transition)
    assert model.predict_one(scene(2.0, 3.0)).scene["c"]["v"] == pytest.approx(2.7)
