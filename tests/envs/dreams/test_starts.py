"""First scenes of dreams are drawn from those that are known, each as often."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from relgym.envs.dreams.starts import Drawn, drawn_from
from relgym.errors import ConfigError
from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema

SCHEMA = SceneSchema((ObjectType("cart", ("x",), optional=True),), (("a", "cart"), ("b", "cart")))
BOTH = [SCHEMA.scene({"a": [float(k)], "b": [-float(k)]}) for k in range(3)]


def test_each_scene_comes_as_often() -> None:
    drawn = drawn_from(BOTH)(np.random.default_rng(0), 3000)
    assert drawn.shape == (3000, 2) and (drawn[:, 0] == -drawn[:, 1]).all()
    assert np.abs(np.bincount(drawn[:, 0].astype(int), minlength=3) - 1000).max() < 120


def test_vectors_may_be_given_and_are_copied_as_floats() -> None:
    given = np.array([[1, 2], [3, 4]])
    start = Drawn(given)
    given[:] = 0
    drawn = start(np.random.default_rng(1), 50)
    assert drawn.dtype == np.float64 and {tuple(row) for row in drawn.tolist()} == {(1.0, 2.0), (3.0, 4.0)}
    assert start.fit(lambda scene: scene.vector) is start


def test_scenes_are_fitted_to_a_world() -> None:
    turned = Drawn(BOTH).fit(lambda scene: scene.vector[::-1].copy())
    assert {tuple(row) for row in turned(np.random.default_rng(0), 40).tolist()} == {
        (-0.0, 0.0),
        (-1.0, 1.0),
        (-2.0, 2.0),
    }


def test_scenes_of_several_layouts_must_be_fitted_first() -> None:
    mixed = Drawn([BOTH[0], SCHEMA.scene({"a": [1.0]})])
    with pytest.raises(ConfigError, match="hold different objects"):
        mixed(np.random.default_rng(0), 1)
    fitted = mixed.fit(lambda scene: np.array([scene["a"]["x"]]))
    assert {row[0] for row in fitted(np.random.default_rng(0), 40).tolist()} == {0.0, 1.0}


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ([], "expected some scenes with the same objects, got none"),
        (np.empty((0, 2)), r"got an array of shape \(0, 2\)"),
        (np.zeros(3), r"got an array of shape \(3,\)"),
        ("scenes", "expected scenes, or an array of state vectors"),
        ([BOTH[0], 5], "expected scenes, or an array of state vectors"),
        (None, "expected scenes, or an array of state vectors, got None"),
    ],
)
def test_what_is_no_start(given: Any, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        drawn_from(given)
