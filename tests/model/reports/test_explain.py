"""What an explanation says is true of the scene: every printed condition, tested by another route."""

from __future__ import annotations

from collections import Counter
from itertools import islice

import numpy as np
import pytest
from rule_checker import Checker, printed

from relgym.config import ModelConfig
from relgym.experiments.data import ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.worlds.online import learned
from relgym.model.reports.explain import Explanation, explanations
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene

WORLD = ModelConfig(frames="world")


@pytest.fixture(scope="module")
def ball() -> WorldModel:
    return learned(ball_episodes(1, seed=0, episodes=15), config=WORLD)


@pytest.fixture(scope="module")
def truck() -> WorldModel:
    return learned(truck_episodes(seed=0))


def told(model: WorldModel, scenes: list[Scene]) -> Counter[str]:
    """Conditions printed of some scenes, by whether they hold."""
    found: Counter[str] = Counter()
    for scene in scenes:
        prediction = model.predict_one(scene)
        for each in explanations(model, scene):
            checker = Checker(scene, each.prediction.object, prediction)
            for text in printed(each):
                assert checker.true(text), f"{text!r} isn't true of\n{scene}\n\n{each}"
                found["conditions"] += 1
            found["by vote"] += each.branch is None and bool(each.function)
    return found


def scenes_of(episodes: list[Episode], count: int) -> list[Scene]:
    every = [episode.scene(k) for episode in episodes for k in range(len(episode.vectors) - 1)]
    return every[:: max(1, len(every) // count)][:count]


def test_every_printed_condition_of_the_ball_is_true(ball: WorldModel) -> None:
    scenes = scenes_of(list(ball_episodes(1, seed=1, episodes=6, test=True)), 60)
    assert told(ball, scenes)["conditions"] > 100


def test_every_printed_condition_of_the_truck_is_true(truck: WorldModel) -> None:
    scenes = scenes_of(list(islice(truck_episodes(seed=1, test=True), 24)), 30)
    assert told(truck, scenes)["conditions"] > 30


def resting(model: WorldModel, scenes: list[Scene]) -> list[Explanation]:
    """What is said of balls that stay at rest on something."""
    found = []
    for scene in scenes:
        if scene["ball"]["vy"] == 0.0 and model.predict_one(scene).scene["ball"]["vy"] == 0.0:
            found.append(next(e for e in explanations(model, scene) if e.prediction.property == "vy"))
    return found


def test_what_rests_rests(ball: WorldModel) -> None:
    scenes = scenes_of(list(ball_episodes(1, seed=2, episodes=8)), 400)
    said = resting(ball, scenes)
    assert len(said) > 5
    for each in said:
        assert each.word == "at rest" and "bounc" not in str(each), str(each)
        assert "vy' = 0" in each.function


def test_a_law_says_which_piece_holds() -> None:
    model = learned(ball_episodes(1, seed=0, episodes=15), config=ModelConfig(frames="auto"))
    assert model.governed
    scenes = scenes_of(list(ball_episodes(1, seed=2, episodes=8)), 300)
    for each in resting(model, scenes):
        assert "rests: v'_n = max(u_n, -0.9 v_n) = 0" in str(each)
        # It may well bounce off a wall at the same time.
        assert not any("bounces" in line and "n = (0, 1)" in line for line in str(each).split("\n"))
    said = [str(e) for s in scenes for e in explanations(model, s)]
    assert any("bounces: v'_n" in text for text in said)


def test_what_was_decided_by_vote_says_so(ball: WorldModel) -> None:
    scene = scenes_of(list(ball_episodes(1, seed=1, episodes=1)), 1)[0]
    rules = ball.rules()
    wrong = rules.properties[0].branches[0]
    assert wrong.function is not None
    # As if the list said something else than the vote.
    from dataclasses import replace

    part = replace(rules.properties[0], branches=(replace(wrong, cases=()),))
    ball._rules = (ball._rules[0], replace(rules, properties=(part, *rules.properties[1:])))  # type: ignore[index]
    try:
        (first, *_) = explanations(ball, scene)
        checker = Checker(scene, "ball", ball.predict_one(scene))
        if first.branch is None:
            assert "  vote      vx'" in str(first)
            assert printed(first) and all(map(checker.true, printed(first)))
    finally:
        ball._rules = None


@pytest.mark.slow
@pytest.mark.parametrize(("experiment", "world"), [(1, "ball"), (2, "ball"), (0, "truck")])
def test_explanations_of_two_thousand_random_scenes_are_true(experiment: int, world: str) -> None:
    if world == "ball":
        model = learned(ball_episodes(experiment, seed=0), config=WORLD)
        fresh = list(ball_episodes(experiment, seed=1, test=True))
    else:
        model = learned(truck_episodes(seed=0))
        fresh = list(truck_episodes(seed=1, test=True))
    rng = np.random.default_rng(0)
    every = [(episode, k) for episode in fresh for k in range(len(episode.vectors) - 1)]
    chosen = [every[i] for i in rng.permutation(len(every))[:2000]]
    scenes = [episode.scene(k) for episode, k in chosen]
    assert told(model, scenes)["conditions"] > 2000 * (world == "ball")
    if world == "ball":
        assert not [each for each in resting(model, scenes) if "bounc" in str(each)]
