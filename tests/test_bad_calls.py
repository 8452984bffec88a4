"""Whatever a public call is given, it works or says what it expected: generated from the public signatures.

Every call is made with arguments that are right, but for one that is replaced by something else: another type, NaN,
infinity, a number that no float can hold, another shape, nothing at all. Nothing but relgym's own errors may come of
it, or Gymnasium's where its contract says so; and a model that refuses what it is given is, to the byte, what it was.
"""

from __future__ import annotations

import inspect
import json
import os
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import relgym.envs as envs
import relgym.wrappers as wrappers
from relgym.clustering.features import register_function
from relgym.config import ClassificationConfig, ClusteringConfig, ModelConfig
from relgym.envs.views import Angle, FunctionView, NumbersView, Part, SceneView, Static, TableView, TaskView
from relgym.errors import RelgymError
from relgym.model.world_model import WorldModel, with_action
from relgym.scene import (
    ConvexPolyhedron,
    Extractor,
    Kinematics,
    ObjectType,
    Prism,
    Scene,
    SceneSchema,
    Target,
    Transition,
    relational_state,
)
from relgym.scene.shapes import Sphere

OBSERVED = spaces.Box(-9.0, 9.0, (2,), np.float64)
PUSHES = spaces.Box(-1.0, 1.0, (1,), np.float64)
TABLE = spaces.Box(-9.0, 9.0, (3, 2), np.float64)


