"""Dyna with Stable-Baselines3's algorithms: what goes into batches, when, and what is refused."""

from __future__ import annotations

import inspect
import pickle
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from dyna_worlds import Flat, LineEnv, LineModel
from gymnasium import spaces

import relgym
from relgym.envs.tasks import TaskOutcome
from relgym.envs.views import NumbersView
from relgym.errors import ConfigError, QueryError
from relgym.wrappers.dyna.config import DynaConfig
from relgym.wrappers.dyna.recorder import TransitionRecorder

pytestmark = pytest.mark.sb3

QUICK: dict[str, Any] = {
    "dreams": 8,
    "every": 4,
    "updates": 2,
    "shuffle": 5,
    "horizon": 4,
    "least": 5,
    "window": 10,
}


def flat(steps: int = 8) -> gym.Env[Any, Any]:
    return Flat(TransitionRecorder(gym.wrappers.TimeLimit(LineEnv(), steps)))


def plain() -> gym.Env[Any, Any]:
    return TransitionRecorder(LineEnv(dtype=np.float32))


class Steering(gym.ActionWrapper[Any, Any, Any]):
    """Left, not at all, or right."""

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self.action_space = spaces.Discrete(3)

    def action(self, action: Any) -> Any:
        return np.array([float(action) - 1.0], dtype=np.float32)


def agent(name: str, env: Any, **options: Any) -> Any:
    import stable_baselines3
    import torch

    from relgym.wrappers.sb3.replay import replay_options

    torch.set_num_threads(1)
    n_steps = options.pop("n_steps", 1)
    policy = "MultiInputPolicy" if isinstance(env.observation_space, spaces.Dict) else "MlpPolicy"
    mixing = replay_options(env.observation_space, n_steps=n_steps)
    settings = {"learning_starts": 10, "batch_size": 16, "seed": 0, "device": "cpu", "buffer_size": 500}
    algorithm = getattr(stable_baselines3, name)
    return algorithm(policy, env, policy_kwargs={"net_arch": [8]}, **{**settings, **mixing, **options})


@pytest.mark.parametrize(
    ("name", "make", "options"),
    [
        ("SAC", flat, {}),
        ("SAC", plain, {}),
        ("SAC", flat, {"n_steps": 3}),
        ("TD3", flat, {}),
        ("DQN", lambda: Steering(flat()), {"train_freq": 1}),
    ],
)
def test_accepted_dreams_are_exact_transitions(name: str, make: Any, options: dict[str, Any]) -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    world, env = LineModel(), make()
    dyna = Dyna(world, DynaConfig(**QUICK))
    algorithm = agent(name, env, **options)
    algorithm.learn(60, callback=dyna)
    acceptance = dyna.trainer.acceptance
    assert (acceptance.accepted, acceptance.known) == (True, 1.0)
    assert acceptance.error < 1e-6  # observations are float32
    assert dyna.imagined > 100
    assert len(world.learned) == 60  # in the end those too that were waiting for their turn
    pool = algorithm.replay_buffer.imagined
    last = pool.size()
    place = pool.observations["cart"][:last, 0, 0] if make is plain else 2.0 * pool.observations[:last, 0, 0]
    after = (
        pool.next_observations["cart"][:last, 0, 0]
        if make is plain
        else 2.0 * pool.next_observations[:last, 0, 0]
    )
    push = pool.actions[:last, 0, 0] - 1.0 if name == "DQN" else pool.actions[:last, 0, 0]
    np.testing.assert_allclose(after, place + 2.0 * push, atol=1e-5)
    np.testing.assert_allclose(pool.rewards[:last, 0], -np.abs(after), atol=1e-5)
    ended = pool.dones[:last, 0] * (1.0 - pool.timeouts[:last, 0])
    np.testing.assert_array_equal(ended, np.abs(after) > 5.0)
    # A dream ends with a cut or a termination; within one, each step goes on from the last.
    going = pool.dones[: last - 1, 0] == 0.0
    np.testing.assert_allclose(place[1:][going], after[:-1][going], atol=1e-6)
    assert algorithm.gradient_steps == 1  # as it was before


