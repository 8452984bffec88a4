"""Forces between objects that don't touch: pairs are named where a line explains what nothing else does, only there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.experiments.bodies.suite import FORCES
from relgym.experiments.bodies.trials import watched
from relgym.experiments.bodies.worlds import body_rooms
from relgym.model.reports import distant
from relgym.model.reports.advice import Advice
from relgym.model.reports.distant import DistantForce, distant_forces
from relgym.model.world_model import WorldModel
from relgym.reporting.parser import parse_rules
from relgym.scene.objects import POSE, Kinematics, ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Sphere

Array = NDArray[np.float64]
Force = Callable[[str, str, Array], Array]
"""What one object's velocity changes by for another one, that lies so far away from it."""

HASTY = ModelConfig(cells_per_step=1_000, saved_cells=1_000)
"""Laws are sought in the examples when somebody asks; what modes make of them doesn't matter."""


def attraction(_: str, __: str, apart: Array) -> Array:
    return np.asarray(0.01 * apart / np.linalg.norm(apart) ** 3)


def between(*names: str, force: Force = attraction) -> Force:
    """The same between these objects, and none on others."""
    return lambda one, other, apart: force(one, other, apart) if {one, other} == {*names} else 0.0 * apart


def schema_of(kinds: str, dimensions: int = 2) -> SceneSchema:
    """Points a0, b1, …: a letter is a type; they don't meet."""
    velocity = ("vx", "vy", "vz" if dimensions == 3 else None)
    moving = [v for v in velocity if v]
    types = [ObjectType(kind, (*POSE, *moving), Sphere(), velocity=velocity) for kind in dict.fromkeys(kinds)]
    return SceneSchema(
        tuple(types),
        tuple((f"{kind}{k}", kind) for k, kind in enumerate(kinds)),
        planar=dimensions == 2,
        kinematics=tuple(Kinematics(t.name, f"p{v[1]}", v) for t in types for v in moving),
        targets=tuple(Target(t.name, v) for t in types for v in moving),
    )


def flights(
    schema: SceneSchema, force: Force, names: tuple[str, ...], *, episodes: int = 3
) -> list[Transition]:
    """Episodes of 40 steps of some objects."""
    d = 2 if schema.planar else 3
    rng = np.random.default_rng(0)
    found = []
    for _ in range(episodes):
        places, velocities = rng.uniform(-5.0, 5.0, (len(names), d)), rng.uniform(-0.1, 0.1, (len(names), d))

        def scene(p: Array, v: Array) -> Scene:
            size = [0.02] * 3
            return schema.scene(
                {name: [*p[k], *[0.0] * (6 - d), *size, *v[k]] for k, name in enumerate(names)}
            )

        for _ in range(40):
            before = scene(places, velocities)
            change = np.zeros_like(velocities)
            for k, one in enumerate(names):
                for j, other in enumerate(names):
                    if j != k:
                        change[k] += force(one, other, places[j] - places[k])
            velocities = velocities + change
            places = places + velocities
            found.append(Transition(before, scene(places, velocities)))
    return found


def forces(kinds: str, force: Force, dimensions: int = 2) -> tuple[DistantForce, ...]:
    """What is said of forces in a world of such objects, as if no target were explained."""
    schema = schema_of(kinds, dimensions)
    model = WorldModel(schema, HASTY)
    for transition in flights(schema, force, tuple(name for name, _ in schema.objects)):
        model.learn_one(transition)
    told = distant_forces(model._parts, model.targets)
    return tuple(each for found in told.values() for each in found)


def test_a_pair_that_attracts_is_named_both_ways() -> None:
    assert forces("abb", between("a0", "b2")) == (
        DistantForce(("a0",), "b2", 1, -1),
        DistantForce(("b2",), "a0", 1, -1),
    )


def test_also_of_one_type_in_space_and_where_it_repels() -> None:
    repelled = between("a1", "a2", force=lambda one, other, apart: -attraction(one, other, apart))
    assert set(forces("aaa", repelled, 3)) == {
        DistantForce(("a1",), "a2", -1, -1),
        DistantForce(("a2",), "a1", -1, -1),
    }


def test_a_spring_pulls_and_pushes() -> None:
    def spring(_: str, __: str, apart: Array) -> Array:
        return np.asarray(0.001 * apart * (1.0 - 4.0 / np.linalg.norm(apart)))

    assert {(f.objects, f.other, f.sense) for f in forces("ab", spring)} == {
        (("a0",), "b1", 0),
        (("b1",), "a0", 0),
    }


