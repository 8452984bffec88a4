"""Worlds of the thesis that are small enough to state whole: collisions, planets, trucks, balls; and 3-D."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from worlds import (
    LINE_TARGETS,
    Raw,
    RawStep,
    formulas,
    learned,
    line,
    moved,
    scene,
    schema_of,
    transitions,
    wrong,
)

from relgym.config import ClassificationConfig, ModelConfig
from relgym.experiments.data import ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import evaluate
from relgym.experiments.truck_check import check_truck
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Target

PAIR, TRIO = ("light", "heavy"), ("light", "heavy", "heavy")
LIGHT, HEAVY = LINE_TARGETS


# ---------------------------------------------------------------------- §1.2.5: two balls on a line, masses 1 and 3
@pytest.fixture(scope="module")
def pair_model() -> WorldModel:
    return learned(schema_of(line(0, 1, TRIO), LINE_TARGETS), line(0, 300, PAIR))


def test_elastic_collisions_are_one_mode_with_two_roles(pair_model: WorldModel) -> None:
    # By hand: k1 = (1 - 3) / 4, k2 = 2 * 3 / 4 for the light ball; (3 - 1) / 4 and 2 / 4 for the heavy one.
    assert formulas(pair_model, LIGHT) == ["vx' = -0.5 vx + 1.5 heavy.vx", "vx' = vx"]
    assert formulas(pair_model, HEAVY) == ["vx' = 0.5 vx + 0.5 light.vx", "vx' = vx"]
    mode = next(m for m in pair_model.modes("light", "vx") if m.open_roles)
    assert [role.type for role in mode.roles] == ["light", "heavy"]
    weights = [w for role in mode.roles for _, w in role.terms]
    assert weights == pytest.approx([-0.5, 1.5], abs=1e-9)
    assert mode.intercept == 0.0


def test_two_balls_are_predicted(pair_model: WorldModel) -> None:
    assert wrong(pair_model, line(1, 200, PAIR)) == 0


def test_the_same_model_predicts_three_balls(pair_model: WorldModel) -> None:
    assert wrong(pair_model, line(2, 200, TRIO)) == 0


def test_the_roles_are_played_by_the_balls_that_meet(pair_model: WorldModel) -> None:
    apart: Raw = {
        "light0": ("light", {"px": 0.0, "vx": 0.02}),
        "heavy0": ("heavy", {"px": 9.0, "vx": -0.01}),
        "heavy1": ("heavy", {"px": 0.995, "vx": -0.03}),
    }
    part = pair_model.predict_one(scene(pair_model.schema, apart))["light0", "vx"]
    assert part.roles == ("light0", "heavy1")
    assert part.value == pytest.approx(-0.5 * 0.02 + 1.5 * -0.03, abs=1e-9)


def test_the_role_classifier_is_a_ball_that_intersects() -> None:
    # §3.5: fulfills(T, X, Y) <- is-ball(T, Y) and intersect(T, X, Y); here is-ball is the role's type.
    config = ModelConfig(classification=ClassificationConfig(contact_facts=False))
    steps = line(3, 400, TRIO)
    model = learned(schema_of(steps, [LIGHT]), steps, config=config)
    mode = next(m for m in model.modes("light", "vx") if m.open_roles)
    (role,) = model.property_model("light", "vx").casting.classifiers[mode.id].descriptions
    assert role.kind.type == "heavy"
    assert role.definition is not None
    assert [str(clause) for clause in role.definition.clauses] == ["intersect(A, B)"]


# ---------------------------------------------------------------------- §1.2.1: a planet in polar coordinates
def orbit(n: int, *, turn: float = 0.02) -> list[RawStep]:
    """Two planets on circles about a star: distances stay, angles change by a constant amount."""
    steps = []
    for k in range(n):
        bodies: Raw = {"star": ("star", {"px": 0.0, "py": 0.0})}
        for name, r in (("inner", 3.0), ("outer", 5.0)):
            bodies[name] = ("planet", {"distance": r, "angle": turn * k + r})
        turned = {name: {"angle": bodies[name][1]["angle"] + turn} for name in ("inner", "outer")}
        steps.append(moved(bodies, turned))
    return steps


def test_a_planet_in_polar_coordinates_is_one_constant_mode() -> None:
    steps = orbit(40)
    schema = schema_of(steps)
    # Geometry is shown the encoding's own axes; functions are learned on the encoding.
    types = tuple(
        replace(t, pose={"px": "distance", "py": "angle"}) if t.name == "planet" else t for t in schema.types
    )
    model = learned(replace(schema, types=types), steps)
    assert model.targets == (Target("planet", "angle"),)
    (mode,) = model.modes("planet", "angle")
    assert mode.formula() == "angle' = angle + 0.02"
    assert mode.examples == 80
    assert wrong(model, orbit(200)[150:]) == 0


def test_the_same_planet_in_rectangular_coordinates_is_none() -> None:
    angles = 0.02 * np.arange(61)
    places = [{"px": 3.0 * math.cos(a), "py": 3.0 * math.sin(a)} for a in angles]
    steps = [({"planet": ("planet", a)}, {"planet": ("planet", b)}) for a, b in pairwise(places)]
    model = learned(schema_of(steps), steps)
    # One rotation: linear in both coordinates, but of two terms instead of a constant.
    assert [len(m.roles[0].terms) for m in model.modes("planet", "px")] == [2]


# ---------------------------------------------------------------------- 3-D: a sphere among rotated boxes
TURN = (0.3, 0.5, -0.7)


def rotation(rx: float, ry: float, rz: float) -> np.ndarray:
    """R = Rz Ry Rx."""
    cx, cy, cz, sx, sy, sz = *np.cos([rx, ry, rz]), *np.sin([rx, ry, rz])
    return (
        np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    )


def bounce_in_space(rng: np.random.Generator) -> RawStep:
    """A sphere flies beside a box, or touches one of its faces and is reflected if it approaches."""
    axes = rotation(*TURN)
    raw: Raw = {}
    for k in range(2):
        centre = np.array([10.0 * k, 0.0, 0.0]) + rng.uniform(-1, 1, 3)
        raw[f"box{k}"] = ("box", _body(centre, TURN, rng.uniform(1.0, 2.0, 3)))
    box = raw[f"box{rng.integers(2)}"][1]
    face, side, d = int(rng.integers(3)), rng.choice([-1.0, 1.0]), rng.uniform(0.2, 0.5)
    extents = np.array([box["sx"], box["sy"], box["sz"]])
    local = rng.uniform(-0.3, 0.3, 3) * extents
    touches = rng.random() < 0.6
    local[face] = side * (extents[face] / 2 + d / 2 + (-0.005 if touches else 0.2))
    place = np.array([box["px"], box["py"], box["pz"]]) + axes @ local
    v, normal = rng.uniform(-0.05, 0.05, 3), side * axes[:, face]
    new = v - 1.8 * (v @ normal) * normal if touches and v @ normal < 0 else v
    names = ("vx", "vy", "vz")
    raw["ball"] = (
        "ball",
        dict(zip(("px", "py", "pz"), place.tolist(), strict=True))
        | dict(zip(names, v.tolist(), strict=True))
        | {"d": d},
    )
    return moved(raw, {"ball": dict(zip(names, new.tolist(), strict=True))})


def _body(centre: np.ndarray, turn: tuple[float, ...], size: np.ndarray) -> dict[str, float]:
    names = ("px", "py", "pz", "rx", "ry", "rz", "sx", "sy", "sz")
    return dict(zip(names, [*centre.tolist(), *turn, *size.tolist()], strict=True))


def test_a_sphere_among_rotated_boxes() -> None:
    rng = np.random.default_rng(0)
    steps = [bounce_in_space(rng) for _ in range(500)]
    target = Target("ball", "vx")
    model = learned(schema_of(steps, [target], planar=False), steps)
    modes = {m.formula(3): m for m in model.modes("ball", "vx")}
    assert len(modes) == 4
    found = [
        np.array([dict(m.roles[0].terms).get(p, 0.0) for p in ("vx", "vy", "vz")]) for m in modes.values()
    ]
    expected = [np.array([1.0, 0.0, 0.0])]
    for face in range(3):
        n = rotation(*TURN)[:, face]
        expected.append(np.array([1.0, 0.0, 0.0]) - 1.8 * n[0] * n)
    for law in expected:
        assert min(np.abs(law - each).max() for each in found) < 1e-9
    fresh = [bounce_in_space(rng) for _ in range(300)]
    assert wrong(model, fresh) <= 3


# ---------------------------------------------------------------------- chapter III's truck, chapter IV's ball
def train(episodes: Sequence[Episode]) -> WorldModel:
    model = WorldModel(episodes[0].schema, ModelConfig(frames="world"))
    for episode in episodes:
        for each in episode.transitions():
            model.learn_one(each)
    model.finish()
    return model


SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 5))]


@pytest.mark.parametrize("resample", ["step", "episode"])
@pytest.mark.parametrize("seed", SEEDS)
def test_truck_push_is_table_3_1(resample: str, seed: int) -> None:
    model = train(list(truck_episodes(resample=resample, seed=seed)))  # type: ignore[arg-type]
    assert sorted(m.examples for m in model.modes("truck", "vx")) == [480, 480, 960]
    check = check_truck(model, truck_episodes(resample=resample, seed=1000 + seed), every=8)  # type: ignore[arg-type]
    assert check.perfect, str(check)


def test_sixteen_episodes_of_the_first_experiment() -> None:
    model = train(list(ball_episodes(1, seed=0, episodes=16)))
    assert formulas(model, Target("ball", "vx"), 4) == [
        "vx' = -0.9 vx",
        "vx' = 0.525 vx - 0.8227 vy + 0.0004244",
        "vx' = vx",
    ]
    assert formulas(model, Target("ball", "vy"), 4) == [
        "vy' = -0.8227 vx - 0.425 vy - 0.000245",
        "vy' = -0.9 vy",
        "vy' = 0",
        "vy' = vy - 0.00098",
    ]
    result = evaluate(model, ball_episodes(1, seed=1000, episodes=40, test=True))
    for target in result.targets:
        assert target.total.rate <= 0.005


@pytest.mark.slow
def test_the_first_experiment() -> None:
    model = train(list(ball_episodes(1, seed=0)))
    for target in evaluate(model, ball_episodes(1, seed=1000, test=True)).targets:
        # As the benchmark ball-1 asks.
        assert target.total.rate <= 0.0005


def test_transitions_of_a_world_are_its_laws() -> None:
    # The worlds of these tests themselves: momentum is kept in every collision.
    steps = line(4, 50, PAIR)
    for each in transitions(schema_of(steps), steps):
        momentum = [s["light0"]["vx"] + 3.0 * s["heavy0"]["vx"] for s in (each.before, each.after)]
        assert momentum[0] == pytest.approx(momentum[1], abs=1e-15)
