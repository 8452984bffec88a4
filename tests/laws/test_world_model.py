"""Contact laws inside the world model: learned from a stream, exact everywhere, carried over, saved and told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relgym.config import ModelConfig
from relgym.errors import ConfigError
from relgym.experiments.data import BallExperiment, ball_episodes
from relgym.model.world_model import WorldModel

STEEP = BallExperiment(60.0, 0.9, (0.0,), 80)


def wrong(model: WorldModel, experiment: int | BallExperiment, episodes: int) -> int:
    """Transitions off by more than 1e-9, or abstained, corners and several contacts included."""
    count = 0
    for episode in ball_episodes(experiment, seed=91, episodes=episodes, test=True):
        predicted = model.predict_batch(episode.layout, episode.vectors[:-1])
        columns = [episode.layout.column(episode.layout.index("ball"), p) for p in ("vx", "vy")]
        off = np.abs(predicted.vectors[:, columns] - episode.vectors[1:][:, columns]).max(axis=1) > 1e-9
        count += int((off | ~predicted.ok).sum())
    return count


@pytest.fixture(scope="module")
def model() -> WorldModel:
    """Experiment 1 after twelve episodes."""
    known: WorldModel | None = None
    for episode in ball_episodes(1, seed=7, episodes=12):
        known = known or WorldModel(episode.schema)
        for transition in episode.transitions():
            known.learn_one(transition)
    assert known is not None
    known.finish()
    return known


def test_three_sentences_tell_everything(model: WorldModel) -> None:
    told = model.describe(details=True)
    for law in ("vx' = vx, vy' = vy - 0.00098", "v'_n = max(u_n, -0.9 v_n)", "v'_t = u_t"):
        assert law in told


def test_every_transition_is_predicted_corners_included(model: WorldModel) -> None:
    assert wrong(model, 1, 20) == 0


def test_the_laws_hold_on_another_incline(model: WorldModel) -> None:
    assert wrong(model, STEEP, 20) == 0


def test_the_thesis_functions_follow(model: WorldModel) -> None:
    told = model.describe(details=True, frame="world", incline=30)
    assert "vx' = 0.525 vx - 0.8227241 vy + 0.0004243524" in told  # Table 4.2
    assert "vy' = -0.8227241 vx - 0.425 vy - 0.000245" in told


def test_single_and_batched_predictions_agree_bit_for_bit(model: WorldModel) -> None:
    episode = next(iter(ball_episodes(1, seed=92, episodes=1, test=True)))
    batched = model.predict_batch(episode.layout, episode.vectors[:-1]).vectors
    for k in range(0, len(episode), 5):
        assert model.predict_one(episode.scene(k)).scene.vector.tobytes() == batched[k].tobytes()


@pytest.mark.parametrize("history", [False, True])
def test_files_keep_the_laws(model: WorldModel, tmp_path: Path, history: bool) -> None:
    model.save(tmp_path / "model", history=history)
    again = WorldModel.load(tmp_path / "model")
    assert again.describe(details=True) == model.describe(details=True)
    assert again.describe() == model.describe()
    assert wrong(again, 1, 3) == 0


def test_the_thesis_learner_stays_selectable() -> None:
    episode = next(iter(ball_episodes(1, seed=7, episodes=1)))
    model = WorldModel(episode.schema, ModelConfig(frames="world"))
    for transition in episode.transitions():
        model.learn_one(transition)
    assert "mode" in model.describe(details=True) and "v'_n" not in model.describe()
    with pytest.raises(ConfigError, match="frames must be one of"):
        ModelConfig(frames="moon")  # type: ignore[arg-type]
