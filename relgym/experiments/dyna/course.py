"""One agent's course of learning: with a relational model, a neural one or none, checked again and again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from time import process_time
from typing import Any, Final

import gymnasium as gym
import numpy as np

from relgym.experiments.dyna.arms import Arm, Change, Course, make_agent, make_dyna, make_env

__all__ = ["CHECK_EVERY", "ENOUGH", "EPISODES", "STEPS", "Examination", "Run", "run", "solved_at"]

EPISODES: Final = 100
"""Evaluation episodes, always the same."""

ENOUGH: Final = 90
"""So many of them, twice in a row, are success."""

CHECK_EVERY: Final = 250
"""Real steps between two evaluations."""

STEPS: Final = 60_000
"""Runs end here, and count as more."""

_FIRST_EPISODE: Final = 50_000  # its seed: far from those of training


@dataclass(frozen=True, slots=True)
class Run:
    """One agent's course of learning.

    Attributes
    ----------
    course, arm, seed, steps
        What was run, and for how many real steps at most.
    curve
        (real steps, successes of `EPISODES`) at every evaluation.
    solved_at
        Real steps after which success was seen twice in a row; none: never.
    seconds
        Processor time of one core, evaluations included: what else a machine does doesn't count.
    learning_seconds, dreaming_seconds
        Wall time that the model took to predict and learn, and to dream.
    accepted
        Share of the real steps at which the model was accepted.
    laws
        What was learned, as text; empty where nothing readable was.
    """

    course: str
    arm: str
    seed: int
    steps: int
    curve: tuple[tuple[int, int], ...]
    solved_at: int | None
    seconds: float
    learning_seconds: float = 0.0
    dreaming_seconds: float = 0.0
    accepted: float = 0.0
    laws: str = ""

    @property
    def last(self) -> int:
        """Successes at the last evaluation; 0 if there was none."""
        return self.curve[-1][1] if self.curve else 0

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Run:
        """Read what ``asdict`` wrote."""
        return cls(**{**data, "curve": tuple((int(steps), int(good)) for steps, good in data["curve"])})


class Examination:
    """Fixed evaluation episodes, played side by side.

    Parameters
    ----------
    course
        Where.
    episodes
        How many.
    first
        Number of the first one.
    arguments
        Of the env, where they differ from the course's.
    """

    def __init__(self, course: Course, episodes: int = EPISODES, *, first: int = 0, **arguments: Any) -> None:
        self._envs = [make_env(course, **arguments) for _ in range(episodes)]
        self._seeds = [_FIRST_EPISODE + first + k for k in range(episodes)]
        self._horizon = course.horizon

    def successes(self, agent: Any) -> int:
        """How many episodes the agent's best actions end well; ``info["is_success"]`` at the end counts."""
        firsts = [env.reset(seed=seed)[0] for env, seed in zip(self._envs, self._seeds, strict=True)]
        seen, good = np.stack(firsts), 0
        going = np.arange(len(self._envs))
        for _ in range(self._horizon):
            actions, _ = agent.predict(seen[going], deterministic=True)
            over = np.zeros(len(going), dtype=bool)
            for at, (k, action) in enumerate(zip(going.tolist(), actions, strict=True)):
                seen[k], _, terminated, truncated, info = self._envs[k].step(action)
                over[at] = terminated or truncated
                good += bool(over[at] and info["is_success"])
            going = going[~over]
            if not len(going):
                break
        for env in self._envs:
            env.get_wrapper_attr("take")()  # nobody learns from tests
        return good


def run(
    course: Course,
    arm: Arm,
    *,
    seed: int,
    steps: int = STEPS,
    testing: Examination | None = None,
    to_the_end: bool = False,
    heard: Callable[[int, int], None] | None = None,
    met: Callable[[Any, Any], None] | None = None,
    agent: dict[str, Any] | None = None,
    dyna: dict[str, Any] | None = None,
    model: Any = None,
    change: Change | None = None,
) -> Run:
    """Let one agent learn until it succeeds twice in a row, or for so many real steps.

    Parameters
    ----------
    course, arm
        Where and how.
    seed
        Of agent, env and model.
    steps
        Real steps (decisions) at most.
    testing
        Evaluation episodes; default: new ones.
    to_the_end
        Go on after success.
    heard
        Is told (real steps, successes) at every evaluation.
    met
        Is shown the trained agent and its model (none: it has none) at the end.
    agent, dyna
        Parameters of the agent and of Dyna that differ from the course's.
    model
        To dream in, if it isn't to be learned from nothing.
    change
        How the world changes while the agent learns; tests are in the world as it is by then.
    """
    env: gym.Env[Any, Any] = make_env(course, change, arm=arm)
    settings = {**(course.agent if arm.dreams else {}), **(agent or {})}
    algorithm = make_agent(arm, env, seed=seed, **settings)  # says so where the extra is missing
    import torch
    from stable_baselines3.common.callbacks import BaseCallback, CallbackList

    torch.set_num_threads(1)  # nets this small lose by more
    own = make_dyna(arm, course, env, seed=seed, model=model, **(dyna or {}))
    tests = testing or Examination(course)
    later = tests if change is None else Examination(course, **change.arguments)
    curve: list[tuple[int, int]] = []
    accepted = 0

    class Check(BaseCallback):  # type: ignore[misc]
        def _on_step(self) -> bool:
            nonlocal accepted
            accepted += int(getattr(self.model.replay_buffer, "accepted", False))
            if self.num_timesteps % CHECK_EVERY:
                return True
            exam = tests if change is None or self.num_timesteps <= change.after else later
            curve.append((self.num_timesteps, exam.successes(self.model)))
            if heard is not None:
                heard(*curve[-1])
            return to_the_end or solved_at(curve) is None

    started = process_time()
    algorithm.learn(steps, callback=CallbackList([*([own] if own is not None else []), Check()]))
    seconds = process_time() - started
    if met is not None:
        met(algorithm, getattr(own, "world", None))
    learning, dreaming, laws = _costs(own)
    share = accepted / max(1, algorithm.num_timesteps)
    solved = solved_at(curve)
    return Run(
        course.name, arm.name, seed, steps, tuple(curve), solved, seconds, learning, dreaming, share, laws
    )


def solved_at(curve: Sequence[tuple[int, int]]) -> int | None:
    """Real steps at the second of two evaluations in a row that are success; none if there are none."""
    pairs = pairwise(curve)
    return next((later[0] for sooner, later in pairs if min(sooner[1], later[1]) >= ENOUGH), None)


def _costs(own: Any) -> tuple[float, float, str]:
    if own is None or not hasattr(own, "trainer"):
        return 0.0, 0.0, ""
    parts = [own.world, getattr(own.trainer.reward_model, "model", None)]
    laws = [part.describe() for part in dict.fromkeys(parts) if hasattr(part, "describe")]
    return own.trainer.seconds, own.dreaming_seconds, "\n\n".join(laws)
