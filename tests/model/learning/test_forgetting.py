"""Bounded memory: what stays, what is counted, and that forgetting changes no answer."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from points import formulas, learned, schema_of, transitions

from relgym.config import ModelConfig
from relgym.config.constants import MORE_ROOM
from relgym.errors import ConfigError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition

SCHEMA = schema_of(("v",), ("a",))
BOUND = 200


def bounces(n: int, seed: int = 0) -> list[Transition]:
    """v' = v + a, but where v > 2: turned round; one step in thirty."""
    rng = np.random.default_rng(seed)
    v = np.where(rng.random(n) < 1 / 30, rng.uniform(2.0, 3.0, n), rng.uniform(-2.0, 2.0, n))
    step = lambda s, u: [-0.5 * s[0] if s[0] > 2.0 else s[0] + u[0]]  # noqa: E731
    return transitions(SCHEMA, step, v[:, None], rng.normal(size=(n, 1)))


@pytest.fixture(scope="module")
def old() -> WorldModel:
    return learned(SCHEMA, bounces(1200), history=BOUND)


def test_the_history_is_bounded(old: WorldModel) -> None:
    assert BOUND <= old.history <= (1.0 + MORE_ROOM) * BOUND + 100


def test_both_modes_live_on_and_count_all_they_explained(old: WorldModel) -> None:
    assert sorted(formulas(old, "v")) == ["v' = -0.5 v", "v' = v + action.a"]
    counts = sorted(mode.examples for mode in old.modes("self", "v"))
    assert sum(counts) + old.property_model("self", "v").clusterer.noise_examples == 1200
    assert counts[0] >= 25


def test_rare_modes_are_kept_whole(old: WorldModel) -> None:
    clusterer = old.property_model("self", "v").clusterer
    rare = min(old.modes("self", "v"), key=lambda m: m.examples)
    assert (clusterer.labels == rare.id).sum() >= 10


def test_answers_are_those_of_a_model_that_forgets_nothing(old: WorldModel) -> None:
    whole = learned(SCHEMA, bounces(1200))
    for t in bounces(100, seed=1):
        assert old.predict_one(t.before).scene.vector == pytest.approx(
            whole.predict_one(t.before).scene.vector
        )


def test_what_stays_is_spread_over_all_times(old: WorldModel) -> None:
    serials = old._parts.tables["self"].serials
    assert (np.diff(serials) > 0).all()
    quarters = np.bincount(serials * 4 // 1200, minlength=4)
    assert quarters.min() >= 0.5 * quarters.mean()


def test_saved_and_loaded_it_goes_on_as_if_never_saved(old: WorldModel, tmp_path: Path) -> None:
    old.save(tmp_path / "old.zip", history=True)
    again = WorldModel.load(tmp_path / "old.zip")
    for model in (again, twin := WorldModel.load(tmp_path / "old.zip")):
        for t in bounces(150, seed=2):
            model.learn_one(t)
    assert json.dumps(again.to_json(history=True)) == json.dumps(twin.to_json(history=True))
    assert again.history <= (1.0 + MORE_ROOM) * BOUND + 100


def test_a_bound_too_small_is_refused() -> None:
    with pytest.raises(ConfigError, match="history"):
        ModelConfig(history=10)
