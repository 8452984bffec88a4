"""Envs that aren't relgym's, solved by planning in what 1,000 random steps teach, beside agents without a model."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import Any, Final

import gymnasium as gym
import numpy as np

from relgym.envs.tasks import RewardFunctions, TaskOutcome
from relgym.errors import ConfigError
from relgym.experiments.plan.course import played
from relgym.planning import CrossEntropy, ModelSimulator, Objective, Planner, TreeSearch
from relgym.planning.sequences import Search
from relgym.scene.objects import Float2D, SceneLayout
from relgym.wrappers import ModelLearner

__all__ = ["FOREIGN", "Foreign", "SwingUp", "Uphill", "agent_alone", "planned"]

_FIRST: Final = 50_000
"""Seed of the first test episode, far from those of training."""

_ENOUGH: Final = 95
"""Successes of 100 that end the run of an agent alone."""

_UPRIGHT: Final = 0.95
"""Cosine of the angle above which a pendulum stands upright."""

_FLAG: Final = 0.5
"""Where MountainCar's flag is."""


class SwingUp(RewardFunctions):
    """The reward of Pendulum-v1: it is quadratic, and relgym learns what is linear."""

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """Minus the squares of angle, speed and torque, as in the env's source; never an end."""
        angle, speed = (before[:, layout.column(0, prop)] for prop in ("angle_x0", "x2"))
        upright = (angle + np.pi) % (2.0 * np.pi) - np.pi
        torque = np.asarray(actions, dtype=np.float64).reshape(len(before))
        never = np.zeros(len(before), dtype=np.bool_)
        return TaskOutcome(-(upright**2 + 0.1 * speed**2 + 0.001 * torque**2), never, never)


class Uphill(RewardFunctions):
    """The task of MountainCar-v0; it is given, for random steps never see the flag."""

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """-1 for every step, until the flag is reached."""
        there = np.asarray(after[:, layout.column(0, "x0")] >= _FLAG, dtype=np.bool_)
        return TaskOutcome(np.full(len(after), -1.0), there, there)


@dataclass(frozen=True)
class Foreign:
    """An env, how to plan in it, and whom to compare.

    Attributes
    ----------
    title, env_id
        For people, and for `gymnasium.make`.
    task
        What plans are for.
    search, commit
        As for `Planner`.
    good
        Whether an episode was solved, by its last observation.
    baseline, settings
        Stable-Baselines3's algorithm and its parameters: those of rl-baselines3-zoo.
    limit, every
        Real steps that the baseline may take, and between two tests of it.
    """

    title: str
    env_id: str
    task: RewardFunctions
    search: Search
    commit: int | None
    good: Callable[[Any], bool]
    baseline: str
    settings: Mapping[str, Any]
    limit: int
    every: int


FOREIGN: Final = {
    "pendulum": Foreign(
        "Pendulum swing-up",
        "Pendulum-v1",
        SwingUp(),
        CrossEntropy(horizon=25, candidates=128, rounds=3),
        4,
        lambda seen: bool(seen[0] > _UPRIGHT),
        "SAC",
        {"learning_rate": 1e-3},
        20_000,
        1_000,
    ),
    "mountain-car": Foreign(
        "MountainCar",
        "MountainCar-v0",
        Uphill(),
        # The way up leads back down first, again and again: a tree spreads over places and speeds.
        TreeSearch(horizon=200, expansions=16_384, batch=256, hold=32, patience=1),
        None,
        lambda seen: bool(seen[0] >= _FLAG),
        "DQN",
        {
            "batch_size": 128,
            "buffer_size": 10_000,
            "exploration_final_eps": 0.07,
            "exploration_fraction": 0.2,
            "gamma": 0.98,
            "gradient_steps": 8,
            "learning_rate": 4e-3,
            "learning_starts": 1_000,
            "policy_kwargs": {"net_arch": [256, 256]},
            "target_update_interval": 600,
            "train_freq": 16,
        },
        120_000,
        10_000,
    ),
}


def _solved(place: Foreign, agent: Any, episodes: int) -> tuple[int, float]:
    """Successes of 100, and processor time of a decision."""
    env, predict = gym.make(place.env_id), partial(agent.predict, deterministic=True)
    each = [played(env, predict, _FIRST + k) for k in range(episodes)]
    good = sum(place.good(episode.seen) for episode in each)
    return round(100 * good / episodes), sum(e.seconds for e in each) / sum(e.decisions for e in each)


def planned(*, name: str, seed: int, steps: int = 1_000, episodes: int = 100) -> dict[str, Any]:
    """Learn a model from random steps, then plan test episodes in it.

    Parameters
    ----------
    name
        In `FOREIGN`.
    seed
        Of the random steps.
    steps
        Of them.
    episodes
        Of the test.

    Returns
    -------
    ``successes`` of 100; ``learning``, processor time in seconds, and ``decision``, that of one; ``laws``.
    """
    place = FOREIGN[name]
    env = ModelLearner(gym.make(place.env_id), config={"features": ("trig",)})
    env.action_space.seed(seed)
    started = process_time()
    env.reset(seed=seed)
    for _ in range(steps):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    learning = process_time() - started
    simulator = ModelSimulator(env.model, gym.make(place.env_id), view=env.view, task=place.task)
    planner = Planner(simulator, place.search, Objective(), commit=place.commit, tolerance=1e-4, seed=seed)
    good, decision = _solved(place, planner, episodes)
    print(f"{name}, seed {seed}: {good} of 100", file=sys.stderr, flush=True)
    return {"successes": good, "learning": learning, "decision": decision, "laws": env.model.describe()}


def agent_alone(*, name: str, seed: int, episodes: int = 100) -> dict[str, Any]:
    """Train Stable-Baselines3's agent until it solves as many test episodes as were asked for.

    Parameters
    ----------
    name
        In `FOREIGN`.
    seed
        Of everything random.
    episodes
        Of a test.

    Returns
    -------
    ``curve``: (real steps, successes of 100) at each test; ``solved_at``, real steps at the first test that was enough,
    or None.

    Raises
    ------
    ConfigError
        Stable-Baselines3 isn't installed.
    """
    try:
        import stable_baselines3
        import torch
        from stable_baselines3.common.callbacks import BaseCallback
    except ImportError as missing:
        raise ConfigError(
            f"{missing}: agents without a model need the extra sb3 (pip install 'relgym[sb3]')"
        ) from None
    torch.set_num_threads(1)  # nets this small lose by more
    place = FOREIGN[name]
    curve: list[tuple[int, int]] = []

    class Check(BaseCallback):  # type: ignore[misc]
        def _on_step(self) -> bool:
            if self.num_timesteps % place.every:
                return True
            curve.append((self.num_timesteps, _solved(place, self.model, episodes)[0]))
            print(f"{name}, {place.baseline}, seed {seed}: {curve[-1]}", file=sys.stderr, flush=True)
            return curve[-1][1] < _ENOUGH

    made = getattr(stable_baselines3, place.baseline)
    made("MlpPolicy", place.env_id, seed=seed, device="cpu", **place.settings).learn(
        place.limit, callback=Check()
    )
    good = bool(curve) and curve[-1][1] >= _ENOUGH
    return {"curve": curve, "solved_at": curve[-1][0] if good else None}