def test_batches_hold_the_share_that_was_asked_for() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    dyna = Dyna(LineModel(), DynaConfig(**QUICK, real_ratio=0.25))
    algorithm = agent("SAC", flat())
    algorithm.learn(40, callback=dyna)
    buffer = algorithm.replay_buffer
    buffer.rewards[:] = 7.0  # as if the world paid this, and only the world
    buffer.accepted = True  # as while it learned
    batch = buffer.sample(64)
    assert int((batch.rewards == 7.0).sum()) == 16
    assert batch.observations.shape == (64, 1)
    buffer.accepted = False
    assert bool((buffer.sample(64).rewards == 7.0).all())
    buffer.accepted, buffer.real_ratio = True, 0.0
    assert not bool((buffer.sample(64).rewards == 7.0).any())
    buffer.real_ratio = 1.0
    assert bool((buffer.sample(64).rewards == 7.0).all())


def test_without_the_callback_nothing_stale_is_drawn() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    algorithm = agent("SAC", flat())
    algorithm.learn(40, callback=Dyna(LineModel(), DynaConfig(**QUICK)))
    buffer = algorithm.replay_buffer
    assert buffer.imagined.size() > 0 and not buffer.accepted
    buffer.accepted = True
    kept = pickle.loads(pickle.dumps(buffer))
    assert (kept.size(), kept.imagined.size(), kept.accepted) == (40, 0, False)
    assert buffer.accepted and buffer.imagined.size() > 0  # keeping it changed nothing


def test_what_others_save_while_it_learns_is_the_agents_own(tmp_path: Any) -> None:
    from stable_baselines3 import SAC
    from stable_baselines3.common.callbacks import CallbackList, CheckpointCallback

    from relgym.wrappers.sb3.dyna import Dyna

    algorithm = agent("SAC", flat())
    dyna = Dyna(LineModel(), DynaConfig(**QUICK))
    algorithm.learn(40, callback=CallbackList([dyna, CheckpointCallback(10, str(tmp_path))]))
    assert algorithm._n_updates > 40  # more than one per step
    saved = sorted(tmp_path.glob("*.zip"))
    assert len(saved) == 4
    assert {SAC.load(path).gradient_steps for path in saved} == {1}


def test_steps_that_were_made_before_are_learned_from_too() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    env, world = flat(), LineModel()
    env.reset(seed=0)
    for _ in range(5):
        env.step(env.action_space.sample())
    agent("SAC", env).learn(20, callback=Dyna(world, DynaConfig(**QUICK)))
    assert len(world.learned) == 25


def test_steps_that_others_make_in_the_env_are_no_long_decision() -> None:
    from stable_baselines3.common.callbacks import CallbackList, EvalCallback

    from relgym.wrappers.sb3.dyna import Dyna

    class Restless(gym.Wrapper[Any, Any, Any, Any]):
        """Does nothing three times before an episode."""

        def reset(self, **options: Any) -> Any:
            self.env.reset(**options)
            for _ in range(3):
                seen, _, _, _, info = self.env.step(np.zeros(1, dtype=np.float32))
            return seen, info

    world, env = LineModel(), flat()
    tests = EvalCallback(env, eval_freq=15, n_eval_episodes=2, verbose=0, warn=False)
    agent("SAC", env).learn(30, callback=CallbackList([tests, Dyna(world, DynaConfig(**QUICK))]))
    assert len(world.learned) > 30
    restless = Flat(Restless(TransitionRecorder(gym.wrappers.TimeLimit(LineEnv(), 8))))
    agent("SAC", restless).learn(30, callback=Dyna(LineModel(), DynaConfig(**QUICK)))


def test_an_interrupted_training_leaves_the_agent_its_own_gradient_steps() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    algorithm, dyna = agent("SAC", flat()), Dyna(LineModel(), DynaConfig(**QUICK))
    train, left = algorithm.train, [25]

    def interrupted(*given: Any, **named: Any) -> None:
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt
        train(*given, **named)

    algorithm.train = interrupted
    with pytest.raises(KeyboardInterrupt):
        algorithm.learn(60, callback=dyna)
    assert algorithm.gradient_steps == 2  # Dyna's
    algorithm.learn(20, callback=dyna)
    assert algorithm.gradient_steps == 1
    algorithm.gradient_steps = 3  # what a user sets in between counts
    algorithm.learn(20, callback=dyna)
    assert algorithm.gradient_steps == 3


