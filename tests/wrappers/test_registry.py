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

from relgym.model.prediction import Outcome
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


@pytest.mark.slow
@pytest.mark.parametrize("name", [*LIGHT, *BOX2D])
def test_what_is_not_explained_is_called_so(name: str) -> None:
    _check(name)
    env = ModelLearner(make(name))
    live(env, 500)
    model = env.model
    assert model.seen == 500
    told = model.describe()
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
