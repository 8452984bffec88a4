"""ModelLearner around envs that know nothing of scenes."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from carts import run
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from plain_envs import Crates, Slider, Wheel

from relgym.envs.views import FunctionView, NumbersView, Part, Rows, Static, TableView, TaskView
from relgym.errors import ConfigError, ObservationError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere
from relgym.wrappers import ModelLearner
from relgym.wrappers.views import chosen_view

PUSH = np.array([0.5])
PUSHES = spaces.Box(-1.0, 1.0, (1,), np.float64)
PLANE = spaces.Box(-9.0, 9.0, (2,), np.float64)


def slider_view(observation_space: Any, action_space: Any) -> NumbersView:
    return NumbersView(observation_space, action_space, names=("x", "v"))


def everything(model: WorldModel) -> dict[str, Any]:
    return model.to_json(history=True)


# ---------------------------------------------------------------------- one line
def test_any_env_passes_through_untouched() -> None:
    bare, watched = run(Slider(), 60), run(ModelLearner(Slider()), 60)
    assert str(bare) == str(watched)


def test_the_law_of_a_bare_env_in_one_line() -> None:
    env = ModelLearner(Slider(), view=slider_view)
    run(env, 120)
    (mode,) = env.model.modes("self", "v")
    assert mode.formula(6) == "v' = 0.8 v + 0.5 action.a"


def test_angles_are_settled_at_the_first_reset() -> None:
    env = ModelLearner(Wheel())
    with pytest.raises(ResetNeeded, match=r"cosine and sine.*call reset\(\) first, or pass view="):
        _ = env.model
    run(env, 60)
    assert env.view.schema.type("self").properties == ("angle_x0",)
    (mode,) = env.model.modes("self", "angle_x0")
    assert mode.formula(4) == "angle_x0' = angle_x0 + action.a + 0.7"
    assert env.prequential.recent < 1.0  # float32's rounding isn't counted as wrong


def test_declared_views_know_their_model_at_once() -> None:
    space, actions = Wheel().observation_space, Wheel().action_space
    assert ModelLearner(Wheel(), view=NumbersView(space, actions, angles=())).model.seen == 0
    assert ModelLearner(Wheel(bound=2.0)).model.seen == 0


def test_reward_and_termination_are_learned_on_demand() -> None:
    env = ModelLearner(Slider(limit=4.0), view=slider_view, learn_reward=True, learn_termination=True)
    env.action_space.seed(0)
    ended = 0
    for k in range(12):
        env.reset(seed=k)
        for _ in range(30):
            *_, terminated, _, _ = env.step(env.action_space.sample())
            if terminated:
                ended += 1
                break
    assert ended
    assert {"task.reward", "task.terminated"} <= {str(target) for target in env.model.targets}
    assert env.scene.layout.names == ("self",)  # what a step brought belongs to the transition
    (still,) = [m for m in env.model.modes("task", "terminated") if m.formula() == "terminated' = 0"]
    assert still.examples > 0


def test_a_view_may_be_json_or_a_function_of_the_spaces() -> None:
    by_function = ModelLearner(Slider(), view=slider_view)
    by_json = ModelLearner(Slider(), view=by_function.view.to_json())
    assert by_json.view.schema == by_function.view.schema
    with pytest.raises(ConfigError, match="expected a view"):
        ModelLearner(Slider(), view=3)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="expected a view"):
        ModelLearner(Slider(), view=lambda observation_space, action_space: None)  # type: ignore[arg-type, return-value]


def test_an_env_with_scenes_and_a_task_object_is_not_given_another() -> None:
    schema = SceneSchema((ObjectType("task", ("reward",)),), (("task", "task"),))
    space = spaces.Dict({"task": spaces.Box(-1.0, 1.0, (1,), np.float64)})
    with pytest.raises(ConfigError, match="leave out learn_reward"):
        chosen_view(None, space, PUSHES, schema=schema, reward=True)
    assert isinstance(chosen_view(None, PLANE, PUSHES, reward=True), TaskView)


class Camera(gym.ObservationWrapper[Any, Any, Any]):
    def __init__(self, env: gym.Env[Any, Any], space: spaces.Space[Any]) -> None:
        super().__init__(env)
        self.observation_space = space

    def observation(self, observation: Any) -> Any:
        return self.observation_space.sample()


@pytest.mark.parametrize(
    ("space", "message"),
    [
        (spaces.Box(0, 255, (8, 8, 3), np.uint8), "image"),
        (spaces.Box(-1, 1, (5, 4), np.float32), "view=TableView"),
        (spaces.Dict({"a": spaces.Dict({"b": spaces.Discrete(2)})}), "nested"),
    ],
)
def test_what_shows_no_objects_is_refused_when_wrapped(space: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ModelLearner(Camera(Slider(), space))
    eye = SceneSchema((ObjectType("eye", ("sum",)),), (("eye", "eye"),))
    view = FunctionView(eye, lambda seen, info: {"eye": [info["limit"]]}, PUSHES)
    env = ModelLearner(Camera(Slider(), space), view=view)
    run(env, 3)
    assert env.model.seen == 3


# ---------------------------------------------------------------------- bad observations
@pytest.mark.parametrize("says", [np.array([np.nan, 0.0]), np.zeros(3), {"x": 1.0}])
def test_bad_observations_are_raised_and_nothing_is_learned(says: Any) -> None:
    env = ModelLearner(Slider())
    run(env, 30)
    before = everything(env.model)
    inner = env.unwrapped
    assert isinstance(inner, Slider)
    inner.says = says
    with pytest.raises(ObservationError, match=r"call reset.* or skip and count.*bad_observations='skip'"):
        env.step(PUSH)
    assert everything(env.model) == before


@pytest.mark.parametrize("says", [np.array([np.nan, 0.0]), np.zeros(3), {"x": 1.0}])
def test_bad_observations_are_skipped_and_counted_on_demand(says: Any) -> None:
    env = ModelLearner(Slider(), bad_observations="skip", view=slider_view)
    inner = env.unwrapped
    assert isinstance(inner, Slider)
    run(env, 50)
    for bad in (1, 2):
        inner.says = says
        for _ in range(bad):
            report = env.step(PUSH)[4]["relgym"]
            assert report.learned is None and report.prediction is None
        inner.says = None
        assert env.step(PUSH)[4]["relgym"].learned is None  # a transition from nowhere
        assert env.step(PUSH)[4]["relgym"].learned is not None
    assert env.skipped == 3
    assert env.model.seen == 52
    assert len(env.model.modes("self", "v")) == 1
    inner.says = says
    env.reset()
    assert env.skipped == 4


def test_a_reward_that_is_no_number_is_bad_too() -> None:
    class Lost(Slider):
        def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
            seen, _, *rest = super().step(action)
            return seen, float("nan"), *rest

    env = ModelLearner(Lost(), learn_reward=True)
    env.reset(seed=0)
    with pytest.raises(ObservationError, match="the reward: expected a finite number, got nan"):
        env.step(PUSH)
    without = ModelLearner(Lost())
    run(without, 5)
    assert without.model.seen == 5


def test_an_object_that_changes_its_type_is_raised_or_skipped() -> None:
    ball, brick = ObjectType("ball", ("x",)), ObjectType("brick", ("x",))
    schema = SceneSchema((ball, brick), (("thing", "ball"),))

    def kinds(seen: Any, info: Any) -> Any:
        return {"thing": ("ball" if seen[0] < 0.0 else "brick", [seen[0]])}

    env = ModelLearner(Slider(), view=FunctionView(schema, kinds, PUSHES), bad_observations="skip")
    run(env, 100)
    assert 0 < env.skipped < 104
    strict = ModelLearner(Slider(), view=FunctionView(schema, kinds, PUSHES))
    with pytest.raises(ObservationError, match="'thing' changed its type"):
        run(strict, 100)


def test_the_flag_has_two_values() -> None:
    with pytest.raises(ConfigError, match="expected 'raise' or 'skip'"):
        ModelLearner(Slider(), bad_observations="ignore")  # type: ignore[arg-type]


# ---------------------------------------------------------------------- files, specs, copies
def test_a_model_file_holds_the_view(tmp_path: Path) -> None:
    env = ModelLearner(Wheel(), learn_reward=True)
    run(env, 40)
    env.save(tmp_path / "wheel.json", history=True)
    extra = WorldModel.load(tmp_path / "wheel.json").extra
    assert extra["view"] == env.view.to_json()
    again = ModelLearner(Wheel(), view=extra["view"], model=tmp_path / "wheel.json")
    run(again, 10)
    assert again.model.seen == 50


def test_the_spec_rebuilds_views_and_options() -> None:
    gym.register("tests/Slider-v0", Slider)
    try:
        env = ModelLearner(
            gym.make("tests/Slider-v0"), view=slider_view, bad_observations="skip", learn_reward=True
        )
        assert env.spec is not None
        again = gym.make(env.spec)
        assert again.get_wrapper_attr("view").schema == env.view.schema
        assert again.get_wrapper_attr("view").schema.type("self").properties == ("x", "v")
    finally:
        gym.registry.pop("tests/Slider-v0")


@pytest.mark.parametrize("angles", ["auto", (), [("c", "s")]])
def test_the_spec_of_a_view_may_be_written_and_read(angles: Any) -> None:
    gym.register("tests/Wheel-v0", "plain_envs:Wheel")
    try:
        inner = gym.make("tests/Wheel-v0", bound=1.0)
        view = NumbersView(inner.observation_space, inner.action_space, names=("c", "s"), angles=angles)
        env = ModelLearner(inner, view=TaskView(view), config={"features": ("trig",)}, targets=None)
        assert env.spec is not None
        again = gym.make(EnvSpec.from_json(env.spec.to_json()))
        for learner in (env, again):
            learner.reset(seed=0)
        assert again.get_wrapper_attr("view").schema == env.view.schema
        assert again.get_wrapper_attr("model").config == env.model.config
        assert again.get_wrapper_attr("view") is not env.view
    finally:
        gym.registry.pop("tests/Wheel-v0")


def test_a_view_made_of_a_function_stays_an_object_in_the_spec() -> None:
    gym.register("tests/Slider-v0", Slider)
    try:
        eye = SceneSchema((ObjectType("eye", ("sum",)),), (("eye", "eye"),))
        view = FunctionView(eye, lambda seen, info: {"eye": [info["limit"]]}, PUSHES)
        env = ModelLearner(gym.make("tests/Slider-v0"), view=view)
        assert env.spec is not None
        assert gym.make(env.spec).get_wrapper_attr("view").schema == env.view.schema
    finally:
        gym.registry.pop("tests/Slider-v0")


def test_parts_and_copies() -> None:
    parts = [Part("place", ("x0",)), Part("speed", ("x1",))]
    space, actions = Slider().observation_space, Slider().action_space
    env = ModelLearner(Slider(), view=NumbersView(space, actions, parts=parts))
    run(env, 60)
    twin = copy.deepcopy(env)
    run(twin, 5)
    assert (env.model.seen, twin.model.seen) == (60, 65)
    formulas = [m.formula(6) for m in env.model.modes("place", "x0")]
    assert formulas == ["x0' = x0 + 0.5 action.a + 0.8 speed.x1"]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_who_lies_on_the_floor_lies_there_in_float32_too(dtype: type, tmp_path: Path) -> None:
    env = Crates(dtype)
    crates = Rows(
        "crate",
        2,
        shape=Sphere(),
        pose={"px": "x", "py": "y"},
        velocity=("vx", None, None),
        constants={"sx": 1.0, "sy": 1.0, "sz": 1.0},
    )
    ground = {"py": -0.4, "sx": 200.0, "sy": 1.0, "sz": 1.0}
    view = TableView(
        env.observation_space,
        env.action_space,
        columns=("x", "y", "vx"),
        rows=[crates],
        static=[Static("floor", ground, shape=Box())],
    )
    learner = ModelLearner(env, view=view, targets=["crate.vx"])
    run(learner, 300, length=5)
    wrong = learner.prequential.recent
    assert wrong < 0.15  # what is claimed waits for a record of what came true
    learner.save(tmp_path / "crates.json")
    loaded = WorldModel.load(tmp_path / "crates.json")
    assert loaded.schema.precision == view.precision == (0.0 if dtype is np.float64 else view.precision)
    assert (loaded.schema.precision > 0.0) is (dtype is np.float32)


def test_files_that_say_nothing_of_precision_are_gone_on_from(tmp_path: Path) -> None:
    """They are of an earlier day; the model keeps what it knew."""
    learner = ModelLearner(Wheel())
    run(learner, 40)
    old = WorldModel(replace(learner.model.schema, precision=0.0))
    old.save(tmp_path / "old.json", history=True)
    again = ModelLearner(Wheel(), view=learner.view, model=tmp_path / "old.json")
    run(again, 20)
    assert (again.model.seen, again.model.schema.precision) == (20, 0.0)
