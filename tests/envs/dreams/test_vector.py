"""Many dreams at once: the same bits as single ones, Gymnasium's contract for vector envs, and what goes wrong."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from dreams import (
    CART_SCHEMA,
    ROOM_STEPS,
    Errand,
    FlatCart,
    cart_model,
    flat_model,
    line_model,
    lost_model,
    room_model,
    starts_of,
    vectors_of,
)
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import line, room

import relgym
from relgym.envs import LearnedModelEnv, LearnedModelVectorEnv, drawn_from, in_batches
from relgym.envs.arguments import checked_actions
from relgym.envs.dreams.shown import BoxesShown, ViewShown
from relgym.envs.views import NumbersView, Static, TaskView
from relgym.errors import ActionError, ConfigError, ObservationError, QueryError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene
from relgym.wrappers.model_learner import ModelLearner

ID = "relgym/LearnedModel-v0"
MODES = list(AutoresetMode)


def carts(count: int = 4, **arguments: Any) -> LearnedModelVectorEnv:
    """Dreams of the cart."""
    return LearnedModelVectorEnv(cart_model(), count, **arguments)


def pushes(count: int, rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-1.0, 1.0, (count, 1)).astype(np.float32)


# ---------------------------------------------------------------------- the same as single dreams
WORLDS: dict[str, tuple[Callable[[], WorldModel], Callable[[int, int], Any]]] = {
    "modes": (lambda: room_model("world"), lambda seed, n: room(seed, n)),
    "laws": (lambda: room_model("auto"), lambda seed, n: room(seed, n)),
    "roles": (line_model, lambda seed, n: line(seed, n, ("light", "heavy", "light"))),
}


@pytest.mark.parametrize("world", WORLDS)
@settings(max_examples=8)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 12), min_margin=st.sampled_from([0.0, 3.0]))
def test_many_dreams_are_single_dreams_to_the_last_bit(
    world: str, seed: int, count: int, min_margin: float
) -> None:
    model, steps = WORLDS[world][0](), WORLDS[world][1](seed, count)
    starts = starts_of(model.schema, steps)

    def bounced(before: Scene, action: Any, after: Scene) -> float:
        return float((before.vector * after.vector).sum())

    options: dict[str, Any] = {"min_margin": min_margin, "horizon": 3, "reward": bounced}
    singles = [LearnedModelEnv(model, **options) for _ in starts]
    many = LearnedModelVectorEnv(
        model, count, **options | {"reward": in_batches(model.schema, bounced)}, autoreset_mode="Disabled"
    )
    seen = [single.reset(options={"scene": start})[0] for single, start in zip(singles, starts, strict=True)]
    together, _ = many.reset(options={"scenes": vectors_of(starts)})
    for _ in range(3):
        for name, values in together.items():
            np.testing.assert_array_equal(values, [each[name] for each in seen])
        stepped = [single.step(0) for single in singles]
        together, rewards, terminated, truncated, infos = many.step(np.zeros(count, dtype=np.int64))
        seen = [observation for observation, *_ in stepped]
        np.testing.assert_array_equal(rewards, [reward for _, reward, *_ in stepped])
        np.testing.assert_array_equal(terminated, [ended for _, _, ended, *_ in stepped])
        np.testing.assert_array_equal(truncated, [cut for *_, cut, _ in stepped])
        for key in ("reason", "cause"):
            said = infos.get(key, np.full(count, None))
            assert said.tolist() == [info.get(key) for *_, info in stepped]
        if truncated.any():
            break


@pytest.mark.parametrize("mode", MODES)
def test_autoreset_is_that_of_gymnasiums_own_vector_env(mode: AutoresetMode) -> None:
    rng, count = np.random.default_rng(0), 3
    horizons = {"horizon": 4}
    alone = SyncVectorEnv(
        [
            lambda: LearnedModelEnv(cart_model(), task=Errand(), start=_begin, **horizons)
            for _ in range(count)
        ],
        autoreset_mode=mode,
    )
    many = carts(count, task=Errand(), start=_begin_many, autoreset_mode=mode, **horizons)
    assert many.metadata["autoreset_mode"] is mode
    seen, together = alone.reset(seed=1)[0], many.reset(seed=1)[0]
    ends = 0
    for _ in range(14):
        for name, values in together.items():
            np.testing.assert_array_equal(values, seen[name])
        action = pushes(count, rng)
        seen, *expected, told = alone.step(action)
        together, *found, infos = many.step(action)
        for a, b in zip(expected, found, strict=True):
            np.testing.assert_array_equal(a, b)
            assert a.dtype == b.dtype
        over = found[1] | found[2]
        ends += int(over.sum())
        if mode is AutoresetMode.SAME_STEP and over.any():
            np.testing.assert_array_equal(told["_final_obs"], infos["_final_obs"])
            for k in np.flatnonzero(over):
                np.testing.assert_array_equal(told["final_obs"][k]["cart"], infos["final_obs"][k]["cart"])
            for key in ("reason", "is_success"):  # what was said of the others stays where it is
                there = {name for name in (key, f"_{key}") if name in infos}
                assert there == {name for name in (key, f"_{key}") if name in told}
                if there:
                    np.testing.assert_array_equal(infos[f"_{key}"], told[f"_{key}"])
            told, infos = told["final_info"], infos["final_info"]
            np.testing.assert_array_equal(told["is_success"][over], infos["is_success"][over])
        if found[2].any():
            assert infos["cause"][found[2]].tolist() == told["cause"][found[2]].tolist()
            np.testing.assert_array_equal(infos["_cause"], found[2])
        if mode is AutoresetMode.DISABLED and over.any():
            with pytest.raises(ResetNeeded, match="reset_mask"):
                many.step(action)
            seen, together = (envs.reset(options={"reset_mask": over})[0] for envs in (alone, many))
    assert ends >= 3


def _begin(rng: np.random.Generator) -> Scene:
    return CART_SCHEMA.scene({"cart": [-3.0, 0.0]})


def _begin_many(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.repeat([[-3.0, 0.0, 0.0, 0.0]], count, axis=0)


def test_resets_of_a_real_env_are_those_of_single_dreams() -> None:
    truck = gym.make("relgym/TruckPush-v0", n_boxes=1, task=None)
    model = relgym.wrappers.ModelLearner(gym.make("relgym/TruckPush-v0", n_boxes=1, resample="step"))
    model.action_space.seed(0)
    for episode in range(8):
        model.reset(seed=episode)
        for _ in range(20):
            model.step(model.action_space.sample())
    alone = SyncVectorEnv([lambda: LearnedModelEnv(model.model, like=truck) for _ in range(3)])
    many = LearnedModelVectorEnv(model.model, 3, like=truck)
    options = {"box1_friction": 0.25}
    assert str(many.reset()[0]) != str(many.reset()[0])
    for name, values in alone.reset(seed=5, options=options)[0].items():
        np.testing.assert_array_equal(many.reset(seed=5, options=options)[0][name], values)
    for action in (np.ones((3, 1), np.float32), np.full((3, 1), -0.3)):
        expected, together = alone.step(action)[0], many.step(action)[0]
        for name, values in together.items():
            np.testing.assert_array_equal(values, expected[name])


def test_dreams_through_a_view_are_single_dreams_too() -> None:
    alone = SyncVectorEnv([lambda: LearnedModelEnv(flat_model(), like=FlatCart(), horizon=3)] * 3)
    many = LearnedModelVectorEnv(flat_model(), 3, like=FlatCart(), horizon=3)
    expected, together = alone.reset(seed=2)[0], many.reset(seed=2)[0]
    assert together in many.observation_space
    rng = np.random.default_rng(0)
    for _ in range(3):
        np.testing.assert_array_equal(together, expected)
        action = pushes(3, rng)
        expected, *flags, _ = alone.step(action)
        together, *found, _ = many.step(action)
        for a, b in zip(flags, found, strict=True):
            np.testing.assert_array_equal(a, b)
    assert found[2].all()
    same = LearnedModelVectorEnv(flat_model(), 2, horizon=1, autoreset_mode="SameStep")
    same.reset(seed=0)
    *_, infos = same.step(pushes(2, rng))
    assert all(last in same.single_observation_space for last in infos["final_obs"])


@pytest.mark.parametrize("space", [spaces.Discrete(3), spaces.Box(-1, 1, (2,)), spaces.MultiDiscrete([2, 3])])
def test_actions_through_a_view_are_those_of_single_scenes(space: spaces.Space) -> None:
    view = NumbersView(spaces.Box(-9, 9, (2,), np.float64), space)
    deeds = ViewShown(view, spaces.Box(-9, 9, (2,), np.float64), space).deeds()
    space.seed(0)
    vectors, actions = np.arange(10.0).reshape(5, 2), np.array([space.sample() for _ in range(5)])
    joined = deeds.joined(vectors, deeds.checked(actions, 5))
    for vector, action, both in zip(vectors, actions, joined, strict=True):
        np.testing.assert_array_equal(view.with_action(view.scene(vector), action).vector, both)
    np.testing.assert_array_equal(deeds.parted(joined), vectors)


@pytest.mark.parametrize("told", [False, True])
def test_views_of_numbers_show_many_scenes_as_one(told: bool, rng: np.random.Generator) -> None:
    """Angles, constants, several keys, coarse numbers: the same bits in arrays, and the same limits."""
    keys = {
        "hand": spaces.Box(-1.0, 1.0, (2,), np.float32),
        "gear": spaces.Discrete(3),
        "load": spaces.Box(-5.0, 5.0, (1,), np.float64),
    }
    space, acting = spaces.Dict(keys), spaces.Discrete(2)
    view: Any = NumbersView(
        space, acting, angles=[("hand.x0", "hand.x1")], static=[Static("wall", {"at": 3.0})]
    )
    view = TaskView(view) if told else view
    shown = ViewShown(view, space, acting)
    vectors = rng.uniform(-6.0, 6.0, (300, shown.layout.width))
    seen, inside = shown.observations(vectors), shown.inside(vectors)
    assert 0.1 < inside.mean() < 0.9
    left = shown.outside(shown.layout, vectors)
    for k, vector in enumerate(vectors):
        one = Scene(view.schema, shown.layout, vector.copy())
        assert inside[k] == (left[k] == "")
        if inside[k]:
            for key, part in shown.observation(one).items():
                np.testing.assert_array_equal(seen[key][k], part)


def test_what_a_subclass_of_a_view_changes_holds_for_many_too() -> None:
    class Clipped(NumbersView):
        def observation(self, scene: Scene) -> Any:
            return np.clip(super().observation(scene), -1.0, 1.0)

    class Doubled(NumbersView):
        def with_action(self, scene: Scene, action: Any) -> Scene:
            return super().with_action(scene, 2.0 * action)

    space, acting = FlatCart().observation_space, FlatCart().action_space
    start = {"scene": flat_model().schema.scene({"self": [5.0, -4.0]})}
    push = np.array([[0.5]], np.float32)
    for kind in (Clipped, Doubled):
        alone = LearnedModelEnv(flat_model(), view=kind(space, acting))
        many = LearnedModelVectorEnv(flat_model(), 1, view=kind(space, acting))
        np.testing.assert_array_equal(many.reset(options=start)[0][0], alone.reset(options=start)[0])
        np.testing.assert_array_equal(many.step(push)[0][0], alone.step(push[0])[0])


def test_the_limits_of_boxes_are_those_of_what_they_show() -> None:
    seen = spaces.Dict({"cart": spaces.Box(-100, 100, (2,), np.int64)})
    boxes = BoxesShown(CART_SCHEMA, seen, spaces.Box(-1.0, 1.0, (1,), np.float32))
    assert boxes.inside(np.array([[100.4, 0.6, 0.0, 0.0], [100.6, 0.0, 0.0, 0.0]])).tolist() == [True, False]
    assert boxes.observations(np.array([[100.4, 0.6, 0.0, 0.0]]))["cart"].tolist() == [[100, 1]]
    most = np.iinfo(np.int64)
    wide = spaces.Dict({"cart": spaces.Box(most.min, most.max, (2,), np.int64)})
    boxes = BoxesShown(CART_SCHEMA, wide, spaces.Box(-1.0, 1.0, (1,), np.float32))
    ends = np.array([[2.0**63, 0.0, 0.0, 0.0], [2.0**62, 0.0, 0.0, 0.0], [-(2.0**63), 0.0, 0.0, 0.0]])
    assert boxes.inside(ends).tolist() == [False, True, True]


def test_many_switches_are_thrown_at_once() -> None:
    """A batch of MultiBinary actions is an int8 Box to Gymnasium; agents send what they like."""
    space = spaces.MultiBinary(2)
    for sent in (np.array([[1, 0], [0, 1]]), np.array([[1.0, 0.0], [0.0, 1.0]], np.float32)):
        found = checked_actions(space, sent, 2)
        assert (found.tolist(), found.dtype) == ([[1, 0], [0, 1]], np.int8)
    for bad in (np.array([[1, 2], [0, 1]]), np.array([1, 0]), "on"):
        with pytest.raises(ActionError, match="expected 2 actions of MultiBinary"):
            checked_actions(space, bad, 2)


# ---------------------------------------------------------------------- what Gymnasium asks
def test_make_vec_needs_a_file_alone(tmp_path: Path) -> None:
    room_model("world").save(tmp_path / "room.json")
    envs = gym.make_vec(ID, num_envs=5, model=str(tmp_path / "room.json"), max_episode_steps=3)
    assert isinstance(envs.unwrapped, LearnedModelVectorEnv)
    observations, infos = envs.reset(seed=3)
    assert observations in envs.observation_space and infos == {}
    for name, values in observations.items():
        assert values.shape == envs.observation_space[name].shape
        assert values[0] in envs.single_observation_space[name]
    for expected in (False, False, True):
        *_, truncated, _ = envs.step(envs.action_space.sample())
        assert truncated.tolist() == [expected] * 5
    again = gym.make_vec(envs.spec)
    assert str(again.reset(seed=3)[0]) == str(observations)
    single = gym.make(ID, model=str(tmp_path / "room.json"))
    assert single.observation_space == envs.single_observation_space
    assert single.action_space == envs.single_action_space


def test_gymnasiums_vector_wrappers_go_round_it() -> None:
    envs: Any = gym.wrappers.vector.RecordEpisodeStatistics(carts(3, horizon=5))
    envs = gym.wrappers.vector.ClipReward(envs, 0.0, 1.0)
    envs.reset(seed=0)
    for _ in range(5):
        _, rewards, _, truncated, infos = envs.step(np.ones((3, 1), np.float32))
    assert truncated.all() and infos["episode"]["l"].tolist() == [5, 5, 5]
    assert ((rewards >= 0.0) & (rewards <= 1.0)).all()


def test_seeds_decide_where_dreams_begin() -> None:
    envs = carts(40)
    first, again, other = (envs.reset(seed=seed)[0]["cart"] for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    assert set(first[:, 0].tolist()) == {0.0, 1.0, 2.0, 3.0}  # the model's first scenes


def test_observations_belong_to_the_caller() -> None:
    envs = carts(2)
    observations, _ = envs.reset(seed=0)
    was = envs.vectors.copy()
    observations["cart"] += 1.0
    envs.step(np.ones((2, 1)))[0]["cart"][:] = np.nan
    assert np.isfinite(envs.vectors).all() and (envs.vectors != was).any()
    with pytest.raises(ValueError, match="read-only"):
        envs.vectors[0, 0] = 1.0


@pytest.mark.parametrize("through", [copy.deepcopy, lambda envs: pickle.loads(pickle.dumps(envs))])
def test_copies_go_on_alike_and_apart(through: Any) -> None:
    envs = carts(3, horizon=3)
    envs.reset(seed=0)
    envs.step(np.ones((3, 1)))
    twin = through(envs)
    for _ in range(4):  # over a reset
        assert str(twin.step(np.ones((3, 1)))) == str(envs.step(np.ones((3, 1))))
    twin.step(-np.ones((3, 1)))
    assert (twin.vectors != envs.vectors).any()


def test_dreams_are_drawn() -> None:
    envs = LearnedModelVectorEnv(room_model("world"), 2, render_mode="rgb_array")
    envs.reset(seed=0)
    pictures = envs.render()
    assert len(pictures) == 2
    for picture in pictures:
        assert picture.dtype == np.uint8 and picture.shape[2] == 3 and len(np.unique(picture)) > 3
    envs.close()
    with pytest.raises(ConfigError, match="render_mode='rgb_array'"):
        carts().render()
    with pytest.raises(ConfigError, match="render_mode='human'"):
        carts(render_mode="human")


def test_the_model_is_live_unless_a_snapshot_is_wanted() -> None:
    model = copy.deepcopy(cart_model())
    live, apart = (LearnedModelVectorEnv(model, 2, snapshot=snapshot) for snapshot in (False, True))
    assert live.model is model and apart.model is not model


# ---------------------------------------------------------------------- where dreams begin
def test_first_scenes_can_be_drawn_from_arrays_and_scenes() -> None:
    scenes = [CART_SCHEMA.scene({"cart": [x, 1.0], "task": [0.0, 0.0]}) for x in (10.0, 20.0)]
    for given_ in (scenes, vectors_of(scenes)):
        envs = carts(30, start=drawn_from(given_))
        assert set(envs.reset(seed=0)[0]["cart"][:, 0].tolist()) == {10.0, 20.0}
    with pytest.raises(ConfigError, match="some scenes with the same objects"):
        drawn_from([])
    wild = np.concatenate([vectors_of(scenes), np.full((1, 4), np.nan)])  # whether or not it would be drawn
    with pytest.raises(ObservationError, match="start: scene 2 can't begin here"):
        carts(1, start=drawn_from(wild)).reset(seed=0)


def test_scenes_to_draw_from_may_name_their_objects_in_any_order() -> None:
    model = room_model()
    starts = starts_of(model.schema, ROOM_STEPS[:4])
    turned = replace(model.schema, objects=tuple(reversed(model.schema.objects)))
    other = [turned.scene(each.values()) for each in starts]
    assert other[0].layout.names != starts[0].layout.names
    for scenes in (starts, other):
        envs = LearnedModelVectorEnv(model, 3, start=drawn_from(scenes))
        envs.reset(seed=0)
        assert {tuple(v) for v in envs.vectors} <= {tuple(each.vector) for each in starts}
    with pytest.raises(ConfigError, match="the same ones in another order"):
        drawn_from([starts[0], other[0]])(np.random.default_rng(0), 1)
    learned = LearnedModelVectorEnv(cart_model(), 2, start=drawn_from([cart_start()]))
    learned.reset(seed=0)
    assert learned.vectors.shape == (2, 4)
    with pytest.raises(ObservationError, match="expected the objects"):
        LearnedModelVectorEnv(cart_model(), 2, start=drawn_from(starts))
    for bad in ([1], [], np.zeros(3), 5):
        with pytest.raises(ConfigError, match=r"expected (some )?scenes"):
            drawn_from(bad)  # type: ignore[arg-type]


def test_a_step_whose_new_beginnings_fail_is_not_made() -> None:
    broken = [False]

    def start(rng: np.random.Generator, count: int) -> Any:
        return np.full((count, 4), np.nan if broken[0] else 0.0)

    envs = LearnedModelVectorEnv(cart_model(), 2, start=start, horizon=2, autoreset_mode="SameStep")
    envs.reset(seed=0)
    envs.step(np.ones((2, 1), np.float32))
    was, broken[0] = envs.vectors.copy(), True
    with pytest.raises(ObservationError, match="start: dream 0 can't begin here"):
        envs.step(np.ones((2, 1), np.float32))
    np.testing.assert_array_equal(envs.vectors, was)
    broken[0] = False
    *_, cut, infos = envs.step(np.ones((2, 1), np.float32))
    assert cut.all() and infos["_final_obs"].all()


def test_who_evaluates_changes_nothing() -> None:
    def greedy(_layout: Any, before: Any, _actions: Any, after: Any) -> Any:
        after -= before
        return after[:, 0]

    envs = carts(2, reward=greedy)
    envs.reset(seed=0)
    with pytest.raises(ValueError, match="read-only"):
        envs.step(np.ones((2, 1), np.float32))


def test_some_dreams_begin_anew_and_the_others_go_on() -> None:
    envs = carts(3)
    envs.reset(seed=0)
    envs.step(np.ones((3, 1)))
    was = envs.vectors.copy()
    mask = np.array([False, True, False])
    options = {"reset_mask": mask, "scene": CART_SCHEMA.scene({"cart": [33.0, 0.0]})}
    observations, _ = envs.reset(options=options)
    assert observations["cart"][1].tolist() == [33.0, 0.0]
    np.testing.assert_array_equal(envs.vectors[[0, 2]], was[[0, 2]])
    assert set(options) == {"reset_mask", "scene"}  # as it was


def test_first_scenes_must_be_of_this_world() -> None:
    envs = carts(2)
    with pytest.raises(ResetNeeded):
        envs.step(np.ones((2, 1)))
    with pytest.raises(ResetNeeded, match="without a mask first"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    for options, message in [
        ({"scenes": np.zeros((3, 4))}, r"expected 2 first scenes.*shape \(2, 4\).*got shape \(3, 4\)"),
        ({"scenes": np.full((2, 4), np.nan)}, "dream 0 can't begin here"),
        (
            {"scenes": np.array([[0.0] * 4, [2e4, 0, 0, 0]])},
            r"dream 1 can't begin here: cart\.x = 20000 left",
        ),
        ({"scene": {"cart": [0.0, 0.0]}}, "expected a start scene, got dict"),
    ]:
        with pytest.raises(ObservationError, match=message):
            envs.reset(options=options)
    with pytest.raises(ConfigError, match="unknown reset options"):
        envs.reset(options={"v": 1.0})
    for mask in (np.zeros(2, dtype=bool), np.ones(3, dtype=bool), [True, False]):
        with pytest.raises(ConfigError, match="reset_mask"):
            envs.reset(options={"reset_mask": mask})


# ---------------------------------------------------------------------- reward and end
def test_reward_and_end_can_be_learned() -> None:
    envs = carts(2, reward="learned", terminated="learned")
    starts = [CART_SCHEMA.scene({"cart": [x, 0.0]}) for x in (0.0, 49.5)]
    envs.reset(options={"scenes": starts})
    _, rewards, terminated, _, _ = envs.step(np.array([[1.0], [1.0]]))
    np.testing.assert_allclose(rewards, [1.0, 1.0], rtol=0, atol=1e-9)
    assert terminated.tolist() == [False, True]


def test_what_depends_on_something_unknown_has_no_margin_alone_or_among_many() -> None:
    model, start = lost_model(), CART_SCHEMA.scene({"cart": [0.0, 1.0], "action": [0.0], "task": [0.0, 0.0]})
    one, many = model.predict_one(start), model.predict_batch(start.layout, start.vector[None])
    assert [part.margin for part in one.parts] == many.margins[0].tolist() == [0.0, 0.0]


def test_a_dream_that_knows_nothing_ends_and_the_reason_is_told() -> None:
    envs = LearnedModelVectorEnv(lost_model(), 2, autoreset_mode="Disabled", reward=lambda *_: np.ones(2))
    before, _ = envs.reset(seed=0)
    after, rewards, terminated, truncated, infos = envs.step(np.ones((2, 1)))
    assert truncated.all() and not terminated.any() and not rewards.any()
    assert infos["cause"].tolist() == ["no_mode"] * 2
    assert infos["reason"][0].startswith("cart.v: no mode learned yet")
    assert str(before) == str(after)


def test_a_dream_ends_where_it_leaves_the_observation_space() -> None:
    envs = carts(2, autoreset_mode="Disabled")
    envs.reset(options={"scenes": [CART_SCHEMA.scene({"cart": [x, 5.0]}) for x in (0.0, 9_999.0)]})
    *_, truncated, infos = envs.step(np.ones((2, 1)))
    assert truncated.tolist() == [False, True]
    assert infos["cause"].tolist() == [None, "left"]
    assert infos["reason"][1] == "cart.x = 10004.5 left the observation space [-10000, 10000]"
    assert envs.vectors[1, 0] == 9_999.0


# ---------------------------------------------------------------------- bad input
def test_bad_input_names_the_remedy() -> None:
    for arguments, message in [
        ({"count": 0}, "num_envs=0"),
        ({"horizon": 0}, "horizon=0"),
        ({"max_episode_steps": 0}, "max_episode_steps=0"),
        ({"autoreset_mode": "never"}, r"autoreset_mode='never': expected one of \['NextStep'"),
        ({"min_margin": float("nan")}, "min_margin=nan"),
        ({"start": 3}, "start=3: expected a function, or None"),
        ({"start": lambda rng: None}, r"expected a function of \(random generator, count\)"),
        ({"reward": np.zeros(2)}, "reward=array.*expected a function, 'learned' or None"),
        (
            {"reward": lambda before, action, after: 0.0},
            r"reward: .*in_batches\(schema, function\) makes one",
        ),
        ({"view": 3}, "view=3: expected a view"),
    ]:
        with pytest.raises(ConfigError, match=message):
            carts(**arguments)
    for model in (None, 3):
        with pytest.raises(ConfigError, match="expected a WorldModel or the path of its file"):
            LearnedModelVectorEnv(model, 2)  # type: ignore[arg-type]
    for options, error, message in [
        (["scene"], ConfigError, "expected a dict such as"),
        ({"scenes": None}, ObservationError, r"options\['scenes'\]: expected 2 first scenes"),
        ({1: 2, "x": 3}, ConfigError, "unknown reset options"),
    ]:
        with pytest.raises(error, match=message):
            carts(2).reset(options=options)  # type: ignore[arg-type]
    with pytest.raises(ObservationError, match="start: expected 2 first scenes"):
        carts(2, start=lambda rng, n: None).reset()
    with pytest.raises(QueryError, match="let a ModelLearner around the real env act"):
        LearnedModelVectorEnv(WorldModel(CART_SCHEMA), 2, like=cart_start(), snapshot=True)
    envs = carts(2)
    envs.reset(seed=0)
    for actions, message in [
        (np.ones((3, 1)), r"expected actions of shape \(2, 1\)"),
        (np.array([[0.0], [7.0]]), "action 1 of 2 lies outside"),
        (np.array([[0.0], [np.nan]]), "action 1 of 2 lies outside"),
        ("push", "expected numbers of shape"),
    ]:
        with pytest.raises(ActionError, match=message):
            envs.step(actions)


def cart_start() -> Scene:
    return CART_SCHEMA.scene({"cart": [0.0, 0.0]})


def test_terminations_that_are_no_numbers_are_refused() -> None:
    envs = carts(2, terminated=lambda *_: np.array([0.0, np.nan]))
    envs.reset(seed=0)
    with pytest.raises(ConfigError, match="the termination of dreamed step 1 of 2 is nan"):
        envs.step(np.ones((2, 1)))
    with pytest.raises(ConfigError, match=r"expected an object with functions rewards and terminations"):
        carts(2, task=object())


def test_pictures_mark_where_to_go() -> None:
    pytest.importorskip("pygame")
    real = gym.make("relgym/BallGoal-v0")
    learner = ModelLearner(real, predict=False)
    learner.reset(seed=0)
    for _ in range(40):
        learner.step(learner.action_space.sample())
    envs = LearnedModelVectorEnv(learner.model, 2, like=real, render_mode="rgb_array")
    envs.reset(seed=0)
    for picture in envs.render():
        assert (np.abs(picture.astype(int) - np.array([255, 214, 92])).max(axis=2) < 3).mean() > 0.0005


def test_rewards_that_are_no_numbers_are_refused_and_nothing_has_changed() -> None:
    for reward, message in [
        (
            lambda _layout, before, _actions, _after: np.where(before[:, 0] > 0, np.nan, 0.0),
            "step 1 of 2 is nan",
        ),
        (lambda *_: np.ones(3), r"expected an array of 2 numbers .*got one of shape \(3,\)"),
        (lambda *_: None, "reward: expected an array of 2 numbers .*got None"),
        (lambda *_: [[1.0], [1.0, 2.0]], "reward: expected an array of 2 numbers"),
        (lambda *_: 1.0, r"in_batches\(schema, function\) makes one"),
    ]:
        envs = carts(2, reward=reward)
        envs.reset(options={"scenes": [CART_SCHEMA.scene({"cart": [x, 5.0]}) for x in (-9.0, 9.0)]})
        was = envs.vectors.copy()
        with pytest.raises(ConfigError, match=message):
            envs.step(np.ones((2, 1)))
        np.testing.assert_array_equal(envs.vectors, was)
