"""The kernel is loaded off the step, once it pays; who can't have it is told so once."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event
from typing import Any

import gymnasium as gym
import pytest

from relgym.config.constants import REPAID
from relgym.errors import SlowWarning
from relgym.model.running import compiled
from relgym.model.running.compiled import KERNEL, Kernel
from relgym.wrappers import ModelLearner


def test_the_kernel_is_loaded_off_the_step_once_it_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    going, made = Event(), KERNEL.load()

    def slowly() -> object:
        assert going.wait(60.0)
        return made

    monkeypatch.setattr(compiled, "make", slowly)
    kernel = Kernel()
    assert kernel.after(1) is None and kernel.asked > 0.0 and kernel._loader is None
    many = REPAID * REPAID
    assert kernel.after(many) is None  # a thread has begun
    assert kernel._loader is not None and kernel.after(1) is None
    going.set()
    kernel._loader.join()
    assert kernel.after(1) is kernel.machine is made is not None


def test_who_wants_it_now_waits_for_it() -> None:
    kernel = Kernel()
    assert kernel.load() is not None
    assert kernel.after(1) is kernel.load() is kernel.machine


def refused() -> None:
    raise ImportError("No module named 'llvmlite'")


@pytest.mark.parametrize(("make", "why"), [(refused, "pip install llvmlite"), (lambda: None, "be compiled")])
def test_who_cannot_have_it_is_told_so_once(
    monkeypatch: pytest.MonkeyPatch, make: Callable[[], None], why: str
) -> None:
    monkeypatch.setattr(compiled, "make", make)
    kernel = Kernel()
    assert kernel.after(REPAID * REPAID) is None
    assert kernel._loader is not None
    kernel._loader.join()
    with pytest.warns(SlowWarning, match=why):
        assert kernel.after(1) is None
    assert kernel.after(1) is None  # a second warning would be an error
    assert kernel.load() is None


def learned(env_id: str, **options: Any) -> tuple[list[dict[Any, float]], dict[str, Any]]:
    """What each step's predictions were off by, and the model after some 400 steps."""
    env = ModelLearner(gym.make(env_id), **options)
    env.action_space.seed(0)
    env.reset(seed=0)
    off = []
    for _ in range(400):
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        off.append(dict(info["relgym"].residuals))
        if terminated or truncated:
            env.reset()
    return off, env.model.to_json(history=True)


@pytest.mark.parametrize(
    ("env_id", "options"),
    [
        ("relgym/BallBoxRamp-v0", {}),
        ("relgym/TruckPush-v0", {"learn_reward": True, "learn_termination": True}),
        ("CartPole-v1", {}),
        ("FrozenLake-v1", {}),
    ],
)
def test_what_is_learned_is_the_same_with_and_without_it(
    monkeypatch: pytest.MonkeyPatch, env_id: str, options: dict[str, Any]
) -> None:
    assert KERNEL.load() is not None
    known = learned(env_id, **options)
    monkeypatch.setattr(KERNEL, "machine", None)
    monkeypatch.setattr(KERNEL, "_warned", True)  # it can't be had, and that was said
    assert repr(learned(env_id, **options)) == repr(known)
