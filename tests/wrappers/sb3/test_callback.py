"""A model from the rollouts of Stable-Baselines3."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from plain_envs import Drifter, Slider

from relgym.envs.views import Angle, NumbersView
from relgym.errors import ConfigError, ObservationError

pytestmark = pytest.mark.sb3


def view_of_slider(observation_space: Any, action_space: Any) -> NumbersView:
    return NumbersView(observation_space, action_space, names=("x", "v"))


def vec_env(n: int = 2, length: int = 9) -> Any:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv

    return DummyVecEnv([lambda: Monitor(Slider(length=length)) for _ in range(n)])


def algorithm(kind: str, env: Any) -> Any:
    import stable_baselines3

    settings: dict[str, Any] = {
        "PPO": {"n_steps": 16, "batch_size": 16},
        "SAC": {"learning_starts": 90},
    }
    return getattr(stable_baselines3, kind)("MlpPolicy", env, seed=0, device="cpu", **settings[kind])


def callback(**arguments: Any) -> Any:
    from relgym.wrappers.sb3 import ModelCallback

    return ModelCallback(**arguments)


@pytest.mark.parametrize("kind", ["PPO", "SAC"])
@pytest.mark.parametrize("normalised", [False, True])
def test_the_law_is_learned_from_rollouts(kind: str, normalised: bool) -> None:
    from stable_baselines3.common.vec_env import VecNormalize

    env: Any = VecNormalize(vec_env()) if normalised else vec_env()
    watch = callback(view=view_of_slider)
    algorithm(kind, env).learn(128, callback=watch)
    world = watch.world
    assert world.seen == 128
    assert "v' = 0.8 v + 0.5 action.a" in [m.formula(6) for m in world.modes("self", "v")]
    # Every 9th step ends an episode; one that led into the next would be a leap, and noise.
    if not normalised:
        assert world.property_model("self", "v").clusterer.noise_examples == 0
    assert watch.prequential.steps == 128


def test_training_goes_on_as_without_it() -> None:
    def weights(**arguments: Any) -> list[Any]:
        agent = algorithm("PPO", vec_env())
        agent.learn(64, **arguments)
        return [part.detach().numpy() for part in agent.policy.parameters()]

    for bare, watched in zip(weights(), weights(callback=callback()), strict=True):
        np.testing.assert_array_equal(bare, watched)


def test_it_logs_saves_and_goes_on(tmp_path: Any) -> None:
    watch = callback(view=view_of_slider, log_every=1)
    agent = algorithm("PPO", vec_env())
    agent.learn(32, callback=watch)
    assert agent.logger.name_to_value["relgym/transitions"] == 32
    assert agent.logger.name_to_value["relgym/modes"] == len(watch.world.modes("self", "v")) + len(
        watch.world.modes("self", "x")
    )
    count = watch.prequential
    assert agent.logger.name_to_value["relgym/nrmse"] == count.nrmse < 1.0
    assert agent.logger.name_to_value["relgym/coverage"] == count.coverage <= 1.0
    assert agent.logger.name_to_value["relgym/calibration"] == count.calibration
    agent.learn(32, callback=watch, reset_num_timesteps=False)
    assert watch.world.seen == 64
    watch.save(tmp_path / "slider.json", history=True)
    assert callback(model=tmp_path / "slider.json", view=view_of_slider)
    with pytest.raises(ConfigError, match="has followed 2 envs, now there are 3"):
        algorithm("PPO", vec_env(3)).learn(32, callback=watch)


def test_errors_reach_tensorboard(tmp_path: Any) -> None:
    from stable_baselines3.common.logger import configure
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    agent = algorithm("PPO", vec_env())
    agent.set_logger(configure(str(tmp_path), ["tensorboard"]))
    agent.learn(96, callback=callback(view=view_of_slider, log_every=1))
    agent.logger.close()
    told = EventAccumulator(str(tmp_path)).Reload()
    assert {"relgym/nrmse", "relgym/calibration", "relgym/coverage", "relgym/wrong"} <= set(
        told.Tags()["scalars"]
    )
    assert 0.0 <= told.Scalars("relgym/nrmse")[-1].value < 1.0


def test_in_the_background() -> None:
    watch = callback(view=view_of_slider, background=1000)
    agent = algorithm("PPO", vec_env())
    agent.learn(64, callback=watch)
    assert watch.world.seen == 0  # training never waits
    assert watch.catch_up().seen + watch.dropped == 64
    assert agent.logger.name_to_value["relgym/dropped"] == watch.dropped == 0
    assert watch.prequential.nrmse < 1.0 and watch.prequential.coverage > 0.0
    watch.close()


def test_before_training_there_is_nothing() -> None:
    with pytest.raises(ConfigError, match="training has not begun"):
        _ = callback().world


def test_a_vec_env_that_hides_last_observations_is_refused() -> None:
    from stable_baselines3.common.vec_env import VecEnvWrapper

    class Forgetful(VecEnvWrapper):
        def reset(self) -> Any:
            return self.venv.reset()

        def step_wait(self) -> Any:
            seen, rewards, dones, infos = self.venv.step_wait()
            for info in infos:
                info.pop("terminal_observation", None)
            return seen, rewards, dones, infos

    with pytest.raises(ConfigError, match=r"without infos\['terminal_observation'\]"):
        algorithm("PPO", Forgetful(vec_env())).learn(32, callback=callback())


def drifters(n: int = 2) -> Any:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv

    return DummyVecEnv([lambda: Monitor(Drifter(length=9)) for _ in range(n)])


def test_a_guessed_angle_that_is_none_ends_no_training() -> None:
    watch = callback()
    assert (watch.withdrawn, watch.skipped, watch.dropped) == ((), 0, 0)
    algorithm("PPO", drifters()).learn(64, callback=watch)
    assert watch.withdrawn == (Angle("x0", "x1"),)
    assert watch.world.seen == 62  # all but the step of both envs that refuted it
    assert watch.world.property_model("self", "x0").clusterer.noise_examples == 0


def test_learning_may_be_paused_while_training_goes_on() -> None:
    watch = callback(view=view_of_slider)
    watch.pause()
    agent = algorithm("PPO", vec_env())
    agent.learn(32, callback=watch)
    assert (watch.learning, watch.world.seen) == (False, 0)
    watch.learning = True
    agent.learn(32, callback=watch, reset_num_timesteps=False)
    assert watch.world.seen == 32


def test_bad_observations_of_one_env_are_skipped_or_name_it() -> None:
    def broken() -> Any:
        env = vec_env()
        env.envs[1].unwrapped.says = np.array([np.nan, 0.0])
        return env

    watch = callback(bad_observations="skip")
    with pytest.raises(ValueError, match="nan"):  # what the policy makes of it
        algorithm("PPO", broken()).learn(32, callback=watch)
    assert watch.skipped == 1
    with pytest.raises(ObservationError, match=r"^env 1: .*got nan"):
        algorithm("PPO", broken()).learn(32, callback=callback())
