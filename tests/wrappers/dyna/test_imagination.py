"""Dreams worked out by hand, and their ends: terminated, cut off, unknown."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from dyna_worlds import SCHEMA, Flat, LineEnv, LineModel, LineTask

from relgym.envs.actions import acting
from relgym.envs.tasks import TaskOutcome
from relgym.errors import ConfigError
from relgym.wrappers.action_repeat import ActionRepeat
from relgym.wrappers.dyna.acting import acting_all
from relgym.wrappers.dyna.imagination import Imagination
from relgym.wrappers.dyna.lens import Lens
from relgym.wrappers.dyna.recorder import TransitionRecorder

LAYOUT = SCHEMA.layout(("cart", "other", "mark"))


def vectors(*xs: float) -> Any:
    return np.array([[x, 1.0, 0.0, 2.0, 0.0] for x in xs])


def forwards(seen: Any) -> Any:
    """Always a push of +1 (0.5 of 2), kept as 0.25 to tell the two apart."""
    n = len(seen["cart"]) if isinstance(seen, dict) else len(seen)
    return np.full((n, 1), 0.5, dtype=np.float32), np.full((n, 1), 0.25, dtype=np.float32)


def imagination(
    env: gym.Env[Any, Any] | None = None, reward_model: Any = None, **model: float
) -> Imagination:
    lens = Lens(Flat(TransitionRecorder(LineEnv())) if env is None else env)
    return Imagination(LineModel(**model), lens, reward_model or LineTask())


def test_two_dreams_by_hand() -> None:
    found = imagination().dream(LAYOUT, vectors(0.0, 3.5), forwards, horizon=3)
    assert found is not None
    # 0 -> 1 -> 2 -> 3, cut off; 3.5 -> 4.5 -> 5.5, terminated.
    np.testing.assert_allclose(found.observations, [[0.0], [0.5], [1.0], [1.75], [2.25]])
    np.testing.assert_allclose(found.next_observations, [[0.5], [1.0], [1.5], [2.25], [2.75]])
    assert found.observations.dtype == np.float32  # type: ignore[union-attr]
    np.testing.assert_allclose(found.rewards, [-1.0, -2.0, -3.0, -4.5, -5.5])
    assert found.terminated.tolist() == [False, False, False, False, True]
    assert found.cut.tolist() == [False, False, True, False, False]
    assert set(found.actions.ravel().tolist()) == {0.25}
    assert (len(found), found.known) == (5, 1.0)


def test_actions_mean_what_they_mean_in_the_env_that_the_agent_acts_in() -> None:
    """A model knows forces; how an env scales them is the env's own affair."""
    strong = LineEnv()
    strong.schema = replace(SCHEMA, action_scale=(("push", -8.0, 8.0),))
    found = imagination(TransitionRecorder(strong)).dream(LAYOUT, vectors(0.0), forwards, horizon=1)
    assert found is not None
    assert found.next_observations["cart"][:, 0].tolist() == [4.0]  # type: ignore[call-overload,index]


def test_where_the_model_abstains_the_step_before_is_cut_off() -> None:
    found = imagination(mute_from=1.5).dream(LAYOUT, vectors(0.0, 3.0), forwards, horizon=5)
    assert found is not None
    np.testing.assert_allclose(found.next_observations, [[0.5], [1.0]])
    assert found.cut.tolist() == [False, True]
    assert not found.terminated.any()
    assert found.known == pytest.approx(2 / 4)
    assert imagination(mute_from=1.5).dream(LAYOUT, vectors(3.0), forwards, horizon=5) is None


def test_a_dream_stays_in_the_observation_space() -> None:
    assert imagination(off=200.0).dream(LAYOUT, vectors(0.0), forwards, horizon=5) is None


def test_decisions_of_several_steps() -> None:
    env = Flat(ActionRepeat(TransitionRecorder(LineEnv()), 3))
    found = imagination(env).dream(LAYOUT, vectors(0.0), forwards, horizon=5)
    assert found is not None
    # 0 -> 1, 2, 3; -> 4, 5, 6: terminated.
    np.testing.assert_allclose(found.next_observations, [[1.5], [3.0]])
    np.testing.assert_allclose(found.rewards, [-6.0, -15.0])
    assert found.terminated.tolist() == [False, True]


def test_dict_observations() -> None:
    env = TransitionRecorder(LineEnv(dtype=np.float32))
    found = imagination(env).dream(LAYOUT, vectors(0.0), forwards, horizon=2)
    assert found is not None
    assert isinstance(found.next_observations, dict)
    assert found.next_observations["cart"].tolist() == [[1.0, 1.0], [2.0, 1.0]]
    assert {part.dtype for part in found.next_observations.values()} == {np.dtype(np.float32)}


def test_actions_in_scenes_are_the_single_ones(rng: np.random.Generator) -> None:
    some, done = rng.normal(size=(20, 5)), rng.uniform(-1, 1, (20, 1))
    whole, joined = acting_all(SCHEMA, LAYOUT, some, done)
    for vector, action, row in zip(some, done, joined, strict=True):
        single = acting(SCHEMA.scene(dict(zip(LAYOUT.names, np.split(vector, [2, 4]), strict=True))), action)
        assert single.layout is whole
        np.testing.assert_array_equal(single.vector, row)


