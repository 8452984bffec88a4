"""Minari data sets: written, found, refused, and learned from as online."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from plain_envs import Slider

import relgym
from relgym.data import Dataset
from relgym.errors import ConfigError, DataError
from relgym.wrappers import ModelLearner

minari = pytest.importorskip("minari")
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning:minari")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))


def file_of(model: Any, folder: Path) -> bytes:
    model.save(folder / "model.relgym", history=True)
    return (folder / "model.relgym").read_bytes()


@pytest.mark.parametrize(
    ("name", "steps", "options", "form"),
    [
        ("CartPole-v1", 30, {"learn_reward": True, "learn_termination": True}, "hdf5"),
        ("Pendulum-v1", 40, {}, "arrow"),
        ("relgym/BallBoxRamp-v0", 210, {}, "hdf5"),
        ("relgym/TruckPush-v0", 15, {}, "arrow"),
    ],
)
def test_byte_for_byte_the_model_learned_online(
    name: str, steps: int, options: dict[str, Any], form: str, tmp_path: Path
) -> None:
    learner = ModelLearner(gym.make(name), **options)
    learner.action_space.seed(0)
    learner.reset(seed=0)
    for _ in range(steps):
        *_, terminated, truncated, _ = learner.step(learner.action_space.sample())
        if terminated or truncated:
            learner.reset()
    env = gym.make(name)
    lived = Dataset.collect(env, steps, seed=0)
    dataset = lived.to_minari("test/some-v0", env=env, data_format=form)
    assert dataset.total_steps == steps
    for source in (dataset, "test/some-v0"):
        assert file_of(relgym.fit(source, **options), tmp_path) == file_of(learner, tmp_path)


def test_written_and_read_again() -> None:
    lived = Dataset.collect(Slider(7), 30, seed=0)
    lived.to_minari("test/slider-v0")
    again = Dataset.from_minari("test/slider-v0")
    assert (again.observation_space, again.action_space) == (lived.observation_space, lived.action_space)
    assert len(again) == 30
    for then, now in zip(lived, again, strict=True):
        np.testing.assert_array_equal(then.observations, now.observations)
        np.testing.assert_array_equal(then.actions, now.actions)
        np.testing.assert_array_equal(then.rewards, now.rewards)  # type: ignore[arg-type]
        assert now.truncated  # where a recording stops, Minari says that it was cut off
    with pytest.raises(DataError, match="can't be made a Minari data set"):
        lived.to_minari("test/slider-v0")


def test_spaces_of_parts() -> None:
    seen = spaces.Dict(
        a=spaces.Box(-9, 9, (2,), np.float64), b=spaces.Tuple((spaces.Discrete(3), spaces.Text(4)))
    )
    rows = [{"a": np.array([k, 0.5]), "b": (k % 3, "ab"[: 1 + k % 2])} for k in range(5)]
    episode = relgym.data.Episode(rows, [0, 1, 0, 1], [0.0] * 4, terminated=True)
    Dataset([episode], seen, spaces.Discrete(2)).to_minari("test/parts-v0")
    (again,) = Dataset.from_minari("test/parts-v0")
    assert again.terminated
    assert [row["b"] for row in again.observations] == [row["b"] for row in rows]
    assert [row["a"].tolist() for row in again.observations] == [[k, 0.5] for k in range(5)]  # type: ignore[attr-defined]


def test_no_such_data_set() -> None:
    Dataset.collect(Slider(7), 8, seed=0).to_minari("test/slider-v0")
    with pytest.raises(
        DataError, match=r"no Minari data set 'test/slide-v0' here .*there are: test/slider-v0"
    ):
        relgym.fit("test/slide-v0")
    with pytest.raises(DataError, match="no Minari data set 'not an id'"):
        relgym.fit("not an id")
    with pytest.raises(DataError, match="expected a Minari data set or the id of one, got int"):
        Dataset.from_minari(3)


def test_an_env_that_can_not_be_made_here() -> None:
    gym.register("relgym-test/Gone-v0", "plain_envs:Slider")
    try:
        env = gym.make("relgym-test/Gone-v0")
        dataset = Dataset.collect(env, 20, seed=0).to_minari("test/gone-v0", env=env)
    finally:
        gym.registry.pop("relgym-test/Gone-v0")
    dataset.env_spec.entry_point = "nowhere:Slider"
    with pytest.warns(UserWarning, match="Gone-v0 can't be made here .* pass env="):
        model = relgym.fit(dataset)
    assert model.seen == 20
    assert relgym.fit(dataset, env=Slider()).seen == 20


def test_rewards_are_needed() -> None:
    x = np.arange(4.0)[:, None]
    with pytest.raises(DataError, match="pass rewards="):
        Dataset.from_arrays(x[:-1], x[:-1], x[1:]).to_minari("test/none-v0")


def test_without_minari(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "minari", None)
    with pytest.raises(ConfigError, match=r"pip install 'relgym\[minari\]'"):
        Dataset.from_minari("test/slider-v0")
