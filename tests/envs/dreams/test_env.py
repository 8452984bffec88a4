"""Dreams have the real env's spaces, follow the model, and stop where it knows nothing."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from carts import CartEnv, run
from dreams import (
    CART_SCHEMA,
    Errand,
    FlatCart,
    cart_model,
    cart_step,
    flat_model,
    lost_model,
    room_model,
)
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from plain_envs import Drifter, Visited
from worlds import ROOM_TARGETS, room, scene, schema_of

from relgym.envs import LearnedModelEnv, LearnedModelVectorEnv
from relgym.envs.dreams.shown import BoxesShown
from relgym.envs.model_files import EnvRecord
from relgym.envs.spaces_json import space_from_json, space_to_json
from relgym.envs.views import NumbersView, Rows, TableView, TaskView
from relgym.errors import ActionError, ConfigError, ModelFileError, ObservationError, QueryError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, Target
from relgym.wrappers import ModelLearner, VectorModelLearner

ID = "relgym/LearnedModel-v0"
PUSH = np.array([1.0], np.float32)


@pytest.fixture(scope="module")
def truck() -> ModelLearner:
    """A truck with one box, watched for 12 episodes of ever new pushes."""
    env = ModelLearner(gym.make("relgym/TruckPush-v0", n_boxes=1, resample="step"))
    env.action_space.seed(0)
    for episode in range(12):
        env.reset(seed=episode)
        for _ in range(40):
            env.step(np.clip(env.action_space.sample(), 0.5, 1.0))
    return env


@pytest.fixture(scope="module")
def cart() -> ModelLearner:
    """A cart that was pushed 100 times."""
    env = ModelLearner(CartEnv())
    run(env, 100)
    return env


@pytest.fixture
def model_file(truck: ModelLearner, tmp_path: Path) -> Path:
    truck.save(tmp_path / "truck.json")
    return tmp_path / "truck.json"


# ---------------------------------------------------------------------- what Gymnasium asks
@pytest.mark.parametrize("horizon", [None, 40])
def test_the_checker_has_nothing_to_say(model_file: Path, horizon: int | None) -> None:
    env = gym.make(ID, model=str(model_file), horizon=horizon)
    check_env(env.unwrapped)  # warnings are errors
    env.close()


def test_the_checker_has_nothing_to_say_of_a_model_in_memory(cart: ModelLearner) -> None:
    check_env(gym.make(ID, model=cart.model, like=CartEnv()).unwrapped, skip_render_check=True)


@pytest.mark.sb3
@pytest.mark.parametrize("horizon", [None, 40])
def test_sb3s_checker_has_nothing_to_say(model_file: Path, horizon: int | None) -> None:
    from stable_baselines3.common import env_checker

    env_checker.check_env(gym.make(ID, model=str(model_file), horizon=horizon))  # warnings are errors


def test_same_seed_same_dream(model_file: Path) -> None:
    def dream() -> list[Any]:
        env = gym.make(ID, model=str(model_file), max_episode_steps=40)
        observations = [env.reset(seed=5)[0]]
        observations += [env.step(PUSH)[0] for _ in range(10)]
        return observations

    assert str(dream()) == str(dream())


def test_observations_belong_to_the_caller(cart: ModelLearner) -> None:
    dream = LearnedModelEnv(cart.model)
    observation, _ = dream.reset(seed=0)
    was = dream.scene["cart"]["v"]
    observation["cart"] += 1.0
    assert dream.scene["cart"]["v"] == was


@pytest.mark.parametrize("through", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_go_on_alike_and_apart(cart: ModelLearner, through: Any) -> None:
    dream = LearnedModelEnv(cart.model, like=CartEnv())
    dream.reset(seed=0)
    dream.step(PUSH)
    twin = through(dream)
    assert str(twin.step(PUSH)[0]) == str(dream.step(PUSH)[0])
    dream.step(PUSH)
    assert twin.scene["cart"]["v"] != dream.scene["cart"]["v"]
    twin.step(PUSH)
    assert str(twin.reset()[0]) == str(dream.reset()[0])


def test_a_dream_is_drawn_and_recorded(model_file: Path, tmp_path: Path) -> None:
    pytest.importorskip("moviepy", reason="RecordVideo writes through moviepy")
    env = gym.make(ID, model=str(model_file), render_mode="rgb_array", max_episode_steps=5)
    env = gym.wrappers.RecordVideo(env, str(tmp_path / "videos"))
    env.reset(seed=0)
    picture: Any = env.render()
    assert picture.dtype == np.uint8 and picture.shape[2] == 3 and len(np.unique(picture)) > 3
    for _ in range(5):
        env.step(PUSH)
    env.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert video.stat().st_size > 1000


def test_a_dream_opens_a_window(model_file: Path) -> None:
    env = LearnedModelEnv(model_file, render_mode="human")
    env.reset(seed=0)
    env.step(PUSH)
    assert env.render() is None
    env.close()
    env.close()


# ---------------------------------------------------------------------- as the real env
def test_spaces_are_the_real_ones(truck: ModelLearner, model_file: Path) -> None:
    dream = LearnedModelEnv(model_file)
    assert dream.observation_space == truck.observation_space
    assert dream.action_space == truck.action_space
    assert dream.metadata["render_fps"] == truck.metadata["render_fps"]


@pytest.mark.parametrize("action", [-1.0, -0.3, 0.25, 1.0])
def test_actions_mean_the_same_as_in_the_real_env(cart: ModelLearner, action: float) -> None:
    real, dream = CartEnv(), LearnedModelEnv(cart.model)
    real.reset(options={"v": 10.0})
    dream.reset(options={"scene": cart.model.schema.scene({"cart": [10.0]})})
    for _ in range(20):
        seen, *_ = real.step(np.array([action]))
        imagined, *_ = dream.step(np.array([action]))
        assert imagined["cart"][0] == pytest.approx(seen["cart"][0], abs=1e-11)


def test_a_dream_follows_the_trucks_world(truck: ModelLearner) -> None:
    real = gym.make("relgym/TruckPush-v0", n_boxes=1, task=None)  # with frictions that stay
    dream = LearnedModelEnv(truck.model, like=real)
    real.reset(seed=77)
    dream.reset(options={"scene": real.get_wrapper_attr("scene")})
    for k in range(30):
        action = np.array([0.5 + 0.01 * k], np.float32)
        seen, *_ = real.step(action)
        imagined, _, _, truncated, info = dream.step(action)
        assert not truncated, info
        for name, values in seen.items():
            np.testing.assert_allclose(imagined[name], values, rtol=0, atol=1e-9)


def test_a_ball_dreamed_from_a_file_bounces_as_the_real_one(tmp_path: Path) -> None:
    env = ModelLearner(gym.make("relgym/BallBoxRamp-v0", objects=()))
    for episode in range(12):
        env.reset(seed=episode)
        truncated = False
        while not truncated:
            *_, truncated, _ = env.step(0)
    env.model.save(tmp_path / "ball.json")
    dream = gym.make(ID, model=str(tmp_path / "ball.json"))
    real = gym.make("relgym/BallBoxRamp-v0", objects=())
    _, info = real.reset(seed=900)
    dream.reset(options={"scene": info["scene"]})
    bounces = 0
    for _ in range(199):
        seen, *_, told = real.step(0)
        imagined, _, _, stopped, info = dream.step(0)
        assert not stopped, info
        bounces += bool(told["contacts"])
        for name, values in seen.items():
            np.testing.assert_allclose(imagined[name], values, rtol=0, atol=1e-11)
    assert bounces > 3


def test_a_dream_can_be_learned_from(cart: ModelLearner) -> None:
    again = ModelLearner(LearnedModelEnv(cart.model, horizon=50))
    run(again, 100)
    (mode,) = again.model.modes("cart", "v")
    assert mode.formula(6) == "v' = 0.9 v + 0.1 action.push"


# ---------------------------------------------------------------------- where dreams begin
def test_a_dream_begins_as_the_real_env_would(truck: ModelLearner) -> None:
    real = gym.make("relgym/TruckPush-v0", n_boxes=1, resample="step")
    dream = LearnedModelEnv(truck.model, like=real)
    for options in (None, {"box1_friction": 0.25, "speed": 3.0}):
        expected, _ = real.reset(seed=8, options=options)
        assert str(dream.reset(seed=8, options=options)[0]) == str(expected)
    assert dream.scene["box1"]["friction"] == 0.25
    assert str(dream.reset()[0]) != str(dream.reset()[0])


def test_the_real_episode_goes_on_undisturbed(cart: ModelLearner) -> None:
    learner = ModelLearner(CartEnv(), targets=["cart.v"])
    run(learner, 50)
    learner.reset(seed=0, options={"v": 10.0})
    learner.step(PUSH)
    dream = LearnedModelEnv(learner.model, like=learner)
    dream.reset(seed=1)
    dream.step(PUSH)
    assert learner.scene["cart"]["v"] == 10.0
    assert (learner.model.seen, learner.get_wrapper_attr("resets")) == (51, 3)


def test_files_hold_first_scenes(cart: ModelLearner, tmp_path: Path) -> None:
    cart.model.save(tmp_path / "cart.json")
    dream = LearnedModelEnv(tmp_path / "cart.json")
    begun = {dream.reset(seed=seed)[0]["cart"][0] for seed in range(40)}
    real = {CartEnv().reset(seed=seed)[0]["cart"][0] for seed in (0, 25, 50, 75)}
    assert begun == real
    with pytest.raises(ConfigError, match="unknown reset options"):
        dream.reset(options={"v": 1.0})


def test_a_sampler_draws_first_scenes(cart: ModelLearner) -> None:
    def fast(rng: np.random.Generator) -> Scene:
        return cart.model.schema.scene({"cart": [rng.uniform(90.0, 91.0)]})

    dream = LearnedModelEnv(cart.model, like=CartEnv(), start=fast)
    first = dream.reset(seed=3)[0]["cart"][0]
    assert 90.0 <= first <= 91.0
    assert dream.reset(seed=3)[0]["cart"][0] == first
    assert dream.reset()[0]["cart"][0] != first


def test_a_given_scene_must_be_of_this_world(cart: ModelLearner, truck: ModelLearner) -> None:
    schema, dream = cart.model.schema, LearnedModelEnv(cart.model)
    dream.reset(options={"scene": schema.scene({"cart": [5.0], "action": [1.0]})})
    assert dream.scene == schema.scene({"cart": [5.0]})
    for first, message in [
        (truck.scene, "expected the objects"),
        (schema.scene({"action": [1.0]}), r"expected the objects \['cart'\], got \[\]"),
        (schema.scene({"cart": [2000.0]}), r"cart\.v = 2000 left the observation space \[-1000, 1000\]"),
        ({"cart": [1.0]}, "expected a start scene, got dict"),
    ]:
        with pytest.raises(ObservationError, match=message):
            dream.reset(options={"scene": first})


# ---------------------------------------------------------------------- other objects than in training
def test_a_dream_of_other_objects_is_like_an_env_that_has_them(cart: ModelLearner) -> None:
    env = ModelLearner(gym.make("relgym/TruckPush-v0", n_boxes=2, resample="step"))
    env.action_space.seed(0)
    for episode in range(24):
        env.reset(seed=episode, options={"layout": 1 + episode % 2})
        for _ in range(20):
            env.step(env.action_space.sample())
    crowd = gym.make("relgym/TruckPush-v0", n_boxes=2, bystanders=3, task=None)
    dream = LearnedModelEnv(env.model, like=crowd)
    check_env(dream, skip_render_check=True)
    assert dream.observation_space == crowd.observation_space
    seen, _ = crowd.reset(seed=1)
    imagined, _ = dream.reset(seed=1)
    assert str(seen) == str(imagined)
    followed = 0
    for _ in range(10):
        imagined, _, _, truncated, info = dream.step(PUSH)
        if truncated:
            break
        followed += 1
        np.testing.assert_allclose(imagined["truck"], crowd.step(PUSH)[0]["truck"], rtol=0, atol=1e-9)
    assert followed or "outside" in info["cause"] or "roles" in info["cause"]


def test_a_dream_of_other_objects_is_like_a_scene_that_has_them() -> None:
    model = room_model("auto")
    (step,) = room(5, 1, boxes=5, balls=2)
    other = scene(schema_of([step], ROOM_TARGETS), step[0])
    dream = LearnedModelEnv(model, like=other)
    check_env(dream, skip_render_check=True)
    assert sorted(dream.observation_space.spaces) == sorted(other.layout.names)
    dream.reset(seed=0)
    assert dream.scene == dream.schema.scene(other.values())
    observation, *_, truncated, info = dream.step(0)
    assert not truncated, info
    for ball in ("ball0", "ball1"):
        np.testing.assert_allclose(observation[ball], list(step[1][ball][1].values()), rtol=0, atol=1e-9)
    with pytest.raises(ObservationError, match="for scenes with other objects pass like=scene"):
        LearnedModelEnv(model).reset(options={"scene": dream.scene})


def test_objects_of_unknown_bounds_are_refused(truck: ModelLearner) -> None:
    schema = dataclasses.replace(truck.model.schema, objects=(("box1", "box"), ("action", "action")))
    boxed = truck.scene
    model = WorldModel(schema, targets=[Target("box", "px")])
    model.extra = recorded_extra = {**truck.record.to_json(), "starts": []}
    recorded_extra["spaces"] = EnvRecord(
        spaces.Dict({"box1": truck.observation_space["box1"]}), truck.action_space
    ).to_json()["spaces"]
    with pytest.raises(ConfigError, match="no bounds are known for object 'truck'"):
        LearnedModelEnv(model, like=boxed)


# ---------------------------------------------------------------------- learned through a view
def test_a_dream_shows_what_the_real_env_shows(tmp_path: Path) -> None:
    model, real = flat_model(), FlatCart()
    model.save(tmp_path / "flat.json")
    for dream in (LearnedModelEnv(tmp_path / "flat.json"), LearnedModelEnv(model, like=real)):
        check_env(dream, skip_render_check=True)
        assert (dream.observation_space, dream.action_space) == (real.observation_space, real.action_space)
    expected, _ = real.reset(seed=5)
    seen, _ = dream.reset(seed=5)
    np.testing.assert_array_equal(seen, expected)
    for push in (1.0, -0.5, 0.25):
        action = np.array([push], np.float32)
        expected, gained, *_ = real.step(action)
        seen, reward, _, truncated, info = dream.step(action)
        np.testing.assert_allclose(seen, expected, rtol=0, atol=1e-9)
        assert not truncated, info
        assert reward == pytest.approx(gained, abs=1e-9)


def visited_view(seen: spaces.Space, acting: spaces.Space) -> TableView:
    rows = (Rows("box"), Rows("visitor"))
    return TableView(seen, acting, columns=("here", "x"), rows=rows, presence="here")


def flat_scene(x: float, v: float) -> Scene:
    return flat_model().schema.scene({"self": [x, v]})


def test_a_view_must_fit_the_dream() -> None:
    with pytest.raises(ConfigError, match="expected the spaces of the env that the model was learned in"):
        other = FlatCart()
        other.action_space = spaces.Box(-2.0, 2.0, (1,), np.float32)
        LearnedModelEnv(flat_model(), like=other)
    with pytest.raises(ConfigError, match="bounds are known of observations only"):
        LearnedModelEnv(flat_model(), like=LearnedModelEnv(flat_model()).reset(seed=0)[1]["scene"])
    with pytest.raises(ConfigError, match="the view's scenes"):
        LearnedModelEnv(cart_model(), view=NumbersView(FlatCart().observation_space, FlatCart().action_space))


def test_of_an_env_in_wrappers_those_inside_are_reset() -> None:
    for like in (
        gym.wrappers.NormalizeObservation(ModelLearner(FlatCart())),
        gym.wrappers.RescaleAction(FlatCart(), np.float32(-3.0), np.float32(3.0)),
        gym.wrappers.TimeLimit(FlatCart(), 5),
    ):
        dream = LearnedModelEnv(flat_model(), like=like)
        assert dream.observation_space == FlatCart().observation_space
        np.testing.assert_array_equal(dream.reset(seed=3)[0], FlatCart().reset(seed=3)[0])


def test_attributes_of_others_that_have_our_names_are_left_alone() -> None:
    env = FlatCart()
    env.schema, env.task = {"x": "metres"}, "drive"  # type: ignore[attr-defined]
    learner = ModelLearner(env)
    run(learner, 30)
    dream = LearnedModelEnv(learner.model, like=learner)
    dream.reset(seed=0)
    assert dream.step(PUSH)[1] == 0.0
    env.task = Errand()  # type: ignore[attr-defined]
    errand = LearnedModelEnv(flat_model(), like=gym.wrappers.TimeLimit(env, 9))
    assert isinstance(errand.task, Errand)

    class Paid(gym.Wrapper[Any, Any, Any, Any]):
        task = Errand()

    assert LearnedModelEnv(flat_model(), like=Paid(FlatCart())).task is Paid.task


def test_a_dream_of_an_env_without_a_schema_has_none() -> None:
    """So whatever goes round the env goes round the dream."""
    dream = LearnedModelEnv(flat_model())
    assert not hasattr(dream, "schema")
    learner = ModelLearner(dream)
    run(learner, 20)
    assert learner.model.seen == 20
    many = VectorModelLearner(LearnedModelVectorEnv(flat_model(), 2, horizon=5))
    many.reset(seed=0)
    many.step(np.zeros((2, 1), np.float32))
    assert many.model.seen == 2
    assert LearnedModelEnv(cart_model(), like=LearnedModelEnv(cart_model())).schema == cart_model().schema


# ---------------------------------------------------------------------- numbers that a space can't hold
@pytest.mark.parametrize("dtype", [np.int64, np.int8])
def test_a_dream_of_whole_numbers_shows_the_nearest_and_leaves_where_none_is(dtype: type) -> None:
    learner = ModelLearner(Visited(dtype), view=visited_view, learn_reward=True)
    for seed in range(12):
        run(learner, 15, seed=seed)
    learner.model.finish()
    dream = LearnedModelEnv(learner.model, like=learner)
    for seed in range(4):  # with a visitor and without
        seen, _ = dream.reset(seed=seed)
        place, objects = int(seen[0, 1]), len(dream.scene.layout.names)
        for _ in range(5):
            seen, reward, _, truncated, info = dream.step(1)
            place += 3
            assert (seen[0, 1], seen.dtype) == (place, dtype), info
            assert reward == pytest.approx(-place, abs=1e-6)
            assert not truncated
        assert seen[1, 0] == objects - 2
    far = learner.view.scene(np.array([[1, 99], [0, 0]]).astype(dtype))
    dream.reset(options={"scene": far})
    seen, _, _, truncated, info = dream.step(1)
    assert (truncated, info["cause"], seen[0, 1]) == (True, "left", 99)


def test_infinite_numbers_have_left_every_space() -> None:
    env = FlatCart()
    env.observation_space = spaces.Box(-np.inf, np.inf, (2,), np.float32)
    model = flat_model()
    kept = model.extra
    try:
        model.extra = {}
        dream = LearnedModelEnv(model, like=env, view=NumbersView(env.observation_space, env.action_space))
        dream.reset(options={"scene": flat_scene(3.2e38, 3.2e38)})
        _, _, _, truncated, info = dream.step(PUSH)
    finally:
        model.extra = kept
    assert truncated and "left what float32 can hold" in info["reason"]
    assert np.isfinite(dream.scene.vector).all()
    vast = {"cart": spaces.Box(-np.inf, np.inf, (2,), np.float64)}
    boxes = BoxesShown(CART_SCHEMA, spaces.Dict(vast), spaces.Box(-1.0, 1.0, (1,), np.float32))
    vectors = np.array([[0.0, 1.0, 0.0, 0.0], [np.inf, 1.0, 0.0, 0.0], [0.0, np.nan, 0.0, 0.0]])
    assert boxes.inside(vectors).tolist() == [True, False, False]


# ---------------------------------------------------------------------- reward and end
def test_a_live_dream_is_paid_as_soon_as_the_model_knows() -> None:
    learner = ModelLearner(FlatCart(), learn_reward=True)
    learner.reset(seed=0)
    early = [LearnedModelEnv(learner.model, like=FlatCart(), reward=how) for how in (None, "learned")]
    many = LearnedModelVectorEnv(learner.model, 2, like=FlatCart())
    with pytest.raises(QueryError, match="knows none of its targets"):
        early[1].reset(seed=0)
    run(learner, 120)
    learner.model.finish()
    late = LearnedModelEnv(learner.model, like=FlatCart())
    rewards = []
    for dream in (*early, late):
        dream.reset(seed=0)
        rewards.append(dream.step(PUSH)[1])
    assert rewards[0] != 0.0 and len(set(rewards)) == 1
    many.reset(seed=0)
    assert many.step(np.ones((2, 1), np.float32))[1][0] == rewards[0]


def test_a_view_that_is_passed_again_loses_no_reward() -> None:
    env = FlatCart()
    view = NumbersView(env.observation_space, env.action_space)
    for again in (view, TaskView(view, terminated=False)):
        dream, known = (LearnedModelEnv(flat_model(), **given) for given in ({"view": again}, {}))
        dream.reset(seed=0), known.reset(seed=0)
        assert dream.step(PUSH)[1] == known.step(PUSH)[1] != 0.0


def test_reward_and_end_can_be_learned() -> None:
    dream = LearnedModelEnv(cart_model())
    check_env(dream, skip_render_check=True)
    observation, _ = dream.reset(options={"scene": CART_SCHEMA.scene({"cart": [40.0, 5.0]})})
    assert list(observation) == ["cart"]  # the task is no part of what an agent sees
    x, v, ends = 40.0, 5.0, []
    for _ in range(4):
        observation, reward, terminated, truncated, _ = dream.step(PUSH)
        x, v, expected, way = cart_step(x, v, 10.0)
        assert reward == pytest.approx(expected, abs=1e-9) and not truncated
        assert terminated is (way > 0.5)
        ends.append(terminated)
    assert ends == [False, True, True, True]


def test_what_the_model_says_of_a_reward_that_is_given_does_not_matter() -> None:
    # The rewards that it was shown are dice.
    env = ModelLearner(Drifter((0.5, 0.0)), view=plain_numbers, learn_reward=True, predict=False)
    env.action_space.seed(0)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(120):
        env.unwrapped.reward = float(rng.normal())
        env.step(env.action_space.sample())
    push = np.array([0.05])
    blind = LearnedModelEnv(env.model)
    blind.reset(seed=0)
    *_, truncated, info = blind.step(push)
    assert truncated and info["reason"].startswith("task.reward")
    dream = LearnedModelEnv(env.model, reward=lambda before, action, after: 7.0)
    dream.reset(seed=0)
    _, reward, _, truncated, _ = dream.step(push)
    assert (reward, truncated) == (7.0, False)
    dreams = LearnedModelVectorEnv(env.model, 2, reward=lambda layout, before, *_: np.full(len(before), 7.0))
    dreams.reset(seed=0)
    _, rewards, _, truncations, _ = dreams.step(np.stack([push, push]))
    assert (rewards.tolist(), truncations.tolist()) == ([7.0, 7.0], [False, False])


def plain_numbers(space: Any, actions: Any) -> NumbersView:
    return NumbersView(space, actions, angles=())


@pytest.mark.parametrize("told", [None, "much", np.nan, np.inf])
@pytest.mark.parametrize("what", ["reward", "terminated"])
def test_verdicts_are_finite_numbers(what: str, told: Any) -> None:
    dream = LearnedModelEnv(cart_model(), **{what: lambda *_: told})
    dream.reset(seed=0)
    was = dream.scene
    with pytest.raises(ConfigError, match=r"of a dreamed step is .*: expected a finite number; fix the"):
        dream.step(PUSH)
    assert dream.scene is was


def test_what_was_learned_of_the_task_holds_among_other_objects() -> None:
    rng = np.random.default_rng(0)

    def taught() -> ModelLearner:
        real = gym.make("relgym/TruckPush-v0", n_boxes=1)
        env = ModelLearner(real, predict=False, learn_reward=True, learn_termination=True)
        env.reset(seed=0)
        for _ in range(250):
            *_, terminated, truncated, _ = env.step(rng.uniform(-0.2, 1.0, 1))
            if terminated or truncated:
                env.reset()
        return env

    model = taught().model
    assert [str(t) for t in model.targets][-2:] == ["task.terminated", "task.reward"]
    crowd = gym.make("relgym/TruckPush-v0", n_boxes=3)
    dream = LearnedModelEnv(model, like=crowd, reward="learned", terminated="learned")
    task = crowd.get_wrapper_attr("task")
    right = []
    for episode in range(10):
        observation, info = crowd.reset(seed=episode)
        assert dream.reset(options={"scene": info["scene"]})[0].keys() == observation.keys()
        over = cut = False
        while not (over or cut):
            before, action = dream.scene, rng.uniform(-0.2, 1.0, 1)
            _, reward, over, cut, _ = dream.step(action)
            if not cut:
                expected = (
                    task.reward(before, action, dream.scene),
                    task.terminated(before, action, dream.scene),
                )
                right.append((pytest.approx(reward, abs=1e-6), over) == expected)
    assert len(right) > 20
    assert np.mean(right) > 0.9


def test_a_dream_is_evaluated_by_the_real_envs_own_task() -> None:
    real = gym.make("relgym/TruckPush-v0", task="push", n_boxes=1)
    learner = ModelLearner(gym.make("relgym/TruckPush-v0", task="push", n_boxes=1), predict=False)
    learner.action_space.seed(0)
    for episode in range(60):
        learner.reset(seed=episode)
        ended = False
        while not ended:
            _, _, terminated, truncated, _ = learner.step(learner.action_space.sample())
            ended = terminated or truncated
    dream, rng, ends = LearnedModelEnv(learner.model, like=real), np.random.default_rng(0), 0
    for episode in range(500, 510):
        real.reset(seed=episode)
        dream.reset(seed=episode)
        ended = False
        while not ended:
            action = rng.uniform(0.2, 1.0, 1).astype(np.float32)
            _, expected, terminated, ended, told = real.step(action)
            _, reward, over, truncated, info = dream.step(action)
            assert not truncated, info
            assert reward == pytest.approx(expected, abs=1e-9)
            assert (over, info["is_success"]) == (terminated, told["is_success"])
            ends += terminated
            ended = ended or terminated
    assert ends > 5


def test_what_is_given_goes_before_what_is_learned() -> None:
    dream = LearnedModelEnv(cart_model(), reward=lambda *_: 7.0)
    dream.reset(seed=0)
    assert dream.step(PUSH)[1] == 7.0
    evaluated = LearnedModelEnv(cart_model(), task=Errand(), reward="learned")
    evaluated.reset(options={"scene": CART_SCHEMA.scene({"cart": [0.0, 0.0]})})
    _, reward, terminated, _, info = evaluated.step(PUSH)
    assert reward == pytest.approx(1.0) and terminated and info["is_success"] is True


def test_what_was_not_learned_cannot_be_read(cart: ModelLearner) -> None:
    for model in (cart_model(rewarded=False), cart.model):
        with pytest.raises(QueryError, match=r"has not learned task\.reward.*pass the function itself"):
            LearnedModelEnv(model, reward="learned")


def test_what_is_no_argument_is_refused_at_once(cart: ModelLearner, tmp_path: Path) -> None:
    for arguments, message in [
        ({"start": 3}, "start=3: expected a function, or None"),
        ({"start": lambda rng, count: None}, r"expected a function of \(random generator\)"),
        ({"view": 3}, "view=3: expected a view"),
        ({"reward": lambda before, after: 0.0}, r"reward: expected a function of \(scene before, action"),
        ({"reward": np.zeros(3)}, "reward=array.*expected a function"),
    ]:
        with pytest.raises(ConfigError, match=message):
            LearnedModelEnv(cart.model, **arguments)
    with pytest.raises(
        ConfigError, match=r"expected a WorldModel or the path of its file; a ModelLearner's is env\.model"
    ):
        LearnedModelEnv(cart)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"options=\['scene'\]: expected a dict"):
        LearnedModelEnv(cart.model).reset(options=["scene"])  # type: ignore[arg-type]
    for path in ("nowhere.json", "/"):
        with pytest.raises(ModelFileError, match="can't be read"):
            LearnedModelEnv(path)
    with pytest.raises(
        ModelFileError, match=r"/nowhere/x\.json can't be written \(No such file or directory\)"
    ):
        cart.save("/nowhere/x.json")
    with pytest.raises(ModelFileError, match="is a folder: expected the path of a file"):
        cart.save(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_reward_that_is_no_number_is_refused_and_nothing_has_changed(
    cart: ModelLearner, bad: float
) -> None:
    dream = LearnedModelEnv(cart.model, reward=lambda *_: bad, horizon=1)
    dream.reset(seed=0)
    was = dream.scene
    with pytest.raises(ConfigError, match="expected a finite number; fix the reward function"):
        dream.step(PUSH)
    assert dream.scene is was


def test_reward_and_termination_are_functions_of_both_scenes(truck: ModelLearner) -> None:
    seen: list[Any] = []

    def gained(before: Scene, action: Any, after: Scene) -> float:
        seen.append(action)
        assert "action" not in before and "action" not in after
        return after["truck"]["px"] - before["truck"]["px"]

    dream = LearnedModelEnv(
        truck.model,
        like=gym.make("relgym/TruckPush-v0", n_boxes=1, resample="step"),
        reward=gained,
        terminated=lambda _before, _action, after: after["truck"]["vx"] > 100.0,
    )
    dream.reset(seed=0)
    for _ in range(40):
        _, reward, terminated, _, _ = dream.step(PUSH)
        assert reward == pytest.approx(dream.scene["truck"]["vx"], abs=1e-9)
        if terminated:
            break
    assert terminated and dream.scene["truck"]["vx"] > 100.0
    assert all(action == [1.0] for action in seen)


def test_a_dream_ends_where_the_model_knows_nothing() -> None:
    dream = LearnedModelEnv(lost_model(), reward=lambda *_: 1.0, terminated=lambda *_: True)
    before, _ = dream.reset(seed=0)
    after, reward, terminated, truncated, info = dream.step(PUSH)
    assert truncated and not terminated and reward == 0.0
    assert info["reason"].startswith("cart.v: no mode learned yet") and "cart.x: depends on" in info["reason"]
    assert info["cause"] == "no_mode"
    assert str(before) == str(after)


def test_what_knows_nothing_cannot_be_dreamed_of(truck: ModelLearner) -> None:
    ignorant = WorldModel(truck.model.schema)
    like = gym.make("relgym/TruckPush-v0", n_boxes=1, resample="step")
    dream = LearnedModelEnv(ignorant, like=like)  # live: it may learn yet
    with pytest.raises(
        QueryError, match=r"knows none of its targets \['truck.vx', 'box.px'\] after 0 transitions"
    ):
        dream.reset(seed=0)
    with pytest.raises(QueryError, match="let a ModelLearner around the real env act"):
        LearnedModelEnv(ignorant, like=like, snapshot=True)


def test_a_prediction_by_a_small_margin_is_not_followed() -> None:
    wary = {margin: LearnedModelEnv(room_model(), min_margin=margin) for margin in (0.0, 1e6)}
    for dream in wary.values():
        dream.reset(seed=0)
    assert not wary[0.0].step(0)[3]
    *_, truncated, info = wary[1e6].step(0)
    assert truncated and info["cause"] == "low_margin"
    assert (
        "leads its runner-up by too little" in info["reason"] and "expected at least 1e+06" in info["reason"]
    )
    with pytest.raises(ConfigError, match="min_margin=-1"):
        LearnedModelEnv(room_model(), min_margin=-1.0)


def test_a_dream_ends_where_it_leaves_the_observation_space(cart: ModelLearner) -> None:
    dream = LearnedModelEnv(cart.model, like=CartEnv(limit=9.5))
    dream.reset(options={"scene": cart.model.schema.scene({"cart": [9.3]})})  # 9.37, 9.433, 9.4897, 9.54073
    for _ in range(3):
        *_, truncated, info = dream.step(PUSH)
        assert not truncated and "reason" not in info
    observation, _, terminated, truncated, info = dream.step(PUSH)
    assert truncated and not terminated
    assert info["reason"] == "cart.v = 9.54073 left the observation space [-9.5, 9.5]"
    assert info["prediction"].scene["cart"]["v"] > 9.5
    assert observation in dream.observation_space


def test_a_horizon_truncates(cart: ModelLearner) -> None:
    dream = LearnedModelEnv(cart.model, horizon=3)
    for _ in range(2):
        dream.reset(seed=0)
        assert [dream.step(PUSH)[3] for _ in range(3)] == [False, False, True]
    with pytest.raises(ConfigError, match="horizon=0"):
        LearnedModelEnv(cart.model, horizon=0)


def test_the_model_is_live_unless_a_snapshot_is_wanted() -> None:
    env = ModelLearner(CartEnv())
    run(env, 50)
    dream, snapshot = LearnedModelEnv(env.model), LearnedModelEnv(env.model, snapshot=True)
    was = snapshot.model.seen
    run(env, 100)
    assert dream.model is env.model and dream.model.seen == env.model.seen
    assert snapshot.model.seen == was < env.model.seen


# ---------------------------------------------------------------------- bad input and files
def test_bad_input_names_the_remedy(cart: ModelLearner, truck: ModelLearner) -> None:
    with pytest.raises(ConfigError, match="like=env"):
        LearnedModelEnv(WorldModel(truck.model.schema))
    with pytest.raises(ConfigError, match="render_mode"):
        LearnedModelEnv(cart.model, render_mode="ascii")
    with pytest.raises(ConfigError, match="but it has up='y', planar=True"):
        LearnedModelEnv(truck.model, like=gym.make("relgym/BallBoxRamp-v0"))
    with pytest.raises(
        ConfigError, match=r"like='CartPole-v1': expected an env \(gym.make makes one of an id\)"
    ):
        LearnedModelEnv(cart.model, like="CartPole-v1")  # type: ignore[arg-type]
    with pytest.raises(
        ConfigError, match=r"functions reward and terminated.*it has no reward and no terminated"
    ):
        LearnedModelEnv(cart.model, task=object())  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="reward='learnt': expected a function"):
        LearnedModelEnv(cart.model, reward="learnt")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="make it with the arguments"):
        LearnedModelEnv(truck.model, like=gym.make("relgym/TruckPush-v0", n_boxes=1, force_range=(0, 1)))
    with pytest.raises(ConfigError, match="make it with the arguments"):
        LearnedModelEnv(cart.model, like=gym.make("CartPole-v1"))
    dream = LearnedModelEnv(cart.model)
    with pytest.raises(ResetNeeded):
        dream.step(PUSH)
    with pytest.raises(ConfigError, match="render_mode="):
        dream.render()
    dream.reset(seed=0)
    with pytest.raises(ActionError):
        dream.step(np.array([7.0]))


def test_an_env_that_cannot_be_copied_is_named(cart: ModelLearner) -> None:
    like: Any = CartEnv()
    like.lock = (k for k in range(3))  # generators can't be copied
    with pytest.raises(ConfigError, match="can't be copied"):
        LearnedModelEnv(cart.model, like=like)


def test_damaged_files_are_refused(model_file: Path, tmp_path: Path) -> None:
    (tmp_path / "short.json").write_bytes(model_file.read_bytes()[:-40])
    with pytest.raises(ModelFileError, match="truncated"):
        LearnedModelEnv(tmp_path / "short.json")


@pytest.mark.parametrize(
    ("damage", "match"),
    [
        ({"spaces": {}}, r"missing required field `observation` - at `\$\.spaces`"),
        ({"starts": [{"objects": ["cow"], "vector": [1.0]}]}, "unknown objects .*cow"),
        ({"starts": [{"objects": ["cart"], "vector": [1.0, 2.0]}]}, "expected . numbers"),
        ({"starts": [{"objects": ["cart"], "vector": [float("nan")]}]}, r"starts\[0\]\.vector\[0\]"),
        ({"metadata": 3}, r"Expected `object`, got `int` - at `\$\.metadata`"),
        ({"metadata": {"render_fps": -1}}, "expected pictures per second, got -1"),
    ],
)
def test_a_malformed_record_is_refused(cart: ModelLearner, damage: dict[str, Any], match: str) -> None:
    model = copy.deepcopy(cart.model)
    model.extra = {**cart.record.to_json(), **damage}
    with pytest.raises(ModelFileError, match=match):
        LearnedModelEnv(model)


def test_what_a_file_says_of_the_env_survives(truck: ModelLearner) -> None:
    record = truck.record
    data = json.loads(json.dumps(record.to_json()))
    assert EnvRecord.from_json(data, truck.model.schema) == record
    assert len(record.starts) == 12
    assert record.metadata == {
        "env": "relgym/TruckPush-v0",
        "arguments": {"n_boxes": 1, "resample": "step"},
        "render_fps": truck.metadata["render_fps"],
    }


def test_spaces_survive_json() -> None:
    space = spaces.Dict(
        {
            "a": spaces.Box(-1.0, np.array([1.0, 2.0], np.float32), dtype=np.float32),
            "b": spaces.Discrete(3, start=1),
            "c": spaces.Box(-np.inf, np.inf, (2, 2), dtype=np.float64),
            "d": spaces.Tuple([spaces.MultiDiscrete([2, 3], start=[1, 0]), spaces.MultiBinary(2)]),
        }
    )
    assert space_from_json(json.loads(json.dumps(space_to_json(space)))) == space
    others = spaces.Tuple(
        [
            spaces.Text(5, min_length=0, charset="abc"),
            spaces.Sequence(spaces.Box(0.0, 1.0, (2,)), stack=True),
            spaces.Graph(spaces.Box(-1.0, 1.0, (3,)), spaces.Discrete(4)),
            spaces.Graph(spaces.Discrete(4), None),
            spaces.OneOf([spaces.Discrete(2), spaces.Text(3)]),
        ]
    )
    assert space_from_json(json.loads(json.dumps(space_to_json(others)))) == others

    class Own(spaces.Space[Any]):
        pass

    with pytest.raises(ConfigError, match=r"come with Gymnasium, got .*Own"):
        space_to_json(Own())
