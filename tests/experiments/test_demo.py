"""The demonstration's parts: lessons through the wrapper, figures and pictures."""

from __future__ import annotations

import builtins
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relgym.errors import ConfigError
from relgym.experiments.demo import demonstrations, learn_online
from relgym.experiments.plots import Trajectory, draw_curves, draw_trajectories
from relgym.model.world_model import WorldModel


def test_lessons_are_the_thesis_data() -> None:
    truck, ball = demonstrations()
    assert sum(len(episode) for episode in truck.training(0)) == 1920
    assert sum(len(episode) for episode in ball.training(0)) == 16_000
    assert sum(len(episode) for episode in ball.testing(0)) == 24_000


def test_what_the_wrapper_sees_are_the_episodes_own_transitions() -> None:
    ball = demonstrations(quick=True)[1]
    episodes, env = list(ball.training(5))[:2], ball.make()
    taught = WorldModel(env.model.schema, env.model.config)
    lesson = learn_online(env, ball, seed=5)
    for episode in episodes:
        next(lesson)
        for transition in episode.transitions():
            taught.learn_one(transition)
    env.model.finish()
    taught.finish()
    assert env.model.to_json() == taught.to_json()


def test_forces_arrive_in_newtons() -> None:
    truck = demonstrations(quick=True)[0]
    episode, env = next(iter(truck.training(2))), truck.make()
    first = next(learn_online(env, truck, seed=2))
    assert first.steps == 40 and set(first.wrong) == {"truck.vx", "box.px"}
    physical = episode.columns("action", "force")[:-1, 0]
    assert physical.min() >= 300.0 and physical.max() <= 500.0
    assert env.model.seen == 40


def test_the_first_episode_is_the_hardest() -> None:
    ball = demonstrations(quick=True)[1]
    lesson = learn_online(ball.make(), ball, seed=0)
    curve = [next(lesson) for _ in range(6)]
    for target in ("ball.vx", "ball.vy"):
        assert curve[0].wrong[target] > curve[-1].wrong[target]


def _trajectory(off: float = 0.0) -> Trajectory:
    episode = next(iter(demonstrations(quick=True)[1].training(0)))
    imagined = episode.vectors.copy()
    imagined[10:, episode.layout.column(episode.layout.index("ball"), "px")] += off
    return Trajectory("ball", episode.scene(0), "ball", episode.vectors, imagined, len(episode))


def test_distance_between_real_and_imagined() -> None:
    error = _trajectory(0.25).error
    np.testing.assert_allclose(error, np.where(np.arange(201) < 10, 0.0, 0.25), atol=1e-12)


def _size(path: Path) -> tuple[int, ...]:
    from matplotlib.image import imread

    picture: Any = imread(path)
    assert np.ptp(picture) > 0.5, "not a blank page"
    return tuple(picture.shape)


def test_pictures_are_written(tmp_path: Path) -> None:
    shown = [_trajectory(), _trajectory(0.25)]
    assert _size(draw_trajectories(tmp_path / "paths.png", shown))[:2] == (558, 1080)
    curves = {"ball": {"ball.vx": [0.5, 0.1, 0.0], "ball.vy": [0.5, 0.1, 0.0]}, "truck": {"truck.vx": [1.0]}}
    assert _size(draw_curves(tmp_path / "curves.png", curves))[:2] == (378, 1080)


def test_a_path_that_leaves_the_scene_is_drawn_over_time(tmp_path: Path) -> None:
    episode = next(iter(demonstrations(quick=True)[0].training(0)))
    shown = Trajectory("truck", episode.scene(0), "truck", episode.vectors, episode.vectors, 7)
    assert _size(draw_trajectories(tmp_path / "truck.png", [shown]))[1] == 1080


@pytest.fixture
def without_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    original: Callable[..., Any] = builtins.__import__

    def refuse(name: str, *rest: Any, **named: Any) -> Any:
        if name.split(".")[0] == "matplotlib":
            raise ImportError(name)
        return original(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", refuse)


@pytest.mark.usefixtures("without_matplotlib")
def test_missing_matplotlib_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"relgym\[viz\]"):
        draw_curves(tmp_path / "curves.png", {"ball": {"ball.vx": [0.0]}})
