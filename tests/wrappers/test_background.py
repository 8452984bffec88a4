"""Learning in a process of its own."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from carts import run
from plain_envs import Slider

from relgym.envs.views import NumbersView
from relgym.errors import ConfigError, ObservationError, RelgymError
from relgym.scene.objects import Transition
from relgym.wrappers import ModelLearner
from relgym.wrappers.background import Background


def view_of_slider(observation_space: Any, action_space: Any) -> NumbersView:
    return NumbersView(observation_space, action_space, names=("x", "v"))


def test_the_background_learns_the_same_model_and_counts_the_same_errors() -> None:
    here = ModelLearner(Slider(), view=view_of_slider)
    there = ModelLearner(Slider(), view=view_of_slider, background=1000)
    run(here, 80)
    run(there, 80)
    assert there.model.seen == 0  # as of the last catch_up
    assert there.catch_up().to_json(history=True) == here.model.to_json(history=True)
    assert there.dropped == 0
    assert there.prequential.wrong == here.prequential.wrong
    told = [e.model.property_model("self", "v").hindsight.to_json() for e in (here, there)]
    assert told[0] == told[1]
    assert len(told[0]["steps"]) > 40
    twin = copy.deepcopy(there)
    run(there, 10, seed=5)
    there.close()
    assert (there.model.seen, twin.model.seen) == (90, 80)
    twin.reset(seed=0)
    assert twin.step(np.zeros(1))[4]["relgym"].learned is not None  # a copy learns in the foreground


def test_what_finds_the_queue_full_is_dropped_and_counted() -> None:
    env = ModelLearner(Slider(), background=2)
    run(env, 200)
    model = env.catch_up()
    assert env.dropped > 0
    assert model.seen + env.dropped == 200
    env.close()


def test_parcels_lose_nothing_and_what_waits_is_bounded() -> None:
    model = ModelLearner(Slider()).model
    scene = model.schema.scene({"self": [0.0, 0.0], "action": [0.0]})
    background = Background(model, None, queue=400)  # parcels of 6
    for _ in range(20):
        assert background.put(Transition(scene, scene))
    assert background.fetch()[0].seen == 20  # the last parcel isn't full
    background._process.terminate()
    background._process.join()
    taken = [background.put(Transition(scene, scene)) for _ in range(420)]
    assert (background.sent, background.dropped) == (20 + sum(taken), 420 - sum(taken))
    assert 390 <= sum(taken) <= 400
    assert taken == sorted(taken, reverse=True)
    background.close()


def test_what_made_learning_fail_is_raised_where_it_is_asked_for() -> None:
    model = ModelLearner(Slider()).model
    bad = model.schema.scene({"self": [0.0, 0.0], "action": [0.0]})
    bad.vector.flags.writeable = True
    bad.vector[0] = np.nan
    background = Background(model, None, queue=10)
    assert background.put(Transition(bad, bad))
    with pytest.raises(ObservationError, match="'self', property 'x0': expected a finite number, got nan"):
        background.fetch()
    background.close()


def test_a_process_that_died_is_reported() -> None:
    background = Background(ModelLearner(Slider()).model, None, queue=10)
    background.close()
    with pytest.raises(RelgymError, match="the learning process has ended"):
        background.fetch()
    with pytest.raises(ConfigError, match="background=0: expected a whole number"):
        ModelLearner(Slider(), background=0)


def test_closing_over_a_dead_process_says_so_and_ends_it() -> None:
    env = ModelLearner(Slider(), background=10)
    background: Any = env._observer.study._background
    background._process.terminate()
    background._process.join()
    with pytest.raises(RelgymError, match="the learning process has ended"):
        env.close()
    env.close()  # nothing is left to end
