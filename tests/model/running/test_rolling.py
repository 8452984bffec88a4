"""Roll-outs of many scenes come to where those of single scenes come to, whoever runs them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dreams import cart_model
from programs import MODELS, scenes_of

from relgym.config import ModelConfig
from relgym.errors import ConfigError, ObservationError
from relgym.model.running.compiled import KERNEL
from relgym.model.running.rolling import step_by_step
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, Scene


@pytest.mark.parametrize("name", MODELS)
def test_each_is_a_roll_out(name: str) -> None:
    model = MODELS[name]()
    KERNEL.load()
    layout, vectors = scenes_of(model, 40)
    vectors = np.ascontiguousarray(vectors)
    found = model.rollout_batch(layout, vectors, 6)
    known = step_by_step(model.predict_batch, layout, vectors, np.empty((6, 40, 0)), 0)
    np.testing.assert_array_equal(found.lasted, known.lasted)
    np.testing.assert_array_equal(found.vectors, known.vectors)
    for k in range(5):
        alone = model.rollout(Scene(model.schema, layout, vectors[k].copy()), 6)
        assert sum(each.ok for each in alone) == found.lasted[k]
        last = [vectors[k], *(each.scene.vector for each in alone if each.ok)][-1]
        np.testing.assert_array_equal(found.vectors[k], last)


def test_actions_are_taken_one_after_the_other() -> None:
    model = cart_model()
    KERNEL.load()
    layout, vectors = scenes_of(model, 5)
    where = layout.slice(layout.index(ACTION))
    rng = np.random.default_rng(0)
    actions = rng.choice(vectors[:, where][:, 0], size=(4, 5, where.stop - where.start))
    found = model.rollout_batch(layout, vectors, 4, actions)
    for k in range(5):
        alone = model.rollout(Scene(model.schema, layout, vectors[k].copy()), 4, actions[:, k])
        assert len(alone) == 4 and found.lasted[k] == sum(each.ok for each in alone)
        if all(each.ok for each in alone):
            np.testing.assert_array_equal(found.vectors[k], alone[-1].scene.vector)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"steps": 0}, ConfigError, "steps"),
        ({"device": "gpu"}, ConfigError, "device='gpu': expected 'cpu' or 'cuda'"),
        (
            {"actions": np.zeros((2, 5, 9))},
            ObservationError,
            r"actions: expected shape \(2, 5, 1\), got \(2, 5, 9\)",
        ),
        ({"actions": np.full((2, 5, 1), np.nan)}, ObservationError, "actions: some are NaN or infinite"),
        ({"vectors": np.zeros((5, 2))}, ObservationError, "expected vectors of shape"),
    ],
)
def test_bad_calls(arguments: dict[str, Any], error: type[Exception], words: str) -> None:
    model = cart_model()
    layout, vectors = scenes_of(model, 5)
    given = {"layout": layout, "vectors": vectors, "steps": 2} | arguments
    with pytest.raises(error, match=words):
        model.rollout_batch(**given)
    if "device" in arguments:
        with pytest.raises(error, match=words):
            model.predict_batch(layout, vectors, **arguments)


def test_numbers_that_overflow_are_refused() -> None:
    """As for a single scene: what can't be is said, not rolled out."""
    model = cart_model()
    layout, vectors = scenes_of(model, 3)
    wrong = vectors.copy()
    wrong[1, 0] = np.inf
    with pytest.raises(ObservationError):
        model.rollout_batch(layout, wrong, 2)


def test_arrays_answer_where_there_is_no_program() -> None:
    model = WorldModel(cart_model().schema, ModelConfig())
    layout, vectors = scenes_of(cart_model(), 3)
    found = model.rollout_batch(layout, vectors, 2)
    assert found.lasted.tolist() == [0, 0, 0]
    np.testing.assert_array_equal(found.vectors, vectors)
