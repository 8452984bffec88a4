"""Roll-outs are timed on scenes that a model knows; without a card it is said why nothing was measured there."""

from __future__ import annotations

import math

import pytest

from relgym.experiments.speed import rolls


def test_scenes_are_ones_that_the_model_knows() -> None:
    model, layout, vectors = rolls.scenes("ball by laws", 50)
    assert vectors.shape == (50, layout.width)
    assert (model.rollout_batch(layout, vectors, 3).lasted == 3).all()


def test_without_a_card(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rolls, "speeds", lambda world: (2e6, math.nan, "no card"))
    monkeypatch.setattr(rolls, "engine", lambda world: world)
    monkeypatch.setattr(rolls, "rate", lambda envs, **_: 5e4)
    assert rolls.trial(world="ball by laws") == {"engine": 5e4, "core": 2e6, "card": None, "why": "no card"}
