"""All public callables, each with arguments that are right: what generated tests of bad calls begin with.

`surface` lists every function, constructor and method that the packages' `__all__` offer. Arguments that are right are
looked up by name (`RIGHT`), or for one callable (`OTHERWISE`); what nobody thought of here is an error of the test.
"""

from __future__ import annotations

import atexit
import importlib
import inspect
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, get_origin

import gymnasium as gym
import numpy as np
from gymnasium import spaces

import relgym.envs as envs
import relgym.wrappers as wrappers
from relgym.clustering.features import register_function
from relgym.data import DataLearner, Dataset
from relgym.envs.views import (
    Angle,
    FunctionView,
    NumbersView,
    Part,
    Rows,
    SceneView,
    Static,
    TableView,
    TaskView,
)
from relgym.errors import ModelFileError
from relgym.hypotheses import Examples, Law, Proposal, register_hypothesis
from relgym.logic import Clause, Definition, Literal, facts_from_tuples, world_of
from relgym.model.world_model import WorldModel, with_action
from relgym.planning import (
    ActionCoder,
    Coverage,
    CrossEntropy,
    EnvSimulator,
    Explore,
    Familiar,
    ModelSimulator,
    Objective,
    PathIntegral,
    Planner,
    PlanningAgent,
    RandomShooting,
    TreeSearch,
)
from relgym.planning.planner import PlannerState
from relgym.scene import (
    Extractor,
    Kinematics,
    ObjectType,
    Scene,
    SceneSchema,
    Target,
    Transition,
    relational_state,
)
from relgym.scene.shapes import Sphere
from relgym.thesis.model import ThesisModel

__all__ = ["FACADES", "LEFT_OUT", "Public", "Slider", "surface"]

FACADES = (
    "relgym",
    "relgym.config",
    "relgym.data",
    "relgym.envs",
    "relgym.envs.views",
    "relgym.hypotheses",
    "relgym.logic",
    "relgym.planning",
    "relgym.scene",
    "relgym.thesis.model",
    "relgym.thesis.settings",
    "relgym.wrappers",
)
"""Packages whose `__all__` is what users may call."""

LEFT_OUT = {
    **{
        f"{kind}.from_json": "takes what view_from_json, which is tried, has checked"
        for kind in ("NumbersView", "Part", "Rows", "SceneView", "Static", "TableView")
    },
    "Dataset.from_minari": "Minari's data sets, an extra",
    "Dataset.to_minari": "Minari's data sets, an extra",
    "FunctionView.observation": "needs the inverse of a function; tried by tests of its own",
    "WorldModel.name_condition": "needs a learned condition; tried by tests of its own",
    "AgentsEnv": "PettingZoo's envs, an extra",
    "AgentsSpace": "Gymnasium's own Dict space but for one method",
    "AgentsView": "its spaces are those of PettingZoo's envs",
    "logic.Coverage": "two counts",
    "Deviation": "a record of text",
    "DoubtedTask": "needs a reward model; tried by tests of its own",
    "OptimisticTask": "needs a DoubtedTask; tried by tests of its own",
    "EnvState": "what get_state gives, for set_state",
    "Examples": "what hypothesis classes are given",
    "FlatSpec": "tried as part of FlatView",
    "Flattener": "tried as part of FlatView",
    "Plan": "what searches give",
    "Relations": "what Extractor gives",
    "SceneEnv": "a base class; its children are tried",
    "SceneObject": "what scenes give",
    "StepReport": "what learners give",
    "Steps": "what simulators give",
    "TargetModel": "a part of ThesisModel",
    "Task": "a base class of tasks",
    "World": "what world_of gives",
}
"""Public names that users don't make or call themselves, and why they aren't tried."""


OBSERVED = spaces.Box(-9.0, 9.0, (2,), np.float64)
PUSHES = spaces.Box(-1.0, 1.0, (1,), np.float64)
ROWS = spaces.Box(-9.0, 9.0, (3, 2), np.float64)


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
class Public:
    """One public callable.

    Attributes
    ----------
    function
        It, bound to an object where it is a method.
    arguments
        Those that it needs, right ones.
    owner
        The object that it is bound to; None for functions and constructors.
    """

    function: Callable[..., Any]
    arguments: dict[str, Any]
    owner: Any = None

    @property
    def parameters(self) -> list[str]:
        """Names of all that can be given by name."""
        kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
        found = {p.name for p in inspect.signature(self.function).parameters.values() if p.kind in kinds}
        return sorted(found | self.arguments.keys())


