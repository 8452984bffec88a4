"""Pairs of numbers that looked like cosine and sine of an angle, and aren't."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from carts import run
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from plain_envs import Drifter, Wheel

from relgym.envs.views import Angle, NumbersView
from relgym.errors import ObservationError
from relgym.scene.objects import Transition
from relgym.wrappers import ModelLearner, VectorModelLearner
from relgym.wrappers.study import NOTHING

PUSH, STAY = np.array([0.05]), np.array([0.0])
PAIR = (Angle("x0", "x1"),)
PLAIN = ("x0", "x1")


def properties(env: ModelLearner | VectorModelLearner) -> tuple[str, ...]:
    return env.view.schema.type("self").properties


def plain(space: Any, actions: Any) -> NumbersView:
    return NumbersView(space, actions, angles=())


def inner(env: Any) -> Any:
    return env.unwrapped


@pytest.mark.parametrize("bad", ["raise", "skip"])
@pytest.mark.parametrize(("start", "bound"), [((-1.0, 0.0), 1.0), ((0.6, 0.8), np.inf)])
def test_a_refuted_guess_is_withdrawn_and_the_rest_is_learned_as_without_it(
    bad: Any, start: tuple[float, float], bound: float
) -> None:
    env = ModelLearner(Drifter(start, bound=bound), bad_observations=bad, predict=False)
    run(env, 60, length=60)
    assert env.withdrawn == PAIR
    assert properties(env) == PLAIN
    assert (env.model.seen, env.skipped) == (59, 0)  # all but the step that refuted it
    assert [m.formula(3) for m in env.model.modes("self", "x0")] == ["x0' = 0.9 x0 + action.a"]
    other = ModelLearner(Drifter(start, bound=bound), view=plain, learn=False, predict=False)
    other.action_space.seed(0)
    other.reset(seed=0)
    for k in range(60):
        other.step(other.action_space.sample())
        other.learning = other.learning or k == 0
    assert env.model.to_json(history=True) == other.model.to_json(history=True)


def test_what_was_learned_of_the_angle_goes_and_so_does_what_was_counted() -> None:
    env = ModelLearner(Drifter(), learn_reward=True)
    env.reset(seed=0)
    inner(env).says = np.array([0.6, 0.8], np.float32)
    for _ in range(3):
        env.step(STAY)
    assert (env.model.seen, env.withdrawn) == (3, ())
    stale = env.model
    inner(env).says = np.array([0.6, 0.7], np.float32)
    assert env.step(STAY)[4]["relgym"] is NOTHING
    assert env.withdrawn == PAIR
    assert env.model is not stale and (env.model.seen, env.prequential.steps) == (0, 0)
    assert env.scene["self"].values.tolist() == np.array([0.6, 0.7], np.float32).tolist()
    assert env.step(STAY)[4]["relgym"].learned is not None


def test_an_episode_that_begins_elsewhere_refutes_it_too() -> None:
    env = ModelLearner(Drifter())
    env.reset(seed=0)
    inner(env).start = (0.0, 0.0)
    env.reset(seed=1)
    assert env.withdrawn == PAIR
    env.step(PUSH)
    assert env.model.seen == 1


def test_a_true_angle_stays_one() -> None:
    env = ModelLearner(Wheel())
    run(env, 200)
    assert (env.withdrawn, properties(env), env.model.seen) == ((), ("angle_x0",), 200)


def test_a_declared_angle_is_not_withdrawn() -> None:
    space, actions = Drifter().observation_space, Drifter().action_space
    env = ModelLearner(Drifter(), view=NumbersView(space, actions, angles=[("x0", "x1")]))
    env.reset(seed=0)
    with pytest.raises(ObservationError, match=r"angles=\(\)\) if none is"):
        env.step(PUSH)
    assert (env.withdrawn, env.model.seen) == ((), 0)


def test_who_names_the_angle_has_declared_it(tmp_path: Path) -> None:
    env = ModelLearner(Drifter(), targets=["self.angle_x0"])
    env.reset(seed=0)
    with pytest.raises(ObservationError, match="were taken for cosine and sine"):
        env.step(PUSH)
    turned = ModelLearner(Wheel())
    run(turned, 5)
    turned.save(tmp_path / "wheel.json", history=True)
    again = ModelLearner(Wheel(), model=tmp_path / "wheel.json")
    again.reset(seed=0)
    inner(again).angle = np.nan
    before = again.model
    with pytest.raises(ObservationError):
        again.step(STAY)
    assert again.model is before


@pytest.mark.parametrize("reward", [False, True])
def test_a_model_goes_on_without_the_angle_that_it_had_to_take_back(reward: bool, tmp_path: Path) -> None:
    env = ModelLearner(Drifter(), learn_reward=reward, predict=False)
    run(env, 60, length=60)
    env.save(tmp_path / "drifter.json", history=True)
    again = ModelLearner(Drifter(), model=tmp_path / "drifter.json", learn_reward=reward, predict=False)
    run(again, 5, length=5)
    assert (properties(again), again.withdrawn, again.model.seen) == (PLAIN, (), env.model.seen + 5)


def test_learning_stays_paused_and_starts_stay_known(tmp_path: Path) -> None:
    env = ModelLearner(Drifter(), predict=False)
    env.pause()  # before the first reset, too
    assert (env.learning, env.dropped, env.skipped) == (False, 0, 0)
    run(env, 5)
    assert (env.withdrawn, env.learning, env.model.seen) == (PAIR, False, 0)
    env.learning = True
    run(env, 40)
    env.save(tmp_path / "drifter.json")
    dream = gym.make("relgym/LearnedModel-v0", model=str(tmp_path / "drifter.json"))
    first, _ = dream.reset(seed=0)
    np.testing.assert_allclose(first, [-1.0, 0.0], atol=1e-6)


def test_copies_know_what_was_guessed() -> None:
    env = ModelLearner(Drifter())
    env.reset(seed=0)
    twin = copy.deepcopy(env)
    twin.step(PUSH)
    assert (twin.withdrawn, env.withdrawn) == (PAIR, ())


def test_in_the_background() -> None:
    env = ModelLearner(Drifter(), background=100)
    run(env, 30)
    assert env.withdrawn == PAIR
    assert env.catch_up().seen == 29
    env.close()


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_one_env_of_many_refutes_it_for_all(mode: AutoresetMode) -> None:
    envs = VectorModelLearner(
        SyncVectorEnv([lambda: Drifter(length=6) for _ in range(3)], autoreset_mode=mode)
    )
    envs.reset(seed=0)
    for _ in range(2):
        envs.step(np.full((3, 1), 0.0))  # 0.9 of -1 is off the circle
    assert (envs.withdrawn, properties(envs), envs.model.seen) == (PAIR, PLAIN, 3)
    kept: list[Transition] = []
    envs.model.take_up = lambda transition, *_: kept.append(transition)  # type: ignore[assignment, method-assign]
    for _ in range(8):
        *_, truncated, _ = envs.step(np.full((3, 1), 0.02))
        if truncated.any() and mode is AutoresetMode.DISABLED:
            envs.reset(options={"reset_mask": truncated})
    assert len(kept) == (21 if mode is AutoresetMode.NEXT_STEP else 24)
    for transition in kept:  # no leap among them
        now, then = transition.before["self"]["x0"], transition.after["self"]["x0"]
        assert then == pytest.approx(0.9 * now + transition.before["action"]["a"], abs=1e-6)


def test_a_reset_of_one_env_leaves_the_others_in_the_midst_of_theirs() -> None:
    """They need no reset; the step on which their view changed teaches nothing."""
    envs = VectorModelLearner(SyncVectorEnv([Wheel, Wheel, Wheel], autoreset_mode=AutoresetMode.DISABLED))
    envs.reset(seed=0)
    envs.step(np.zeros((3, 1), np.float32))
    assert envs.model.seen == 3
    envs.env.unwrapped.envs[1]._seen = lambda: np.zeros(2, np.float32)  # type: ignore[attr-defined]
    envs.reset(options={"reset_mask": np.array([False, True, False])})
    assert (envs.withdrawn, envs.model.seen) == (PAIR, 0)
    envs.step(np.zeros((3, 1), np.float32))
    assert envs.model.seen == 1
    envs.step(np.zeros((3, 1), np.float32))
    assert envs.model.seen == 4


# ---------------------------------------------------------------------- bad first observations
@pytest.mark.parametrize("says", [np.zeros(3, np.float32), np.full(2, np.nan, np.float32)])
def test_a_bad_first_observation_decides_nothing(says: Any) -> None:
    class Late(Wheel):
        wrong: Any = says

        def _seen(self) -> Any:
            return super()._seen() if self.wrong is None else self.wrong

    env = ModelLearner(Late(), bad_observations="skip")
    env.reset(seed=0)
    env.step(STAY)
    assert env.skipped == 2
    inner(env).wrong = None
    env.step(STAY)
    assert properties(env) == ("angle_x0",)
    env.step(STAY)
    assert (env.skipped, env.model.seen) == (2, 1)
    strict = ModelLearner(Late())
    with pytest.raises(ObservationError, match=r"call reset\(\)"):
        strict.reset(seed=0)
    inner(strict).wrong = None
    strict.reset(seed=0)
    assert properties(strict) == ("angle_x0",)


def test_the_sound_ones_of_several_first_observations_decide() -> None:
    class Lost(Wheel):
        def _seen(self) -> Any:
            return np.full(2, np.nan, np.float32)

    envs = VectorModelLearner(SyncVectorEnv([Wheel, Lost, Wheel]), bad_observations="skip")
    envs.reset(seed=0)
    assert (properties(envs), envs.skipped) == (("angle_x0",), 1)
    envs.step(np.zeros((3, 1), np.float32))
    assert (envs.model.seen, envs.skipped) == (2, 2)


# ---------------------------------------------------------------------- rewards
def test_a_reward_that_nobody_learns_may_be_anything() -> None:
    for reward in (None, np.array([1.0, 2.0]), "much"):
        env = ModelLearner(Drifter((0.0, 0.0)), learn_termination=True)
        inner(env).reward = reward
        env.reset(seed=0)
        assert env.step(PUSH)[1] is reward
        assert env.model.seen == 1
