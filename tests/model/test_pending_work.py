"""What is under way when a model is copied, saved, rolled back or finished."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relgym.clustering.examples import ExampleTable
from relgym.clustering.last_resort import Resort
from relgym.clustering.population import Population
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
        patch.setattr(
            "relgym.model.learning.transition._refresh", lambda *given: (_ for _ in ()).throw(MemoryError())
        )
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


# --- approximations, which take many steps and are sought for one target after the other --------------------

CURVES = SceneSchema((ObjectType("curve", ("a", "b", "c")),), (("q", "curve"),))
FEATURES = ModelConfig(
    features=("trig", "products"), cells_per_step=60_000, most_cells=60_000, saved_cells=60_000
)


def curves(n: int) -> list[Transition]:
    """Nearly, but not quite, what a few features say."""
    rng = np.random.default_rng(8)
    found = []
    for now in rng.uniform(-2.0, 2.0, size=(n, 3)):
        a, b, c = now
        after = [a + np.sin(b + 0.01 * a**3), b + np.sin(c + 0.01 * a**3), c + np.sin(a + 0.01 * b**3)]
        found.append(Transition(CURVES.scene({"q": now}), CURVES.scene({"q": after})))
    return found


def test_the_oldest_approximation_is_sought_anew_first(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[str] = []
    of = Resort.of.__func__  # type: ignore[attr-defined]

    def spied(cls: type[Resort], population: Population, table: ExampleTable, **options: Any) -> Resort:
        begun.append(population.target.property)
        found: Resort = of(cls, population, table, **options)
        return found

    monkeypatch.setattr(Resort, "of", classmethod(spied))
    model = WorldModel(CURVES, FEATURES)
    for transition in curves(1_100):
        model.learn_one(transition)
    assert begun[:3] == ["a", "b", "c"]
    model.finish()
    # what came due while others were sought is made up for, with the examples there are by then
    assert {prop: begun.count(prop) >= 2 for prop in "abc"} == dict.fromkeys("abc", True)
    assert not any(part.clusterer.waits for part in model._parts.models.values())


def test_what_begins_anew_at_the_end_is_searched_and_approximated() -> None:
    model = WorldModel(CURVES, FEATURES)
    for transition in curves(400):
        model.learn_one(transition)
    part = next(m for t, m in model._parts.models.items() if t.property == "b")
    part.clusterer.due = True
    model._parts.retarget(part.target, replace(part.target, given=(("curve", "a"),)))
    assert not part.modes
    model.finish()
    assert part.modes and part.clusterer.approximate
