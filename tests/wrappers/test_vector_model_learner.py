"""One model from many envs, whatever their way of beginning anew."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from carts import CartEnv
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from plain_envs import Slider, Wheel

from relgym.envs.views import FunctionView, NumbersView
from relgym.errors import ConfigError, ObservationError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Transition
from relgym.scene.schema import SceneSchema
from relgym.wrappers import ModelLearner, VectorModelLearner
from relgym.wrappers.vector_model_learner import info_at

N, LENGTH, STEPS = 4, 7, 30


def sliders(mode: AutoresetMode, kind: Any = SyncVectorEnv) -> Any:
    return kind([lambda: Slider(length=LENGTH) for _ in range(N)], autoreset_mode=mode)


def view_of_slider(observation_space: Any, action_space: Any) -> NumbersView:
    return NumbersView(observation_space, action_space, names=("x", "v"))


def drive(envs: VectorModelLearner, steps: int = STEPS) -> None:
    """Random actions; resets what has ended where nobody else does."""
    envs.action_space.seed(0)
    envs.reset(seed=0)
    for _ in range(steps):
        *_, terminated, truncated, _ = envs.step(envs.action_space.sample())
        over = terminated | truncated
        if over.any() and envs.metadata["autoreset_mode"] is AutoresetMode.DISABLED:
            envs.reset(options={"reset_mask": over})


def record(envs: VectorModelLearner) -> list[tuple[Any, ...]]:
    """The transitions that the model learns from now on, each with what was predicted of it and how that came out."""
    kept: list[tuple[Any, ...]] = []
    learn = envs.model.take_up

    def take_up(transition: Transition, *told: Any) -> Any:
        kept.append((transition, *told))
        return learn(transition, *told)

    envs.model.take_up = take_up  # type: ignore[method-assign]
    return kept


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_every_autoreset_mode_learns_like_a_single_env(mode: AutoresetMode) -> None:
    envs = VectorModelLearner(sliders(mode), view=view_of_slider, learn_reward=True)
    kept = record(envs)
    drive(envs)
    alone = WorldModel(envs.view.schema)
    for transition, *told in kept:
        alone.take_up(transition, *told)
        push = transition.before["action"]["a"]
        now, then = transition.before["self"], transition.after["self"]
        assert then["v"] == 0.8 * now["v"] + 0.5 * push  # no leap from one episode to the next
        assert transition.after["task"]["reward"] == -then["x"]
    assert envs.model.to_json(history=True) == alone.to_json(history=True)
    (mode_of_v,) = envs.model.modes("self", "v")
    assert mode_of_v.formula(6) == "v' = 0.8 v + 0.5 action.a"
    # With NEXT_STEP the step that resets is no transition.
    pauses = 3 * N if mode is AutoresetMode.NEXT_STEP else 0
    assert len(kept) >= N * STEPS - pauses - N
    assert envs.prequential.steps == len(kept) == envs.model.seen


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_what_the_envs_say_is_untouched(mode: AutoresetMode) -> None:
    def play(envs: Any) -> list[str]:
        envs.action_space.seed(1)
        said = [str(envs.reset(seed=1))]
        for _ in range(LENGTH - 1):
            *rest, infos = envs.step(envs.action_space.sample())
            said.append(str((rest, {k: v for k, v in infos.items() if k != "relgym"})))
        return said

    assert play(sliders(mode)) == play(VectorModelLearner(sliders(mode)))


def test_every_env_has_its_report() -> None:
    envs = VectorModelLearner(sliders(AutoresetMode.NEXT_STEP))
    envs.reset(seed=0)
    for k in range(LENGTH + 1):
        *_, infos = envs.step(np.ones((N, 1)))
        reports = infos["relgym"]
        assert reports.shape == (N,)
        taught = [report.learned is not None for report in reports]
        assert taught == [k < LENGTH] * N
    assert envs.model.seen == N * LENGTH


def test_envs_in_processes_of_their_own() -> None:
    envs = VectorModelLearner(sliders(AutoresetMode.SAME_STEP, AsyncVectorEnv))
    drive(envs, steps=9)
    assert envs.model.seen == 9 * N
    envs.close()


def test_scenes_angles_and_infos_in_vectors() -> None:
    carts = VectorModelLearner(SyncVectorEnv([CartEnv, CartEnv]))
    carts.reset(seed=0)
    for _ in range(12):
        carts.step(carts.action_space.sample())
    assert [m.formula(6) for m in carts.model.modes("cart", "v")] == ["v' = 0.9 v + 0.1 action.push"]
    wheels = VectorModelLearner(SyncVectorEnv([Wheel, Wheel]))
    wheels.reset(seed=0)
    assert wheels.view.schema.type("self").properties == ("angle_x0",)
    limit = SceneSchema((ObjectType("fence", ("x",)),), (("fence", "fence"),))
    view = FunctionView(limit, lambda seen, info: {"fence": [info["limit"]]}, Slider().action_space)
    envs = VectorModelLearner(sliders(AutoresetMode.SAME_STEP), view=view)
    drive(envs, steps=9)
    assert envs.model.seen == 9 * N


def test_infos_of_one_env_by_hand() -> None:
    nested = {"c": [3, 4], "_c": [False, True]}
    infos = {"a": [1, 2], "_a": [True, False], "b": nested, "_b": [True, True]}
    assert info_at(infos, 0) == {"a": 1, "b": {}}
    assert info_at(infos, 1) == {"b": {"c": 4}}


def test_a_bad_observation_of_one_env_is_no_excuse_for_leaps_of_the_others() -> None:
    envs = VectorModelLearner(sliders(AutoresetMode.NEXT_STEP))
    envs.reset(seed=0)
    second: Any = envs.env.unwrapped.envs[1]  # type: ignore[attr-defined]
    second.says = np.array([np.nan, 0.0])
    before = envs.model.to_json(history=True)
    with pytest.raises(ObservationError, match=r"^env 1: .*'x0': expected a finite number, got nan"):
        envs.step(np.zeros((N, 1)))
    assert envs.model.to_json(history=True) == before  # nor was the first env's step learned
    second.says = None
    seen = envs.model.seen
    with pytest.raises(gym.error.ResetNeeded):
        envs.step(np.zeros((N, 1)))
    envs.reset(seed=1)
    envs.step(np.zeros((N, 1)))
    assert envs.model.seen == seen + N
    lenient = VectorModelLearner(sliders(AutoresetMode.NEXT_STEP), bad_observations="skip")
    lenient.reset(seed=0)
    lenient.env.unwrapped.envs[1].says = np.array([np.nan, 0.0])  # type: ignore[attr-defined]
    lenient.step(np.zeros((N, 1)))
    assert (lenient.model.seen, lenient.skipped) == (N - 1, 1)


def test_what_is_no_vector_env_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"ModelLearner\(env\) learns from a single one"):
        VectorModelLearner(Slider())  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"VectorModelLearner\(env\) learns one model from all"):
        ModelLearner(sliders(AutoresetMode.NEXT_STEP))
    abstained = sliders(AutoresetMode.NEXT_STEP)
    abstained.metadata = {}
    with pytest.raises(ConfigError, match=r"expected metadata\['autoreset_mode'\].*got None"):
        VectorModelLearner(abstained)


def test_the_last_observation_of_an_episode_may_be_bad_too() -> None:
    class Broken(Slider):
        def step(self, action: Any) -> Any:
            seen, reward, terminated, truncated, info = super().step(action)
            return (seen * np.nan if truncated else seen), reward, terminated, truncated, info

    envs = VectorModelLearner(
        SyncVectorEnv(
            [lambda: Slider(length=9), lambda: Broken(length=2)], autoreset_mode=AutoresetMode.SAME_STEP
        )
    )
    envs.reset(seed=0)
    envs.step(np.zeros((2, 1)))
    with pytest.raises(ObservationError, match=r"^env 1: "):
        envs.step(np.zeros((2, 1)))
    assert envs.model.seen == 2


def test_actions_outside_their_space_are_learned_from_as_they_were_given() -> None:
    envs = VectorModelLearner(sliders(AutoresetMode.NEXT_STEP), view=view_of_slider)
    envs.reset(seed=0)
    kept = record(envs)
    envs.step(np.full((N, 1), 2.0))
    assert envs.env.unwrapped.envs[0].steps == 1  # type: ignore[attr-defined]
    assert [transition.before["action"]["a"] for transition, *_ in kept] == [2.0] * N
    for transition, *_ in kept:
        assert transition.after["self"]["v"] == 0.8 * transition.before["self"]["v"] + 1.0
    envs.step(np.ones((N, 2)))
    assert (envs.model.seen, envs.skipped) == (N, N)
