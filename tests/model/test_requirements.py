"""The thesis' requirements R1-R5 (§1.3), each as a change of the world that must change nothing in the model."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from worlds import (
    GRAVITY,
    ROOM_MODES,
    ROOM_TARGETS,
    Raw,
    RawStep,
    formulas,
    learned,
    room,
    scene,
    schema_of,
    transitions,
    vary,
    wrong,
)

from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene

FRESH = room(1, 200)
"""Steps that no model has learned from."""


def numbers(model: WorldModel) -> list[float]:
    """All coefficients of all modes, functions in alphabetical order."""
    found: list[float] = []
    for target in ROOM_TARGETS:
        modes = sorted(model.modes(target.type, target.property), key=lambda m: m.formula(6))
        for mode in modes:
            found += [*(w for role in mode.roles for _, w in role.terms), mode.intercept, mode.examples]
    return found


def answers(model: WorldModel, steps: Sequence[RawStep]) -> np.ndarray:
    """Predictions of both targets, NaN where no mode made one; shape ``(n, 2)``."""
    predicted = [model.predict_one(scene(model.schema, before)).parts for before, _ in steps]
    return np.array([[p.value if p.ok else np.nan for p in parts] for parts in predicted])


def assert_alike(changed: WorldModel, plain: WorldModel, fresh: Sequence[RawStep]) -> None:
    """Same modes, same coefficients, same example counts, and the same predictions on the changed scenes."""
    for target in ROOM_TARGETS:
        assert formulas(changed, target) == formulas(plain, target)
    assert numbers(changed) == pytest.approx(numbers(plain), abs=1e-9)
    assert answers(changed, fresh) == pytest.approx(answers(plain, FRESH), abs=1e-9)


def variant(steps: Sequence[RawStep]) -> WorldModel:
    return learned(schema_of(steps, ROOM_TARGETS), steps)


def test_the_plain_world_is_learned(room_model: WorldModel) -> None:
    for target in ROOM_TARGETS:
        assert formulas(room_model, target) == ROOM_MODES[target.property]
    assert wrong(room_model, FRESH) == 0


# ---------------------------------------------------------------------- R1: what doesn't matter doesn't matter
def with_crowd(raw: Raw) -> Raw:
    """Twenty boxes far away."""
    crowd: Raw = {
        f"far{k}": ("box", {"px": 300.0 + 7.0 * k, "py": 100.0 + k, "sx": 1.0, "sy": 1.0}) for k in range(20)
    }
    return raw | crowd


def test_r1_far_objects(room_model: WorldModel, room_steps: list[RawStep]) -> None:
    assert_alike(variant(vary(room_steps, with_crowd)), room_model, vary(FRESH, with_crowd))


def test_r1_irrelevant_properties(room_model: WorldModel, room_steps: list[RawStep]) -> None:
    rng = np.random.default_rng(5)

    def with_junk(raw: Raw) -> Raw:
        return {
            n: (kind, p | {f"junk{k}": float(rng.normal()) for k in range(5)}) for n, (kind, p) in raw.items()
        }

    assert_alike(variant(vary(room_steps, with_junk)), room_model, vary(FRESH, with_junk))


def test_r1_a_model_meets_far_objects_for_the_first_time(room_steps: list[RawStep]) -> None:
    fresh = vary(FRESH, with_crowd)
    model = learned(schema_of(fresh, ROOM_TARGETS), room_steps)
    assert wrong(model, fresh) == 0


# ---------------------------------------------------------------------- R2: where and how large
def shifted(raw: Raw) -> Raw:
    return {n: (kind, p | {"px": p["px"] + 1e3, "py": p["py"] - 1e3}) for n, (kind, p) in raw.items()}


def resized(raw: Raw) -> Raw:
    """Every length five times as large, velocities as they were."""
    return {
        n: (kind, {k: v if k.startswith("v") else 5.0 * v for k, v in p.items()})
        for n, (kind, p) in raw.items()
    }


@pytest.mark.parametrize("change", [shifted, resized])
def test_r2_learning_elsewhere(
    change: Callable[[Raw], Raw], room_model: WorldModel, room_steps: list[RawStep]
) -> None:
    assert_alike(variant(vary(room_steps, change)), room_model, vary(FRESH, change))


@pytest.mark.parametrize("change", [shifted, resized])
def test_r2_a_model_is_taken_elsewhere(change: Callable[[Raw], Raw], room_model: WorldModel) -> None:
    assert answers(room_model, vary(FRESH, change)) == pytest.approx(answers(room_model, FRESH), abs=1e-9)


# ---------------------------------------------------------------------- R3: names, order, sameness
def renamed(raw: Raw) -> Raw:
    names = {"ball0": "kugel", "box0": "z", "box1": "y", "box2": "x"}
    return {names[n]: each for n, each in raw.items()}


def reordered(raw: Raw) -> Raw:
    return dict(reversed(raw.items()))


def exchanged(raw: Raw) -> Raw:
    """Two boxes in each other's place."""
    return raw | {"box0": raw["box2"], "box2": raw["box0"]}


@pytest.mark.parametrize("change", [renamed, reordered, exchanged])
def test_r3_learning_under_other_names(
    change: Callable[[Raw], Raw], room_model: WorldModel, room_steps: list[RawStep]
) -> None:
    assert_alike(variant(vary(room_steps, change)), room_model, vary(FRESH, change))


