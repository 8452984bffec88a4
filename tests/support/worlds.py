"""Small worlds with known laws: transitions drawn at random, every mode frequent, no engine between.

A raw scene says of every object by name what type it is of and what its properties are; variations of a world
(other names, more objects, other places) are made of raw scenes, and `transitions` makes the schema they need.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from relgym.model.world_model import WorldModel
from relgym.scene.objects import Kinematics, ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Shape, Sphere

Raw: TypeAlias = dict[str, tuple[str, dict[str, float]]]
"""Object name → (type name, properties)."""
RawStep: TypeAlias = tuple[Raw, Raw]
"""A scene and the one that follows."""

SHAPES: Mapping[str, Shape | None] = {
    "ball": Sphere(),
    "light": Sphere(),
    "heavy": Sphere(),
    "box": Box(),
    "planet": Sphere(),
    "star": Sphere(),
}
PARENTS = {"light": "ball", "heavy": "ball"}
ROUND = {"sx": "d", "sy": "d", "sz": "d"}
"""A sphere's one diameter."""

ELASTICITY, GRAVITY = 0.9, 0.00098


def schema_of(
    steps: Sequence[RawStep], targets: Sequence[Target] | None = None, *, planar: bool = True
) -> SceneSchema:
    """The schema of raw scenes: every object that occurs; optional if it is missing somewhere."""
    first: dict[str, tuple[str, dict[str, float]]] = {}
    for before, after in steps:
        for name, each in [*before.items(), *after.items()]:
            first.setdefault(name, each)
    kinds = {kind: props for kind, props in first.values()}
    types = tuple(_type(kind, tuple(props)) for kind, props in kinds.items())
    laws = tuple(
        Kinematics(t.name, p, f"v{p[1]}")
        for t in types
        for p in ("px", "py", "pz")
        if p in t.properties and f"v{p[1]}" in t.properties
    )
    objects = tuple((name, kind) for name, (kind, _) in first.items())
    return SceneSchema(
        types, objects, planar=planar, kinematics=laws, targets=None if targets is None else tuple(targets)
    )


def _type(kind: str, properties: tuple[str, ...]) -> ObjectType:
    velocity = tuple(v if v in properties else None for v in ("vx", "vy", "vz"))
    return ObjectType(
        kind,
        properties,
        SHAPES.get(kind),
        parent=PARENTS.get(kind),
        pose=ROUND if "d" in properties else {},
        velocity=velocity if any(velocity) else (),
        optional=True,
    )


def scene(schema: SceneSchema, raw: Raw) -> Scene:
    """A raw scene as the schema's."""
    return schema.scene({n: [props[p] for p in schema.type(k).properties] for n, (k, props) in raw.items()})


def transitions(schema: SceneSchema, steps: Iterable[RawStep]) -> list[Transition]:
    """Raw steps as the schema's transitions."""
    return [Transition(scene(schema, before), scene(schema, after)) for before, after in steps]


def learned(schema: SceneSchema, steps: Iterable[RawStep], **arguments: object) -> WorldModel:
    """A model that has seen the steps."""
    model = WorldModel(schema, **arguments)  # type: ignore[arg-type]
    for each in transitions(schema, steps):
        model.learn_one(each)
    model.finish()
    return model


def moved(before: Raw, changes: Mapping[str, Mapping[str, float]]) -> RawStep:
    """A step: the named objects' properties change, and what has a velocity moves by its next one."""
    after: Raw = {}
    for name, (kind, props) in before.items():
        new = props | changes.get(name, {})
        for axis in "xyz":
            if f"p{axis}" in new and f"v{axis}" in new:
                new[f"p{axis}"] = props[f"p{axis}"] + new[f"v{axis}"]
        after[name] = (kind, new)
    return before, after


# ---------------------------------------------------------------------- a ball in a room of boxes
ROOM_TARGETS = (Target("ball", "vx"), Target("ball", "vy"))
ROOM_MODES = {
    "vx": ["vx' = -0.9 vx", "vx' = vx"],
    "vy": ["vy' = -0.9 vy", "vy' = vy - 0.00098"],
}


def room_step(
    rng: np.random.Generator, *, boxes: int = 3, balls: int = 1, elasticity: float = ELASTICITY
) -> RawStep:
    """Balls fly or touch a side of a box, approaching it or not."""
    raw: Raw = {}
    for k in range(boxes):
        place = {"px": 4.0 * k + rng.uniform(-0.5, 0.5), "py": rng.uniform(-0.5, 0.5)}
        raw[f"box{k}"] = ("box", place | {"sx": rng.uniform(0.8, 2.0), "sy": rng.uniform(0.8, 2.0)})
    changes = {}
    for k, at in enumerate(rng.permutation(boxes)[:balls]):
        ball, change = _beside(rng, raw[f"box{at}"][1], elasticity)
        raw[f"ball{k}"] = ("ball", ball)
        changes[f"ball{k}"] = change
    return moved(raw, changes)


