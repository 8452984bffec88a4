from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from relgym.experiments.data import ball_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.verdict import Missed, Verdict, verdict
from relgym.model.world_model import WorldModel


@pytest.fixture(scope="module")
def episodes() -> list[Episode]:
    return list(islice(ball_episodes(1, seed=1000, test=True), 6))


@pytest.fixture(scope="module")
def model(episodes: list[Episode]) -> WorldModel:
    taught = WorldModel(episodes[0].schema)
    for episode in islice(ball_episodes(1, seed=0), 8):
        for transition in episode.transitions():
            taught.learn_one(transition)
    return taught


def test_a_right_model_is_right_everywhere(model: WorldModel, episodes: list[Episode]) -> None:
    found = verdict(model, episodes, trials=3)
    assert (found.right, found.steps, found.exact, found.trials, found.length) == (1200, 1200, 3, 3, 200)
    assert found.largest < 1e-12
    assert sum(missed.steps for missed in found.missed) == 1200
    assert str(found).startswith(
        "Right on 1,200 of 1,200 fresh steps; 3 of 3 roll-outs of 200 steps exact (within "
    )
    assert "misses" not in str(found)


def test_agrees_with_single_predictions(model: WorldModel, episodes: list[Episode]) -> None:
    stranger = WorldModel(episodes[0].schema, model.config)  # knows little
    transitions = list(episodes[0].transitions())
    for transition in transitions[:40]:
        stranger.learn_one(transition)
    right = 0
    for transition in transitions:
        said = stranger.predict_one(transition.before)
        close = [abs(p.value - transition.after[p.object][p.property]) <= 1e-9 for p in said.parts]
        right += said.ok and all(close)
    found = verdict(stranger, episodes[:1])
    assert 0 < right < 200
    assert (found.right, found.steps) == (right, 200)
    assert sum(missed.wrong for missed in found.missed) == 200 - right


def test_what_is_off_is_wrong_and_where_is_told(model: WorldModel, episodes: list[Episode]) -> None:
    episode = episodes[0]
    vectors, at = episode.vectors.copy(), len(episode) - 1
    for prop in ("vx", "px"):
        vectors[-1, episode.layout.column(episode.layout.index("ball"), prop)] += 1e-8
    corner = np.zeros(len(episode), dtype=bool)
    corner[at] = True
    changed = replace(episode, vectors=vectors, truth=replace(episode.truth, corner=corner))
    found = verdict(model, [changed])
    assert (found.right, found.steps) == (199, 200)
    assert found.missed[0] == Missed("steps that hit a corner", 1, 1)
    assert found.exact == 0 and np.isnan(found.largest)
    assert "1 of 1 steps that hit a corner" in str(found)


def test_one_kind_of_step_needs_no_list() -> None:
    found = Verdict(1, 3, 0, 1, 3, float("nan"), (Missed("steps", 2, 3),))
    assert str(found) == "Right on 1 of 3 fresh steps; 0 of 1 roll-outs of 3 steps exact."
