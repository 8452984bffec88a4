"""Parcels delivered in ``relgym/BoxPush-v0`` after few real steps: by plans in what relgym or nets learned; by SAC."""

from __future__ import annotations

from time import process_time
from typing import Any, Final

from relgym.experiments import dyna, dyna_arms
from relgym.experiments.plan import Arm, Course, Tests, make_agent
from relgym.planning import TreeSearch

__all__ = ["ARMS", "REAL", "delivered"]

REAL: Final = 5_000
"""Real steps that every arm learns from."""

DELIVERY: Final = Course(
    "push",
    "BoxPush",
    "relgym/BoxPush-v0",
    repeat=10,
    limit=100,
    agent={"random_steps": REAL, "restarts": False},
    search=TreeSearch(horizon=30, batch=256, expansions=4_096),
)
"""How parcels are delivered: a decision lasts ten steps. Who pushes gets nothing before he is behind the parcel; a tree
spreads until he is, sequences of actions drawn about a mean often don't."""

ARMS: Final = {
    "relgym": "plans in what relgym learned",
    "ensemble": "the same search in an ensemble of nets",
    "sac": "SAC, 20 updates a decision",
}
"""Names and titles. Both models learn from random actions and plan with the reward that the env states."""


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
        model = Arm(arm, ARMS[arm], "neural" if arm == "ensemble" else "relational", "given")
        agent = make_agent(DELIVERY, model, seed=seed)
        agent.learn(REAL)

        def testing(agent: Any) -> int:
            return Tests(DELIVERY, episodes).successes(agent)[0]

    learning = process_time() - started
    good = testing(agent)
    seconds = process_time() - started - learning
    return {"good": int(good), "episodes": episodes, "learning": learning, "testing": seconds}
