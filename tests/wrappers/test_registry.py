"""Every env that Gymnasium brings along and that shows no images: wrapped, stepped, checked."""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import pytest
from gymnasium.utils.env_checker import check_env

from relgym.model.predicting.prediction import Outcome, Prediction
from relgym.wrappers import ModelLearner

LIGHT = (
    "Acrobot-v1",
    "Blackjack-v1",
    "CartPole-v0",
    "CartPole-v1",
    "CliffWalking-v1",
    "CliffWalkingSlippery-v1",
    "FrozenLake-v1",
    "FrozenLake8x8-v1",
    "MountainCar-v0",
    "MountainCarContinuous-v0",
    "Pendulum-v1",
    "Taxi-v4",
)
NO_WHEEL = pytest.mark.skipif(sys.version_info >= (3, 14), reason="Box2D has no wheel for this Python")
BOX2D = tuple(
    pytest.param(name, marks=NO_WHEEL)
    for name in ("BipedalWalker-v3", "BipedalWalkerHardcore-v3", "LunarLander-v3", "LunarLanderContinuous-v3")
)


@contextlib.contextmanager
def noted() -> Iterator[list[str]]:
    """What is warned of inside; the warning that an env is wrapped is left out."""
    said: list[str] = []
    with warnings.catch_warnings(record=True) as caught, contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("always")
        yield said
    said += sorted({str(w.message) for w in caught if "unwrapped version" not in str(w.message)})


def make(name: str) -> gym.Env[Any, Any]:
    with noted():
        return gym.make(name)


def live(env: gym.Env[Any, Any], steps: int) -> list[str]:
    """Random actions with new episodes where old ones end; all that the env said but reports."""
    env.action_space.seed(0)
    said = [str(env.reset(seed=0))]
    for _ in range(steps):
        *rest, info = env.step(env.action_space.sample())
        said.append(str((rest, {k: v for k, v in info.items() if k != "relgym"})))
        if rest[2] or rest[3]:
            said.append(str(env.reset()))
    return said


@pytest.mark.parametrize("name", [*LIGHT, *BOX2D])
def test_any_env_is_wrapped_and_says_what_it_says_bare(name: str) -> None:
    env = ModelLearner(make(name), learn_reward=True, learn_termination=True)
    assert live(env, 12) == live(make(name), 12)
    assert env.model.seen == 12
    env.close()


@pytest.mark.parametrize("name", ["CartPole-v1", "Pendulum-v1", "Blackjack-v1", "CliffWalking-v1"])
def test_the_checker_says_the_same_as_bare(name: str) -> None:
    _check(name)


def _check(name: str) -> None:
    with noted() as bare:
        check_env(make(name), skip_render_check=True)
    with noted() as wrapped:
        check_env(ModelLearner(make(name)), skip_render_check=True)
    assert wrapped == bare


WITHOUT_LAW = {
    "Blackjack-v1": "self.x0",
    "CliffWalkingSlippery-v1": "self.x",
    "FrozenLake-v1": "self.x",
    "FrozenLake8x8-v1": "self.x",
    "Taxi-v4": "self.x",
}
"""Numbers that follow no law of the form that is looked for: a card drawn, or the number of a cell."""

LAWFUL = {
    "CartPole-v1": ("self.x0", "self.x2"),
    "MountainCarContinuous-v0": ("self.x0",),
}
"""Targets whose modes are right of all but few steps."""


def lived(name: str, steps: int) -> ModelLearner:
    env = ModelLearner(make(name))
    live(env, steps)
    return env


@pytest.mark.slow
@pytest.mark.parametrize("name", WITHOUT_LAW)
def test_modes_that_nobody_can_choose_between_are_called_unexplained(name: str) -> None:
    env = lived(name, 500)
    part = env.model.property_model(*WITHOUT_LAW[name].split("."))
    assert part.modes
    assert not part.clusterer.noise_examples > 0.1 * part.clusterer.seen  # they cover the examples
    assert part.unexplained
    assert "advice: unexplained; its modes cover the examples, but nothing tells which" in env.model.describe(
        details=True
    )
    said, wrong = _predicted(env, 100)
    assert wrong > 15
    assert Outcome.PREDICTED not in {p.outcome for p in said if p.property == part.target.property}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "targets"), LAWFUL.items())
def test_what_is_explained_is_not_called_unexplained(name: str, targets: tuple[str, ...]) -> None:
    env = lived(name, 500)
    told = [str(a) for a in env.model.advice() if a.target in targets]
    assert told == []
    for target in targets:
        assert not env.model.property_model(*target.split(".")).unexplained


def _predicted(env: ModelLearner, steps: int) -> tuple[list[Prediction], int]:
    """What is said of further steps, and of how many of them something was wrong by the values alone."""
    said, wrong = list[Prediction](), 0
    env.reset(seed=1)
    for _ in range(steps):
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        report = info["relgym"]
        said += report.prediction.parts
        wrong += any(abs(residual) > 1e-9 for residual in report.residuals.values())
        if terminated or truncated:
            env.reset()
    return said, wrong


@pytest.mark.slow
@pytest.mark.parametrize("name", [*LIGHT, *BOX2D])
def test_what_is_not_explained_is_called_so(name: str) -> None:
    _check(name)
    env = ModelLearner(make(name))
    live(env, 500)
    model = env.model
    assert model.seen == 500
    told = model.describe(details=True)
    prediction = model.predict_one(env.view.with_action(env.scene, env.action_space.sample()))
    for target in model.targets:
        assert str(target) in told
        known = model.property_model(target.type, target.property)
        part = next(p for p in prediction.parts if p.property == target.property)
        if known.unexplained or not known.modes:
            assert part.outcome is not Outcome.PREDICTED
        assert not known.unexplained or "advice: unexplained" in told
        assert known.modes or f"{target}: no mode learned yet" in told
    env.close()