def _beside(
    rng: np.random.Generator, box: dict[str, float], elasticity: float
) -> tuple[dict[str, float], dict[str, float]]:
    """A ball beside a box, half of the time touching it, and how its velocity changes."""
    along, across = ("x", "y") if rng.random() < 0.5 else ("y", "x")
    side, touches = rng.choice([-1.0, 1.0]), rng.random() < 0.5
    d = rng.uniform(0.2, 0.4)
    gap = -rng.uniform(0.001, 0.01) if touches else rng.uniform(0.05, 0.3)
    velocity = {"vx": rng.uniform(-0.05, 0.05), "vy": rng.uniform(-0.05, 0.05)}
    ball = {"px": 0.0, "py": 0.0, "d": d} | velocity
    ball[f"p{along}"] = box[f"p{along}"] + side * (box[f"s{along}"] / 2 + d / 2 + gap)
    ball[f"p{across}"] = box[f"p{across}"] + rng.uniform(-0.3, 0.3) * box[f"s{across}"]
    change = {"vx": ball["vx"], "vy": ball["vy"] - GRAVITY}
    if touches and side * ball[f"v{along}"] < 0.0:
        change[f"v{along}"] = -elasticity * ball[f"v{along}"]
    return ball, change


def room(seed: int, n: int, **arguments: float) -> list[RawStep]:
    """Steps of the room."""
    rng = np.random.default_rng(seed)
    return [room_step(rng, **arguments) for _ in range(n)]  # type: ignore[arg-type]


# ---------------------------------------------------------------------- balls on a line (§1.2.5)
LINE_TARGETS = (Target("light", "vx"), Target("heavy", "vx"))
MASS = {"light": 1.0, "heavy": 3.0}


def line_step(rng: np.random.Generator, kinds: Sequence[str]) -> RawStep:
    """Balls on a line, in random order; two neighbours of different mass meet elastically half of the time."""
    names = [f"{kind}{sum(k == kind for k in kinds[:i])}" for i, kind in enumerate(kinds)]
    order = rng.permutation(len(kinds))
    gaps = rng.uniform(0.2, 2.0, len(kinds))
    pairs = [k for k in range(1, len(kinds)) if kinds[order[k - 1]] != kinds[order[k]]]
    meeting = int(rng.choice(pairs)) if pairs and rng.random() < 0.5 else 0
    raw: Raw = {}
    x = float(rng.uniform(-5, 5))
    for k, i in enumerate(order):
        x += 1.0 + (-rng.uniform(0.001, 0.01) if k and k == meeting else gaps[k])
        raw[names[i]] = (kinds[i], {"px": x, "vx": rng.uniform(-0.05, 0.05)})
    changes: dict[str, dict[str, float]] = {}
    if meeting:
        left, right = (names[order[k]] for k in (meeting - 1, meeting))
        changes = _collide(raw, left, right)
    return moved({name: raw[name] for name in names}, changes)


def _collide(raw: Raw, left: str, right: str) -> dict[str, dict[str, float]]:
    (kind_a, a), (kind_b, b) = raw[left], raw[right]
    m, n = MASS[kind_a], MASS[kind_b]
    if a["vx"] <= b["vx"]:
        return {}
    return {
        left: {"vx": ((m - n) * a["vx"] + 2 * n * b["vx"]) / (m + n)},
        right: {"vx": ((n - m) * b["vx"] + 2 * m * a["vx"]) / (m + n)},
    }


def line(seed: int, n: int, kinds: Sequence[str]) -> list[RawStep]:
    """Steps of the line."""
    rng = np.random.default_rng(seed)
    return [line_step(rng, kinds) for _ in range(n)]


# ---------------------------------------------------------------------- variations
def vary(steps: Iterable[RawStep], change: Callable[[Raw], Raw]) -> list[RawStep]:
    """Every scene changed in the same way."""
    return [(change(before), change(after)) for before, after in steps]


def formulas(model: WorldModel, target: Target, digits: int = 6) -> list[str]:
    """Functions of a target's modes, sorted."""
    return sorted(m.formula(digits) for m in model.modes(target.type, target.property))


def wrong(model: WorldModel, steps: Iterable[RawStep], tolerance: float = 1e-9) -> int:
    """How many predictions are off or made by no mode."""
    found = 0
    for each in transitions(model.schema, steps):
        for part in model.predict_one(each.before).parts:
            if part.object in each.after:
                truth = each.after[part.object][part.property]
                found += not part.ok or abs(part.value - truth) > tolerance
    return found