class Slider(gym.Env[Any, Any]):
    """x' = x + 0.1 v, v' = 0.9 v + push."""

    observation_space, action_space = OBSERVED, PUSHES

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.state = np.array([0.0, 1.0])
        return self.state.copy(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        x, v = self.state
        push = float(action[0]) if PUSHES.contains(action) else 0.0
        self.state = np.array([x + 0.1 * v, 0.9 * v + push]).clip(-9, 9)
        return self.state.copy(), 0.0, False, False, {}


@dataclass(frozen=True)
class Call:
    """A public callable, arguments that are right, and the model that it must leave as it was."""

    function: Callable[..., Any]
    arguments: dict[str, Any]
    model: WorldModel | None = None
    but: tuple[str, ...] = ()

    @property
    def parameters(self) -> list[str]:
        """Names of all parameters that can be given by name."""
        kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
        found = [p.name for p in inspect.signature(self.function).parameters.values() if p.kind in kinds]
        return sorted({*found, *self.arguments} - {"self", "cls", *self.but})


@cache
def calls() -> dict[str, Call]:
    """Every public call."""
    ball = ObjectType("ball", ("px", "py", "vx", "vy", "sx", "sy"), Sphere(), velocity=("vx", "vy", None))
    push = ObjectType("action", ("push",))
    schema = SceneSchema(
        (ball, push), (("b", "ball"), ("action", "action")), action_scale=(("push", 0.0, 1.0),)
    )
    model = WorldModel(schema)
    rng = np.random.default_rng(0)

    def scene(v: float = 1.0) -> Scene:
        return schema.scene({"b": [*rng.uniform(-1, 1, 2), v, 0.5, 1.0, 1.0], "action": [0.1]})

    for _ in range(20):
        v = float(rng.uniform(-1, 1))
        model.learn_one(Transition(scene(v), scene(0.5 * v)))
    now, layout = scene(), schema.layout(("b", "action"))
    prediction = model.predict_one(now)
    step = Transition(now, scene())
    other = WorldModel(schema)
    learner = wrappers.ModelLearner(Slider())
    learner.reset(seed=0)
    for _ in range(40):
        learner.step(rng.uniform(-1, 1, 1))
    view = learner.view
    seen = np.array([0.0, 1.0])
    file = Path(os.environ.get("TMPDIR", "/tmp")) / f"relgym-bad-calls-{os.getpid()}.json"
    learner.save(file)
    dream = envs.LearnedModelEnv(str(file))
    dream.reset(seed=0)
    world = envs.BallBoxRampEnv()
    world.reset(seed=0)
    truck = envs.TruckPushEnv()
    truck.reset(seed=0)
    flat = wrappers.FlatView(envs.BallBoxRampEnv())
    table = TableView(TABLE, PUSHES, columns=("x", "v"))
    prequential = wrappers.Prequential()
    fns: dict[str, Call] = {
        "WorldModel": Call(WorldModel, {"schema": schema}),
        "learn_one": Call(model.learn_one, {"transition": step}, model),
        "look_back": Call(
            model.look_back, {"prediction": prediction, "residuals": {("b", "vx"): 0.1}}, model
        ),
        "merge": Call(model.merge, {"other": other}, model),
        "predict_one": Call(model.predict_one, {"scene": now}, model),
        "predict_batch": Call(
            model.predict_batch, {"layout": layout, "vectors": np.zeros((2, 7)) + 1.0}, model
        ),
        "rollout": Call(model.rollout, {"scene": now, "steps": 2}, model),
        "describe": Call(model.describe, {}, model),
        "explain": Call(model.explain, {"scene": now}, model),
        "percept": Call(model.percept, {"scene": now}, model),
        "situation": Call(model.situation, {"scene": now, "index": 0}, model),
        "law_lines": Call(model.law_lines, {"scene": now, "index": 0}, model),
        "property_model": Call(model.property_model, {"type_name": "ball", "prop": "vx"}, model),
        "modes": Call(model.modes, {"type_name": "ball", "prop": "vx"}, model),
        "governs": Call(model.governs, {"target": Target("ball", "vx")}, model),
        "save": Call(model.save, {"path": str(file)}, model, but=("extra",)),
        "load": Call(WorldModel.load, {"path": str(file)}),
        "with_action": Call(with_action, {"scene": now, "values": [0.5]}),
        "ObjectType": Call(ObjectType, {"name": "ball", "properties": ("px", "vx")}),
        "Kinematics": Call(
            lambda **k: replace_schema(schema, kinematics=(Kinematics(**k),)),
            {"type": "ball", "property": "px", "rate": "vx", "step": 1.0, "uses_next": True},
        ),
        "Target": Call(
            lambda **k: WorldModel(schema, targets=(Target(**k),)),
            {"type": "ball", "property": "vx", "given": ()},
        ),
        "Transition": Call(
            lambda **k: model.learn_one(Transition(**k)), {"before": now, "after": now}, model
        ),
        "SceneSchema": Call(SceneSchema, {"types": (ball, push), "objects": (("b", "ball"),)}),
        "Scene": Call(Scene, {"schema": schema, "layout": layout, "vector": now.vector.copy()}),
        "schema.scene": Call(schema.scene, {"values": {"b": [0, 0, 1, 1, 1, 1], "action": [0.0]}}),
        "schema.layout": Call(schema.layout, {"names": ("b", "action")}),
        "schema.type": Call(schema.type, {"name": "ball"}),
        "scene.replace": Call(now.replace, {"changes": {("b", "vx"): 1.0}}),
        "scene[]": Call(now.__getitem__, {"name": "b"}),
        "object[]": Call(now["b"].__getitem__, {"prop": "vx"}),
        "layout.index": Call(layout.index, {"name": "b"}),
        "layout.column": Call(layout.column, {"index": 0, "prop": "vx"}),
        "layout.slice": Call(layout.slice, {"index": 0}),
        "layout.of_type": Call(layout.of_type, {"type_name": "ball"}),
        "Prism": Call(Prism, {"vertices": ((0, 0), (1, 0), (0, 1))}),
        "ConvexPolyhedron": Call(
            ConvexPolyhedron, {"vertices": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))}
        ),
        "Extractor": Call(Extractor, {"schema": schema}),
        "relational_state": Call(relational_state, {"scene": now}),
        "ClusteringConfig": Call(ClusteringConfig, {}),
        "ClassificationConfig": Call(ClassificationConfig, {}),
        "ModelConfig": Call(ModelConfig, {}),
        "register_function": Call(register_function, {"name": "badcalls", "function": np.tanh}),
        "BallBoxRampEnv": Call(envs.BallBoxRampEnv, {}),
        "BallGoalEnv": Call(envs.BallGoalEnv, {}),
        "TruckPushEnv": Call(envs.TruckPushEnv, {}),
        "world.reset": Call(world.reset, {}),
        "world.step": Call(world.step, {"action": 0}),
        "truck.reset": Call(truck.reset, {}),
        "truck.step": Call(truck.step, {"action": truck.action_space.sample()}),
        "LearnedModelEnv": Call(envs.LearnedModelEnv, {"model": str(file)}),
        "dream.reset": Call(dream.reset, {}),
        "dream.step": Call(dream.step, {"action": np.zeros(1)}),
        "NumbersView": Call(NumbersView, {"observation_space": OBSERVED, "action_space": PUSHES}),
        "TableView": Call(
            TableView, {"observation_space": TABLE, "action_space": PUSHES, "columns": ("x", "v")}
        ),
        "FunctionView": Call(
            FunctionView, {"schema": schema, "function": lambda seen, info: {}, "action_space": PUSHES}
        ),
        "SceneView": Call(
            SceneView,
            {
                "schema": world.schema,
                "observation_space": world.observation_space,
                "action_space": world.action_space,
            },
        ),
        "TaskView": Call(TaskView, {"view": view}),
        "Angle": Call(Angle, {"name": "th", "cos": "a", "sin": "b"}),
        "Part": Call(Part, {"name": "p", "columns": ("x",)}),
        "Static": Call(Static, {"name": "wall", "values": {"px": 1.0}}),
        "view.scene": Call(view.scene, {"observation": seen}),
        "view.with_action": Call(view.with_action, {"scene": view.scene(seen), "action": np.zeros(1)}),
        "table.scene": Call(table.scene, {"observation": np.zeros((3, 2))}),
        "ModelLearner": Call(wrappers.ModelLearner, {"env": Slider()}),
        "learner.step": Call(learner.step, {"action": np.zeros(1)}),
        "learner.reset": Call(learner.reset, {}),
        "learner.predict": Call(learner.predict, {"observation": seen, "action": np.zeros(1)}),
        "learner.save": Call(learner.save, {"path": str(file)}),
        "VectorModelLearner": Call(wrappers.VectorModelLearner, {"env": gym.vector.SyncVectorEnv([Slider])}),
        "FlatView": Call(wrappers.FlatView, {"env": envs.BallBoxRampEnv()}),
        "flat.reset": Call(flat.reset, {}),
        "ActionRepeat": Call(wrappers.ActionRepeat, {"env": Slider(), "repeat": 2}),
        "Prequential": Call(wrappers.Prequential, {}),
        "prequential.count": Call(prequential.count, {"predicted": (), "wrong": ()}),
    }
    return fns


