"""A program that stays while its model learns says what arrays say, at every step."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from relgym.model import running
from relgym.model.grounds import Grounds
from relgym.model.prediction import ScenePrediction
from relgym.model.querying import predict
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene
from relgym.wrappers import ModelLearner


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel is there, and programs are lowered for the first scene that is asked."""
    monkeypatch.setattr(running, "PATIENCE", 0)
    running.KERNEL.load()


def told(prediction: ScenePrediction) -> list[object]:
    """All that a prediction says, NaN being itself."""
    parts = [
        repr([getattr(p, name) for name in p.__slots__]) for p in prediction.parts
    ]  # what takes no part in comparisons among them
    return [*parts, prediction.scene.vector.tobytes()]


def by_arrays(model: WorldModel, scene: Scene) -> ScenePrediction:
    parts = model._parts
    return predict(parts, parts.perception.percept(scene.layout, scene.vector[None]), scene)


@pytest.mark.parametrize(
    ("name", "steps", "least", "options"),
    [
        ("relgym/BallBoxRamp-v0", 500, 0.5, {}),
        ("relgym/BallBoxRamp-v0", 350, 0.5, {"config": {"frames": "world"}}),
        ("relgym/TruckPush-v0", 120, 0.3, {"learn_reward": True, "learn_termination": True}),
        ("CartPole-v1", 200, 0.3, {}),
        ("MountainCar-v0", 300, 0.3, {}),
    ],
)
def test_a_program_that_stays_says_what_arrays_say(
    monkeypatch: pytest.MonkeyPatch, name: str, steps: int, least: float, options: dict[str, object]
) -> None:
    env = ModelLearner(gym.make(name), **options)  # type: ignore[arg-type]
    env.action_space.seed(3)
    env.reset(seed=3)
    answered, lowerings = 0, 0
    run, lowered = WorldModel._run_one, running.lowered

    def compared(self: WorldModel, scene: Scene) -> ScenePrediction | None:
        nonlocal answered
        found = run(self, scene)
        if found is not None:
            answered += 1
            assert told(found) == told(by_arrays(self, scene))
        return found

    def counted(*args: object) -> object:
        nonlocal lowerings
        lowerings += 1
        return lowered(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(WorldModel, "_run_one", compared)
    monkeypatch.setattr(running, "lowered", counted)
    for _ in range(steps):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    assert answered > least * steps
    assert lowerings < 0.6 * steps


def test_grounds_are_the_same_until_something_is_said_otherwise() -> None:
    env = ModelLearner(gym.make("relgym/BallBoxRamp-v0"))
    env.reset(seed=0)
    for _ in range(30):
        env.step(env.action_space.sample())
    model = env.model
    known = Grounds.of(model._parts)
    assert known.same(Grounds.of(model._parts))
    target = model.targets[0]
    fallback = model._parts.models[target].fallback
    fallback.scope = type(fallback.scope)()
    assert not known.same(Grounds.of(model._parts))
    assert np.isfinite(env.scene.vector).all()
