"""Kinematics discovered: which next value follows from which, and predicted values as conditions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from points import formulas, learned, schema_of, transitions

from relgym.model.predicting.chaining import in_order
from relgym.model.world_model import WorldModel
from relgym.scene.objects import TASK, Target, Transition

CAR = schema_of(("x", "v"), ("a",))
WALL = -1.2


def car(state: np.ndarray, action: np.ndarray) -> list[float]:
    """A mountain car of which the mountain's law is known to be a sine: new velocity, and a wall that stops."""
    x, v = state
    v = v + 0.001 * action[0] - 0.0025 * math.cos(3.0 * x)
    if x + v <= WALL:
        return [WALL, 0.0]
    return [x + v, v]


def drive(n: int, seed: int) -> list[Transition]:
    rng = np.random.default_rng(seed)
    left = np.where(rng.random(n) < 0.2, -1.1, 0.5)
    starts = np.column_stack([rng.uniform(-1.2, left), rng.uniform(-0.05, 0.05, n)])
    return transitions(CAR, car, starts, rng.integers(-1, 2, (n, 1)).astype(float))


@pytest.fixture(scope="module")
def driver() -> WorldModel:
    return learned(CAR, drive(1500, 1), features=("trig",))


def test_the_new_velocity_moves_the_car(driver: WorldModel) -> None:
    assert [str(t) for t in driver.targets] == ["self.v", "self.x"]
    assert driver.targets[1].given == (("self", "v"),)
    assert "x' = x + v'" in formulas(driver, "x")


def test_the_mountain_is_found_as_printed_in_the_source(driver: WorldModel) -> None:
    assert "v' = v - 0.0025 cos(3 x) + 0.001 action.a" in formulas(driver, "v")


def test_a_wall_is_a_condition_on_where_the_car_would_get_to(driver: WorldModel) -> None:
    told = driver.describe(details=True, digits=5)
    assert "v' = 0 where x + v' would be <= -1.2" in told
    assert "x' = -1.2 where v' = 0" in told


def test_walls_are_told_from_the_way_on_fresh_steps(driver: WorldModel) -> None:
    fresh = drive(400, 2)
    hits = [t for t in fresh if t.after["self"]["x"] == WALL]
    assert len(hits) >= 5
    for t in fresh:
        predicted = driver.predict_one(t.before)
        assert predicted.ok
        assert predicted.scene["self"].values == pytest.approx(t.after["self"].values, abs=1e-6)


def test_batches_and_single_scenes_agree_bit_for_bit(driver: WorldModel) -> None:
    fresh = drive(60, 3)
    layout = fresh[0].before.layout
    batch = driver.predict_batch(layout, np.array([t.before.vector for t in fresh]))
    one = [driver.predict_one(t.before) for t in fresh]
    assert batch.vectors.tolist() == [p.scene.vector.tolist() for p in one]
    assert batch.margins.tolist() == [[part.margin for part in p.parts] for p in one]


def test_an_explanation_names_the_condition(driver: WorldModel) -> None:
    hit = next(t.before for t in drive(400, 2) if t.after["self"]["x"] == WALL)
    told = driver.explain(hit)
    assert "then      0, as the rule alone would lead to x + v' <= -1.2" in told
    assert "then      -1.2, as the rule alone would lead to v' = 0 within " in told


def test_the_old_velocity_needs_no_order() -> None:
    rng = np.random.default_rng(0)
    starts = rng.normal(size=(120, 2))
    steps = transitions(
        CAR, lambda s, u: [s[0] + 0.02 * s[1], 0.9 * s[1] + u[0]], starts, rng.normal(size=(120, 1))
    )
    model = learned(CAR, steps)
    assert formulas(model, "x") == ["x' = x + 0.02 v"]
    assert not any(t.given for t in model.targets)


def test_an_angle_that_goes_round_obeys_one_law() -> None:
    schema = schema_of(("th", "w"), ("u",), angles=("th",))
    rng = np.random.default_rng(0)

    def swing(s: np.ndarray, u: np.ndarray) -> list[float]:
        w = s[1] + 0.75 * math.sin(s[0]) + 0.15 * u[0]
        return [math.remainder(s[0] + 0.05 * w, 2.0 * math.pi), w]

    starts = np.column_stack([rng.uniform(-math.pi, math.pi, 250), rng.uniform(-8.0, 8.0, 250)])
    steps = transitions(schema, swing, starts, rng.uniform(-2.0, 2.0, (250, 1)))
    model = learned(schema, steps, features=("trig",))
    assert formulas(model, "th") == ["th' = th + 0.05 w'"]
    assert formulas(model, "w") == ["w' = w + 0.75 sin(th) + 0.15 action.u"]
    assert any(abs(t.after["self"]["th"] - t.before["self"]["th"]) > math.pi for t in steps)
    for t in steps[:50]:
        assert model.predict_one(t.before).scene["self"]["th"] == pytest.approx(
            t.after["self"]["th"], abs=1e-9
        )


def test_targets_come_after_what_they_are_given_and_the_task_last() -> None:
    x, v = Target("self", "x", (("self", "v"),)), Target("self", "v")
    reward = Target(TASK, "reward", (("self", "x"),))
    assert in_order([reward, x, v]) == (v, x, reward)
    circle = Target("self", "v", (("self", "x"),))
    assert set(in_order([x, circle])) == {x, circle}


def sensed(n: int, seed: int, broken: float) -> list[Transition]:
    """A load between walls, set down anew every 100 steps, its speed, and a distance sensor that now and then fails."""
    rng, schema = np.random.default_rng(seed), schema_of(("x", "v", "far"), ("a",))
    steps: list[Transition] = []
    for k, a in enumerate(rng.uniform(-0.1, 0.1, n).tolist()):
        if k % 100 == 0:
            x, v = float(rng.uniform(1.0, 9.0)), float(rng.uniform(-0.5, 0.5))
            far = 10.0 - x
        now, v = (x, v, far), v + a
        x += v
        if not 0.0 <= x <= 10.0:
            x, v = (-x if x < 0.0 else 20.0 - x), -v
        far = -99.0 if rng.random() < broken else 10.0 - x
        before = {"self": now, "action": (a,)}
        steps.append(Transition(schema.scene(before), schema.scene(before | {"self": (x, v, far)})))
    return steps


@pytest.mark.parametrize("seed", range(3))
def test_a_place_doesnt_follow_from_the_sensor_that_shows_it(seed: int) -> None:
    """It would be the shortest law of most steps, and as often wrong as the sensor fails."""
    steps = sensed(1_500, seed, 0.03)
    model = learned(steps[0].before.schema, steps)
    place = next(target for target in model.targets if target.property == "x")
    assert ("self", "far") not in place.given
    fresh = sensed(300, 50 + seed, 0.03)
    said = [model.predict_one(step.before)["self", "x"] for step in fresh]
    right = [p.ok and abs(p.value - s.after["self"]["x"]) < 1e-9 for p, s in zip(said, fresh, strict=True)]
    assert np.mean(right) > 0.98
