"""The demonstration's parts: lessons through the wrapper, figures and pictures."""

from __future__ import annotations

import builtins
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relgym.envs.tasks import Region
from relgym.errors import ConfigError
from relgym.experiments.demo import demonstrate_all, demonstrations, learn_online
from relgym.experiments.episodes import Episode
from relgym.experiments.plots import Curve, Imagined, Trajectory, draw_curves, draw_trajectories
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.world_model import WorldModel


def test_lessons_are_the_thesis_data() -> None:
    ball, modes, truck = demonstrations()
    assert (ball.training, ball.testing) == (modes.training, modes.testing)
    assert sum(len(episode) for episode in truck.training(0)) == 1920
    assert sum(len(episode) for episode in ball.training(0)) == 16_000
    assert sum(len(episode) for episode in ball.testing(0)) == 24_000


def test_what_the_wrapper_sees_are_the_episodes_own_transitions() -> None:
    ball = demonstrations(quick=True)[0]
    episodes, env = list(ball.training(5))[:2], ball.make()
    taught = WorldModel(env.model.schema, env.model.config)
    lesson = learn_online(env, ball, seed=5)
    for episode in episodes:
        next(lesson)
        for transition in episode.transitions():
            compare_and_learn(taught, transition, taught.predict_one(transition.before))
    env.model.finish()
    taught.finish()
    assert env.model.to_json() == taught.to_json()


def test_forces_arrive_in_newtons() -> None:
    truck = demonstrations(quick=True)[2]
    episode, env = next(iter(truck.training(2))), truck.make()
    first = next(learn_online(env, truck, seed=2))
    assert first.steps == 40 and set(first.wrong) == {"truck.vx", "box.px"}
    physical = episode.columns("action", "force")[:-1, 0]
    assert physical.min() >= 300.0 and physical.max() <= 500.0
    assert env.model.seen == 40


def test_the_first_episode_is_the_hardest() -> None:
    ball = demonstrations(quick=True)[0]
    lesson = learn_online(ball.make(), ball, seed=0)
    curve = [next(lesson) for _ in range(6)]
    for target in ("ball.vx", "ball.vy"):
        assert curve[0].wrong[target] > curve[-1].wrong[target]


@pytest.mark.slow
def test_two_processes_tell_what_one_does(tmp_path: Path) -> None:
    shown = [replace(each, episodes=2, training=partial(_first, each.training)) for each in SHOWN[::2]]
    shown = [replace(each, testing=partial(_first, each.testing)) for each in shown]
    told: dict[int, list[tuple[str, int]]] = {1: [], 2: []}
    found = {
        jobs: list(
            demonstrate_all(
                shown,
                tmp_path,
                seed=3,
                jobs=jobs,
                told=lambda name, done, jobs=jobs: told[jobs].append((name, done)),
            )
        )
        for jobs in (1, 2)
    }
    for (one, dreams), (other, same) in zip(found[1], found[2], strict=True):
        # As text, for NaN is not even equal to itself.
        assert repr(replace(one, seconds=0.0)) == repr(replace(other, seconds=0.0))
        assert [d.predicted for d in dreams] == [d.predicted for d in same]
        for a, b in zip(dreams, same, strict=True):
            np.testing.assert_array_equal(a.vectors, b.vectors)
    assert told[1] == [("ball", 1), ("ball", 2), ("truck", 1), ("truck", 2)]
    assert set(told[2]) <= set(told[1])


SHOWN = demonstrations(quick=True)


def _first(source: Callable[[int], Iterable[Episode]], seed: int) -> Iterable[Episode]:
    return islice(source(seed), 2)


def _trajectory(off: float = 0.0, *more: Imagined, **changes: Any) -> Trajectory:
    episode = next(iter(SHOWN[0].training(0)))
    imagined = episode.vectors.copy()
    imagined[10:, episode.layout.column(episode.layout.index("ball"), "px")] += off
    own = Imagined("model", imagined, len(episode))
    return Trajectory("ball", episode.scene(0), "ball", episode.vectors, (own, *more), **changes)


def test_distance_between_real_and_imagined() -> None:
    shown = _trajectory(0.25)
    np.testing.assert_allclose(
        shown.error(shown.imagined[0]), np.where(np.arange(201) < 10, 0.0, 0.25), atol=1e-12
    )
    short = replace(shown.imagined[0], predicted=12)
    assert len(shown.error(short)) == 13


def _image(path: Path) -> Any:
    from matplotlib.image import imread

    picture = imread(path)
    assert np.ptp(picture) > 0.5, "not a blank page"
    return picture


def test_pictures_are_written(tmp_path: Path) -> None:
    shown = [_trajectory(), _trajectory(0.25)]
    assert _image(draw_trajectories(tmp_path / "paths.png", shown)).shape[:2] == (666, 1080)
    curves = {
        "ball": [Curve("ball.vx", [200, 400], [0.5, 0.0]), Curve("ball.vy", [200, 400], [0.5, 0.1])],
        "truck": [Curve("truck.vx", [40], [1.0])],
    }
    assert _image(draw_curves(tmp_path / "curves.png", curves)).shape[:2] == (378, 1080)


def _reddish(picture: Any) -> int:
    """How many pixels have the colour of a second model's lines, and of marked steps."""
    return int((np.abs(picture[..., :3] - np.array([196, 78, 82]) / 255.0).max(axis=2) < 0.02).sum())


def test_what_goes_astray_and_what_is_marked_is_drawn(tmp_path: Path) -> None:
    plain = _trajectory()
    agrees = Imagined("second", plain.real, 200)
    strays = replace(agrees, vectors=_trajectory(0.5).imagined[0].vectors)
    region = Region(0.0, 0.0, 0.1, 0.1)
    red = {
        name: _reddish(_image(draw_trajectories(tmp_path / f"{name}.png", [shown])))
        for name, shown in {
            "agrees": _trajectory(0.0, agrees),
            "strays": _trajectory(0.0, strays),
            "marked": _trajectory(0.0, agrees, events=((20, "corner"),), marks=(region,)),
        }.items()
    }
    assert red["strays"] > red["agrees"] + 100 and red["marked"] > red["agrees"] + 50


def test_a_path_that_leaves_the_scene_is_drawn_in_snapshots_and_over_time(tmp_path: Path) -> None:
    episode = next(iter(SHOWN[2].training(0)))
    dream = Imagined("model", episode.vectors, 7)
    shown = Trajectory("truck", episode.scene(0), "truck", episode.vectors, (dream,))
    assert _image(draw_trajectories(tmp_path / "truck.png", [shown])).shape[1] == 1080


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
        draw_curves(tmp_path / "curves.png", {"ball": [Curve("ball.vx", [1], [0.0])]})