@pytest.mark.parametrize("change", [renamed, reordered, exchanged])
def test_r3_a_model_speaks_of_other_names(change: Callable[[Raw], Raw], room_model: WorldModel) -> None:
    fresh = vary(FRESH, change)
    schema = schema_of(fresh, ROOM_TARGETS)
    found = [[p.value for p in room_model.predict_one(scene(schema, before)).parts] for before, _ in fresh]
    assert np.array(found) == pytest.approx(answers(room_model, FRESH), abs=1e-9)


def test_r3_a_model_meets_other_numbers_of_objects(room_steps: list[RawStep]) -> None:
    more = room(2, 100, boxes=5)
    model = learned(schema_of([*room_steps, *more], ROOM_TARGETS), room_steps)
    assert wrong(model, more) == 0
    assert wrong(model, room(3, 100, boxes=1)) == 0


# ---------------------------------------------------------------------- R4: abrupt changes
def test_r4_behaviour_changes_abruptly_at_contact(room_model: WorldModel) -> None:
    def vy(gap: float) -> float:
        box = {"px": 0.0, "py": 0.0, "sx": 2.0, "sy": 1.0}
        ball = {"d": 0.3, "vx": 0.01, "vy": -0.02, "px": 0.2, "py": 0.65 + gap}
        raw: Raw = {"box0": ("box", box), "ball0": ("ball", ball)}
        return room_model.predict_one(scene(room_model.schema, raw)).scene["ball0"]["vy"]

    assert vy(1e-6) == pytest.approx(-0.02 - GRAVITY, abs=1e-12)
    assert vy(-1e-6) == pytest.approx(0.018, abs=1e-12)


def test_r4_nothing_is_averaged(room_model: WorldModel) -> None:
    found = answers(room_model, FRESH)
    before = [b["ball0"][1] for b, _ in FRESH]
    for k, prop in enumerate(("vx", "vy")):
        v = np.array([props[prop] for props in before])
        laws = np.array([v - GRAVITY * k, -0.9 * v])
        assert (np.abs(laws - found[:, k]).min(axis=0) < 1e-12).all()


# ---------------------------------------------------------------------- R5: online
def fingerprint(model: WorldModel) -> str:
    return hashlib.sha256(json.dumps(model.to_json(history=True), sort_keys=True).encode()).hexdigest()


def test_r5_the_model_after_an_episode_doesnt_know_what_follows(room_steps: list[RawStep]) -> None:
    schema = schema_of(room_steps, ROOM_TARGETS)
    short, long = WorldModel(schema), WorldModel(schema)
    at = {}
    for k, each in enumerate(transitions(schema, room_steps[:240])):
        long.learn_one(each)
        if k < 120:
            short.learn_one(each)
        if k == 119:
            at[120] = fingerprint(long)
    assert fingerprint(short) == at[120]
    assert fingerprint(long) != at[120]


def test_r5_asking_teaches_nothing(room_steps: list[RawStep]) -> None:
    schema = schema_of(room_steps, ROOM_TARGETS)
    abstained, asked = WorldModel(schema), WorldModel(schema)
    for each in transitions(schema, room_steps[:150]):
        abstained.learn_one(each)
        asked.predict_one(each.before)
        asked.learn_one(each)
        asked.predict_one(each.after)
        asked.predict_batch(each.after.layout, each.after.vector[None])
    assert fingerprint(asked) == fingerprint(abstained)


def test_r5_the_same_seed_gives_the_same_bytes_whatever_the_hash_seed(room_steps: list[RawStep]) -> None:
    program = (
        "import test_requirements as t\n"
        "steps = t.room(0, 120)\n"
        "print(t.fingerprint(t.learned(t.schema_of(steps, t.ROOM_TARGETS), steps)))"
    )
    here = Path(__file__).parent
    path = os.pathsep.join([str(here), str(here.parent / "support"), *filter(None, sys.path)])
    prints = [fingerprint(learned(schema_of(room_steps[:120], ROOM_TARGETS), room_steps[:120]))]
    for seed in ("0", "1"):
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": path},
            capture_output=True,
            text=True,
            check=True,
        )
        prints.append(done.stdout.strip())
    assert len(set(prints)) == 1


def test_r5_learning_leaves_its_input_alone(room_steps: list[RawStep]) -> None:
    schema = schema_of(room_steps, ROOM_TARGETS)
    model = WorldModel(schema)
    for each in transitions(schema, room_steps[:60]):
        copies = [each.before.vector.copy(), each.after.vector.copy()]
        model.learn_one(each)
        assert (each.before.vector == copies[0]).all()
        assert (each.after.vector == copies[1]).all()


def test_r5_prequential_errors_come_only_before_a_mode_is_known(room_steps: list[RawStep]) -> None:
    schema = schema_of(room_steps, ROOM_TARGETS)
    model, late = WorldModel(schema), 0
    for k, each in enumerate(transitions(schema, room_steps)):
        parts = model.predict_one(each.before).parts
        bad = sum(not p.ok or abs(p.value - each.after[p.object][p.property]) > 1e-9 for p in parts)
        late += bad * (k >= 200)
        model.learn_one(each)
    assert late <= 4


def test_one_scene_gives_the_same_bits_as_a_batch(room_model: WorldModel) -> None:
    scenes: list[Scene] = [scene(room_model.schema, before) for before, _ in FRESH]
    batch = room_model.predict_batch(scenes[0].layout, np.stack([s.vector for s in scenes]))
    for k, each in enumerate(scenes):
        one = room_model.predict_one(each)
        assert one.scene.vector.tobytes() == batch.vectors[k].tobytes()
        assert [p.mode for p in one.parts] == batch.modes[k].tolist()
        assert [p.margin for p in one.parts] == batch.margins[k].tolist()
        assert one.ok == batch.ok[k]
