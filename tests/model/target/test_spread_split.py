"""Noise that depends on a number."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from points import learned, schema_of, transitions

from relgym.config import ClusteringConfig
from relgym.config.constants import ENOUGH
from relgym.model.reports.spread_text import spread_text
from relgym.model.target.spread_split import Split, find_split
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene

SCHEMA = schema_of(("x", "w"), ("a",))


def scattered(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return np.abs(rng.normal(size=n)), rng.normal(size=(n, 2))


def test_a_threshold_that_tells_loud_from_quiet_is_found() -> None:
    error, x = scattered(400)
    error[x[:, 1] > 0.5] *= 0.02
    found = find_split(error, x, ("x", "w"), 1e-9)
    assert found is not None
    assert found.name == "w"
    assert found.threshold == pytest.approx(0.5, abs=0.05)
    assert found.below == pytest.approx(1.0, rel=0.15)
    assert found.above == pytest.approx(0.02, rel=0.15)
    assert (found.of(0.4), found.of(0.6)) == (found.below, found.above)


def test_zero_is_a_threshold_of_its_own() -> None:
    error, x = scattered(400)
    error[x[:, 0] > 0.0] *= 0.02
    found = find_split(error, x, ("x", "w"), 1e-9)
    assert found is not None
    assert (found.name, found.threshold) == ("x", 0.0)


@given(st.integers(0, 200))
def test_even_noise_is_not_split(seed: int) -> None:
    error, x = scattered(300, seed)
    assert find_split(error, x, ("x", "w"), 1e-9) is None


def test_a_few_examples_are_no_side() -> None:
    error, x = scattered(400)
    x[:, 0] = 0.0
    x[: ENOUGH - 1, 0] = 1.0
    error[: ENOUGH - 1] *= 1e-3
    assert find_split(error, x, ("x", "w"), 1e-9) is None
    x[ENOUGH - 1, 0], error[ENOUGH - 1] = 1.0, 1e-3
    found = find_split(error, x, ("x", "w"), 1e-9)
    assert found is not None
    assert (found.name, found.threshold) == ("x", 0.0)


def test_rounding_is_not_told_apart() -> None:
    error, x = scattered(400)
    error[x[:, 0] > 0.0] *= 0.02
    assert find_split(1e-12 * error, x, ("x", "w"), 1e-9) is None


# ---------------------------------------------------------------------- in a model
@pytest.fixture(scope="module")
def rough() -> WorldModel:
    """A road that is smooth where x is at most 0."""
    rng = np.random.default_rng(0)
    noise = rng.normal(size=900).tolist()
    starts, actions = rng.normal(size=(900, 2)), rng.normal(size=(900, 1))
    step = lambda s, u: [s[0], 0.9 * s[1] + u[0] + (0.002 if s[0] <= 0.0 else 0.05) * noise.pop()]  # noqa: E731
    # With a noise that is given, no guess is asked whether it is better by a hair.
    return learned(
        SCHEMA, transitions(SCHEMA, step, starts, actions), clustering=ClusteringConfig(noise_std=0.03)
    )


def at(x: float) -> Scene:
    return SCHEMA.scene({"self": [x, 0.3], "action": [0.1]})


def test_the_spread_of_a_prediction_is_that_of_its_side(rough: WorldModel) -> None:
    smooth, bumpy = (rough.predict_one(at(x))["self", "w"].spread for x in (-0.5, 0.5))
    assert smooth == pytest.approx(0.002, rel=0.3)
    assert bumpy == pytest.approx(0.05, rel=0.3)


def test_the_report_tells_the_sides_apart(rough: WorldModel) -> None:
    (mode,) = rough.modes("self", "w")
    split = rough.property_model("self", "w").spreads.by_mode[mode.id].split
    assert split is not None
    assert str(split) in rough.describe(details=True)
    assert str(Split("x", 0.25, 0.002, 0.05)) == "± 0.002 where x <= 0.25, ± 0.05 else"


def test_a_file_knows_the_sides(rough: WorldModel, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("models") / "rough.json"
    rough.save(path)
    again = WorldModel.load(path)
    spreads = [m.property_model("self", "w").spreads for m in (rough, again)]
    assert spreads[0].by_mode == spreads[1].by_mode
    assert again.predict_one(at(0.5)).parts == rough.predict_one(at(0.5)).parts
    assert spread_text(next(iter(spreads[1].by_mode.values())), ()).startswith("± 0.00")
