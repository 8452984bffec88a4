"""A model predicts scenes with other objects of the types it knows, and abstains where it knows nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relgym.errors import ObservationError
from relgym.experiments.data import truck_episodes
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box


@pytest.fixture(scope="module")
def model() -> WorldModel:
    """Truck-push with two and with three boxes."""
    known: WorldModel | None = None
    for n_boxes in (2, 3):
        for episode in truck_episodes("step", seed=5, n_boxes=n_boxes):
            known = known or WorldModel(episode.schema)
            for transition in episode.transitions():
                known.learn_one(transition)
    assert known is not None
    known.finish()
    return known


@pytest.mark.parametrize("n_boxes", [2, 3])
def test_one_model_holds_for_either_number_of_boxes(model: WorldModel, n_boxes: int) -> None:
    for episode in truck_episodes("step", seed=6, n_boxes=n_boxes, repeats=1, test=True):
        predicted = model.predict_batch(episode.layout, episode.vectors[:-1])
        assert predicted.ok.all()
        column = episode.layout.column(episode.layout.index("truck"), "vx")
        assert np.abs(predicted.vectors[:, column] - episode.vectors[1:, column]).max() < 1e-9


def test_layouts_that_were_never_seen_are_called_so(model: WorldModel) -> None:
    episode = next(iter(truck_episodes("step", seed=6, n_boxes=4, repeats=1, test=True)))
    predicted = model.predict_batch(episode.layout, episode.vectors[:-1])
    outcomes = {OUTCOMES[k] for k in np.unique(predicted.outcomes)}
    assert not predicted.ok.any()
    assert outcomes == {Outcome.OUTSIDE, Outcome.DEPENDS}
    single = model.predict_one(episode.scene(0))
    assert single["truck", "vx"].outcome is Outcome.OUTSIDE
    assert single["box1", "px"].outcome is Outcome.DEPENDS
    assert single.scene.schema is episode.schema


def altered(scene: Scene, change: dict[str, object], name: str) -> SceneSchema:
    types = tuple(replace(t, **change) if t.name == name else t for t in scene.schema.types)  # type: ignore[arg-type]
    return replace(scene.schema, types=types, kinematics=(), targets=None)


def test_types_that_differ_are_refused(model: WorldModel) -> None:
    scene = next(iter(truck_episodes("step", seed=6, n_boxes=2))).scene(0)
    before = model.to_json(history=True)
    more = altered(scene, {"properties": (*scene.schema.type("box").properties, "colour")}, "box")
    values = {k: np.append(v, 0.0) if k.startswith("box") else v for k, v in scene.values().items()}
    with pytest.raises(ObservationError, match=r"type 'box' has properties .*colour.*expected"):
        model.predict_one(more.scene(values))
    stranger = SceneSchema((ObjectType("kite", ("height",)),), (("kite", "kite"),), planar=False)
    with pytest.raises(ObservationError, match="unknown type 'kite'"):
        model.predict_one(stranger.scene({"kite": [1.0]}))
    with pytest.raises(ObservationError, match="planar=True instead of"):
        model.predict_one(replace(scene.schema, planar=True).scene(scene.values()))
    assert model.to_json(history=True) == before


def test_what_has_no_body_may_read_any_body() -> None:
    wall, goal = ObjectType("wall", ("px",), Box()), ObjectType("goal", ("ahead",))
    car = ObjectType("car", ("px", "vx"), Box(), velocity=("vx", None, None))
    schema = SceneSchema(
        (wall, car, goal),
        (("wall", "wall"), ("car", "car"), ("goal", "goal")),
        targets=(Target("car", "vx"), Target("goal", "ahead", (("car", "vx"),))),
    )
    model, rng = WorldModel(schema), np.random.default_rng(0)
    for v, ahead in rng.normal(size=(40, 2)).tolist():
        before = schema.scene({"wall": [50.0], "car": [0.0, v], "goal": [ahead]})
        after = schema.scene({"wall": [50.0], "car": [0.9 * v, 0.9 * v], "goal": [ahead - 0.9 * v]})
        model.learn_one(Transition(before, after))
    predicted = model.predict_one(schema.scene({"wall": [50.0], "car": [0.0, 1.0], "goal": [3.0]}))
    assert predicted.ok
    assert predicted.scene["goal"]["ahead"] == pytest.approx(2.1)
