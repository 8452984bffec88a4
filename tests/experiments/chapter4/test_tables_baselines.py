"""Cells won and lost at equal features, by hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.scores import target_score
from relgym.experiments.chapter4.tables_baselines import headline_shown


def _run(floor: float, corner: float, best: float | None = None) -> dict[str, Any]:
    """Eight steps of flight predicted exactly, two floor bounces and one corner with these errors."""
    truth = np.array([0] * 8 + [1] * 2 + [-1])
    residual = np.array([0.0] * 8 + [floor] * 2 + [corner])
    known = None if best is None else np.array([0.0] * 8 + [best] * 3)
    score = target_score(
        ("fly", "floor (left), ceiling (left)"),
        truth,
        truth >= 0,
        residual,
        np.zeros(11, dtype=np.bool_),
        known,
        np.ones(11),
    )
    return {"scores": [{"episodes": 16, "targets": {"ball.vx": score, "ball.vy": score}}], "asking": 0.1}


def test_cells_are_won_level_or_lost_and_every_loss_has_its_cause() -> None:
    values = {
        "thesis": [_run(0.5, 0.1, best=0.4)],
        "default": [_run(0.0, 0.9)],
        "knn/thesis": [_run(0.2, 0.9)],
        "knn/contact": [_run(0.1, 0.3)],
    }
    text = headline_shown(Protocol.fast(1), values).text
    thesis, default = text.split("\n")[:2]
    # Per target: p50 is level; the floor's error loses "modes", the corner's loses p95, p99.9 and the mean.
    assert "10 cells: ahead in 6, level in 2, behind in 2 (ahead or level: 80.0%)" in thesis
    assert "10 cells: ahead in 2, level in 2, behind in 6 (ahead or level: 40.0%)" in default
    losses = text.split("what errs most of ours\n")[1].split("\n\n")[0]
    assert losses.count("floor (left): 2 of 2 wrong, 2 not learned") == 2
    assert losses.count("corners and contacts that no linear law explains") == 6


def test_batches_of_which_only_some_have_modes_are_pooled() -> None:
    """Of one batch it is known what the best mode leaves; another one's laws have no modes."""
    mixed = [_run(0.5, 0.1, best=0.4), _run(0.0, 0.1)]
    values = {"thesis": mixed, "default": mixed, "knn/thesis": [_run(0.01, 0.05)] * 2}
    for some in (mixed, mixed[::-1]):
        text = headline_shown(Protocol.fast(1), values | {"thesis": some}).text
        assert "floor (left): 2 of 4 wrong" in text


def test_nothing_lost_is_said() -> None:
    ours, theirs = [_run(0.0, 0.0, best=0.0)], [_run(0.1, 0.1)]
    shown = headline_shown(Protocol.fast(1), {"thesis": ours, "default": ours, "knn/thesis": theirs})
    assert "No cell is lost." in shown.text
