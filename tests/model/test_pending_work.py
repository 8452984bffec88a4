"""What is under way when a model is copied, saved, rolled back or finished."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

from relgym.config import ModelConfig
from relgym.model.files.archive import parts_to_json
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Transition
from relgym.scene.schema import SceneSchema

POINT = ObjectType("point", ("a", "b", "c", "d"))
SCHEMA = SceneSchema((POINT,), (("p", "point"),))
TIGHT = ModelConfig(cells_per_step=60_000, most_cells=60_000, saved_cells=60_000)
"""So little that a search takes many steps."""


def stream(n: int) -> list[Transition]:
    """Two laws of a, one of b, and what none explains."""
    rng = np.random.default_rng(4)
    found = []
    for now in rng.normal(size=(n, 4)):
        a, b, c, d = now
        after = [0.5 * a + d if c > 0 else a - b, b - 0.3 * c, np.sin(5 * a) * d, rng.normal()]
        found.append(Transition(SCHEMA.scene({"p": now}), SCHEMA.scene({"p": after})))
    return found


def taught(n: int) -> WorldModel:
    model = WorldModel(SCHEMA, TIGHT)
    for transition in stream(n):
        model.learn_one(transition)
    return model


def searching(model: WorldModel) -> bool:
    return any(part.clusterer.searching for part in model._parts.models.values())


def plain(model: WorldModel) -> object:
    return parts_to_json(model._parts, history=True)


@pytest.fixture(scope="module")
def pending() -> WorldModel:
    model = taught(40)
    assert searching(model)
    return model


@pytest.mark.parametrize("made", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_copy_goes_on_with_what_is_under_way(pending: WorldModel, made) -> None:  # type: ignore[no-untyped-def]
    one, other = copy.deepcopy(pending), made(pending)
    for transition in stream(70)[40:]:
        one.learn_one(transition)
        other.learn_one(transition)
    assert plain(one) == plain(other)


def test_the_same_steps_give_the_same_model(pending: WorldModel) -> None:
    assert plain(taught(40)) == plain(pending)


def test_a_rollback_comes_to_where_the_search_stood(
    pending: WorldModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, calm = copy.deepcopy(pending), copy.deepcopy(pending)
    later = stream(60)[40:]
    for transition in later[:8]:
        model.learn_one(transition)
        calm.learn_one(transition)
    with monkeypatch.context() as patch:
        patch.setattr("relgym.model.learning._refresh", lambda *given: (_ for _ in ()).throw(MemoryError()))
        with pytest.raises(MemoryError):
            model.learn_one(later[8])
    for transition in later[8:]:
        model.learn_one(transition)
        calm.learn_one(transition)
    assert plain(model) == plain(calm)


def test_finishing_leaves_nothing_under_way(pending: WorldModel) -> None:
    model = copy.deepcopy(pending)
    assert model.finish() > 0
    assert not searching(model)
    assert model.modes("point", "b")[0].formula() == "b' = b - 0.3 c"
    assert model._parts.inquiry is None and not model._parts.looks


def test_who_loads_a_file_begins_again_what_was_under_way(pending: WorldModel, tmp_path: Path) -> None:
    pending.save(tmp_path / "model.relgym", history=True)
    before = plain(pending)
    first, second = (WorldModel.load(tmp_path / "model.relgym") for _ in range(2))
    assert plain(pending) == before
    for transition in stream(200)[40:]:
        first.learn_one(transition)
        second.learn_one(transition)
    assert plain(first) == plain(second)
    first.finish()
    assert first.modes("point", "b")[0].formula() == "b' = b - 0.3 c"


def test_little_by_little_comes_to_the_same_laws() -> None:
    patient, hasty = taught(300), WorldModel(SCHEMA)
    for transition in stream(300):
        hasty.learn_one(transition)
    patient.finish(), hasty.finish()
    formulas = [{mode.formula() for mode in model.modes("point", "a")} for model in (patient, hasty)]
    assert formulas[0] == formulas[1] == {"a' = 0.5 a + d", "a' = a - b"}