@cache
def _kit() -> dict[str, Any]:
    """Things to make calls with."""
    ball = ObjectType("ball", ("px", "py", "vx", "vy", "sx", "sy"), Sphere(), velocity=("vx", "vy", None))
    push = ObjectType("action", ("push",))
    schema = SceneSchema(
        (ball, push), (("b", "ball"), ("action", "action")), action_scale=(("push", 0.0, 1.0),)
    )
    rng = np.random.default_rng(0)
    model, thesis = WorldModel(schema), ThesisModel(schema, targets=[Target("ball", "vx")])

    def scene(v: float = 1.0) -> Scene:
        return schema.scene({"b": [*rng.uniform(-1, 1, 2), v, 0.5, 1.0, 1.0], "action": [0.1]})

    for _ in range(20):
        v = float(rng.uniform(-1, 1))
        step = Transition(scene(v), scene(0.5 * v))
        model.learn_one(step)
        thesis.learn_one(step)
    truck = envs.TruckPushEnv()
    taught = wrappers.ModelLearner(envs.TruckPushEnv(), learn_reward=True, learn_termination=True)
    taught.action_space.seed(0)
    taught.reset(seed=0)
    for _ in range(40):
        *_, over, cut, _ = taught.step(taught.action_space.sample())
        if over or cut:
            taught.reset()
    observed, _ = truck.reset(seed=0)
    facts, _ = facts_from_tuples([{"near": [(0, 1)]}, {"near": [(1, 0)]}], [(0, 1), (0, 1)])
    clause = Clause((Literal("near", (0, 1)),))
    layout = schema.layout(("b", "action"))
    now = scene()
    simulator = EnvSimulator(envs.TruckPushEnv())
    start = simulator.state(observed)
    learner = wrappers.ModelLearner(Slider())
    learner.reset(seed=0)
    for _ in range(20):
        learner.step(rng.uniform(-1, 1, 1))
    folder = Path(tempfile.mkdtemp(prefix="relgym-bad-calls-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    model.save(folder / "model.relgym")
    thesis.save(folder / "thesis.relgym")
    register_hypothesis(_Doubling())
    return {
        "file": folder / "model.relgym",
        "thesis file": folder / "thesis.relgym",
        "ball": ball,
        "schema": schema,
        "model": model,
        "thesis": thesis,
        "scene": now,
        "step": Transition(now, scene()),
        "layout": layout,
        "vectors": np.stack([now.vector, scene(0.3).vector]),
        "relations": Extractor(schema).extract(layout, np.stack([now.vector])),
        "state": relational_state(now),
        "prediction": model.predict_one(now),
        "truck": truck,
        "truck model": taught.model,
        "truck view": taught.view,
        "observed": observed,
        "start": start,
        "simulator": simulator,
        "coder": ActionCoder(truck.action_space),
        "data": Dataset.collect(envs.TruckPushEnv(), 12, seed=0),
        "facts": facts,
        "clause": clause,
        "world": world_of(facts, 0),
        "learner": learner,
        "tree": TreeSearch(horizon=2, expansions=8, batch=4, hold=1, patience=8),
        "sequence": CrossEntropy(horizon=2, candidates=4, rounds=1),
    }


def _made(kind: str) -> Any:
    """An object of a public class, to call its methods; None for one whose methods take nothing."""
    kit = _kit()
    makers: dict[str, Callable[[], Any]] = {
        "ActionCoder": lambda: kit["coder"],
        "Angle": lambda: Angle("a", "b"),
        "ActionRepeat": lambda: _begun(wrappers.ActionRepeat(Slider(), 2)),
        "BallBoxRampEnv": lambda: _begun(envs.BallBoxRampEnv()),
        "BallGoalEnv": lambda: _begun(envs.BallGoalEnv()),
        "BoxPushEnv": lambda: _begun(envs.BoxPushEnv()),
        "Clause": lambda: kit["clause"],
        "planning.Coverage": lambda: Coverage(range(len(kit["start"]))),
        "CrossEntropy": lambda: kit["sequence"],
        "DataLearner": lambda: DataLearner(kit["data"]),
        "Dataset": lambda: kit["data"],
        "Definition": lambda: Definition((kit["clause"],)),
        "EnvSimulator": lambda: kit["simulator"],
        "Episode": lambda: kit["data"].episodes[0],
        "Explore": lambda: _begun(Explore(Slider())),
        "Extractor": lambda: Extractor(kit["schema"]),
        "Facts": lambda: kit["facts"],
        "Familiar": lambda: Familiar(kit["simulator"], Coverage(range(len(kit["start"])))),
        "FlatView": lambda: _begun(wrappers.FlatView(envs.TruckPushEnv())),
        "FunctionView": lambda: FunctionView(kit["schema"], lambda seen, info: {"b": [0, 0, 1, 0, 1, 1]}, PUSHES),
        "LearnedModelEnv": lambda: _begun(envs.LearnedModelEnv(kit["truck model"], kit["truck"])),
        "LearnedModelVectorEnv": lambda: _begun(envs.LearnedModelVectorEnv(kit["truck model"], 2, kit["truck"])),
        "Literal": lambda: Literal("near", (0, 1)),
        "ModelConfig": lambda: None,
        "ModelLearner": lambda: kit["learner"],
        "ModelSimulator": lambda: ModelSimulator(kit["truck model"], kit["truck"]),
        "NumbersView": lambda: NumbersView(OBSERVED, PUSHES),
        "ObjectType": lambda: kit["ball"],
        "PathIntegral": lambda: PathIntegral(horizon=2, candidates=4, rounds=1),
        "Part": lambda: Part("p", ("x",)),
        "Planner": lambda: Planner(kit["simulator"], kit["sequence"]),
        "PlanningAgent": lambda: PlanningAgent(envs.TruckPushEnv(), search=kit["sequence"], random_steps=4),
        "Prequential": wrappers.Prequential,
        "RandomShooting": lambda: RandomShooting(horizon=2, candidates=4),
        "RelationalState": lambda: kit["state"],
        "Rows": lambda: Rows("r"),
        "Scene": lambda: kit["scene"],
        "SceneLayout": lambda: kit["layout"],
        "SceneSchema": lambda: kit["schema"],
        "SceneView": lambda: SceneView(kit["truck"].schema, kit["truck"].observation_space, kit["truck"].action_space),
        "Static": lambda: Static("wall", {"px": 1.0}),
        "TableView": lambda: TableView(ROWS, PUSHES, columns=("x", "v")),
        "TaskView": lambda: TaskView(NumbersView(OBSERVED, PUSHES)),
        "ThesisModel": lambda: kit["thesis"],
        "ThesisSettings": lambda: None,
        "TreeSearch": lambda: kit["tree"],
        "TruckPushEnv": lambda: _begun(envs.TruckPushEnv()),
        "TruncatedEpisodes": lambda: _begun(wrappers.TruncatedEpisodes(Slider(), 5)),
        "VectorFlatView": lambda: _begun(wrappers.VectorFlatView(_vector(envs.TruckPushEnv))),
        "VectorModelLearner": lambda: _begun(wrappers.VectorModelLearner(_vector(Slider))),
        "WorldModel": lambda: kit["model"],
    }  # fmt: skip
    return makers[kind]()


def _begun(env: Any) -> Any:
    env.reset(seed=0)
    return env


def _vector(make: Callable[[], gym.Env[Any, Any]]) -> gym.vector.SyncVectorEnv:
    return gym.vector.SyncVectorEnv([make, make])


def _right(name: str, parameter: str) -> Any:
    """An argument that is right."""
    own = _otherwise().get(name, {})
    return own[parameter] if parameter in own else _by_name()[parameter]


@cache
def _by_name() -> dict[str, Any]:
    """Arguments that are right wherever a parameter has that name."""
    kit = _kit()
    return {
        "action": np.zeros(1),
        "action_space": PUSHES,
        "actions": np.zeros((2, 1)),
        "after": kit["step"].after,
        "args": (0, 1),
        "before": kit["scene"],
        "body": 0,
        "bound": (0,),
        "changes": {("b", "vx"): 1.0},
        "clause": kit["clause"],
        "clauses": (kit["clause"],),
        "coder": kit["coder"],
        "columns": ("x", "v"),
        "condition": "x > 0",
        "config": None,
        "cos": "a",
        "coverage": Coverage(range(len(kit["start"]))),
        "data": kit["data"],
        "deadline": None,
        "definition": Definition((kit["clause"],)),
        "env": Slider(),
        "episodes": kit["data"].episodes,
        "error": None,
        "errors": np.array([0.1, 0.2]),
        "facts": kit["facts"],
        "function": lambda seen, info: {},
        "given": {},
        "index": 0,
        "k": 0,
        "layout": kit["layout"],
        "literal": Literal("near", (0, 1)),
        "literals": (Literal("near", (0, 1)),),
        "model": kit["model"],
        "name": "b",
        "names": ("b", "action"),
        "negatives": np.array([[1, 0]]),
        "now": kit["start"],
        "numeric": {},
        "object_name": "b",
        "objective": Objective(),
        "objects": (("b", "ball"),),
        "observation": np.array([0.0, 1.0]),
        "observation_space": OBSERVED,
        "observations": np.zeros((3, 2)),
        "path": str(Path("model.json")),
        "positives": np.array([[0, 0]]),
        "prediction": kit["prediction"],
        "prop": "vx",
        "properties": ("px", "vx"),
        "property": "px",
        "rate": "vx",
        "relation": "near",
        "relations": kit["relations"],
        "repeat": 2,
        "residuals": {("b", "vx"): 0.1},
        "resolution": 1e-9,
        "rng": np.random.default_rng(0),
        "scene": kit["scene"],
        "scenes": [kit["scene"]],
        "schema": kit["schema"],
        "simulator": kit["simulator"],
        "sin": "b",
        "space": PUSHES,
        "start": kit["start"],
        "states": np.stack([kit["start"]] * 2),
        "steps": 2,
        "target": Target("ball", "vx"),
        "transition": kit["step"],
        "tuples": np.array([[0, 0]]),
        "type": "ball",
        "type_name": "ball",
        "types": (kit["ball"],),
        "values": {"b": [0, 0, 1, 1, 1, 1], "action": [0.0]},
        "vector": kit["scene"].vector,
        "vectors": kit["vectors"],
        "view": NumbersView(OBSERVED, PUSHES),
        "warm": None,
        "weight": 0.1,
        "world": kit["world"],
    }


@cache
def _otherwise() -> dict[str, dict[str, Any]]:
    """Arguments of single callables that differ from those that `_by_name` gives."""
    kit = _kit()
    truck, pushed = kit["truck"], kit["truck"].action_space
    held = np.zeros((2, *pushed.shape))
    seen, start = kit["observed"], kit["start"]
    numbers, table = NumbersView(OBSERVED, PUSHES), TableView(ROWS, PUSHES, columns=("x", "v"))
    scenes = SceneView(truck.schema, truck.observation_space, pushed)
    of_truck = {"schema": truck.schema, "observation_space": truck.observation_space, "action_space": pushed}
    rows = {
        "observations": np.ones((3, 6)),
        "actions": np.zeros((3, 1)),
        "next_observations": np.ones((3, 6)),
    }
    found: dict[str, dict[str, Any]] = {
        "ActionCoder.actions": {"latents": np.zeros((2, kit["coder"].size))},
        "Clause.from_dict": {"plain": kit["clause"].to_dict()},
        "Dataset": of_truck,
        "Dataset.from_arrays": {"actions": np.zeros((3, 1))},
        "Dataset.from_episodes": {"observation_space": truck.observation_space, "action_space": pushed},
        "Definition.from_dict": {"plain": Definition((kit["clause"],)).to_dict()},
        "Episode": {"observations": np.zeros((3, 2)), "actions": np.zeros((2, 1))},
        "Explore.step": {"action": np.zeros(1)},
        "Facts.arity": {"name": "near"},
        "Facts.relation": {"name": "near"},
        "Facts": {"relations": {}, "exists": np.ones((1, 2), dtype=np.bool_)},
        "FunctionView.scene": {"observation": np.zeros(4)},
        "Kinematics": {"type": "ball", "property": "px", "rate": "vx"},
        "LearnedModelEnv": {"model": kit["truck model"], "like": truck},
        "LearnedModelVectorEnv": {"model": kit["truck model"], "like": truck},
        "Literal": {"relation": "near"},
        "Literal.from_dict": {"plain": Literal("near", (0, 1)).to_dict()},
        "Literal.rename": {"names": {0: 1, 1: 0}},
        "ModelConfig.from_json": {"data": {}},
        "ModelConfig.of": {"given": {}},
        "ModelSimulator": {"model": kit["truck model"], "like": truck},
        "NumbersView.from_json": {"data": numbers.to_json()},
        "NumbersView.observations": {
            "layout": numbers.scene(np.zeros(2)).layout,
            "vectors": np.stack([numbers.scene(np.zeros(2)).vector]),
        },
        "ObjectType": {"name": "ball"},
        "Part": {"name": "p", "columns": ("x",)},
        "Part.from_json": {"data": Part("p", ("x",)).to_json()},
        "Planner.act": {"thread": PlannerState()},
        "PlanningAgent.learn": {"total_steps": 2},
        "PlanningAgent.mistaken": {"steps": []},
        "Prism": {"vertices": ((0, 0), (1, 0), (0, 1))},
        "Prequential.count": {"predicted": (), "wrong": ()},
        "planning.Coverage": {"columns": [0, 1]},
        "planning.Coverage.add": {"state": start},
        "RelationalState": {"relations": {"near": frozenset({("b", "c")})}},
        "RelationalState.tuples": {"name": "intersect"},
        "Rows": {"name": "r"},
        "Rows.from_json": {"data": Rows("r").to_json()},
        "Compound": {"parts": (((0, 0), (1, 0), (0, 1)),)},
        "ConvexPolyhedron": {"vertices": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))},
        "SceneLayout.of_type": {"type_name": "ball"},
        "SceneView": of_truck,
        "SceneView.from_json": {"data": scenes.to_json()},
        "Static": {"name": "wall", "values": {"px": 1.0}},
        "Static.from_json": {"data": Static("wall", {"px": 1.0}).to_json()},
        "TableView": {"observation_space": ROWS},
        "TableView.from_json": {"data": table.to_json()},
        "TableView.scene": {"observation": np.zeros((3, 2))},
        "SceneSchema.type": {"name": "ball"},
        "Target": {"type": "ball", "property": "vx"},
        "VectorFlatView": {"env": _vector(envs.TruckPushEnv)},
        "VectorModelLearner": {"env": _vector(Slider)},
        "ThesisModel": {"targets": [Target("ball", "vx")]},
        "ThesisModel.load": {"path": str(kit["thesis file"])},
        "WorldModel.load": {"path": str(kit["file"])},
        "WorldModel.load_with_extra": {"path": str(kit["file"])},
        "WorldModel.fit": rows,
        "WorldModel.progressive": rows,
        "WorldModel.score": rows,
        "WorldModel.merge": {"other": WorldModel(kit["schema"])},
        "WorldModel.modes": {"prop": "vx"},
        "code_length": {"errors": np.array([0.1, 0.2])},
        "contact_features": {},
        "drawn_from": {"scenes": [kit["scene"]]},
        "facts_from_tuples": {"worlds": [{"near": [(0, 1)]}], "objects": [(0, 1)]},
        "in_batches": {"function": lambda before, action, after: 0.0},
        "register_hypothesis": {"kind": _Doubling()},
        "registered": {"name": "doubling"},
        "render_scene": {"scene": truck.scene},
        "score": {"model": kit["truck model"]},
        "unary": {},
        "view_from_json": {"data": numbers.to_json()},
        "view_of": {"env": Slider()},
        "world_of": {"index": 0},
    }
    for name in ("BallBoxRampEnv", "BallGoalEnv", "BoxPushEnv", "TruckPushEnv"):
        env = _made(name)
        found[f"{name}.set_state"] = {"state": env.get_state()}
        found[f"{name}.step"] = {"action": env.action_space.sample()}
    for name in ("EnvSimulator", "ModelSimulator", "Familiar"):
        found[f"{name}.state"] = {"observation": seen}
        found[f"{name}.step"] = {"states": np.stack([_made(name).state(seen)] * 2), "actions": held}
    for name, view, observed in (
        ("FunctionView", None, None),
        ("NumbersView", numbers, np.zeros(2)),
        ("SceneView", scenes, seen),
        ("TableView", table, np.zeros((3, 2))),
        ("TaskView", TaskView(numbers), np.zeros(2)),
    ):
        if view is not None:
            scene = view.scene(observed)
            found.setdefault(f"{name}.scene", {})["observation"] = observed
            found[f"{name}.observation"] = {"scene": scene}
            found[f"{name}.with_action"] = {
                "scene": scene,
                "action": held[0] if name == "SceneView" else np.zeros(1),
            }
            found[f"{name}.with_outcome"] = {"scene": scene, "reward": 0.0, "terminated": False}
    found["FunctionView.with_outcome"] = {"reward": 0.0, "terminated": False}
    for name in ("FlatView", "ActionRepeat", "ModelLearner", "TruncatedEpisodes", "LearnedModelEnv"):
        found.setdefault(f"{name}.step", {})["action"] = np.zeros(1)
    for name in ("EnvSimulator", "FlatView"):
        found[name] = {"env": truck}
    for name in (
        "Planner.act",
        "Planner.predict",
        "PlanningAgent.predict",
        "DataLearner.predict",
        "FlatView.observation",
    ):
        found.setdefault(name, {})["observation"] = seen
    found["DataLearner.predict"]["action"] = held[0]
    for name in ("VectorFlatView.step", "LearnedModelVectorEnv.step"):
        found[name] = {"actions": held}
    return found  # fmt: skip