class _Broken:
    def evaluate(self, layout: Any, before: Any, actions: Any, after: Any) -> TaskOutcome:
        return TaskOutcome(
            np.full(len(before), np.nan), np.zeros(len(before), bool), np.zeros(len(before), bool)
        )


def test_errors_name_the_remedy() -> None:
    with pytest.raises(ConfigError, match="horizon=0: expected at least 1 decision"):
        imagination().dream(LAYOUT, vectors(0.0), forwards, horizon=0)
    with pytest.raises(ConfigError, match=r"_Broken gave a reward of nan.*fix the reward function"):
        imagination(reward_model=_Broken()).dream(LAYOUT, vectors(0.0), forwards, horizon=1)
    with pytest.raises(ConfigError, match="has no TransitionRecorder: put one directly round the bare env"):
        Lens(Flat(LineEnv()))

    class Odd(gym.Wrapper[Any, Any, Any, Any]):
        @property
        def observation_space(self) -> Any:
            return gym.spaces.Discrete(3)

    with pytest.raises(ConfigError, match="Odd changes a space"):
        Lens(Odd(TransitionRecorder(LineEnv())))


@pytest.mark.parametrize(
    "wrapper",
    [
        lambda env: gym.wrappers.DelayObservation(env, 1),
        lambda env: gym.wrappers.TimeAwareObservation(gym.wrappers.TimeLimit(env, 8)),
        lambda env: gym.wrappers.StickyAction(env, 0.5),
    ],
)
def test_wrappers_that_remember_are_refused(wrapper: Any) -> None:
    with pytest.raises(
        ConfigError, match=r"keeps count of the real episode.*put it inside the TransitionRecorder"
    ):
        Lens(wrapper(Flat(TransitionRecorder(LineEnv()))))


def test_agents_are_shown_whole_numbers_as_the_env_shows_them() -> None:
    env = LineEnv(dtype=np.int16)
    lens = Lens(TransitionRecorder(env))
    state = np.array([[2.9999999, 1.0, -0.9999999, 2.0, 99.6], [1e6, 1.0, 0.0, 2.0, 0.0]])
    seen: Any = lens.observations(LAYOUT, state[:1])
    assert [seen[name][0, 0] for name in ("cart", "other", "mark")] == [3, -1, 100]
    assert lens.inside(LAYOUT, state).tolist() == [True, False]
    env.observation_space["cart"] = gym.spaces.Box(-np.inf, np.inf, (2,), np.float32)
    wide = Lens(TransitionRecorder(env))
    far = np.array([[x, 1.0, 0.0, 2.0, 0.0] for x in (1e30, 1e39, np.inf, np.nan)])
    assert wide.inside(LAYOUT, far).tolist() == [True, False, False, False]


@pytest.mark.skipif(not hasattr(gym.wrappers, "RepeatAction"), reason="Gymnasium has it since 1.3")
def test_gymnasiums_repeats_count() -> None:
    inner = ActionRepeat(TransitionRecorder(LineEnv()), 3)
    assert Lens(Flat(gym.wrappers.RepeatAction(inner, 2))).repeat == 6


def test_a_recorders_schema_knows_how_coarse_its_scenes_are() -> None:
    coarse, fine = (TransitionRecorder(LineEnv(dtype=dtype)) for dtype in (np.float32, np.float64))
    assert coarse.get_wrapper_attr("schema").precision == coarse.view.precision > 0.0
    assert fine.get_wrapper_attr("schema") == SCHEMA
    flat = TransitionRecorder(gym.make("CartPole-v1"))
    assert not flat.has_wrapper_attr("schema") and flat.view.schema.objects[0] == ("self", "self")


def test_a_recorder_nobody_asks_forgets_the_oldest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relgym.wrappers.dyna.recorder._MOST", 3)
    env = TransitionRecorder(LineEnv())
    env.reset(seed=0)
    for push in (0.1, 0.2, 0.3, 0.4, 0.5):
        env.step(np.array([push], dtype=np.float32))
    assert [round(float(step.action[0]), 1) for step in env.take()] == [0.3, 0.4, 0.5]


def test_a_recorder_writes_down_what_happened() -> None:
    env = Flat(ActionRepeat(TransitionRecorder(LineEnv()), 2))
    env.reset(seed=1)
    env.step(np.array([0.5], dtype=np.float32))
    first, second = env.get_wrapper_attr("take")()
    assert (first.first, second.first) == (True, False)
    assert second.start == first.transition.after
    assert first.transition.before["action"]["push"] == 1.0
    assert first.transition.after["cart"]["x"] == pytest.approx(first.start["cart"]["x"] + 1.0)
    assert first.reward == -abs(first.transition.after["cart"]["x"])
    assert env.get_wrapper_attr("take")() == []