def test_in_catch_up_the_target_net_of_dqn_follows() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    algorithm = agent("DQN", Steering(flat()), train_freq=1)
    before = [part.detach().clone() for part in algorithm.q_net_target.parameters()]
    algorithm.learn(20, callback=Dyna(LineModel(), DynaConfig(**QUICK, catch_up=30)))
    after = list(algorithm.q_net_target.parameters())
    assert any(not bool((a == b).all()) for a, b in zip(before, after, strict=True))


def test_a_catch_up_waits_for_a_real_step() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    dyna = Dyna(LineModel(), DynaConfig(**{**QUICK, "least": 1}, catch_up=30))
    algorithm = agent("SAC", flat(), learning_starts=0)
    algorithm.learn(5, callback=dyna)
    assert algorithm._n_updates >= 30


def test_a_decision_lasts_as_long_in_dreams() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    def repeated(wrapper: Any) -> Any:
        return Flat(wrapper(TransitionRecorder(gym.wrappers.TimeLimit(LineEnv(), 8))))

    algorithm = agent("SAC", repeated(lambda env: gym.wrappers.RepeatAction(env, 2)))
    algorithm.learn(40, callback=Dyna(LineModel(), DynaConfig(**QUICK)))
    pool = algorithm.replay_buffer.imagined
    moved = 2.0 * (pool.next_observations - pool.observations)[: pool.size(), 0, 0]
    whole = pool.dones[: pool.size(), 0] == 0.0
    np.testing.assert_allclose(moved[whole], 4.0 * pool.actions[: pool.size(), 0, 0][whole], atol=1e-5)

    class Twice(gym.Wrapper[Any, Any, Any, Any]):
        def step(self, action: Any) -> Any:
            self.env.step(action)
            return self.env.step(action)

    with pytest.raises(
        ConfigError, match=r"a decision lasted 2 env steps, but dreamed ones last 1: .*RepeatAction"
    ):
        refused(repeated(Twice))


