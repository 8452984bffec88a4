"""The rules of a model say what the model says: they are read back from their text and asked about fresh scenes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path

import gymnasium as gym
import pytest

import relgym
from relgym.config import ModelConfig
from relgym.errors import ConfigError
from relgym.experiments.data import ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.online import learned
from relgym.model.reports.rules import agreement
from relgym.model.world_model import WorldModel
from relgym.reporting.parser import parse_rules
from relgym.scene.objects import Scene
from relgym.wrappers.follower import scenes_of
from relgym.wrappers.views import view_of


def scenes(episodes: Iterable[Episode]) -> Iterator[Scene]:
    for episode in episodes:
        yield from (episode.scene(k) for k in range(len(episode.vectors) - 1))


def agreed(model: WorldModel, fresh: Iterable[Scene]) -> float:
    """Share of what the model says that its text says as well."""
    text = model.describe()
    rules = parse_rules(text)
    assert str(rules) == text
    return agreement(model, rules, fresh)[1]


@pytest.fixture(scope="module")
def ball() -> WorldModel:
    return learned(ball_episodes(1, seed=0, episodes=15), config=ModelConfig(frames="world"))


def test_the_ball_in_text(ball: WorldModel) -> None:
    assert agreed(ball, scenes(ball_episodes(1, seed=1, episodes=5, test=True))) >= 0.999
    text = ball.describe(check=islice(scenes(ball_episodes(1, seed=1, episodes=1)), 50))
    assert "\nAgreement: on 50 steps these rules say what the model says of 100 % of 100 values." in text
    assert parse_rules(text).agreement
    assert "mode" not in text.split("Agreement")[1].split("\n", 1)[1], "people aren't shown numbers of modes"


def test_the_truck_in_text() -> None:
    model = learned(truck_episodes(seed=0))
    assert agreed(model, scenes(truck_episodes(seed=1, test=True))) >= 0.999
    assert re.search(r"box_., box_., box_. := any box", model.describe())
    assert "Scenes held truck × 1, box × 3; other numbers of objects were never seen." in model.describe()


def test_laws_in_text() -> None:
    model = learned(ball_episodes(1, seed=0, episodes=15), config=ModelConfig(frames="auto"))
    assert agreed(model, scenes(ball_episodes(1, seed=1, episodes=5, test=True))) == 1.0
    text = model.describe()
    assert "    if   u_n > -0.9 v_n:" in text and "# bounces, or rests where v_n = 0" in text


def test_any_env_in_text(tmp_path: Path) -> None:
    env = relgym.wrappers.ModelLearner(gym.make("MountainCar-v0"), config={"features": ("trig",)})
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(600):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    fresh = gym.make("MountainCar-v0")
    assert agreed(env.model, scenes_of(fresh, view_of(fresh), 400, seed=1)) == 1.0
    assert "always:  x0' = x0 + x1'" in env.model.describe()


def test_a_file_keeps_rules_names_and_advice(ball: WorldModel, tmp_path: Path) -> None:
    name = next(iter(ball.rules()["ball.vy"].names))
    ball.name_condition(f"ball.vy: {name}", "in free flight")
    try:
        text = ball.describe()
        assert "in free flight :=" in text
        ball.save(tmp_path / "ball.json")
        ball.save(tmp_path / "ball.zip", history=True)
    finally:
        ball.condition_names = {}
    for path in ("ball.json", "ball.zip"):
        loaded = WorldModel.load(tmp_path / path)
        assert loaded.describe() == text
        assert loaded.describe(digits=12) != text
        assert list(loaded.advice()) == list(ball.advice())
        again = WorldModel.load(tmp_path / path)
        again.save(tmp_path / "again.json")
        assert WorldModel.load(tmp_path / "again.json").describe() == text


def test_names_for_one_text_only(ball: WorldModel) -> None:
    before = ball.describe()
    name = next(iter(ball.rules()["ball.vy"].names))
    assert "flying :=" in ball.describe(names={f"ball.vy: {name}": "flying"})
    assert ball.describe() == before
    with pytest.raises(ConfigError, match="no condition is called 'nothing'"):
        ball.name_condition("nothing", "something")


def test_rules_follow_what_is_learned() -> None:
    episodes = list(ball_episodes(1, seed=0, episodes=2))
    model = WorldModel(episodes[0].schema, ModelConfig(frames="world"))
    for transition in episodes[0].transitions():
        model.learn_one(transition)
    first = model.rules()
    assert model.rules() == first and first.transitions == 200
    for transition in episodes[1].transitions():
        model.learn_one(transition)
    assert model.rules().transitions == 400


@pytest.mark.slow
@pytest.mark.parametrize("experiment", [1, 2])
def test_the_ball_in_text_on_all_fresh_steps(experiment: int) -> None:
    model = learned(ball_episodes(experiment, seed=0), config=ModelConfig(frames="world"))
    fresh = islice(scenes(ball_episodes(experiment, seed=1, test=True)), 24_000)
    assert agreed(model, fresh) >= 0.999


@pytest.mark.slow
@pytest.mark.parametrize(
    ("env_id", "features"), [("MountainCar-v0", ("trig",)), ("Pendulum-v1", ("trig",)), ("CartPole-v1", ())]
)
def test_any_env_in_text_on_many_fresh_steps(env_id: str, features: tuple[str, ...]) -> None:
    env = relgym.wrappers.ModelLearner(gym.make(env_id), config={"features": features})
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(10_000):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    env.model.finish()
    fresh = gym.make(env_id)
    view = view_of(fresh, env.model.extra.get("view"))
    assert agreed(env.model, scenes_of(fresh, view, 24_000, seed=1)) >= 0.999
