from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import relgym
from relgym.errors import ConfigError, ObservationError
from relgym.planning import Correctable, EnvSimulator, ModelSimulator, Planner, Simulator, TreeSearch
from relgym.wrappers import ModelLearner


@pytest.fixture(scope="module")
def truck() -> gym.Env:  # type: ignore[type-arg]
    return gym.make("relgym/TruckPush-v0", n_boxes=1)


@pytest.fixture(scope="module")
def model(truck: gym.Env) -> relgym.WorldModel:  # type: ignore[type-arg]
    env = ModelLearner(truck)
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(200):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    return env.model


@pytest.mark.parametrize("repeat", [1, 3])
def test_an_exact_env_steps_as_it_does(truck: gym.Env, repeat: int) -> None:  # type: ignore[type-arg]
    simulator = EnvSimulator(truck, repeat=repeat)
    seen, _ = truck.reset(seed=3)
    start = simulator.state(seen)
    actions = np.array([[0.2], [-1.0], [1.0]], dtype=np.float32)
    stepped = simulator.step(np.repeat(start[None], 3, axis=0), actions)
    for k, action in enumerate(actions):
        seen, _ = truck.reset(seed=3)
        total, over, steps = 0.0, False, 0
        while steps < repeat and not over:
            seen, reward, over, _, _ = truck.step(action)
            total, steps = total + float(reward), steps + 1
        np.testing.assert_array_equal(stepped.states[k], simulator.state(seen))
        assert stepped.rewards[k] == pytest.approx(total, abs=1e-12)
        assert stepped.terminated[k] == over
    assert stepped.known.all()


def test_a_learned_model_steps_as_the_env_does(
    truck: gym.Env,  # type: ignore[type-arg]
    model: relgym.WorldModel,
) -> None:
    exact, learned = EnvSimulator(truck, repeat=2), ModelSimulator(model, truck, repeat=2)
    assert isinstance(exact, Simulator) and isinstance(learned, Simulator)
    seen, _ = truck.reset(seed=4)
    start = learned.state(seen)
    np.testing.assert_array_equal(start, exact.state(seen))
    actions = np.linspace(-1.0, 1.0, 9, dtype=np.float32)[:, None]
    one, two = (each.step(np.repeat(start[None], 9, axis=0), actions) for each in (exact, learned))
    known = two.known
    assert known.sum() >= 5
    np.testing.assert_allclose(one.states[known], two.states[known], rtol=0, atol=1e-9)
    np.testing.assert_allclose(one.rewards[known], two.rewards[known], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(one.terminated[known], two.terminated[known])


def test_what_is_not_known_stays_where_it_was(truck: gym.Env) -> None:  # type: ignore[type-arg]
    ignorant = ModelLearner(truck).model
    simulator = ModelSimulator(ignorant, truck)
    start = simulator.state(truck.reset(seed=0)[0])
    stepped = simulator.step(start[None], np.zeros((1, 1), dtype=np.float32))
    assert not stepped.known[0] and stepped.rewards[0] == 0.0
    np.testing.assert_array_equal(stepped.states[0], start)


def test_a_correction_ends_at_the_limits_that_the_model_knows(
    truck: gym.Env,  # type: ignore[type-arg]
    model: relgym.WorldModel,
) -> None:
    simulator = ModelSimulator(model, truck)
    start = simulator.state(truck.reset(seed=4)[0])
    error = np.zeros_like(start)
    error[[0, 2]] = (
        -0.5,
        1.0,
    )  # from 3 down to 2 at least: all of the error, half of it, nothing, and so for the rest
    corrected = simulator.corrected(error)
    corrected._low[0] = 2.0
    states = np.zeros((4, len(start)))
    states[:, 0] = 3.0, 2.25, 2.0, 1.9
    found = corrected._correct(states)
    assert found[:, 0].tolist() == [2.5, 2.0, 2.0, 2.0]
    assert found[:, 2].tolist() == [1.0, 0.5, 0.0, 0.0]
    risen = simulator.corrected(-error)
    risen._low[0] = 2.0
    assert risen._correct(states)[:, 0].tolist() == [3.5, 2.75, 2.0, 2.0]  # what rests goes on resting


def test_a_correction_is_of_decisions(
    truck: gym.Env,  # type: ignore[type-arg]
    model: relgym.WorldModel,
) -> None:
    simulator = ModelSimulator(model, truck, repeat=2)
    start = np.repeat(simulator.state(truck.reset(seed=4)[0])[None], 3, axis=0)
    actions = np.array([[0.5], [0.7], [0.9]], dtype=np.float32)
    error = np.zeros(start.shape[1])
    error[0] = 0.25
    plain, moved = (each.step(start, actions) for each in (simulator, simulator.corrected(error)))
    assert plain.known.all()
    np.testing.assert_array_equal(moved.states[:, 0], plain.states[:, 0] + 0.25)
    np.testing.assert_array_equal(simulator.corrected(None).step(start, actions).states, plain.states)


def test_guesses_go_on_where_nothing_is_known(truck: gym.Env) -> None:  # type: ignore[type-arg]
    simulator = ModelSimulator(ModelLearner(truck).model, truck)
    assert isinstance(simulator, Correctable)
    start = simulator.state(truck.reset(seed=0)[0])
    error = np.zeros_like(start)
    error[0] = 0.5
    stepped = simulator.corrected(error, guesses=True).step(start[None], np.zeros((1, 1), dtype=np.float32))
    assert stepped.known[0]
    np.testing.assert_array_equal(stepped.states[0], start + error)


def test_a_tree_in_an_exact_env_solves_what_it_plans() -> None:
    truck = gym.make("relgym/TruckPush-v0")
    planner = Planner(EnvSimulator(truck), TreeSearch(horizon=20, expansions=2_048, batch=64))
    seen, _ = truck.reset(seed=5)
    state, over = None, False
    while not over:
        action, state = planner.predict(seen, state)
        seen, _, terminated, truncated, info = truck.step(action)
        over = terminated or truncated
    assert info["is_success"]
    assert state is not None and state[0].surprises == 0


def test_other_observations_are_refused(truck: gym.Env, model: relgym.WorldModel) -> None:  # type: ignore[type-arg]
    with pytest.raises(ObservationError, match="source=function"):
        ModelSimulator(model, truck).state(np.zeros(3))


def test_envs_without_a_state_to_set_are_refused() -> None:
    with pytest.raises(ConfigError, match="ModelSimulator"):
        EnvSimulator(gym.make("CartPole-v1"))
    with pytest.raises(ConfigError, match="with a task"):
        EnvSimulator(gym.make("relgym/TruckPush-v0", task=None))
