"""A model is accepted by its predictions of real steps: one of the same world is, one of half the friction never."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import relgym
from relgym.errors import ConfigError
from relgym.scene.objects import Transition
from relgym.wrappers.dyna.config import DynaConfig
from relgym.wrappers.dyna.recorder import Experience, TransitionRecorder
from relgym.wrappers.dyna.reward_models import LearnedRewardModel
from relgym.wrappers.dyna.stock import changing
from relgym.wrappers.dyna.trainer import ModelTrainer


def make(**arguments: Any) -> Any:
    return TransitionRecorder(gym.make("relgym/TruckPush-v0", disable_env_checker=True, **arguments))


def steps(n: int, *, seed: int, **arguments: Any) -> list[Experience]:
    env, found = make(**arguments), []
    env.action_space.seed(seed)
    env.reset(seed=seed)
    while len(found) < n:
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        found += env.take()
        if terminated or truncated:
            env.reset()
    return found


@pytest.mark.parametrize("halved", [False, True])
def test_only_a_model_of_this_world_is_accepted(halved: bool, rng: np.random.Generator) -> None:
    lessons = steps(350, seed=1, gravity=5.0 if halved else 10.0)
    model = relgym.WorldModel(lessons[0].start.schema)
    for k in rng.permutation(len(lessons)):
        model.learn_one(lessons[k].transition)
    model.frozen = True  # as if it had been loaded without its history
    seen = model.seen
    trainer = ModelTrainer(model, make().get_wrapper_attr("task"), DynaConfig(least=50))
    opened = []
    for real in steps(200, seed=2):
        trainer.take_up(real)
        opened.append(trainer.acceptance.accepted)
    assert trainer.acceptance.known > 0.95  # it predicts as many of them
    assert any(opened) is not halved
    assert (trainer.acceptance.error > 0.25) is halved
    assert model.seen == seen  # a frozen model is evaluated, and learns nothing


def test_a_model_that_leaves_out_what_moves_is_not_accepted() -> None:
    env = make()
    model = relgym.WorldModel(env.get_wrapper_attr("schema"), targets=())
    trainer = ModelTrainer(model, env.get_wrapper_attr("task"), DynaConfig(shuffle=0, least=5))
    for real in steps(40, seed=3):
        trainer.take_up(real)
    assert trainer.acceptance.known == 1.0  # nothing changes, it says
    assert trainer.acceptance.error > 0.5
    assert not trainer.acceptance.accepted


def test_what_is_off_by_no_more_than_is_shown_is_not_wrong(rng: np.random.Generator) -> None:
    lessons = steps(350, seed=1)
    model = relgym.WorldModel(lessons[0].start.schema)
    for k in rng.permutation(len(lessons)):
        model.learn_one(lessons[k].transition)
    model.frozen = True
    known = [real for real in steps(60, seed=2) if model.predict_one(real.transition.before).ok][-20:]
    for precision, wrong in ((0.0, True), (1e-6, False)):
        trainer = ModelTrainer(model, make().get_wrapper_attr("task"), DynaConfig(), precision)
        assert trainer.error == 1.0
        for real in known:
            after = real.transition.after
            near = after.replace({("truck", "vx"): after["truck"]["vx"] + 1e-7})
            trainer.take_up(replace(real, transition=replace(real.transition, after=near)))
            assert bool(trainer.wrong) is wrong
            assert trainer.error < 1e-5
    with pytest.raises(ConfigError, match="precision=-1"):
        ModelTrainer(model, make().get_wrapper_attr("task"), precision=-1.0)


@pytest.mark.parametrize("frozen", [False, True])
def test_a_reward_model_learns_at_once(frozen: bool) -> None:
    lessons = steps(20, seed=1)
    model = relgym.WorldModel(lessons[0].start.schema)
    model.frozen = frozen
    reward_model = LearnedRewardModel(model.schema, changing(model))
    trainer = ModelTrainer(model, reward_model, DynaConfig(shuffle=15))
    for count, real in enumerate(lessons, start=1):
        trainer.take_up(real)
        assert reward_model.model.seen == count
    assert model.seen == (0 if frozen else 5)


def test_lessons_come_in_random_order() -> None:
    lessons = steps(30, seed=1)

    class Listening:
        frozen = False
        targets = ()

        def __init__(self) -> None:
            self.schema = lessons[0].start.schema
            self.heard: list[Transition] = []
            self._model = relgym.WorldModel(self.schema)

        def learn_one(self, transition: Transition) -> None:
            self.heard.append(transition)

        def predict_one(self, scene: Any) -> Any:
            return self._model.predict_one(scene)

        def predict_batch(self, layout: Any, vectors: Any) -> Any:
            return self._model.predict_batch(layout, vectors)

    task = make().get_wrapper_attr("task")
    order: list[list[int]] = []
    for shuffle in (0, 10, 10):
        model = Listening()
        trainer = ModelTrainer(model, task, DynaConfig(shuffle=shuffle))
        for real in lessons:
            trainer.take_up(real)
        order.append([[real.transition for real in lessons].index(heard) for heard in model.heard])
    assert order[0] == list(range(30))
    assert sorted(order[1]) != order[1]
    assert len(set(order[1])) == len(order[1]) == 20
    assert order[1] == order[2]


def test_in_a_changed_world_a_replacement_takes_the_models_place() -> None:
    """With half the gravity all friction is halved: the old laws count on, the replacement knows only the new ones."""
    before, after = (steps(n, seed=s, gravity=g) for n, s, g in ((400, 1, 10.0), (500, 2, 5.0)))
    config, models = DynaConfig(least=50), []
    for renew in (1_000, 0):
        model = relgym.WorldModel(before[0].start.schema)
        trainer = ModelTrainer(model, make().get_wrapper_attr("task"), replace(config, renew=renew))
        for real in before:
            trainer.take_up(real)
        assert trainer.acceptance.accepted and trainer.model is model
        known = model.describe()
        for real in after:
            trainer.take_up(real)
        assert (trainer.acceptance.accepted, trainer.renewals) == (bool(renew), int(bool(renew)))
        models.append(trainer.model)
        if renew:
            assert trainer.model is not model
            assert model.describe() != known  # it learned on for as long as nobody was better
    weights = {
        abs(weight)
        for mode in models[0].modes("truck", "vx")
        for role in mode.roles
        for prop, weight in role.terms
        if prop == "friction"
    }
    assert weights and all(round(w / 1.25, 6) in (1.0, 2.0, 3.0) for w in weights)
