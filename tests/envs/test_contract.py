"""What Gymnasium asks of every env, for every registered id."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import relgym
from relgym.envs import BallBoxRampEnv, BallGoalEnv, SceneEnv, TruckPushEnv
from relgym.errors import ConfigError

IDS = ("relgym/BallBoxRamp-v0", "relgym/BallGoal-v0", "relgym/BoxPush-v0", "relgym/TruckPush-v0")
STEPS = {
    "relgym/BallBoxRamp-v0": 200,
    "relgym/BallGoal-v0": 500,
    "relgym/BoxPush-v0": 1_000,
    "relgym/TruckPush-v0": 40,
}
ENDLESS: dict[str, dict[str, Any]] = {"relgym/TruckPush-v0": {"task": None}}  # no action ends an episode
MADE: list[tuple[str, dict[str, Any]]] = [
    *((env_id, {}) for env_id in IDS),
    ("relgym/BallBoxRamp-v0", {"objects": ("box", "ramp", "ramp"), "balls": 3, "type_names": "thesis"}),
    ("relgym/BallBoxRamp-v0", {"objects": ()}),
    ("relgym/BallGoal-v0", {"objects": ("box", "box", "ramp"), "type_names": "thesis", "friction": 0.2}),
    ("relgym/BoxPush-v0", {"n_boxes": 0, "parcel": "tee", "friction": 0.0}),
    ("relgym/TruckPush-v0", {"n_boxes": 5, "resample": "step", "bystanders": 2}),
    ("relgym/TruckPush-v0", {"task": None}),
    ("relgym/TruckPush-v0", {"bystanders": 2}),
]

ids = pytest.mark.parametrize("env_id", IDS)
made = pytest.mark.parametrize(("env_id", "arguments"), MADE)


def scene_env(env_id: str, **arguments: Any) -> SceneEnv:
    env = gym.make(env_id, **arguments).unwrapped
    assert isinstance(env, SceneEnv)
    return env


@made
def test_gymnasiums_checker_says_nothing(env_id: str, arguments: dict[str, Any]) -> None:
    check_env(scene_env(env_id, **arguments))  # warnings are errors


@made
def test_observations_lie_in_their_space(env_id: str, arguments: dict[str, Any]) -> None:
    env = gym.make(env_id, **arguments)
    env.action_space.seed(0)
    for seed in range(3):
        observation, _ = env.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            assert env.observation_space.contains(observation)
            observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
            assert not terminated or scene_env(env_id, **arguments).task is not None


@ids
def test_time_limit_and_schema_through_the_wrappers(env_id: str) -> None:
    env = gym.make(env_id, **ENDLESS.get(env_id, {}))
    observation, info = env.reset(seed=0)
    schema = env.get_wrapper_attr("schema")
    assert info["scene"].schema == schema
    assert info["scene"].layout.names == tuple(name for name in schema.order if name != "action")
    for name, values in observation.items():
        np.testing.assert_array_equal(values, info["scene"][name].values)
    steps = 0
    truncated = False
    while not truncated:
        *_, truncated, _ = env.step(env.action_space.sample())
        steps += 1
    assert steps == STEPS[env_id]


@ids
def test_observations_belong_to_the_caller(env_id: str) -> None:
    env = scene_env(env_id)
    first, _ = env.reset(seed=0)
    before = env.vector
    for values in first.values():
        values += 1.0
    np.testing.assert_array_equal(env.vector, before)
    second, *_ = env.step(env.action_space.sample())
    assert all(not np.shares_memory(first[name], second[name]) for name in first)


@ids
@pytest.mark.parametrize("mode", ["sync", "async"])
@pytest.mark.parametrize("autoreset", list(AutoresetMode))
def test_vector_envs(env_id: str, mode: str, autoreset: AutoresetMode) -> None:
    arguments = ENDLESS.get(env_id, {})
    options = {"autoreset_mode": autoreset}
    made = gym.make_vec(env_id, 2, vectorization_mode=mode, vector_kwargs=options, **arguments)
    single = scene_env(env_id, **arguments)
    observation, _ = made.reset(seed=3)  # 3 and 4
    alone, _ = single.reset(seed=4)
    actions = made.action_space.sample()
    for _ in range(20):
        observation, *_ = made.step(actions)
        alone, *_ = single.step(actions[1])
    for name, values in alone.items():
        np.testing.assert_array_equal(observation[name][1], values)
    made.close()


@made
@pytest.mark.parametrize("through", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_go_on_alike_and_apart(env_id: str, arguments: dict[str, Any], through: Any) -> None:
    env = scene_env(env_id, **arguments)
    unused = through(env)
    env.reset(seed=0)
    for _ in range(5):
        env.step(env.action_space.sample())
    twin = through(env)
    before = twin.vector
    np.testing.assert_array_equal(env.vector, before)
    action = env.action_space.sample()
    for _ in range(30):
        env.step(action)
    np.testing.assert_array_equal(twin.vector, before)
    for _ in range(30):
        twin.step(action)
    np.testing.assert_allclose(twin.vector, env.vector, rtol=0, atol=1e-12)
    # Random draws are part of the state: the next episode is the same too.
    env.reset()
    twin.reset()
    np.testing.assert_array_equal(twin.vector, env.vector)
    unused.reset(seed=0)


@pytest.mark.parametrize("make", [BallBoxRampEnv, BallGoalEnv, TruckPushEnv])
def test_reset_is_needed_first(make: type[SceneEnv]) -> None:
    with pytest.raises(ResetNeeded, match="reset"):
        _ = make().scene
    with pytest.raises(ResetNeeded, match="reset"):
        make().step(0)


@pytest.mark.parametrize(
    ("env_id", "arguments"), [*((name, {}) for name in IDS), ("relgym/TruckPush-v0", {"task": None})]
)
def test_videos_are_recorded(env_id: str, arguments: dict[str, Any], tmp_path: Path) -> None:
    pytest.importorskip("moviepy", reason="RecordVideo writes through moviepy")
    folder = tmp_path / "videos"
    env = gym.wrappers.RecordVideo(
        gym.make(env_id, render_mode="rgb_array", **arguments), str(folder), video_length=5
    )
    env.reset(seed=0)
    for _ in range(5):
        env.step(env.action_space.sample())
    env.close()
    (video,) = folder.glob("*.mp4")
    assert video.stat().st_size > 1000


def test_rendering_needs_a_mode() -> None:
    env = BallBoxRampEnv()
    env.reset(seed=0)
    with pytest.raises(ConfigError, match="render_mode"):
        env.render()


def test_a_copy_of_the_package_is_refused() -> None:
    root = Path(relgym.__file__).resolve().parent.parent
    done = subprocess.run([sys.executable, "-c", "import envs"], cwd=root, capture_output=True, text=True)
    assert done.returncode != 0
    assert "relgym.envs" in done.stderr


def test_unknown_names_are_named() -> None:
    with pytest.raises(AttributeError, match="Nothing"):
        _ = relgym.envs.Nothing
    with pytest.raises(AttributeError, match="nothing"):
        _ = relgym.nothing