def replace_schema(schema: SceneSchema, **changes: Any) -> SceneSchema:
    return replace(schema, **changes)


class Odd:
    """Something that nobody expects."""

    def __repr__(self) -> str:
        return "Odd()"


ODD = Odd()
BAD: list[Any] = [
    None, True, 0, 1, -1, 7, 2**31, 2**63, -(2**64), 10**400, 0.0, -0.5, 1.5, 1e308, -1e308, 5e-324,
    float("nan"), float("inf"), float("-inf"), 1j, "", "x", "ball", "ball.vx", "nan", b"", b"\xff", "\ud800", "\0",
    (), [], {}, set(), [None], [[]], [1, [2]], ["a", 1], [float("nan")], (1, 2), (1, 2, 3), ((1,),), (("a", "b"),),
    {"b": None}, {"x": float("nan")}, {"b": "text"}, {1: 2}, {("b", "vx"): float("nan")}, {("b", "vx"): 10**400},
    {"seed": 1}, {"draws": "many"}, np.array([]), np.zeros((0, 7)), np.zeros(3), np.zeros((2, 3)), np.zeros((2, 2, 2)),
    np.array(["a"]), np.array([None, 1], dtype=object), np.array([np.nan, np.inf]), np.float64("nan"), np.int64(3),
    np.array(1.0), np.full((2, 7), np.nan), np.full(7, 10.0**300), ODD, Odd, lambda: None, lambda x: x, print, int,
    range(3), iter([]), spaces.Box(-1, 1, (0,)), spaces.Dict({}), spaces.Discrete(2), spaces.Text(5), spaces.Tuple(()),
    Path("/"),
    Path("/nonexistent/file"), "/", [10**400], (float("inf"),) * 3, {"a": {"b": {}}}, slice(None), Ellipsis,
    NotImplemented,
]  # fmt: skip


def outcome(name: str, parameter: str, value: Any) -> str:
    """Empty where a call did what it may; else what it raised."""
    call = calls()[name]
    before = None if call.model is None else written(call.model)
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call.function(**{**call.arguments, parameter: value})
    except (RelgymError, gym.error.Error) as error:
        if not str(error):
            return "an error without words"
        if before is not None and call.model is not None and written(call.model) != before:
            return f"changed the model and raised {error!r}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def written(model: WorldModel) -> str:
    return json.dumps(model.to_json(history=True), sort_keys=True)


@pytest.fixture(autouse=True, scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What is saved under odd names isn't saved here."""
    before = Path.cwd()
    os.chdir(tmp_path_factory.mktemp("bad-calls"))
    yield
    os.chdir(before)


@st.composite
def bad_calls(draw: Any) -> tuple[str, str, Any]:
    name = draw(st.sampled_from(sorted(calls())))
    return name, draw(st.sampled_from(calls()[name].parameters)), draw(st.sampled_from(BAD))


@settings(
    max_examples=int(os.environ.get("RELGYM_BAD_CALLS", "400")),
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
@given(bad_calls())
def test_every_public_call_refuses_what_it_cannot_use(call: tuple[str, str, Any]) -> None:
    name, parameter, value = call
    assert not outcome(name, parameter, value), f"{name}({parameter}={value!r})"


@pytest.mark.parametrize("config", [ClusteringConfig, ClassificationConfig, ModelConfig])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf"), 10**400])
def test_configs_refuse_what_is_no_finite_number(config: Any, value: Any) -> None:
    for name in inspect.signature(config).parameters:
        with pytest.raises(RelgymError, match=name):
            config(**{name: value})