def test_a_wrong_model_is_never_dreamed_in() -> None:
    """No harm: while the model is rejected, training is Stable-Baselines3's own, to the last weight."""
    from stable_baselines3.common.callbacks import BaseCallback

    from relgym.wrappers.sb3.dyna import Dyna

    class Nothing(BaseCallback):  # type: ignore[misc]
        def _on_step(self) -> bool:
            return True

    dyna = Dyna(LineModel(off=1.0), DynaConfig(**QUICK))
    weights = []
    for callback in (dyna, Nothing()):
        algorithm = agent("SAC", flat())
        algorithm.learn(60, callback=callback)
        weights.append([part.detach().numpy() for part in algorithm.policy.parameters()])
    assert dyna.imagined == 0
    assert dyna.trainer.acceptance.error > 0.5
    for mine, theirs in zip(*weights, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_when_the_world_changes_the_dreams_are_thrown_away() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    world = LineModel()
    dyna = Dyna(world, DynaConfig(**QUICK))
    algorithm = agent("SAC", flat())
    algorithm.learn(40, callback=dyna)
    assert algorithm.replay_buffer.imagined.size() > 0
    world.off = 3.0  # the model is as wrong as if the world had changed
    algorithm.learn(40, callback=dyna, reset_num_timesteps=False)
    assert not dyna.trainer.acceptance.accepted
    assert algorithm.replay_buffer.imagined.size() == 0
    assert not algorithm.replay_buffer.accepted


def test_when_the_world_changes_a_replacement_is_dreamed_in() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    class Taught(LineModel):
        """Replacements of its own know the world as it is."""

        def untaught(self) -> LineModel:
            return LineModel()

    world = Taught()
    dyna = Dyna(world, DynaConfig(**QUICK, catch_up=30))
    algorithm = agent("SAC", flat())
    algorithm.learn(20, callback=dyna)
    assert dyna.world is world
    world.off = 3.0
    before = algorithm._n_updates
    algorithm.learn(40, callback=dyna, reset_num_timesteps=False)
    assert dyna.world is not world and dyna.trainer.renewals == 1
    assert algorithm._n_updates - before >= 40 + 30  # it makes up for lost time once more
    buffer = algorithm.replay_buffer
    pool, last = buffer.imagined, buffer.imagined.size()
    moved = 2.0 * (pool.next_observations - pool.observations)[:last, 0, 0]
    assert last > 0
    np.testing.assert_allclose(
        moved, 2.0 * pool.actions[:last, 0, 0], atol=1e-5
    )  # nothing of the old one is left


def test_same_seed_same_weights() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    weights = []
    for _ in range(2):
        algorithm = agent("SAC", flat())
        algorithm.learn(40, callback=Dyna(LineModel(), DynaConfig(**QUICK, seed=3)))
        weights.append([part.detach().numpy() for part in algorithm.policy.parameters()])
    for first, second in zip(*weights, strict=True):
        np.testing.assert_array_equal(first, second)


def test_the_log_tells(tmp_path: Any) -> None:
    from stable_baselines3.common.logger import configure

    from relgym.wrappers.sb3.dyna import Dyna

    algorithm = agent("SAC", flat())
    algorithm.set_logger(configure(str(tmp_path), ["csv"]))
    algorithm.learn(60, callback=Dyna(LineModel(), DynaConfig(**QUICK)), log_interval=1)
    algorithm.logger.close()
    head, *rows = (tmp_path / "progress.csv").read_text().splitlines()
    for name in (
        "error",
        "nrmse",
        "coverage",
        "accepted",
        "imagined",
        "dreams_known",
        "learning_seconds",
        "dreaming_seconds",
    ):
        assert f"relgym/{name}" in head
    last = dict(zip(head.split(","), rows[-1].split(","), strict=True))
    assert last["relgym/accepted"] == last["relgym/coverage"] == "1.0"
    assert float(last["relgym/nrmse"]) < 1e-9  # `LineModel` is the law itself


def test_several_envs_teach_one_model() -> None:
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    from relgym.wrappers.sb3.dyna import Dyna

    world = LineModel()
    envs = VecNormalize(DummyVecEnv([flat, flat, flat]))
    dyna = Dyna(world, DynaConfig(**QUICK))
    agent("SAC", envs).learn(60, callback=dyna)
    assert len(world.learned) == 60
    assert dyna.imagined > 50


def refused(env: Any, model: Any = None, *, name: str = "SAC", **options: Any) -> Any:
    from relgym.wrappers.sb3.dyna import Dyna

    algorithm = agent(name, env)
    algorithm.learn(5, callback=Dyna(model or LineModel(), DynaConfig(**QUICK), **options))


def test_updates_are_counted_per_real_step() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    counts = []
    for model in (LineModel(), LineModel(off=1.0)):
        algorithm = agent("SAC", flat(), train_freq=4, gradient_steps=3)
        algorithm.learn(40, callback=Dyna(model, DynaConfig(**QUICK)))
        counts.append(algorithm._n_updates)  # the only count there is
    # After 10 first steps, training comes after steps 12, 16, ..., 40: 8 times 2 x 4 updates, or 3.
    assert counts == [64, 24]


def test_what_a_accepted_model_could_have_taught_is_made_up_for_once() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    world, counts = LineModel(), []
    algorithm = agent("SAC", flat())
    dyna = Dyna(world, DynaConfig(**QUICK, catch_up=30))
    for off, steps in (
        (0.0, 20),
        (3.0, 30),
        (0.0, 30),
    ):  # right, as wrong as if the world had changed, right again
        world.off = off
        before = getattr(algorithm, "_n_updates", 0)
        algorithm.learn(steps, callback=dyna, reset_num_timesteps=False)
        counts.append((algorithm._n_updates - before, dyna.trainer.acceptance.switches))
    assert counts[0] == (10 * 2 + 30, 1)  # the first 10 steps are random
    assert [switches for _, switches in counts] == [1, 2, 3]
    assert counts[2][0] <= 30 * 2  # accepted again, without catch-up updates
    shut = agent("SAC", flat())
    shut.learn(20, callback=Dyna(LineModel(off=1.0), DynaConfig(**QUICK, catch_up=30)))
    assert shut._n_updates == 10
    world.off, other = 0.0, agent("SAC", flat())  # another agent has been taught nothing yet
    other.learn(20, callback=dyna)
    assert other._n_updates >= 30


def test_it_trains_again_when_more_has_become_known_of_the_task() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    env, counts = flat(), []
    reward_model = SimpleNamespace(evaluate=env.get_wrapper_attr("task").evaluate, verdicts=2)
    algorithm = agent("SAC", env)
    dyna = Dyna(LineModel(), DynaConfig(**QUICK, catch_up=30), reward_model=reward_model)
    for verdicts in (2, 3, 3, 2):
        reward_model.verdicts = verdicts
        before, steps = getattr(algorithm, "_n_updates", 0), 20 if not counts else 10
        algorithm.learn(steps, callback=dyna, reset_num_timesteps=False)
        counts.append(algorithm._n_updates - before)
    assert counts == [10 * 2 + 30, 10 * 2 + 30, 10 * 2, 10 * 2]


def test_a_model_that_was_never_accepted_is_complained_of(monkeypatch: pytest.MonkeyPatch) -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    monkeypatch.setattr("relgym.wrappers.sb3.dyna._SHORT", 30)
    with pytest.warns(UserWarning, match=r"never accepted in 40 steps.*its error was 0.*Give it more steps"):
        agent("SAC", flat()).learn(40, callback=Dyna(LineModel(off=1.0), DynaConfig(**QUICK)))


def test_refusals_name_the_remedy() -> None:
    import stable_baselines3

    from relgym.wrappers.sb3.dyna import Dyna

    ppo = stable_baselines3.PPO("MlpPolicy", flat(), n_steps=8, batch_size=8, device="cpu")
    with pytest.raises(ConfigError, match=r"PPO is not off-policy.*take SAC, TD3 or DQN"):
        ppo.learn(8, callback=Dyna(LineModel()))
    sac = stable_baselines3.SAC("MlpPolicy", flat(), device="cpu", buffer_size=100)
    with pytest.raises(ConfigError, match=r"a ReplayBuffer can't mix.*\*\*replay_options"):
        sac.learn(8, callback=Dyna(LineModel()))
    with pytest.raises(ConfigError, match="has no TransitionRecorder"):
        refused(Flat(LineEnv()))
    with pytest.raises(ConfigError, match=r"the algorithm's observation_space is .*dream in the wrappers"):
        refused(flat(), like=plain())
    by_episode = agent("SAC", flat(), train_freq=(1, "episode"))
    with pytest.raises(ConfigError, match="expected steps, since updates are counted per real step"):
        by_episode.learn(5, callback=Dyna(LineModel()))
    taskless = flat()
    taskless.unwrapped.task = None  # type: ignore[attr-defined]
    with pytest.raises(ConfigError, match="imagined steps have no reward"):
        refused(taskless)
    with pytest.raises(ConfigError, match=r"object is no model to dream with: it lacks \['schema'"):
        refused(flat(), object())
    ignorant = relgym.WorldModel(LineEnv().schema)
    ignorant.frozen = True
    with pytest.raises(QueryError, match="the model knows none of its targets"):
        refused(flat(), ignorant)
    for reward_model in ("foo", abs):
        with pytest.raises(ConfigError, match="expected 'learned', or an object with evaluate"):
            refused(flat(), reward_model=reward_model)
    with pytest.raises(ConfigError, match=r"TransformReward changes rewards outside .* put it inside"):
        refused(gym.wrappers.TransformReward(flat(), lambda reward: 100.0 * reward))
    other = agent("SAC", flat(), n_steps=3, gamma=0.5)
    with pytest.raises(ConfigError, match=r"discount by 0.99, the algorithm by 0.5: .*n_steps=3, gamma=0.5"):
        other.learn(5, callback=Dyna(LineModel(), DynaConfig(**QUICK)))
    unfrozen = LineModel()
    unfrozen.frozen, unfrozen.targets = True, ()  # type: ignore[assignment]
    with pytest.raises(ConfigError, match="knows none of the targets"):
        refused(flat(), unfrozen)
    with pytest.raises(ConfigError, match=r"config=.*: expected a DynaConfig, as DynaConfig\(updates=40\)"):
        Dyna(LineModel(), {"updates": 3})  # type: ignore[arg-type]
    for steps in (1.5, True, 0):
        with pytest.raises(ConfigError, match=f"n_steps={steps}: expected a whole number"):
            agent("SAC", flat(), n_steps=steps)
    with pytest.raises(ConfigError, match="training has not begun"):
        _ = Dyna(LineModel()).trainer


def test_a_reward_that_is_no_number_is_said_to_be_none() -> None:
    class Odd:
        def evaluate(self, layout: Any, before: Any, actions: Any, after: Any) -> TaskOutcome:
            never = np.zeros(len(after), dtype=bool)
            return TaskOutcome(np.full(len(after), np.nan), never, never)

    with pytest.raises(ConfigError, match=r"Odd gave a reward of nan: .*fix the reward function"):
        refused(flat(), reward_model=Odd())


def test_a_second_agent_gets_the_dreams_too() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    dyna = Dyna(LineModel(), DynaConfig(**QUICK))
    for _ in range(2):
        algorithm = agent("SAC", flat())
        algorithm.learn(40, callback=dyna)
        assert algorithm.replay_buffer.imagined.size() > 50
    pool = algorithm.replay_buffer.imagined
    algorithm.learn(20, callback=dyna, reset_num_timesteps=False)
    assert algorithm.replay_buffer.imagined is pool  # the same agent goes on with what it dreamed


def test_dreams_teach_wrappers_nothing() -> None:
    from relgym.wrappers.sb3.dyna import Dyna

    env = gym.wrappers.NormalizeObservation(flat())
    dyna = Dyna(LineModel(), DynaConfig(**QUICK))
    agent("SAC", env).learn(60, callback=dyna)
    assert dyna.imagined > 100
    assert env.obs_rms.count < 60 + 60 / 8 + 2  # an observation a step, and one for every reset
    assert env.update_running_mean


class Drift(gym.Env[Any, Any]):
    """Two numbers and no schema: a place, and a speed that is pushed; over when the place is far off."""

    def __init__(self) -> None:
        self.observation_space = spaces.Box(-100.0, 100.0, (2,), np.float64)
        self.action_space = spaces.Discrete(3)
        self.state = np.zeros(2)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.state = self.np_random.uniform(-1.0, 1.0, 2)
        return self.state.copy(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        x, v = self.state
        self.state = np.array([x + 0.5 * v, v + 0.25 * (int(action) - 1)])
        return self.state.copy(), -abs(self.state[0]), bool(abs(self.state[0]) > 6.0), False, {}


def test_any_env_will_do() -> None:
    """Observations that are numbers, discrete actions, and a task that is learned."""
    from relgym.wrappers.sb3.dyna import Dyna

    env = TransitionRecorder(gym.wrappers.TimeLimit(Drift(), 12))
    dyna = Dyna(relgym.WorldModel(env.view.schema), DynaConfig(**QUICK), reward_model="learned")
    algorithm = agent("DQN", env, learning_starts=10, train_freq=1, exploration_fraction=1.0)
    algorithm.learn(500, callback=dyna)
    assert dyna.imagined > 100
    pool = algorithm.replay_buffer.imagined
    last = pool.size()
    now, after = pool.observations[:last, 0], pool.next_observations[:last, 0]
    push = 0.25 * (pool.actions[:last, 0, 0] - 1.0)
    np.testing.assert_allclose(after[:, 0], now[:, 0] + 0.5 * now[:, 1], atol=1e-6)
    np.testing.assert_allclose(after[:, 1], now[:, 1] + push, atol=1e-6)
    np.testing.assert_allclose(pool.rewards[:last, 0], -np.abs(after[:, 0]), atol=1e-6)


def test_n_steps_are_refused_where_there_is_no_buffer_for_them() -> None:
    from relgym.wrappers.sb3.replay import replay_options

    with pytest.raises(ConfigError, match="n_steps=0: expected a whole number"):
        replay_options(flat().observation_space, n_steps=0)
    with pytest.raises(ConfigError, match="n_steps=3 with Dict observations"):
        replay_options(plain().observation_space, n_steps=3)


def test_stable_baselines3_is_still_what_this_stands_on() -> None:
    """Fails where the public extension points move, and says which."""
    from stable_baselines3 import DQN, SAC, TD3
    from stable_baselines3.common.buffers import DictReplayBuffer, NStepReplayBuffer, ReplayBuffer
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
    from stable_baselines3.common.policies import BasePolicy
    from stable_baselines3.common.type_aliases import DictReplayBufferSamples, ReplayBufferSamples
    from stable_baselines3.common.utils import polyak_update

    for algorithm in (SAC, TD3, DQN):
        assert issubclass(algorithm, OffPolicyAlgorithm)
        parameters = inspect.signature(algorithm.__init__).parameters
        assert {"replay_buffer_class", "replay_buffer_kwargs", "gradient_steps", "n_steps"} <= set(parameters)
    names = ["buffer_size", "observation_space", "action_space", "device", "n_envs"]
    for buffer in (ReplayBuffer, DictReplayBuffer):
        assert list(inspect.signature(buffer.__init__).parameters)[1:6] == names
    for buffer in (ReplayBuffer, DictReplayBuffer, NStepReplayBuffer):
        assert list(inspect.signature(buffer.sample).parameters)[1:] == ["batch_size", "env"]
        added = list(inspect.signature(buffer.add).parameters)[1:]
        assert added == ["obs", "next_obs", "action", "reward", "done", "infos"]
    fields = ("observations", "actions", "next_observations", "dones", "rewards", "discounts")
    assert ReplayBufferSamples._fields == DictReplayBufferSamples._fields == fields
    hooks = ("_init_callback", "_on_step", "_on_rollout_start", "_on_rollout_end", "_on_training_start")
    for hook in (*hooks, "_on_training_end", "training_env", "logger"):
        assert hasattr(BaseCallback, hook)
    assert list(inspect.signature(polyak_update).parameters) == ["params", "target_params", "tau"]
    assert {"q_net", "q_net_target", "tau"} <= set(vars(agent("DQN", Steering(flat()), train_freq=1)))
    for name in ("get_vec_normalize_env", "predict", "set_logger", "train", "learn"):
        assert callable(getattr(OffPolicyAlgorithm, name))
    assert list(inspect.signature(OffPolicyAlgorithm.train).parameters)[1:] == [
        "gradient_steps",
        "batch_size",
    ]
    for name in ("scale_action", "unscale_action"):
        assert callable(getattr(BasePolicy, name))


def test_a_vector_env_is_still_made_as_it_was() -> None:
    """What a `VecEnv` of one's own overrides and calls, as those of Stable-Baselines3 do; fails where it moves."""
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    envs = DummyVecEnv([flat, flat])
    assert (len(envs._seeds), len(envs._options), list(envs._get_indices(None))) == (2, 2, [0, 1])
    for name in ("_reset_seeds", "_reset_options", "env_method", "get_attr", "set_attr", "env_is_wrapped"):
        assert callable(getattr(envs, name))
    normalise = VecNormalize(envs)
    for name in ("normalize_obs", "unnormalize_obs", "get_original_obs", "get_original_reward"):
        assert callable(getattr(normalise, name))
    algorithm = agent("SAC", envs)
    algorithm.learn(2)
    assert algorithm._last_obs.shape == (2, 1)  # what a callback sees first
    assert algorithm.train_freq.unit.value == "step"


def test_the_recorder_takes_the_view_that_it_is_given() -> None:
    env = gym.make("Pendulum-v1")
    view = NumbersView(env.observation_space, env.action_space, angles=[("x0", "x1")])
    recorder = TransitionRecorder(env, view=view)
    recorder.reset(seed=0)
    recorder.step(np.array([0.5], dtype=np.float32))
    (step,) = recorder.take()
    assert step.transition.before["self"].type.properties == ("angle_x0", "x2")
    assert recorder.spec is not None
    assert gym.make(recorder.spec).get_wrapper_attr("view").to_json() == view.to_json()
