"""Roll-outs are timed on scenes that a model knows; without a card it is said why nothing was measured there."""

from __future__ import annotations

import math

import pytest

from relgym.experiments import roll_speed


def test_scenes_are_ones_that_the_model_knows() -> None:
    model, layout, vectors = roll_speed.scenes("ball by laws", 50)
    assert vectors.shape == (50, layout.width)
    assert (model.rollout_batch(layout, vectors, 3).lasted == 3).all()


def test_without_a_card(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(roll_speed, "WORLDS", ("ball by laws",))
    monkeypatch.setattr(roll_speed, "speeds", lambda world: (2e6, math.nan, "no card"))
    monkeypatch.setattr(roll_speed, "engine", lambda world: world)
    monkeypatch.setattr(roll_speed, "rate", lambda envs, **_: 5e4)
    roll_speed.main()
    assert (
        capsys.readouterr().out.splitlines()[1]
        == "ball by laws               0.050       2.0  not measured: no card"
    )
