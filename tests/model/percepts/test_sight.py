"""What the kernel sees of a single scene is what arrays see."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import MODELS, crowded, room_schema, scenes_of

from relgym.errors import ShapeError
from relgym.experiments.laws.trials import TRIALS, Trial, trial_rooms
from relgym.model.percepts import perception
from relgym.model.percepts.perception import Percept, Perception
from relgym.model.percepts.sight import Sight
from relgym.model.running.compiled import KERNEL, Kernel
from relgym.program.records import BeyondError
from relgym.scene.objects import SceneLayout
from relgym.scene.schema import SceneSchema


@pytest.fixture(autouse=True)
def at_once() -> None:
    KERNEL.load()


BEYOND = ("space",)
"""Worlds whose bodies the kernel can't look at."""


class Nothing(Kernel):
    """There is no kernel."""

    def after(self, scenes: int) -> None:
        return None


def seen(percept: Percept, index: int, *, arrays: bool, kernel: bool = True) -> dict[str, Any]:
    """What classifiers are shown of an object, and how others are lined up for it."""
    with pytest.MonkeyPatch.context() as patch:
        if arrays:
            patch.setattr(perception, "KERNEL", Nothing())
        place = percept.situation(index)
        assert arrays or place._body < 0 or (place._seen is not None) == kernel
        example = place.examples
        found = {each.name: getattr(example, each.name) for each in fields(example)}
        return found | {"order": place.order, "keys": place.keys}


def assert_seen_alike(
    schema: SceneSchema, layout: SceneLayout, vectors: Any, *, kernel: bool = True, **options: bool
) -> None:
    for vector in vectors:
        for index in range(len(layout.names)):
            two = [Perception(schema, **options).percept(layout, vector[None]) for _ in range(2)]  # type: ignore[arg-type]
            known, found = (
                seen(p, index, arrays=a, kernel=kernel) for p, a in zip(two, (True, False), strict=True)
            )
            for name, value in known.items():
                if not isinstance(value, np.ndarray):
                    assert found[name] == value
                    continue
                assert found[name].dtype == value.dtype and found[name].shape == value.shape
                assert found[name].tobytes() == value.tobytes(), name  # zeros have signs


@pytest.mark.parametrize("name", MODELS)
def test_learned_worlds(name: str) -> None:
    model = MODELS[name]()
    layout, vectors = scenes_of(model, 15, 3)
    assert_seen_alike(model.schema, layout, vectors)


@pytest.mark.parametrize("trial", TRIALS, ids=lambda trial: trial.name)
def test_worlds_of_laws(trial: Trial) -> None:
    (room,) = trial_rooms(trial.world, 1, seed=5, steps=40)
    assert_seen_alike(room.schema, room.layout, room.vectors[::10], kernel=trial.name not in BEYOND)


@pytest.mark.parametrize("options", [{"precision": 1e-6}, {"offsets": True}])
def test_coarse_numbers_and_offsets(options: dict[str, Any]) -> None:
    schema = replace(room_schema(2, 2), **options)
    assert_seen_alike(schema, schema.layout(), crowded(schema, 8, 3))


@settings(max_examples=10, deadline=None)
@given(shapes=st.integers(1, 3), balls=st.integers(1, 3), seed=st.integers(0, 10**6), parting=st.booleans())
def test_crowded_rooms(shapes: int, balls: int, seed: int, parting: bool) -> None:
    schema = room_schema(shapes, balls)
    assert_seen_alike(schema, schema.layout(), crowded(schema, 6, seed), parting=parting)


def test_a_body_that_cannot_be_is_refused_by_arrays() -> None:
    schema = room_schema(1, 1)
    layout, vector = schema.layout(), crowded(schema, 1, 0)[0]
    index = layout.bodies[0]
    vector[layout.offsets[index] + layout.types[index].pose_columns()[6]] = -1.0
    place = Perception(schema).percept(layout, vector[None]).situation(index)
    assert place._seen is None
    with pytest.raises(ShapeError):
        place.examples  # noqa: B018


def test_what_the_kernel_cannot_look_at_is_left_to_arrays() -> None:
    schema = room_schema(1, 1)
    layout, vector = schema.layout(), crowded(schema, 1, 0)[0]
    fcl = Perception(schema, geometry="fcl")
    machine = KERNEL.load()
    assert machine is not None
    with pytest.raises(BeyondError, match="geometry 'fcl'"):
        Sight(machine, fcl.extractor, layout, fcl.feature_columns(layout), parting=True)
    assert fcl.percept(layout, vector[None]).situation(layout.bodies[0])._seen is None
