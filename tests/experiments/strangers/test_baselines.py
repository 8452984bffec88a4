"""What others make of a model's columns, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from points import learned, schema_of, transitions

from relgym.experiments.strangers.baselines import predicted, ridge, sparse
from relgym.scene.objects import Transition

SCHEMA = schema_of(("x", "v"), ("a",))


def curve(n: int, seed: int) -> list[Transition]:
    """v changes by 0.3 sin(x) + 0.1 a, x by 1."""
    rng = np.random.default_rng(seed)
    found: list[Transition] = transitions(
        SCHEMA,
        lambda s, u: [s[0] + 1.0, s[1] + 0.3 * np.sin(s[0]) + 0.1 * u[0]],
        np.column_stack([rng.uniform(-3.0, 3.0, n), rng.normal(size=n)]),
        rng.normal(size=(n, 1)),
    )
    return found


def test_baselines_are_given_the_models_own_columns() -> None:
    training, fresh = curve(200, 0), curve(50, 1)
    v = np.array([t.before["self"]["v"] for t in fresh])
    change = np.array([t.after["self"]["v"] for t in fresh]) - v
    off = {}
    for features in ((), ("trig",)):
        said = predicted(learned(SCHEMA, training, features=features), training, fresh, {"library": ridge})
        assert set(said) == {"library"} and set(said["library"]) == {"self.x", "self.v"}
        np.testing.assert_allclose(said["library"]["self.x"], 1.0)
        off[features] = float(np.abs(said["library"]["self.v"] - change).max())
    assert off["trig",] < 0.01 < 0.1 < off[()]


def test_a_penalty_of_one() -> None:
    """Least squares of (1, 2) on a column (1, 1): 3 / 2; with a penalty of 1: 3 / 3."""
    assert ridge(np.ones((2, 1)), np.array([1.0, 2.0])).tolist() == [1.0]


def test_small_weights_are_dropped() -> None:
    pytest.importorskip("pysindy")
    rng = np.random.default_rng(0)
    x = rng.normal(size=(200, 4))
    y = 2.0 * x[:, 1] + 1e-6 * x[:, 2]
    np.testing.assert_allclose(sparse(x, y), [0.0, 2.0, 0.0, 0.0], atol=1e-4)
