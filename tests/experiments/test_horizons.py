"""How far ahead a model holds: worked by hand, and in an env."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from plain_envs import Slider

from relgym.envs.views import NumbersView
from relgym.experiments.fresh import FreshEpisode, fresh_episodes, transitions
from relgym.experiments.horizons import horizons
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.wrappers import ModelLearner

BALL = ObjectType("ball", ("v",), optional=True)
SCHEMA = SceneSchema((BALL,), (("a", "ball"), ("b", "ball")), targets=(Target("ball", "v"),))


def episode(*values: float) -> FreshEpisode:
    scenes = [SCHEMA.scene({"a": [v]}) for v in values]
    return FreshEpisode(tuple(scenes[:-1]), tuple(scenes[1:]))


@pytest.fixture(scope="module")
def halving() -> WorldModel:
    model = WorldModel(SCHEMA)
    for k in range(15):
        now, then = (SCHEMA.scene({"a": [v * 0.7**k]}) for v in (8.0, 4.0))
        model.learn_one(Transition(now, then))
    return model


def test_errors_after_so_many_steps(halving: WorldModel) -> None:
    """From 8 it expects 4, 2, 1; of 4, 2, 3 the last is off by 2, and nothing is looked up on the way."""
    found = horizons(halving, [episode(8.0, 4.0, 2.0, 3.0), episode(16.0, 8.0)])
    assert (found.trials, found.longest, found.kept, found.stopped) == (2, 3, 1, 0)
    assert (found.after, found.reached) == ((1, 2, 3), (2, 1, 1))
    (ball,) = found.properties
    assert ball.name == "ball.v"
    assert ball.rmse == pytest.approx((0.0, 0.0, 2.0), abs=1e-12)
    assert ball.spread == pytest.approx(np.std([4.0, 2.0, 3.0, 8.0]))
    assert "1 of 2 roll-outs of up to 3 steps" in str(found)


def test_without_a_prediction_it_ends_and_says_of_what() -> None:
    found = horizons(WorldModel(SCHEMA), [episode(8.0, 4.0, 2.0)])
    assert (found.kept, found.stopped, found.lacking, found.after) == (0, 1, ("ball.v",), ())
    assert "without a prediction of ball.v" in str(found)


def test_where_objects_come_or_go_the_comparison_ends(halving: WorldModel) -> None:
    alone, both = SCHEMA.scene({"a": [4.0]}), SCHEMA.scene({"a": [2.0], "b": [9.0]})
    came = FreshEpisode((SCHEMA.scene({"a": [8.0]}), alone, both), (alone, both, SCHEMA.scene({"a": [1.0]})))
    found = horizons(halving, [came])
    assert (found.longest, found.kept) == (2, 1)


def test_a_law_that_was_learned_holds_to_the_end() -> None:
    env = ModelLearner(Slider(length=30))
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(60):
        if env.step(env.action_space.sample())[3]:
            env.reset()
    found = horizons(env.model, list(islice(fresh_episodes(env.env, env.view, seed=0, most=20), 3)))
    assert (found.trials, found.kept, found.longest) == (3, 3, 20)
    assert max(e for p in found.properties for e in p.rmse) < 1e-9


def test_fresh_episodes_come_again_with_their_seed_and_are_broken_off() -> None:
    env = Slider(length=7)
    view = NumbersView(env.observation_space, env.action_space)
    first, second = (list(islice(fresh_episodes(env, view, seed=3, most=5), 2)) for _ in range(2))
    assert [len(e) for e in first] == [5, 5]
    for one, other in zip(first, second, strict=True):
        assert all((a.vector == b.vector).all() for a, b in zip(one.before, other.before, strict=True))
    whole = next(fresh_episodes(env, view, seed=3))
    assert len(whole) == 7
    assert [a.vector.tolist() for a in whole.after[:-1]] == [b.vector[:2].tolist() for b in whole.before[1:]]


def test_a_test_with_the_seed_of_learning_shows_other_episodes() -> None:
    env = Slider()
    view = NumbersView(env.observation_space, env.action_space)
    learned, _ = env.reset(seed=3)
    (fresh,) = transitions(fresh_episodes(env, view, seed=3, most=5), 1)
    assert not np.array_equal(fresh.before.vector[:2], learned)
