"""Parcels delivered in ``relgym/BoxPush-v0`` after few real steps: by plans in what relgym or nets learned; by SAC."""

from __future__ import annotations

from time import process_time
from typing import Any, Final

import numpy as np

from relgym.experiments.dyna import arms as dyna_arms
from relgym.experiments.dyna import course as dyna
from relgym.experiments.plan.course import Course, NeuralSimulator, Tests
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.world_model import WorldModel
from relgym.planning import ModelSimulator, Objective, Planner, PlanningAgent, TreeSearch
from relgym.planning.simulators import Simulator
from relgym.wrappers.dyna.recorder import TransitionRecorder

__all__ = ["ARMS", "REAL", "delivered"]

REAL: Final = 5_000
"""Real steps that every arm learns from."""

DELIVERY: Final = Course(
    "push",
    "BoxPush",
    "relgym/BoxPush-v0",
    repeat=10,
    limit=100,
    search=TreeSearch(horizon=30, batch=512, expansions=8_192, patience=512),
)
"""How parcels are delivered: a decision lasts ten steps. Who pushes gets nothing before he is behind the parcel; a tree
spreads until he is, sequences of actions drawn about a mean often don't. In batches twice as large a branch costs half
as much; and once a plan delivers, one batch in vain is enough."""

CUT: Final = 100
"""Steps after which an episode to learn from is cut short: other bodies elsewhere show more than the same ones."""

HELD: Final = (1, 2, 4, 8, 16)
"""Decisions that a random action to learn from is held for. A pusher who changes his mind at every decision hardly ever
touches a box: with seed 410 none moved in 5,000 steps."""

BANG: Final = 0.5
"""Share of those actions whose every component is at an end of its range, as `PlanningAgent` acts at random."""

ARMS: Final = {
    "relgym": "plans in what relgym learned",
    "sac": "SAC, 20 updates a decision",
    "ensemble": "the same search in an ensemble of nets",
}
"""Names and titles. Both models learn from the same random actions, and plan with the reward that the env states."""


def delivered(*, arm: str, seed: int, episodes: int, first: int = 0) -> dict[str, Any]:
    """How many parcels one arm delivers after `REAL` real steps.

    Parameters
    ----------
    arm
        A name in `ARMS`.
    seed
        Of everything random while it learns.
    episodes
        To test on; they are the same for all arms.
    first
        Number of the first of them.

    Returns
    -------
    ``good`` of ``episodes``, and processor time in seconds: ``learning``, and ``testing``.
    """
    started = process_time()
    if arm == "sac":
        course = dyna_arms.Course(
            DELIVERY.name, DELIVERY.title, DELIVERY.env_id, "pusher", repeat=DELIVERY.repeat, horizon=100
        )
        setup = dyna_arms.ARMS["sac20"]
        agent: Any = dyna_arms.make_agent(setup, dyna_arms.make_env(course, arm=setup), seed=seed)
        agent.learn(REAL // DELIVERY.repeat)
        testing = dyna.Examination(course, episodes, first=first).successes
    else:
        objective = Objective(discount=PlanningAgent.DISCOUNT)
        agent = Planner(_simulator(arm, seed), DELIVERY.search, objective, limit=DELIVERY.limit)

        def testing(agent: Any) -> int:
            return Tests(DELIVERY, episodes, first=first).successes(agent)[0]

    learning = process_time() - started
    good = testing(agent)
    seconds = process_time() - started - learning
    return {"good": int(good), "episodes": episodes, "learning": learning, "testing": seconds}


def _simulator(arm: str, seed: int) -> Simulator:
    """What was learned from random actions, transition by transition, with the env's own reward."""
    env = TransitionRecorder(DELIVERY.make())
    task: Any = env.get_wrapper_attr("task")
    relational = arm == "relgym"
    model: Any = (
        WorldModel(env.get_wrapper_attr("schema")) if relational else dyna_arms.nets_of(env, seed=seed)
    )
    env.action_space.seed(seed)
    rng = np.random.default_rng(seed)
    env.reset(seed=seed)
    action, left, lasted = None, 0, 0
    for _ in range(REAL):
        if not left:
            action, left = env.action_space.sample(), DELIVERY.repeat * int(rng.choice(HELD))
            action = np.sign(action) if rng.random() < BANG else action
        _, _, terminated, truncated, _ = env.step(action)
        left, lasted = left - 1, lasted + 1
        for real in env.take():
            if relational:
                compare_and_learn(model, real.transition, model.predict_one(real.transition.before))
            else:
                model.learn_one(real.transition)
        if terminated or truncated or lasted == CUT:
            env.reset()
            left, lasted = 0, 0
    if relational:
        model.finish()
        return ModelSimulator(model, env, task=task, repeat=DELIVERY.repeat)
    return NeuralSimulator(model, env, DELIVERY.repeat, task)
