"""What is learned depends neither on the units that a world is told in, nor on where its numbers count from."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count, islice

import numpy as np
import pytest
from points import schema_of

from relgym.model.learning.fitting import compare_and_learn
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition

Numbers = tuple[float, ...]
Steps = Iterator[tuple[Numbers, float, Numbers]]
"""What was, what was done, and what followed."""


def carried(rng: np.random.Generator) -> Steps:
    """A load on a belt that little doesn't start, with a catch at each end; and one that follows it."""
    for k in count():
        if k % 200 == 0:
            x, y = rng.uniform(-1.0, 1.0, 2).tolist()
        u, now = float(rng.uniform(-1.0, 1.0)), (x, y)
        far = 0.1 * float(np.tanh(3.0 * x))
        x = x + 0.5 * (abs(u) > 0.4) * (u - 0.4 * float(np.sign(u)))
        x, y = min(max(x, -2.0), 2.0), min(max(y + far, -2.0), 2.0)
        yield now, u, (x, y)


def driven(rng: np.random.Generator) -> Steps:
    """An odometer far from 0, what is left in the tank, and a speed; another car every 200 steps."""
    for k in count():
        if k % 200 == 0:
            way, tank, v = float(rng.uniform(1e4, 9e4)), 20.0, 0.0
        u, now = float(rng.uniform(-1.0, 1.0)), (way, tank, v)
        v = v + 0.5 * u + 0.2
        way, tank = way + v / 36_000.0, tank - 1e-5 * v
        yield now, u, (way, tank, v)


def timed(rng: np.random.Generator) -> Steps:
    """A cart whose motor counts in single precision, beside the time in seconds since 1970."""
    t, x, v = 1.7e9 + float(rng.uniform(0.0, 1e6)), 0.0, 0.0
    for k in count():
        if k % 100 == 0:
            t += float(rng.uniform(0.0, 1e5))
        u, now = float(rng.uniform(-1.0, 1.0)), (t, x, v)
        v = 0.9 * v + float(np.float32(0.1) * np.float32(u))
        t, x = t + 0.25, x + 0.1 * v
        yield now, u, (t, x, v)


def streamed(
    world: Callable[[np.random.Generator], Steps], seed: int, steps: int, unit: float = 1.0
) -> list[Transition]:
    found = []
    for now, u, then in islice(world(np.random.default_rng(seed)), steps):
        schema = schema_of(tuple("xyz"[: len(now)]), ("u",))
        before = {"self": [unit * each for each in now], "action": (u,)}
        after = before | {"self": [unit * each for each in then]}
        found.append(Transition(schema.scene(before), schema.scene(after)))
    return found


def learned(steps: list[Transition]) -> WorldModel:
    model = WorldModel(steps[0].before.schema)
    for step in steps:
        compare_and_learn(model, step, model.predict_one(step.before))
    model.finish()
    return model


def modes(model: WorldModel) -> dict[str, int]:
    return {str(target): len(model.modes(target.type, target.property)) for target in model.targets}


def outcome(model: WorldModel, steps: list[Transition], unit: float = 1.0) -> tuple[float, float]:
    """Share of predictions that are claimed, and of those that are claimed and off by a thousandth of the unit."""
    told = [(model.predict_one(step.before), step.after) for step in steps]
    claimed = [part.ok for said, _ in told for part in said.parts]
    off = [
        part.ok and abs(part.value - came[part.object][part.property]) > 1e-3 * unit
        for said, came in told
        for part in said.parts
    ]
    return float(np.mean(claimed)), float(np.mean(off))


@pytest.fixture(scope="module")
def usual() -> float:
    model = learned(streamed(carried, 1, 800))
    claimed, off = outcome(model, streamed(carried, 2, 200))
    assert claimed > 0.25
    assert off <= 0.01
    return claimed


@pytest.mark.parametrize("power", [-40, -20, 20, 40])
def test_other_units_teach_the_same(power: int, usual: float) -> None:
    """Powers of 2, so that nothing is rounded on the way: of metres some a billionth, and some a billion."""
    unit = 2.0**power
    model = learned(streamed(carried, 1, 800, unit))
    claimed, off = outcome(model, streamed(carried, 2, 200, unit), unit)
    assert claimed == pytest.approx(usual, abs=0.1)
    assert off <= 0.01


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_a_large_number_changes_by_little_is_a_law(seed: int) -> None:
    """Not a constant of each car, though what it went and what it burnt tell the same."""
    model = learned(streamed(driven, seed, 1_000))
    assert modes(model) == {"self.x": 1, "self.y": 1, "self.z": 1}
    for step in streamed(driven, 50 + seed, 200):
        said = model.predict_one(step.before)
        for part in said.parts:
            assert part.ok
            came, was = step.after[part.object][part.property], step.before[part.object][part.property]
            assert part.value == pytest.approx(came, abs=1e-3 * abs(came - was) + 1e-10)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_rounding_leaves_here_is_noise_there(seed: int) -> None:
    model = learned(streamed(timed, seed, 600))
    assert modes(model) == {"self.x": 1, "self.y": 1, "self.z": 1}
    formulas = {
        str(target): model.modes(target.type, target.property)[0].formula() for target in model.targets
    }
    assert formulas["self.x"] == "x' = x + 0.25"
    for step in streamed(timed, 50 + seed, 100):
        said = model.predict_one(step.before)
        assert said.ok
        assert all(
            part.value == pytest.approx(step.after[part.object][part.property], abs=1e-6)
            for part in said.parts
        )
