"""Parcels delivered in ``relgym/BoxPush-v0`` after few real steps: by plans in what relgym or nets learned; by SAC."""

from __future__ import annotations

from time import process_time
from typing import Any, Final

import gymnasium as gym

from relgym.experiments import dyna, dyna_arms
from relgym.experiments.plan import Course, NeuralSimulator, Tests
from relgym.model.fitting import compare_and_learn
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
    search=TreeSearch(horizon=30, batch=256, expansions=4_096),
)
"""How parcels are delivered: a decision lasts ten steps. Who pushes gets nothing before he is behind the parcel; a tree
spreads until he is, sequences of actions drawn about a mean often don't."""

ARMS: Final = {
    "relgym": "plans in what relgym learned",
    "ensemble": "the same search in an ensemble of nets",
    "sac": "SAC, 20 updates a decision",
}
"""Names and titles. Both models learn from the same random actions, and plan with the reward that the env states."""


def delivered(*, arm: str, seed: int, episodes: int) -> dict[str, Any]:
    """How many parcels one arm delivers after `REAL` real steps.

    Parameters
    ----------
    arm
        A name in `ARMS`.
    seed
        Of everything random while it learns.
    episodes
        To test on; they are the same for all arms and seeds.

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
        testing = dyna.Examination(course, episodes).successes
    else:
        objective = Objective(discount=PlanningAgent.DISCOUNT)
        agent = Planner(_simulator(arm, seed), DELIVERY.search, objective, limit=DELIVERY.limit)

        def testing(agent: Any) -> int:
            return Tests(DELIVERY, episodes).successes(agent)[0]

    learning = process_time() - started
    good = testing(agent)
    seconds = process_time() - started - learning
    return {"good": int(good), "episodes": episodes, "learning": learning, "testing": seconds}


def _simulator(arm: str, seed: int) -> Simulator:
    """What was learned from random actions, transition by transition, with the env's own reward."""
    env = TransitionRecorder(gym.make(DELIVERY.env_id, disable_env_checker=True))
    schema: Any = env.get_wrapper_attr("schema")
    task: Any = env.get_wrapper_attr("task")
    if arm == "relgym":
        model: Any = WorldModel(schema)
    else:
        from relgym.baselines.ensemble import MLPEnsemble
        from relgym.baselines.neural_world import NeuralWorldModel
        from relgym.wrappers.flat import FlatView

        # The nets see the scene as a policy does: relative and scaled, which is to their advantage.
        features = FlatView(env).get_wrapper_attr("flattener")
        model = NeuralWorldModel(schema, features=features, ensemble=MLPEnsemble(seed=seed))
    env.action_space.seed(seed)
    env.reset(seed=seed)
    action = None
    for step in range(REAL):
        if step % DELIVERY.repeat == 0:
            action = env.action_space.sample()  # who changes his mind at every step gets nowhere
        _, _, terminated, truncated, _ = env.step(action)
        for real in env.take():
            if arm == "relgym":
                compare_and_learn(model, real.transition, model.predict_one(real.transition.before))
            else:
                model.learn_one(real.transition)
        if terminated or truncated:
            env.reset()
    if arm == "relgym":
        model.finish()
        return ModelSimulator(model, env, task=task, repeat=DELIVERY.repeat)
    return NeuralSimulator(model, env, DELIVERY.repeat, task)