def test_those_of_whom_the_same_holds_are_told_together() -> None:
    fixed = lambda one, other, apart: attraction(one, other, apart) * (other == "a0")  # noqa: E731
    (told,) = forces("abb", fixed)
    assert told == DistantForce(("b1", "b2"), "a0", 1, -1)
    assert str(told) == (
        "what moves b1 and b2 and isn't explained is a pull towards a0, the weaker the farther apart"
    )


def test_of_many_objects_the_first_ones_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    fixed = lambda one, other, apart: attraction(one, other, apart) * (other == "a0")  # noqa: E731
    monkeypatch.setattr(distant, "PAIRS", 3)  # of four pairs: either of two objects has two
    assert forces("abb", fixed) == (DistantForce(("b1",), "a0", 1, -1),)
    monkeypatch.setattr(distant, "PAIRS", 1)
    assert forces("abb", fixed) == ()


def test_where_objects_come_and_go_types_are_named() -> None:
    schema = schema_of("abb")
    model = WorldModel(schema, HASTY)
    for transition in flights(schema, between("a0", "b2"), ("a0", "b2")):
        model.learn_one(transition)
    assert distant_forces(model._parts, model.targets) == {
        "a": (DistantForce(("a",), "b", 1, -1),),
        "b": (DistantForce(("b",), "a", 1, -1),),
    }


def wind(_: str, __: str, ___: Array) -> Array:
    return np.array([0.001, 0.0])


def swirl(_: str, __: str, apart: Array) -> Array:
    return np.asarray(0.001 * np.array([-apart[1], apart[0]]))


@pytest.mark.parametrize("force", [wind, swirl], ids=["wind", "across the line"])
def test_what_lies_along_no_line_is_not_blamed_on_anything(force: Force) -> None:
    assert forces("abb", force) == ()


def test_what_several_do_at_once_is_not_blamed_on_one() -> None:
    assert forces("aaa", attraction) == ()


def test_noise_lies_along_no_line() -> None:
    rng = np.random.default_rng(1)
    assert forces("ab", lambda one, other, apart: rng.normal(0.0, 0.01, 2)) == ()


def test_noise_along_one_axis_lies_along_the_axis() -> None:
    rng = np.random.default_rng(1)
    assert forces("ab", lambda one, other, apart: np.array([rng.normal(0.0, 0.01), 0.0])) == ()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["linear damping", "conveyor", "wind", "quadratic drag"])
def test_other_forces_name_no_pair(name: str) -> None:
    model, _ = watched(body_rooms(FORCES[name], 1, seed=11))
    assert distant_forces(model._parts, model.targets) == {}


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("magnet", {(("disc",), "body1", 1, -1), (("body1",), "disc", 1, -1)}),
        ("spring", {(("body1",), "body2", 1, 1), (("body2",), "body1", 1, 1)}),
    ],
)
def test_magnet_and_spring_name_the_pair(name: str, said: set[tuple[object, ...]], tmp_path: Path) -> None:
    rooms = body_rooms(FORCES[name], 2, seed=11, steps=80)
    model, _ = watched(rooms, model=WorldModel(rooms[0].schema, HASTY))
    told = {force for advice in model.advice() for force in advice.forces}
    assert {(f.objects, f.other, f.sense, f.trend) for f in told} == said
    text = model.describe()
    flat = " ".join(text.replace("\n    | ", " ").split())
    assert all(str(force) in flat for force in told)
    assert parse_rules(text).text() == text
    explained = model.explain(next(iter(rooms[0].transitions())).before)
    assert all(f"  lacks     {force}" in explained for force in told)
    model.save(tmp_path / "model.json")
    loaded = WorldModel.load(tmp_path / "model.json")
    assert {force for advice in loaded.advice() for force in advice.forces} == told
    assert all(str(force) in " ".join(loaded.describe().replace("\n    | ", " ").split()) for force in told)


def test_advice_that_came_before_forces_were_told_is_read() -> None:
    old = {"target": "a.vx", "unexplained": 0.5, "left": 1.0, "features": [], "law": "", "remains": 1.0}
    assert Advice.from_json(old) == Advice("a.vx", 0.5, 1.0, (), "", 1.0)
