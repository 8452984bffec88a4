"""What learners are told about their models."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from relgym.config import ModelConfig
from relgym.errors import ConfigError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, TASK, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.wrappers.settings import check_model, model_of, target_of, targets_of

CART, PUSH = ObjectType("cart", ("x", "v")), ObjectType(ACTION, ("push",))
SCHEMA = SceneSchema((CART, PUSH), (("cart", "cart"), (ACTION, ACTION)), targets=(Target("cart", "v"),))


@pytest.mark.parametrize(
    ("given", "target"),
    [
        (Target("cart", "v"), Target("cart", "v")),
        ("cart.v", Target("cart", "v")),
        ("cart.rear.v", Target("cart.rear", "v")),  # names of types may hold dots
        (("cart", "v"), Target("cart", "v")),
        (["cart", "v"], Target("cart", "v")),
        (("cart", "x", [["cart", "v"]]), Target("cart", "x", (("cart", "v"),))),
    ],
)
def test_ways_to_name_a_target(given: Any, target: Target) -> None:
    assert target_of(given) == target


@pytest.mark.parametrize("given", ["cart", ".v", "cart.", "", ("cart",), ("a", "b", [], 1), 5, None])
def test_what_names_no_target(given: Any) -> None:
    with pytest.raises(ConfigError, match=r"expected 'ball.vx', \('ball', 'vx'\) or a Target"):
        target_of(given)


def test_one_name_isnt_several() -> None:
    with pytest.raises(ConfigError, match=r"targets='cart.v': expected several, such as \['cart.v'\]"):
        targets_of("cart.v")
    for given in (Target("cart", "v"), 3):
        with pytest.raises(ConfigError, match="expected several"):
            targets_of(given)  # type: ignore[arg-type]
    assert targets_of(["cart.v"]) == [Target("cart", "v")]
    assert targets_of(None) is None


def test_a_new_model_has_the_config_and_targets_that_were_given() -> None:
    config = ModelConfig(seed=7)
    made = model_of(SCHEMA, config=config, targets=[Target("cart", "x")], given=None)
    assert isinstance(made, WorldModel)
    assert made.config == config and [str(t) for t in made.targets] == ["cart.x"] and made.schema == SCHEMA


def test_a_model_or_its_file_goes_on(tmp_path: Path) -> None:
    model = WorldModel(SCHEMA)
    assert model_of(SCHEMA, config=None, targets=None, given=model) is model
    model.save(tmp_path / "model.json")
    for path in (tmp_path / "model.json", str(tmp_path / "model.json")):
        loaded = model_of(SCHEMA, config=None, targets=None, given=path)
        assert loaded.schema == SCHEMA


def test_a_model_keeps_its_settings() -> None:
    for arguments in (
        {"config": ModelConfig(), "targets": None},
        {"config": None, "targets": [Target("cart", "v")]},
    ):
        with pytest.raises(ConfigError, match="pass either model or those"):
            model_of(SCHEMA, given=WorldModel(SCHEMA), **arguments)  # type: ignore[arg-type]


def test_another_world_is_named() -> None:
    other = SceneSchema((ObjectType("cart", ("x",)), PUSH), SCHEMA.objects, targets=(Target("cart", "x"),))
    with pytest.raises(ConfigError, match="model: the model was learned in another world than the env's: "):
        model_of(SCHEMA, config=None, targets=None, given=WorldModel(other))


def test_a_task_that_was_learned_or_not_is_told_apart() -> None:
    task = SceneSchema(
        (CART, PUSH, ObjectType(TASK, ("reward",))), (*SCHEMA.objects, (TASK, TASK)), targets=SCHEMA.targets
    )
    with pytest.raises(
        ConfigError, match="learned with reward or termination, and the env is wrapped without"
    ):
        model_of(SCHEMA, config=None, targets=None, given=WorldModel(task))
    with pytest.raises(
        ConfigError, match="learned without reward or termination, and the env is wrapped with"
    ):
        model_of(task, config=None, targets=None, given=WorldModel(SCHEMA))


@pytest.mark.parametrize("given", [5, {"model": 1}, WorldModel])
def test_what_is_no_model(given: Any) -> None:
    with pytest.raises(ConfigError, match="expected a WorldModel or the path of a model file"):
        check_model(given)
