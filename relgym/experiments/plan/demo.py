"""What ``make plan`` shows: an agent that explores, the laws it has found, and ten episodes that it plans."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any, Final

import gymnasium as gym
import numpy as np

from relgym.errors import ConfigError
from relgym.experiments.plan.course import ARMS, COURSES, make_agent
from relgym.experiments.plots import Imagined, Trajectory, draw_trajectories
from relgym.planning import PlanningAgent
from relgym.planning.planner import PlannerState
from relgym.scene.objects import Scene

__all__ = ["PlanDemo", "demonstrate"]

_FIRST: Final = 90_000
"""Seed of the first episode; those shown are no selection."""

_DRAWN: Final = 3
_MOVER: Final = "truck"


@dataclass(frozen=True, slots=True)
class PlanDemo:
    """What was learned and how the episodes went.

    Attributes
    ----------
    steps
        Real steps of learning.
    laws, task
        Dynamics, and reward and end, as text.
    successes, episodes
        How many of how many episodes ended on the goal.
    decisions, surprises
        In these episodes: decisions in all, and steps at which the world did something else than planned.
    seconds
        Processor time of exploring and learning, and of a decision.
    picture
        File of the picture, or why there is none.
    """

    steps: int
    laws: str
    task: str
    successes: int
    episodes: int
    decisions: int
    surprises: int
    seconds: tuple[float, float]
    picture: str

    def __str__(self) -> str:
        learning, decision = self.seconds
        return "\n\n".join(
            [
                f"What the agent learned of its world in {self.steps} real steps ({learning:.0f} s of one core):",
                self.laws,
                "What it learned of its task, which nobody told it:",
                self.task,
                f"{self.successes} of {self.episodes} episodes end on the goal: {self.decisions} decisions, "
                f"{1000 * decision:.0f} ms each; {self.surprises} of them came out otherwise than planned.",
                f"Plans and what happened: {self.picture}",
            ]
        )


def demonstrate(out: Path, *, steps: int = 600, episodes: int = 10, seed: int = 0) -> PlanDemo:
    """Let an agent learn to push a truck to its goal, everything learned, and plan some episodes.

    Parameters
    ----------
    out
        Folder for the picture.
    steps
        Real steps of learning.
    episodes
        To plan.
    seed
        Of everything random.
    """
    course = COURSES["truck"]
    agent = make_agent(course, ARMS["relgym"], seed=seed)
    started = process_time()
    agent.learn(steps)
    learning = process_time() - started
    env = course.make()
    good = decisions = surprises = 0
    shown: list[Trajectory] = []
    started = process_time()
    for k in range(episodes):
        trajectory, thread, succeeded = _episode(agent, env, k)
        good, decisions, surprises = (
            good + succeeded,
            decisions + thread.decisions,
            surprises + thread.surprises,
        )
        if len(shown) < _DRAWN:
            shown.append(trajectory)
    decision = (process_time() - started) / max(1, decisions)
    task = agent.trainer.reward_model
    try:
        picture = str(draw_trajectories(out / "plans.png", shown))
    except ConfigError as missing:
        picture = str(missing)
    return PlanDemo(
        agent.steps,
        agent.model.describe(),
        task.model.describe() if hasattr(task, "model") else "",
        good,
        episodes,
        decisions,
        surprises,
        (learning, decision),
        picture,
    )


def _episode(agent: PlanningAgent, env: gym.Env[Any, Any], k: int) -> tuple[Trajectory, PlannerState, bool]:
    """One episode: what happened, and the first plan beside it until a better one takes its place."""
    seen, info = env.reset(seed=_FIRST + k)
    first: Scene = info["scene"]
    real, planned, state, over, followed = [first.vector], None, None, False, 0
    while not over:
        action, state = agent.predict(seen, state)
        if planned is None:
            planned = state[0].plan
        followed += state[0].plan is planned
        seen, _, terminated, truncated, info = env.step(action)
        real.append(env.get_wrapper_attr("scene").vector)
        over = terminated or truncated
    assert planned is not None and state is not None, "an episode has a first decision"
    count = len(planned.states) - 1
    dream = np.repeat(planned.states[-1:], len(real), axis=0)
    length = min(len(real), count + 1)
    dream[:length] = planned.states[:length]
    succeeded = bool(info["is_success"])
    title = f"episode {k + 1}: {'on the goal' if succeeded else 'not on the goal'}"
    marks = env.get_wrapper_attr("task").regions(first)
    own = Imagined("the first plan, while it was followed", dream, min(count, followed))
    return Trajectory(title, first, _MOVER, np.stack(real), (own,), marks), state[0], succeeded
