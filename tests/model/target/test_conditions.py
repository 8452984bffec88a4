"""Values that clauses may test beside what a target's own object shows."""

from __future__ import annotations

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import relgym  # noqa: F401 - registers the envs
from relgym.model.target.conditions import Conditions
from relgym.model.world_model import WorldModel
from relgym.scene.objects import TASK, ObjectType, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box
from relgym.wrappers import ModelLearner


@pytest.fixture(scope="module")
def learner() -> ModelLearner:
    return taught(1_500, 0)


def taught(count: int, seed: int) -> ModelLearner:
    env = ModelLearner(gym.make("relgym/TruckPush-v0"), learn_reward=True, learn_termination=True)
    follow(env, count, seed)
    return env


def follow(env: ModelLearner, count: int, seed: int) -> list[Transition]:
    env.action_space.seed(seed)
    env.reset(seed=seed)
    found = []
    for _ in range(count):
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        found.append(info["relgym"].transition)
        if terminated or truncated:
            env.reset()
    return found


def test_the_end_of_an_episode_may_depend_on_what_was(learner: ModelLearner) -> None:
    # A step ends it where the truck stops that was moving; one that hasn't begun to move goes on.
    model = learner.model
    fresh = follow(taught(1, 7), 600, 8)
    right = [
        model.predict_one(s.before)[TASK, "terminated"].value == s.after[TASK]["terminated"] for s in fresh
    ]
    assert np.mean(right) > 0.99
    still = [s for s in fresh if s.before["truck"]["vx"] == s.after["truck"]["vx"] == 0.0]
    assert len(still) > 20
    assert not any(s.after[TASK]["terminated"] for s in still)
    rules = next(r for r in model.rules().properties if r.target == f"{TASK}.terminated")
    assert "truck.vx > " in str(rules)


def test_single_scenes_batches_and_files_say_the_same(learner: ModelLearner, tmp_path: Path) -> None:
    model = learner.model
    fresh = [s.before for s in follow(taught(1, 7), 200, 9)]
    batch = model.predict_batch(fresh[0].layout, np.array([s.vector for s in fresh]))
    told = [model.predict_one(scene) for scene in fresh]
    assert [t.scene.vector.tolist() for t in told] == batch.vectors.tolist()
    model.save(path := tmp_path / "model.json", history=True)
    again = WorldModel.load(path)
    assert [str(again.predict_one(scene).parts) for scene in fresh] == [
        str(t.parts) for t in told
    ]  # some are NaN
    part = again.property_model(TASK, "terminated")
    assert part.conditions.names == model.property_model(TASK, "terminated").conditions.names


def conditions() -> Conditions:
    brick = ObjectType("brick", ("px", "py", "pz", "vx"), shape=Box())
    types = (brick, ObjectType("mark", ("at",)), ObjectType(TASK, ("terminated",)))
    schema = SceneSchema(types, (("brick", "brick"), ("mark", "mark"), (TASK, TASK)))
    return Conditions(schema, Target(TASK, "terminated", given=(("brick", "vx"), ("mark", "at"))))


def test_bodies_present_values_are_shown_to_the_task_alone() -> None:
    known = conditions()
    assert known.names == ("brick.vx'", "mark.at'", "brick.vx")  # a mark's present value is shown to all
    assert known.pairs == (("brick", "vx"), ("mark", "at"))


def test_classifiers_of_an_older_file_are_shown_what_they_were_taught_with() -> None:
    known = conditions()
    known.keep(("brick.vx'", "mark.at'"))
    assert known.names == ("brick.vx'", "mark.at'")
    known = conditions()
    known.keep(("brick.vx",))
    assert known.names == ("brick.vx'", "mark.at'", "brick.vx")  # only present values are new
