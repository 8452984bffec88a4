"""Learners that go on from a model that is given, not from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from plain_envs import Slider, Wheel

from relgym.errors import ConfigError
from relgym.model.world_model import WorldModel
from relgym.wrappers import ModelLearner, VectorModelLearner


def lived(env: gym.Env[Any, Any], steps: int = 60, **options: Any) -> ModelLearner:
    learner = ModelLearner(env, **options)
    learner.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        *_, truncated, _ = learner.step(rng.uniform(-0.5, 0.5, 1))
        if truncated:
            learner.reset()
    return learner


def file_of(model: Any, folder: Path) -> bytes:
    model.save(folder / "model.relgym", history=True)
    return (folder / "model.relgym").read_bytes()


def test_an_empty_model_that_is_given_learns_as_one_that_is_made(tmp_path: Path) -> None:
    made = lived(Slider(25))
    given = WorldModel(made.view.schema)
    learner = lived(Slider(25), model=given)
    assert learner.model is given
    assert given.seen == 60
    assert file_of(given, tmp_path) == file_of(made, tmp_path)


def test_it_goes_on_as_from_its_file(tmp_path: Path) -> None:
    first = lived(Slider(25))
    path = tmp_path / "first.relgym"
    first.save(path, history=True)
    from_file = lived(Slider(25), model=path)
    assert file_of(lived(Slider(25), model=first.model), tmp_path) == file_of(from_file, tmp_path)


def test_angles_that_it_learned_through_stand() -> None:
    first = lived(Wheel())
    again = lived(Wheel(), model=first.model)
    assert again.view.to_json() == first.view.to_json()
    assert again.model is first.model


def test_several_envs_teach_it() -> None:
    given = WorldModel(lived(Slider(25)).view.schema)
    learner = VectorModelLearner(gym.vector.SyncVectorEnv([Slider, Slider]), model=given)
    learner.reset(seed=0)
    learner.step(np.zeros((2, 1)))
    assert (learner.model is given, given.seen) == (True, 2)


def test_what_is_refused() -> None:
    model = lived(Slider(25)).model
    with pytest.raises(
        ConfigError, match="model=3: expected a WorldModel or the path of a model file, got int"
    ):
        ModelLearner(Slider(), model=3)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="either model or those"):
        ModelLearner(Slider(), model=model, config={"seed": 2})
    with pytest.raises(ConfigError, match="pass the learn_reward"):
        ModelLearner(Slider(), model=model, learn_reward=True)
    with pytest.raises(ConfigError, match="model: the model was learned in another world"):
        ModelLearner(gym.make("CartPole-v1"), model=model)


def test_specs_make_learners_with_copies() -> None:
    gym.register("relgym-test/Slider-v0", "plain_envs:Slider")
    try:
        model = lived(Slider(25)).model
        learner = ModelLearner(gym.make("relgym-test/Slider-v0"), model=model)
        assert learner.spec is not None
        other = gym.make(learner.spec)
    finally:
        gym.registry.pop("relgym-test/Slider-v0")
    copy = other.get_wrapper_attr("model")
    assert copy is not model
    assert copy.to_json(history=True) == model.to_json(history=True)
