"""Two models of one world made one."""

from __future__ import annotations

import copy
import json
from dataclasses import replace

import numpy as np
import pytest
from points import formulas, learned, schema_of, transitions

from relgym.config import ModelConfig
from relgym.config.constants import MORE_ROOM
from relgym.errors import ConfigError, ModelFileError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Kinematics, ObjectType, Transition
from relgym.scene.schema import SceneSchema

SCHEMA = schema_of(("v", "w"), ("a",))


def steps(n: int, low: float, high: float, seed: int = 0) -> list[Transition]:
    """Beyond 2 v is turned round, else pushed; w decays wherever v is."""
    rng = np.random.default_rng(seed)
    starts = np.column_stack([rng.uniform(low, high, n), rng.normal(size=n)])
    step = lambda s, u: [-0.5 * s[0] if s[0] > 2.0 else s[0] + u[0], 0.8 * s[1]]  # noqa: E731
    return transitions(SCHEMA, step, starts, rng.normal(size=(n, 1)))


@pytest.fixture(scope="module")
def halves() -> tuple[WorldModel, WorldModel]:
    return learned(SCHEMA, steps(80, -2.0, 2.0)), learned(SCHEMA, steps(60, 2.1, 4.0, seed=1))


def test_each_half_knows_its_own_mode(halves: tuple[WorldModel, WorldModel]) -> None:
    assert [formulas(half, "v") for half in halves] == [["v' = v + action.a"], ["v' = -0.5 v"]]


def test_together_they_know_both_and_when_each_holds(halves: tuple[WorldModel, WorldModel]) -> None:
    whole = copy.deepcopy(halves[0])
    whole.merge(halves[1])
    assert whole.seen == 140
    assert sorted(formulas(whole, "v")) == ["v' = -0.5 v", "v' = v + action.a"]
    assert sorted(m.examples for m in whole.modes("self", "v")) == [60, 80]
    fresh = [*steps(40, -2.0, 1.0, seed=2), *steps(40, 2.6, 4.0, seed=3)]
    off = [abs(whole.predict_one(t.before).scene.vector - t.after.vector).max() for t in fresh]
    assert sum(error > 1e-9 for error in off) <= 8  # some twenty remembered examples tell where the two meet


def test_modes_that_say_the_same_are_one(halves: tuple[WorldModel, WorldModel]) -> None:
    whole = copy.deepcopy(halves[0])
    whole.merge(halves[1])
    assert formulas(whole, "w") == ["w' = 0.8 w"]
    assert whole.modes("self", "w")[0].examples == 140


def test_the_other_model_stays_as_it_is(halves: tuple[WorldModel, WorldModel]) -> None:
    before = json.dumps(halves[1].to_json(history=True))
    copy.deepcopy(halves[0]).merge(halves[1])
    assert json.dumps(halves[1].to_json(history=True)) == before


def test_a_merged_model_goes_on_learning(halves: tuple[WorldModel, WorldModel]) -> None:
    whole = copy.deepcopy(halves[0])
    whole.merge(halves[1])
    for t in steps(40, -2.0, 4.0, seed=4):
        whole.learn_one(t)
    assert len(whole.modes("self", "v")) == 2
    assert sum(m.examples for m in whole.modes("self", "v")) == 180


def test_only_models_of_one_world_and_configuration_merge(
    halves: tuple[WorldModel, WorldModel], tmp_path_factory: pytest.TempPathFactory
) -> None:
    one = copy.deepcopy(halves[0])
    with pytest.raises(ConfigError, match="another world"):
        one.merge(WorldModel(schema_of(("v",), ("a",))))
    with pytest.raises(ConfigError, match="another configuration"):
        one.merge(WorldModel(SCHEMA, ModelConfig(features=("trig",))))
    path = tmp_path_factory.mktemp("models") / "half.json"
    halves[1].save(path)
    with pytest.raises(ModelFileError, match="history"):
        one.merge(WorldModel.load(path))


def test_memory_stays_bounded_when_two_are_put_together() -> None:
    bound = 100
    mine, theirs = (learned(SCHEMA, steps(110, -2.0, 2.0, seed=seed), history=bound) for seed in (0, 1))
    assert mine.history == theirs.history == 110
    mine.merge(theirs)
    assert mine.seen == 220
    assert mine.history < (1.0 + MORE_ROOM) * bound
    assert formulas(mine, "v") == ["v' = v + action.a"]
    before = mine.history
    mine.learn_one(steps(1, -2.0, 2.0, seed=9)[0])
    assert mine.history == before + 1


def test_the_other_one_may_have_seen_more_objects() -> None:
    kind = ObjectType("p", ("x", "v"))
    schema = SceneSchema((replace(kind, optional=True),), tuple((name, "p") for name in "abc"))

    def seen(names: str, seed: int) -> WorldModel:
        rng, model = np.random.default_rng(seed), WorldModel(schema)
        for _ in range(40):
            states = {name: rng.uniform(-1.0, 1.0, 2) for name in names}
            after = {name: [x + v, 0.9 * v] for name, (x, v) in states.items()}
            model.learn_one(Transition(schema.scene(states), schema.scene(after)))
        return model

    for mine, theirs in (("", "abc"), ("ab", "abc"), ("abc", "a")):
        model = seen(mine, 0) if mine else WorldModel(schema)
        model.merge(seen(theirs, 1))
        told = model.predict_one(schema.scene({"a": [1.0, 1.0], "b": [0.0, -1.0]}))
        np.testing.assert_allclose(told.scene.vector, [2.0, 0.9, -1.0, -0.9])


def test_what_cannot_be_merged_leaves_the_model_as_it_was() -> None:
    kind = ObjectType("p", ("x", "v"))
    plain = SceneSchema((kind,), (("a", "p"),), kinematics=(Kinematics("p", "x", "v"),))
    model = WorldModel(plain)
    for what in ({"offsets": True}, {"kinematics": (Kinematics("p", "x", "v", 0.01),)}, {"precision": 1e-6}):
        with pytest.raises(ConfigError, match=f"of another world: {next(iter(what))}="):
            model.merge(WorldModel(replace(plain, **what)))  # type: ignore[arg-type]
    assert model.seen == 0
