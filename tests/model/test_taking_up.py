"""What came as predicted is counted and offered to what is kept: the model is as if it had been studied."""

from __future__ import annotations

from itertools import pairwise

import gymnasium as gym
import pytest

from relgym.experiments.body_worlds import Setting, body_rooms
from relgym.model.files.archive import parts_to_arrays, parts_to_json
from relgym.model.fitting import compare_and_learn
from relgym.model.motion import Laws
from relgym.model.prequential import compared
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, Transition
from relgym.wrappers import ModelLearner


@pytest.fixture(scope="module")
def stream() -> list[Transition]:
    learner = ModelLearner(gym.make("relgym/BallBoxRamp-v0"), predict=False)
    learner.reset(seed=3)
    found = []
    for _ in range(1_500):
        *_, terminated, truncated, info = learner.step(0)
        if info["relgym"].transition is not None:
            found.append(info["relgym"].transition)
        if terminated or truncated:
            learner.reset()
    return found


def written(model: WorldModel) -> tuple[object, dict[str, bytes]]:
    arrays = parts_to_arrays(model._parts)
    flat = {f"{k}": repr(v).encode() for k, v in sorted(arrays.items(), key=str)}
    return parts_to_json(model._parts, history=True), flat


@pytest.fixture(scope="module")
def boxes() -> list[Transition]:
    """Two boxes and a disc that turn, pushed about."""
    (room,) = body_rooms(Setting(("box", "box"), friction=0.5), 1, seed=1)
    scenes = [Scene(room.schema, room.layout, vector) for vector in room.vectors[:40]]
    return [Transition(before, after) for before, after in pairwise(scenes)]


@pytest.mark.parametrize(("name", "share"), [("stream", 0.4), ("boxes", 0.1)])
def test_taking_up_is_looking_back_and_learning(
    name: str, share: float, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = request.getfixturevalue(name)
    confirmed = 0
    whole = Laws._confirmed

    def counted(self: Laws, *given: object) -> bool:
        nonlocal confirmed
        found = whole(self, *given)  # type: ignore[arg-type]
        confirmed += found
        return found

    monkeypatch.setattr(Laws, "_confirmed", counted)
    schema = stream[0].before.schema
    quick, slow = WorldModel(schema), WorldModel(schema)
    for transition in stream:
        said, studied = (model.predict_one(transition.before) for model in (quick, slow))
        compare_and_learn(quick, transition, said)
        slow.look_back(studied, compared(studied, transition.after)[0])
        slow.learn_one(transition)
    assert confirmed > share * len(stream)
    assert written(quick) == written(slow)