class _Doubling:
    """A hypothesis class that never proposes anything."""

    name = "doubling"

    def propose(self, examples: Examples) -> Proposal:
        yield 1
        return None

    def from_json(self, data: Mapping[str, Any]) -> Law:
        raise ModelFileError("nothing was ever proposed")


def _methods(kind: type) -> Iterator[tuple[str, bool]]:
    """Each public method of relgym's own that takes something, and whether it needs no object."""
    for name in sorted(dir(kind)):
        plain = inspect.getattr_static(kind, name)
        alone = isinstance(plain, (classmethod, staticmethod))
        function = plain.__func__ if alone else plain
        if (
            name.startswith("_")
            or not inspect.isfunction(function)
            or not function.__module__.startswith("relgym")
        ):
            continue
        kinds = [p.kind for p in inspect.signature(getattr(kind, name)).parameters.values()]
        if any(k is not inspect.Parameter.VAR_KEYWORD for k in kinds[0 if alone else 1 :]):
            yield name, alone


@cache
def surface() -> dict[str, Public]:
    """Every public callable by name: ``fit``, ``Planner``, ``Planner.predict``."""
    found: dict[str, Public] = {}
    for facade in FACADES:
        home = importlib.import_module(facade)
        for name in sorted(home.__all__):
            thing = getattr(home, name)
            full = f"{facade.rpartition('.')[2]}.{name}" if name in _TWICE else name
            kept_out = full in LEFT_OUT or name in LEFT_OUT or full in found
            if not callable(thing) or kept_out or getattr(thing, "_is_protocol", False) or get_origin(thing):
                continue
            if inspect.isclass(thing):
                if inspect.signature(thing).parameters:
                    found[full] = _public(full, thing)
                for method, alone in _methods(thing):
                    if f"{full}.{method}" in LEFT_OUT:
                        continue
                    owner = None if alone else _made(full)
                    bound = getattr(thing if alone else owner, method)
                    found[f"{full}.{method}"] = _public(f"{full}.{method}", bound, owner)
            elif inspect.isfunction(thing):
                found[full] = _public(full, thing)
    return found | _together()


