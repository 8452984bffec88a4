"""What came as predicted is counted and offered to what is kept: the model is as if it had been studied."""

from __future__ import annotations

import gymnasium as gym
import pytest

import relgym
from relgym.model.files.archive import parts_to_arrays, parts_to_json
from relgym.model.fitting import compare_and_learn
from relgym.model.motion import Laws
from relgym.model.prequential import compared
from relgym.model.world_model import WorldModel
from relgym.wrappers import ModelLearner


@pytest.fixture(scope="module")
def stream() -> list[relgym.Transition]:  # type: ignore[name-defined]
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


def test_taking_up_is_looking_back_and_learning(stream: list, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[type-arg]
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
    assert confirmed > 0.4 * len(stream)
    assert written(quick) == written(slow)
