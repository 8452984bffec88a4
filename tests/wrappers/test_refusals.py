"""What learners refuse, and that what the message says to do works."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from carts import run
from gymnasium import spaces
from gymnasium.wrappers import FlattenObservation, TransformAction, TransformObservation
from plain_envs import Slider

from relgym.config import ModelConfig
from relgym.envs.agents import AgentsSpace
from relgym.envs.spaces_json import space_to_json
from relgym.envs.views import FunctionView, NumbersView, Part, SceneView, TableView, TaskView
from relgym.errors import ConfigError, ObservationError
from relgym.planning import PlanningAgent
from relgym.planning.actions import ActionCoder
from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema
from relgym.wrappers import ModelLearner, VectorModelLearner
from relgym.wrappers.views import readable

PUSHES = Slider().action_space
NUMBER = spaces.Box(-9.0, 9.0, (2,), np.float64)


class Seen(gym.Env[Any, Any]):
    """Shows random elements of a space, and takes actions of another one."""

    def __init__(self, space: spaces.Space[Any], actions: spaces.Space[Any] = PUSHES) -> None:
        self.observation_space, self.action_space = space, actions

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.observation_space.seed(seed)
        return self.observation_space.sample(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        assert self.action_space.contains(action)
        return self.observation_space.sample(), 0.0, False, False, {}


def learns(env: gym.Env[Any, Any], **arguments: Any) -> ModelLearner:
    learner = ModelLearner(env, **arguments)
    run(learner, 3)
    assert learner.model.seen == 3
    return learner


# ---------------------------------------------------------------------- observation spaces
def test_a_table_in_a_dict_is_shown_alone_or_flattened() -> None:
    env = Seen(spaces.Dict({"cars": spaces.Box(-9.0, 9.0, (3, 2)), "ego": NUMBER}))
    with pytest.raises(ConfigError, match=r"seen\['cars'\].*view=TableView.*FlattenObservation"):
        ModelLearner(env)
    alone: Any = TransformObservation(env, lambda seen: seen["cars"], env.observation_space["cars"])
    view = TableView(alone.observation_space, alone.action_space, columns=("x", "v"))
    learns(alone, view=view)
    learns(FlattenObservation(env))


def test_keys_that_would_be_one_object_are_named_by_the_user() -> None:
    env = Seen(spaces.Dict({"a b": NUMBER, "a_b": NUMBER}))
    with pytest.raises(ConfigError, match=r"keys 'a b' and 'a_b' would both be objects 'a_b'.*parts=\[Part"):
        ModelLearner(env)
    parts = [Part("other", {"x0": "a_b.x0", "x1": "a_b.x1"})]
    view = NumbersView(env.observation_space, env.action_space, parts=parts)
    assert learns(env, view=view).scene.layout.names == ("other", "a_b")


def test_a_key_called_action_is_given_another_name() -> None:
    env = Seen(spaces.Dict({"action": NUMBER, "x": NUMBER}))
    with pytest.raises(
        ConfigError, match=r"can't be called 'action'.*parts=\[Part\('other', \{'x0': 'action.x0'"
    ):
        ModelLearner(env)
    parts = [Part("last", {"x0": "action.x0", "x1": "action.x1"})]
    view = NumbersView(env.observation_space, env.action_space, parts=parts)
    assert learns(env, view=view).scene.layout.names == ("last", "x")


# ---------------------------------------------------------------------- action spaces
STEPS = spaces.Discrete(2)


@pytest.mark.parametrize(
    "space", [spaces.Dict({"a": spaces.Dict({"b": STEPS})}), spaces.Tuple([STEPS, spaces.Text(3)])]
)
def test_nested_actions_are_made_of_flat_ones(space: Any) -> None:
    env = Seen(NUMBER, space)
    with pytest.raises(ConfigError, match=r"TransformAction\(env, function, space\)"):
        ModelLearner(env)
    within = isinstance(space, spaces.Dict)
    learns(TransformAction(env, lambda step: {"a": {"b": step}} if within else (step, "abc"), STEPS))


@pytest.mark.parametrize("kind", [spaces.Dict, spaces.Tuple])
def test_actions_may_have_parts(kind: Any, tmp_path: Path) -> None:
    parts: Any = {"grip": spaces.Discrete(3), "push": PUSHES}
    space = spaces.Dict(parts) if kind is spaces.Dict else spaces.Tuple(tuple(parts.values()))
    place = "push" if kind is spaces.Dict else 1

    def made(grip: int, push: Any) -> Any:
        return {"grip": grip, "push": push} if kind is spaces.Dict else (grip, push)

    env = ModelLearner(TransformAction(Slider(), lambda acted: acted[place], space))
    run(env, 100)
    assert env.model.seen == 100 and env.skipped == 0
    observation, _ = env.reset(seed=1)
    acted = made(2, np.array([0.5]))
    (came, *_), told = env.unwrapped.step(np.array([0.5])), env.predict(observation, acted)
    np.testing.assert_allclose(told.scene["self"].values, came)  # the law reads the part that pushes
    scene = env.view.scene(env.observation_space.sample())
    wide = np.full(PUSHES.shape, 9.0)  # outside, but an env may take it
    taken = env.view.with_action(scene, readable(space, made(2, wide)))
    assert taken["action"].values.tolist() == [2.0, *wide, 0.0, 0.0, 1.0]
    wrong: list[Any] = [0, None, {"grip": 2}, (2,), made(7, wide), made(0, wide[:0]), made(0, wide * np.nan)]
    assert [readable(space, each) for each in wrong] == [None] * len(wrong)

    env.save(tmp_path / "model.json")
    dream = gym.make("relgym/LearnedModel-v0", model=tmp_path / "model.json")
    assert dream.action_space == space
    dream.reset(seed=0)
    dream.step(dream.action_space.sample())
    with pytest.raises(ConfigError, match="dreamt one at a time"):
        gym.make_vec("relgym/LearnedModel-v0", num_envs=2, model=tmp_path / "model.json")
    with pytest.raises(ConfigError, match="can't plan actions of"):
        ActionCoder(space)
    with pytest.raises(ConfigError, match=r"TransformAction\(env, function, space\) inside"):
        PlanningAgent(TransformAction(Slider(), lambda acted: acted[place], space))


def test_of_many_envs_with_parts_each_action_is_learned_from() -> None:
    space = spaces.Dict({"grip": spaces.Discrete(3), "push": PUSHES})
    one = lambda: TransformAction(Slider(), lambda acted: acted["push"], space)  # noqa: E731
    envs = VectorModelLearner(gym.vector.SyncVectorEnv([one, one]))
    envs.reset(seed=0)
    envs.action_space.seed(0)
    for _ in range(30):
        envs.step(envs.action_space.sample())
    assert envs.model.seen == 60
    assert envs.model.schema.type_of("action").properties[:2] == ("grip", "push")


def test_a_tuples_action_may_be_an_array() -> None:
    both = spaces.Tuple((spaces.Discrete(3), spaces.Discrete(2)))
    env = learns(Seen(NUMBER, both))
    env.step(np.array([2, 1]))
    assert (env.model.seen, env.skipped) == (4, 0)


def test_parts_that_cannot_be_named_are_refused_with_a_remedy() -> None:
    two = spaces.Discrete(2)
    spaced = learns(Seen(NUMBER, spaces.Dict({"left arm": two, "1": two})))
    assert spaced.model.schema.type_of("action").properties == ("_1", "left_arm")
    with pytest.raises(ConfigError, match=r"actions: \['a_is_0'\] name both"):
        ModelLearner(Seen(NUMBER, spaces.Dict({"a": spaces.Discrete(3), "a_is_0": two})))
    with pytest.raises(ConfigError, match="actions: names of an action's numbers: expected 3 different"):
        ModelLearner(Seen(NUMBER, spaces.Dict({"m": spaces.MultiBinary(2), "m1": two})))
    for none in (spaces.Dict({}), spaces.Tuple(())):
        with pytest.raises(ConfigError, match="has no parts"):
            ModelLearner(Seen(NUMBER, none))
    agents = AgentsSpace({"a": two, "b": two})
    with pytest.raises(ConfigError, match="AgentsView"):
        NumbersView(NUMBER, agents)
    with pytest.raises(ConfigError, match="leave the action out of the schema"):
        FunctionView(PUSHED, lambda seen: {"body": seen}, spaces.Dict({"push": PUSHES}))
    numbered = spaces.Dict([(0, two), (1, two)])
    with pytest.raises(ConfigError, match=r"keys are strings, got \[0, 1\]"):
        space_to_json(numbered)


BODY = SceneSchema((ObjectType("body", ("x", "v")),), (("body", "body"),))
PUSHED = SceneSchema(
    (ObjectType("body", ("x", "v")), ObjectType("action", ("push",))),
    (("body", "body"), ("action", "action")),
)


@pytest.mark.parametrize("made_for", [spaces.Discrete(2), spaces.Discrete(3), spaces.Box(-1.0, 1.0, (2,))])
def test_a_view_of_other_actions_is_refused(made_for: Any) -> None:
    views: list[Any] = [
        NumbersView(NUMBER, made_for),
        TaskView(NumbersView(NUMBER, made_for)),
        FunctionView(BODY, lambda seen, info: {"body": seen}, made_for),
    ]
    for view in views:
        with pytest.raises(ConfigError, match=r"made for actions of .*make it with env\.action_space"):
            ModelLearner(Slider(), view=view)
    table = TableView(spaces.Box(-9.0, 9.0, (2, 2)), made_for, columns=("x", "v"))
    with pytest.raises(ConfigError, match=r"make it with env\.action_space"):
        ModelLearner(Seen(spaces.Box(-9.0, 9.0, (2, 2))), view=table)


def test_a_schema_with_other_actions_is_refused_and_the_right_one_is_not() -> None:
    view = FunctionView(PUSHED, lambda seen, info: {"body": seen}, PUSHES)
    learns(Slider(), view=view)
    with pytest.raises(ConfigError, match="declare one property for each number"):
        ModelLearner(Seen(NUMBER, spaces.Box(-1.0, 1.0, (2,))), view=view)
    shown = spaces.Dict({"body": NUMBER})
    with pytest.raises(ConfigError, match="declare one property for each number"):
        ModelLearner(Seen(shown, spaces.Box(-1.0, 1.0, (2,))), view=SceneView(PUSHED, shown, PUSHES))
    # Bounds are the env's affair.
    learns(Slider(), view=NumbersView(NUMBER, spaces.Box(-5.0, 5.0, (1,))))


def test_a_view_of_the_users_own_need_not_know_of_checks() -> None:
    class Own:
        """All that `View` asks for."""

        matches, precision = False, 0.0

        def __init__(self) -> None:
            self._inner = NumbersView(NUMBER, PUSHES)
            self.schema = self._inner.schema
            for name in ("scene", "with_action", "with_outcome", "observation"):
                setattr(self, name, getattr(self._inner, name))

        def to_json(self) -> dict[str, Any]:
            return {"kind": "function"}

    learns(Slider(), view=Own())


# ---------------------------------------------------------------------- what a function returns
@pytest.mark.parametrize("wrong", ["hello", [1.0, "a"]])
def test_what_a_function_returns_is_skipped_or_named(wrong: Any) -> None:
    view = FunctionView(BODY, lambda seen, info: {"body": wrong}, PUSHES)
    env = ModelLearner(Slider(), view=view, bad_observations="skip")
    run(env, 2)
    assert (env.skipped, env.model.seen) == (3, 0)
    with pytest.raises(ObservationError, match="'body' of type 'body': expected 2 numbers"):
        ModelLearner(Slider(), view=view).reset()


# ---------------------------------------------------------------------- configurations
@pytest.mark.parametrize(
    ("config", "message"),
    [
        (3, "expected a ModelConfig, or a dict"),
        ({"features": "trig"}, r"such as \('trig',\), got 'trig'"),
        ({"features": (3,)}, "must be a tuple of names"),
        ({"features": 3}, "must be a tuple of names"),
        ({"features": ("crat:trig",)}, r"for type 'crat'; expected one of \['self'\]"),
        ({"features": ("trig(nope)",)}, r"properties \['nope'\]; expected some of \['x0', 'x1'\]"),
        ({"features": ("trig(a)",)}, r"properties \['a'\]"),
        ({"features": ("trgi",)}, "'trgi' is unknown"),
        ({"clustering": 3}, "config="),
    ],
)
def test_configurations_that_mean_nothing_are_refused(config: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ModelLearner(Slider(), config=config)


def test_features_may_be_a_list() -> None:
    assert ModelLearner(Slider(), config={"features": ["self:trig(x0)"]}).model.config == ModelConfig(
        features=("self:trig(x0)",)
    )


def test_what_is_no_env_no_target_and_nothing_to_learn_of() -> None:
    with pytest.raises(ConfigError, match=r"expected an env, got 'CartPole-v1': gym\.make makes one"):
        ModelLearner("CartPole-v1")  # type: ignore[arg-type]
    for wrong in (3, ("ball",), "vx", {}):
        with pytest.raises(
            ConfigError, match=r"target .*: expected 'ball\.vx', \('ball', 'vx'\) or a Target"
        ):
            ModelLearner(Slider(), targets=[wrong])  # type: ignore[list-item]
    bare = Slider()
    bare.observation_space = spaces.Dict({})
    with pytest.raises(ConfigError, match="has no parts: expected some numbers to learn of"):
        ModelLearner(bare)
