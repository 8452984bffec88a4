from __future__ import annotations

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import relgym  # noqa: F401  (registers the ids)
from relgym.envs.dreams.env import LearnedModelEnv
from relgym.envs.dreams.vector import LearnedModelVectorEnv
from relgym.envs.flat import FlatSpec
from relgym.errors import ConfigError
from relgym.wrappers.flat import FlatView, VectorFlatView
from relgym.wrappers.model_learner import ModelLearner


def pushing() -> gym.Env[object, object]:
    return gym.make("relgym/TruckPush-v0", task="push")


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_checker_has_nothing_to_say() -> None:
    check_env(FlatView(pushing()), skip_render_check=True)  # warnings are errors


def test_the_goal_is_seen_from_afar_and_closely() -> None:
    env = FlatView(pushing())
    flat, _ = env.reset(seed=0, options={"goal_distance": 30.0})
    shown = dict(zip(env.flattener.names, flat.tolist(), strict=True))
    assert shown["goal.ahead/20"] == 1.5
    assert shown["goal.ahead/2"] == 5.0
    assert shown["truck.vx/5"] == 0.0


def test_round_a_learner_and_its_dream() -> None:
    learner = ModelLearner(gym.make("relgym/TruckPush-v0", task=None), targets=["truck.vx"])
    env = FlatView(learner)
    first, _ = env.reset(seed=0)
    for force in np.linspace(0.2, 1.0, 30):  # enough for a mode or two
        env.step(np.array([force], dtype=np.float32))
    assert learner.model.modes("truck", "vx")
    dream = FlatView(LearnedModelEnv(learner.model, like=learner))
    seen, _ = dream.reset(seed=0)
    np.testing.assert_array_equal(seen, first)
    assert dream.observation_space == env.observation_space


def test_copies_and_specs() -> None:
    spec = FlatSpec(actor="truck", scales={"px": (2.0,)})
    env = FlatView(pushing(), spec)
    env.reset(seed=3)
    for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env)), gym.make(env.spec)):  # type: ignore[arg-type]
        flat, _ = twin.reset(seed=4)
        np.testing.assert_array_equal(flat, env.reset(seed=4)[0])


def test_vectors_of_envs() -> None:
    made = gym.make_vec("relgym/TruckPush-v0", 3, "sync", wrappers=[FlatView], task="push")
    flat, _ = made.reset(seed=0)
    assert flat.shape == (3, 15) and flat.dtype == np.float32
    with pytest.raises(ConfigError, match="make_vec"):
        FlatView(made)  # type: ignore[arg-type]
    made.close()


def test_envs_without_scenes_are_refused() -> None:
    with pytest.raises(ConfigError, match="schema"):
        FlatView(gym.make("CartPole-v1"))


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_vector_envs_are_flattened_as_single_ones(mode: AutoresetMode) -> None:
    options = {"autoreset_mode": mode}
    inner = gym.make_vec("relgym/TruckPush-v0", 3, "sync", vector_kwargs=options, task="push")
    envs, alone = VectorFlatView(inner), FlatView(pushing())
    flat, _ = envs.reset(seed=5)
    single, _ = alone.reset(seed=7)
    actions = np.ones((3, 1), np.float32)
    while True:
        np.testing.assert_array_equal(flat[2], single)
        assert envs.observation_space.contains(flat)
        flat, _, terminated, _, infos = envs.step(actions)
        single, _, over, *_ = alone.step(actions[2])
        assert terminated[2] == over
        if over or terminated.any():
            break
    if mode is AutoresetMode.SAME_STEP:
        ended = int(np.argmax(terminated))
        assert infos["final_obs"][ended].shape == flat[0].shape
        assert not np.array_equal(infos["final_obs"][ended], flat[ended])
    envs.close()


def test_dreams_by_the_dozen() -> None:
    env = pushing()
    learner = ModelLearner(env, predict=False)
    learner.reset(seed=0)
    for _ in range(20):
        *_, over, late, _ = learner.step(np.array([0.5]))
        if over or late:
            learner.reset()
    dreams = VectorFlatView(LearnedModelVectorEnv(learner.model, num_envs=4, like=env))
    flat, _ = dreams.reset(seed=0)
    assert flat.shape == (4, 15)
    assert dreams.flattener.names == FlatView(env).flattener.names
    with pytest.raises(ConfigError, match="schema"):
        VectorFlatView(gym.make_vec("CartPole-v1", 2, "sync"))
