"""Reward and termination learned as properties of the task, and what is said where nothing is known."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from file_mutations import Mutator
from gymnasium import spaces

import relgym
from relgym.envs import LearnedModelEnv, LearnedModelVectorEnv
from relgym.envs.scripted import ball_home, push_knowing
from relgym.errors import ConfigError, ModelFileError
from relgym.model.files.storage import read_model, write_model
from relgym.scene.objects import ObjectType, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.wrappers.dyna.recorder import Experience, TransitionRecorder
from relgym.wrappers.dyna.reward_models import LearnedRewardModel
from relgym.wrappers.dyna.stock import changing
from relgym.wrappers.dyna.trainer import ModelTrainer

MOVING = {("truck", "vx"), ("truck", "px"), ("goal", "ahead"), ("box", "px")}


def pushes(n: int, knowing: float, rng: np.random.Generator) -> list[Experience]:
    """Steps of which a share is taken by a controller that knows the frictions."""
    env = TransitionRecorder(gym.make("relgym/TruckPush-v0", task="push", disable_env_checker=True))
    env.action_space.seed(int(rng.integers(2**31)))
    env.reset(seed=int(rng.integers(2**31)))
    found: list[Experience] = []
    while len(found) < n:
        scene = env.get_wrapper_attr("scene")
        action = push_knowing(scene) if rng.random() < knowing else env.action_space.sample()
        *_, terminated, truncated, _ = env.step(action)
        found += env.take()
        if terminated or truncated:
            env.reset()
    return found


def verdicts(reward_model: Any, steps: list[Experience]) -> Any:
    return reward_model.evaluate(
        steps[0].start.layout,
        np.stack([s.start.vector for s in steps]),
        np.stack([s.action for s in steps]),
        np.stack([s.transition.after.vector for s in steps]),
    )


def test_the_push_task_is_learned_from_what_it_says(rng: np.random.Generator) -> None:
    steps = [*pushes(300, 0.0, rng), *pushes(700, 0.9, rng)]
    reward_model = LearnedRewardModel(steps[0].start.schema, MOVING)
    for k in rng.permutation(len(steps)):
        reward_model.learn_step(steps[k].transition, steps[k].reward, terminated=steps[k].terminated)
    assert "reward' = 0.1 next.truck_vx - 0.02" in reward_model.model.describe(details=True)
    assert "reward' = 1.98" in reward_model.model.describe(details=True)
    fresh = pushes(300, 0.9, rng)
    said = verdicts(reward_model, fresh)
    known = np.isfinite(said.rewards)
    assert known.mean() > 0.99
    off = np.abs(said.rewards - [s.reward for s in fresh])[known]
    assert (off > 1e-9).mean() < 0.03
    assert (said.terminated != [s.terminated for s in fresh])[known].mean() < 0.1


def test_it_knows_no_verdict_whose_parts_never_went_together(rng: np.random.Generator) -> None:
    steps = [*pushes(200, 0.0, rng), *pushes(400, 0.9, rng)]
    reward_model = LearnedRewardModel(steps[0].start.schema, MOVING)
    for step in steps:
        reward_model.learn_step(step.transition, step.reward, terminated=step.terminated)
    # On the goal, slower and slower. Only a stop is paid for, and a stop is an end.
    goal = steps[0].start.schema.type_of("goal")
    start = steps[0].start.replace({("goal", "ahead"): 0.3, ("truck", "vx"): 0.2})
    assert goal.properties == ("ahead",)
    speeds = np.concatenate([np.linspace(0.0, 0.1, 2_001), [0.0]])
    after = np.stack([start.replace({("truck", "vx"): v, ("goal", "ahead"): 0.3 - v}).vector for v in speeds])
    before = np.tile(start.vector, (len(speeds), 1))
    said = reward_model.evaluate(start.layout, before, np.zeros((len(speeds), 1)), after)
    paid = np.nan_to_num(said.rewards) > 1.0
    assert paid[0] and said.terminated[0]
    assert (said.terminated[paid]).all()


def test_ends_are_not_forgotten_among_many_steps_that_end_nothing(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relgym.wrappers.dyna.reward_models._REMEMBERED", 100)
    steps = [*pushes(200, 0.0, rng), *pushes(400, 0.9, rng)]
    reward_model = LearnedRewardModel(steps[0].start.schema, MOVING)
    others = [step for step in steps if not step.terminated]
    for step in [*steps, *others[:150]]:
        reward_model.learn_step(step.transition, step.reward, terminated=step.terminated)
    paid = [step for step in steps if step.terminated and step.reward > 1.0]
    said = verdicts(reward_model, paid)
    assert np.isfinite(said.rewards).mean() > 0.9
    assert said.terminated.mean() > 0.9


def test_what_is_paid_for_elsewhere_is_not_forgotten(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relgym.wrappers.dyna.reward_models._REMEMBERED", 50)
    car = ObjectType("car", ("x",))
    schema = SceneSchema((car,), (("car", "car"),), targets=(Target("car", "x"),))
    reward_model = LearnedRewardModel(schema, {("car", "x")})

    def step(x: float) -> Transition:
        return Transition(schema.scene({"car": [x - 0.1]}), schema.scene({"car": [x]}))

    for x in [*rng.uniform(-1.0, 1.0, 200), *rng.uniform(0.0, 1.0, 300)]:  # it lives on one side in the end
        reward_model.learn_step(step(x), abs(x), terminated=False)
    there = np.linspace(-0.9, -0.1, 9)[:, None]
    said = reward_model.evaluate(schema.layout(), there - 0.1, np.zeros((9, 0)), there)
    assert said.rewards == pytest.approx(-there[:, 0])


def test_it_says_nothing_before_it_was_told(rng: np.random.Generator) -> None:
    steps = pushes(5, 0.0, rng)
    reward_model = LearnedRewardModel(steps[0].start.schema, MOVING)
    said = verdicts(reward_model, steps)
    assert np.isnan(said.rewards).all()
    assert not said.terminated.any()


def homecomings(seeds: range) -> list[list[Experience]]:
    """Episodes of a ball that is steered home."""
    env = TransitionRecorder(gym.make("relgym/BallGoal-v0", disable_env_checker=True))
    found = []
    for seed in seeds:
        env.reset(seed=seed)
        over, action = False, None
        for step in range(500):
            if step % 5 == 0:
                action = ball_home(env.get_wrapper_attr("scene"))
            *_, terminated, truncated, _ = env.step(action)
            if over := terminated or truncated:
                break
        steps = env.take()
        if over and steps[-1].terminated:
            found.append(steps)
    return found


def test_a_few_ends_show_what_an_end_is_paid_for() -> None:
    # Dozens of numbers might say when; the law of progress is the same as ever, and the bonus comes on top.
    taught, fresh = homecomings(range(7)), homecomings(range(100, 106))
    reward_model = LearnedRewardModel(
        taught[0][0].start.schema, changing(relgym.WorldModel(taught[0][0].start.schema))
    )
    for episode in taught:
        for step in episode:
            reward_model.learn_step(step.transition, step.reward, terminated=step.terminated)
    assert "2 terminated'" in reward_model.model.describe(details=True)
    assert "terminated' = 1" in reward_model.model.describe(details=True)
    said = [verdicts(reward_model, episode) for episode in fresh]
    right = [abs(v.rewards[-1] - e[-1].reward) < 1e-6 for v, e in zip(said, fresh, strict=True)]
    assert len(fresh) >= 5
    assert np.mean(right) > 0.5
    assert not any(v.terminated[:-1].any() for v in said)


def test_saved_and_loaded_it_goes_on_as_if_never_saved(rng: np.random.Generator, tmp_path: Path) -> None:
    steps = [*pushes(200, 0.0, rng), *pushes(500, 0.9, rng)]
    reward_model = LearnedRewardModel(steps[0].start.schema, MOVING)
    for step in steps[:600]:
        reward_model.learn_step(step.transition, step.reward, terminated=step.terminated)
    reward_model.save(tmp_path / "task.relgym")
    again = LearnedRewardModel.load(tmp_path / "task.relgym")
    for each in (reward_model, again):
        for step in steps[600:]:
            each.learn_step(step.transition, step.reward, terminated=step.terminated)
    fresh = pushes(100, 0.9, rng)
    one, two = verdicts(reward_model, fresh), verdicts(again, fresh)
    assert np.isfinite(one.rewards).any()
    np.testing.assert_array_equal(one.rewards, two.rewards)
    np.testing.assert_array_equal(one.terminated, two.terminated)
    for number, each in enumerate((reward_model, again)):
        each.save(tmp_path / f"{number}.relgym")
    assert (tmp_path / "0.relgym").read_bytes() == (tmp_path / "1.relgym").read_bytes()
    assert relgym.WorldModel.load(tmp_path / "0.relgym").describe() == reward_model.model.describe()


def test_other_files_are_no_learned_task(tmp_path: Path) -> None:
    schema = gym.make("relgym/TruckPush-v0").unwrapped.schema  # type: ignore[attr-defined]
    relgym.WorldModel(schema).save(tmp_path / "world.relgym")
    with pytest.raises(
        ModelFileError, match=r"no learned task: expected what LearnedRewardModel\.save wrote"
    ):
        LearnedRewardModel.load(tmp_path / "world.relgym")
    reward_model = LearnedRewardModel(schema, MOVING)
    reward_model.model.save(tmp_path / "half.relgym", history=True, extra={"learned_task": {"ends": []}})
    with pytest.raises(ModelFileError, match="the learned task isn't as the format says"):
        LearnedRewardModel.load(tmp_path / "half.relgym")


def test_changed_files_are_refused_or_work(rng: np.random.Generator, tmp_path: Path) -> None:
    """Every change has the checksum that goes with it (`tests/fuzz` does the same to models)."""
    steps = pushes(80, 0.9, rng)
    reward_model = LearnedRewardModel(steps[0].start.schema, MOVING)
    for step in steps[:60]:
        reward_model.learn_step(step.transition, step.reward, terminated=step.terminated)
    path = tmp_path / "task.relgym"
    reward_model.save(path)
    body, arrays = read_model(path)
    mutator, accepted, changes = Mutator(body["extra"]["learned_task"], None, random.Random(0)), 0, 150
    for _ in range(changes):
        data, _ = mutator.draw()
        write_model(path, {**body, "extra": {"learned_task": data}}, arrays)
        try:
            again = LearnedRewardModel.load(path)
        except ModelFileError:
            continue
        accepted += 1
        for step in steps[60:]:
            again.learn_step(step.transition, step.reward, terminated=step.terminated)
        again.save(path)
    assert 5 < accepted < changes - 5


def test_dreams_are_evaluated_by_what_was_learned(rng: np.random.Generator) -> None:
    """As the world evaluates them; and where nothing is known they are cut off, one by one and in batches alike."""
    real = gym.make("relgym/TruckPush-v0", disable_env_checker=True)
    steps = [*pushes(200, 0.0, rng), *pushes(400, 0.9, rng)]
    model = relgym.WorldModel(steps[0].start.schema)
    reward_model = LearnedRewardModel(model.schema, MOVING)
    for k in rng.permutation(len(steps)):
        model.learn_one(steps[k].transition)
        reward_model.learn_step(steps[k].transition, steps[k].reward, terminated=steps[k].terminated)
    model.finish()
    dream = LearnedModelEnv(model, like=real, task=reward_model)
    dreams = LearnedModelVectorEnv(model, 1, like=real, task=reward_model, autoreset_mode="Disabled")
    task, right = real.get_wrapper_attr("task"), []
    for episode in range(16):
        _, info = real.reset(seed=episode)
        dream.reset(options={"scene": info["scene"]})
        dreams.reset(options={"scene": info["scene"]})
        over = cut = False
        while not (over or cut):
            before = dream.scene
            action = push_knowing(before) if episode % 2 else real.action_space.sample()
            _, reward, over, cut, told = dream.step(action)
            _, *many, infos = dreams.step(np.asarray(action)[None])
            assert [part.tolist() for part in many] == [[reward], [over], [cut]]
            if cut:
                assert infos["cause"].tolist() == [told["cause"]]
                break
            expected = task.reward(before, action, dream.scene), task.terminated(before, action, dream.scene)
            right.append((pytest.approx(reward, abs=1e-6), over) == expected)
    assert len(right) > 40
    assert np.mean(right) > 0.95
    nothing = LearnedRewardModel(model.schema, MOVING)
    unsure = LearnedModelEnv(model, like=real, task=nothing)
    unsure.reset(seed=0)
    _, reward, over, cut, told = unsure.step(np.array([0.5]))
    assert (reward, over, cut, told["cause"]) == (0.0, False, True, "no_reward")
    assert "nothing that was learned of the task" in told["reason"]


@pytest.mark.sb3
def test_dyna_learns_the_task_beside_the_world() -> None:
    import torch
    from stable_baselines3 import SAC

    from relgym.wrappers.flat import FlatView
    from relgym.wrappers.sb3 import Dyna, DynaConfig, replay_options

    torch.set_num_threads(1)
    env = FlatView(TransitionRecorder(gym.make("relgym/TruckPush-v0", task="push", disable_env_checker=True)))
    model = relgym.WorldModel(env.get_wrapper_attr("schema"))
    dyna = Dyna(model, DynaConfig(updates=1, shuffle=20), reward_model="learned")
    agent = SAC(
        "MlpPolicy", env, learning_starts=10_000, device="cpu", **replay_options(env.observation_space)
    )
    agent.learn(250, callback=dyna)
    reward_model = dyna.trainer.reward_model
    assert isinstance(reward_model, LearnedRewardModel)
    assert (model.seen, reward_model.model.seen) == (250, 250)
    assert 0.0 < dyna.trainer.acceptance.error < 1.0


@pytest.mark.sb3
def test_actions_come_into_scenes_as_the_env_has_them() -> None:
    """Three choices are a number and three indicators in its scenes: a reward model learns that from the env."""
    from relgym.wrappers.sb3.dreaming import explore

    class Paying(gym.Env[Any, Any]):
        observation_space = spaces.Box(-np.inf, np.inf, (1,), np.float64)
        action_space = spaces.Discrete(3)

        def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
            super().reset(seed=seed)
            self.x, self.steps = self.np_random.uniform(-1.0, 1.0, 1), 0
            return self.x.copy(), {}

        def step(self, action: Any) -> Any:
            self.x, self.steps = 0.9 * self.x + (action == 1), self.steps + 1
            return self.x.copy(), float(action == 1), False, self.steps >= 20, {}

    env = TransitionRecorder(Paying())
    schema = env.view.schema
    reward_model = LearnedRewardModel(schema, {("self", "x")})
    bare, nothing, choices = schema.layout(("self",)), np.zeros((3, 1)), np.arange(3)
    explore(ModelTrainer(relgym.WorldModel(schema), reward_model), env, 120, seed=0)
    told = reward_model.evaluate(bare, nothing, choices, np.array([[0.0], [1.0], [0.0]]))
    np.testing.assert_allclose(told.rewards, [0.0, 1.0, 0.0], atol=1e-6)
    with pytest.raises(ConfigError, match=r"expected 4 numbers for each action.*Lens\(env\)\.acting"):
        LearnedRewardModel(schema, {("self", "x")}).evaluate(bare, nothing, choices, nothing)


def test_what_a_reward_is_made_of_is_found_among_all_that_stays_the_same() -> None:
    # Four laws, one for each side of the goal, in scenes of sixty properties, most of them constants of an episode.
    env = TransitionRecorder(gym.make("relgym/BallGoal-v0", disable_env_checker=True))
    env.action_space.seed(3)
    steps: list[Experience] = []
    for k in range(40):
        env.reset(seed=k)
        action = env.action_space.sample()
        for _ in range(15):
            env.step(action)
        steps += env.take()
    moving = {("ball", prop) for prop in ("px", "py", "vx", "vy")} | {
        ("goal", prop) for prop in ("dx", "dy", "held")
    }
    reward_model = LearnedRewardModel(steps[0].start.schema, moving)
    for k in np.random.default_rng(0).permutation(450):
        reward_model.learn_step(steps[k].transition, steps[k].reward, terminated=steps[k].terminated)
    fresh = steps[450:]
    off = np.abs(verdicts(reward_model, fresh).rewards - [s.reward for s in fresh])
    assert (off <= 1e-9).mean() >= 0.9
