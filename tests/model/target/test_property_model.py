"""One target: modes, preconditions and roles kept in step with one another."""

from __future__ import annotations

import numpy as np
import points
import pytest
from worlds import LINE_TARGETS, learned, line, room, scene, schema_of, transitions

from relgym.clustering.mode import NOISE
from relgym.config import ModelConfig
from relgym.errors import QueryError
from relgym.experiments.data import truck_episodes
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.target.property_model import bodies_of
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition

TRIO = ("light", "heavy", "heavy")
GROUND = points.schema_of(("height", "a", "b", "c", "touch"), ("u",))


def touches(n: int, rng: np.random.Generator) -> list[Transition]:
    """Below 0.3 a quarter of what comes touches a ground that nobody sees; all is drawn anew in each step."""
    before = np.column_stack([rng.uniform(size=(n, 4)), np.zeros(n)])
    touch = ((before[:, 0] < 0.3) & (rng.uniform(size=n) < 0.25)).astype(float)
    after = iter(np.column_stack([rng.uniform(size=(n, 4)), touch]))
    return points.transitions(GROUND, lambda s, u: next(after), before, rng.normal(size=(n, 1)))


def test_classifiers_know_the_clusterers_modes_after_every_example() -> None:
    # Modes come and go while constants are unified; nobody may remember one that is gone.
    steps = line(0, 120, TRIO)
    schema = schema_of(steps, LINE_TARGETS)
    model = WorldModel(schema)
    for each in transitions(schema, steps):
        model.learn_one(each)
        for target in LINE_TARGETS:
            part = model.property_model(target.type, target.property)
            ids = [m.id for m in part.modes]
            assert list(part.classifier.modes) == ids
            assert set(part.casting.classifiers) <= {m.id for m in part.modes if m.open_roles}
            assert set(part.clusterer.labels.tolist()) <= {NOISE, *ids}


def test_mode_values_are_what_the_modes_say(room_model: WorldModel) -> None:
    part = room_model.property_model("ball", "vy")
    before, _ = room(1, 1)[0]
    each = scene(room_model.schema, before)
    ball = each.layout.index("ball0")
    vy = each["ball0"]["vy"]
    said = dict(
        zip(part.classifier.modes, part.mode_values(room_model.percept(each), ball, each.vector), strict=True)
    )
    for mode in part.modes:
        weight = dict(mode.roles[0].terms)["vy"]
        assert said[mode.id] == pytest.approx(weight * vy + mode.intercept, abs=1e-15)


def test_functions_with_open_roles_say_nothing_until_they_are_cast() -> None:
    steps = line(0, 200, TRIO)
    model = learned(schema_of(steps, LINE_TARGETS), steps)
    part = model.property_model("light", "vx")
    (number,) = (m.id for m in part.modes if m.open_roles)
    each = scene(model.schema, steps[0][0])
    values = part.mode_values(model.percept(each), each.layout.index("light0"), each.vector)
    assert np.isnan(values[part.classifier.modes.index(number)])


def test_open_roles_give_the_same_bits_one_by_one_and_in_a_batch() -> None:
    steps, fresh = line(0, 200, TRIO), line(1, 80, TRIO)
    model = learned(schema_of(steps, LINE_TARGETS), steps)
    scenes = [scene(model.schema, before) for before, _ in fresh]
    batch = model.predict_batch(scenes[0].layout, np.stack([s.vector for s in scenes]))
    for k, each in enumerate(scenes):
        one = model.predict_one(each)
        assert one.scene.vector.tobytes() == batch.vectors[k].tobytes()
        assert [OUTCOMES.index(p.outcome) for p in one.parts] == batch.outcomes[k].tolist()
        assert [p.mode for p in one.parts] == batch.modes[k].tolist()


def test_situations_never_seen_are_outside_experience() -> None:
    # A quarter of the thesis' truck episodes: not every way to stack three boxes was shown.
    episodes = list(truck_episodes(resample="step", seed=0))
    careful, bold = (
        WorldModel(episodes[0].schema, ModelConfig(abstain=abstain)) for abstain in (True, False)
    )
    for episode in episodes[:12]:
        for each in episode.transitions():
            careful.learn_one(each)
            bold.learn_one(each)
    outcomes = []
    for episode in episodes[12:]:
        one, other = (model.predict_one(episode.scene(0))["truck", "vx"] for model in (careful, bold))
        outcomes.append(one.outcome)
        assert other.outcome is Outcome.PREDICTED
        # Outside experience nothing is claimed, but the value is what the vote's winner says, if its roles aren't open.
        assert one == other or (one.mode == 0 and one.value in {other.value, episode.scene(0)["truck"]["vx"]})
        batch = careful.predict_batch(episode.layout, episode.scene(0).vector[None])
        assert batch.vectors[0].tobytes() == careful.predict_one(episode.scene(0)).scene.vector.tobytes()
    assert set(outcomes) == {Outcome.PREDICTED, Outcome.OUTSIDE}


def test_rare_events_are_not_predicted_where_they_are_unlikely() -> None:
    # Among few remembered examples there are corners in which by chance only the rare event lies.
    steps = touches(2000, np.random.default_rng(1))
    model = WorldModel(GROUND)
    predicted = 0
    for each in steps:
        predicted += model.predict_one(each.before).scene["self"]["touch"] > 0.5
        model.learn_one(each)
    assert points.formulas(model, "touch") == ["touch' = 0", "touch' = 1"]
    assert predicted == 0


def test_roles_name_the_objects_that_play_them(room_model: WorldModel) -> None:
    before, _ = room(1, 1)[0]
    part = room_model.predict_one(scene(room_model.schema, before))["ball0", "vx"]
    assert part.roles[0] == "ball0"


def test_unknown_targets_are_named(room_model: WorldModel) -> None:
    with pytest.raises(QueryError, match=r"box\.px is no target"):
        room_model.property_model("box", "px")


def test_bodies_are_numbered_without_the_bodiless() -> None:
    steps = room(0, 1)
    layout = schema_of(steps).layout()
    assert bodies_of(np.array([1, 0, 3, 2]), layout) == (1, 0, 3, 2)
