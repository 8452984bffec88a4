"""What a roll-out that goes wrong is called (Table 4.18)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from relgym.experiments.chapter4.rolled import cause_of, imagine, trial_episodes
from relgym.experiments.episodes import Episode


@pytest.fixture(scope="module")
def trials() -> list[Episode]:
    return trial_episodes(1, [900], 40)


def _flights(trials: list[Episode], *, risen: bool) -> Iterator[tuple[Episode, int]]:
    """Steps of free flight in which the ball still overlaps what it lay on, or bounced off, the step before."""
    for episode in trials:
        truth, vy = episode.truth, episode.columns("ball", "vy")[:, 0]
        slide = list(truth.mode_names["ball.vy"]).index("slide, floor")
        bounce = list(truth.mode_names["ball.vy"]).index("bounce, floor")
        for k in range(1, len(truth.active)):
            before = truth.mode["ball.vy"][k - 1]
            freed = truth.active[k] == 0 and truth.touched[k] & truth.pushing[k - 1]
            if freed and before == (bounce if risen else slide) and (vy[k] > 0) == risen:
                yield episode, k


def test_a_ball_past_an_edge_that_is_said_to_lie_there_still_falls_late(trials: list[Episode]) -> None:
    found = list(_flights(trials, risen=False))
    assert found, "some balls slide off the box"
    for episode, k in found:
        vx, vy = episode.columns("ball", "vx", "vy")[k]
        assert vy == 0.0
        assert cause_of(episode, k, 1, np.array([vx, 0.0])) == "delayed falling"


def test_a_ball_that_rises_and_is_said_to_bounce_again_was_badly_resolved(trials: list[Episode]) -> None:
    found = list(_flights(trials, risen=True))
    assert found, "some bounces leave the ball inside for a step"
    for episode, k in found:
        vx, vy = episode.columns("ball", "vx", "vy")[k]
        assert cause_of(episode, k, 1, np.array([vx, -0.9 * vy])) == "bad collision resolution, level surface"


@pytest.mark.parametrize("learner", ["original", "default"])
def test_the_most_accurate_of_several_models_imagines(learner: str) -> None:
    found = imagine(
        learner=learner,
        experiment=1,
        batches=[[900, 0], [901, 1]],
        episodes=3,
        chosen_on={"seeds": [902], "episodes": 2},
        tests=[903],
        trials=2,
    )
    assert found["batch"] in ([900, 0], [901, 1])
    assert len(found["trials"]) == 2