def _together() -> dict[str, Public]:
    """Calls that only fail together with others, or that have no name."""
    kit = _kit()
    schema, model, scene = kit["schema"], kit["model"], kit["scene"]
    return {
        "Kinematics of a schema": Public(
            lambda **given: replace(schema, kinematics=(Kinematics(**given),)),
            {"type": "ball", "property": "px", "rate": "vx", "step": 1.0, "uses_next": True},
        ),
        "Target of a model": Public(
            lambda **given: WorldModel(schema, targets=(Target(**given),)),
            {"type": "ball", "property": "vx", "given": ()},
        ),
        "Transition learned": Public(
            lambda **given: model.learn_one(Transition(**given)), {"before": scene, "after": scene}, model
        ),
        "Scene[]": Public(scene.__getitem__, {"name": "b"}),
        "SceneObject[]": Public(scene["b"].__getitem__, {"prop": "vx"}),
        "with_action": Public(with_action, {"scene": scene, "values": [0.5]}),
        "register_function": Public(register_function, {"name": "badcalls", "function": np.tanh}),
    }


_TWICE = {"Coverage"}
"""Names that two packages give to different things."""


def _public(name: str, function: Any, owner: Any = None) -> Public:
    needed = {
        p.name: _right(name, p.name)
        for p in inspect.signature(function).parameters.values()
        if p.default is p.empty and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)
    }
    return Public(function, {**needed, **_otherwise().get(name, {})}, owner)
