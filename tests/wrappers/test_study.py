"""Who predicts, compares and learns tells the model how its predictions came out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from carts import run
from gymnasium import spaces

from relgym.model.world_model import WorldModel
from relgym.wrappers import ModelLearner, VectorModelLearner


class Lottery(gym.Env[Any, Any]):
    """What is shown next is 0, 3 or 7, whatever was and whatever is done."""

    observation_space = spaces.Box(0.0, 7.0, (1,), np.float64)
    action_space = spaces.Box(-1.0, 1.0, (1,), np.float64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        return np.zeros(1), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return self.np_random.choice([0.0, 3.0, 7.0], 1), 0.0, False, False, {}


def evaluated(model: WorldModel) -> dict[str, Any]:
    return {str(t): model.property_model(t.type, t.property).hindsight.to_json() for t in model.targets}


@pytest.fixture(scope="module")
def watched() -> ModelLearner:
    env = ModelLearner(Lottery())
    run(env, 160)
    return env


def test_a_learner_evaluates_itself(watched: ModelLearner) -> None:
    part = watched.model.property_model("self", "x")
    assert part.hindsight.spoken > 80
    assert part.unexplained
    report = watched.step(np.zeros(1))[4]["relgym"]
    assert report.wrong == (("self", "x"),)  # nothing was claimed


def test_the_same_seed_gives_the_same_file_and_a_file_goes_on(watched: ModelLearner, tmp_path: Path) -> None:
    twin = ModelLearner(Lottery())
    run(twin, 160)
    twin.step(np.zeros(1))
    for name, env in (("one", watched), ("other", twin)):
        env.save(tmp_path / name, history=True)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()
    again = ModelLearner(Lottery(), model=tmp_path / "one")
    again.reset(seed=1)
    assert evaluated(again.model) == evaluated(watched.model)
    assert again.model.property_model("self", "x").unexplained


def test_who_does_not_learn_is_not_evaluated() -> None:
    env = ModelLearner(Lottery())
    run(env, 60)
    before = evaluated(env.model)
    env.pause()
    run(env, 30)
    assert evaluated(env.model) == before
    assert env.prequential.steps == 90


def test_who_does_not_predict_is_not_evaluated() -> None:
    env = ModelLearner(Lottery(), predict=False)
    run(env, 60)
    assert evaluated(env.model)["self.x"]["steps"] == []


def test_many_envs_evaluate_each_prediction() -> None:
    envs = VectorModelLearner(gym.vector.SyncVectorEnv([Lottery, Lottery]))
    envs.reset(seed=0)
    for _ in range(60):
        envs.step(envs.action_space.sample())
    known = envs.model.property_model("self", "x").hindsight
    assert 0 < known.spoken == len(known)
    assert known.wrong > 0
