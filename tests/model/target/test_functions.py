"""Modes' functions laid over slots: which object is bound to a role that no relation can describe."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from relgym.clustering.mode import NOISE
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.predicting.calibration import Calibration
from relgym.model.predicting.prediction import Outcome
from relgym.model.world_model import WorldModel
from relgym.reporting.parser import parse_rules
from relgym.scene.objects import ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema

AGENT = ObjectType("agent", ("v", "gap"))
TEAM = SceneSchema((AGENT,), tuple((name, "agent") for name in "abcd"))
GAP = Target("agent", "gap")


def walks(count: int, follows: dict[str, str], seed: int = 0) -> Iterator[Transition]:
    """Agents that each walk as they like, and see how far another one is ahead: always the same one."""
    rng, gaps = np.random.default_rng(seed), dict.fromkeys("abcd", 0.0)
    scenes: list[Scene] = []
    for _ in range(count + 1):
        speeds = dict(zip("abcd", rng.uniform(-1.0, 1.0, 4).tolist(), strict=True))
        scenes.append(TEAM.scene({name: [speeds[name], gaps[name]] for name in "abcd"}))
        gaps = {name: gaps[name] + 0.25 * (speeds[follows[name]] - speeds[name]) for name in "abcd"}
    return map(Transition, scenes[:-1], scenes[1:])


def learned(follows: dict[str, str], count: int = 400) -> WorldModel:
    model = WorldModel(TEAM, targets=[GAP])
    for step in walks(count, follows):
        compare_and_learn(model, step, model.predict_one(step.before))
    return model


SECOND = {"a": "c", "b": "c", "c": "b", "d": "b"}
"""Whom each of four agents looks at: the second one of the others."""


def test_a_role_is_bound_to_who_always_stands_at_the_same_place(tmp_path: Path) -> None:
    model = learned(SECOND)
    assert [mode.formula() for mode in model.modes("agent", "gap")] == [
        "gap' = -0.25 v + gap + 0.25 agent_a.v"
    ]
    text, bound = model.rules().text(17), "number 2 of the other objects of type agent"
    assert f"agent_a := {bound}" in text
    assert bound in model.describe(details=True)
    (step,) = walks(1, SECOND, seed=1)
    model.save(tmp_path / "team.json.gz", history=True)
    for same in (model, WorldModel.load(tmp_path / "team.json.gz"), copy.deepcopy(model)):
        said = same.predict_one(step.before)
        vectors = np.repeat(step.before.vector[None], 3_000, axis=0)  # enough for a program
        many = same.predict_batch(step.before.layout, vectors)
        for k, (name, other) in enumerate(SECOND.items()):
            told = said[(name, "gap")]
            assert (told.outcome, told.roles) == (Outcome.PREDICTED, (name, other))
            assert told.value == pytest.approx(step.after[name]["gap"], abs=1e-12)
            assert (many.vectors[:, 2 * k + 1] == told.value).all()
            assert (many.probabilities[:, k] == told.probability).all()
            for rules in (parse_rules(text), same.rules()):
                assert rules.predict(step.before)[name, "gap"] == pytest.approx(told.value, abs=1e-12)


def test_who_stands_elsewhere_for_each_isnt_told_by_places() -> None:
    model = learned({"a": "b", "b": "c", "c": "d", "d": "a"})
    known = model.property_model("agent", "gap").functions
    assert all(not slots for slots in known.places.values())
    (step,) = walks(1, SECOND, seed=1)
    assert not any(part.ok for part in model.predict_one(step.before).parts)


def test_an_only_mode_that_explains_all_is_proven() -> None:
    model = learned(SECOND, 20)  # what properties mostly change by is known then
    for step in walks(600, SECOND, seed=1):
        assert model.property_model("agent", "gap").proven == 0
        model.learn_one(step)
        if model.property_model("agent", "gap").clusterer.seen >= 1 << 10:
            break
    part = model.property_model("agent", "gap")
    assert part.proven == part.calibration.proven == 10  # of 1,024 examples
    again = Calibration.from_json(part.calibration.to_json(), 0.5)
    assert again.proven == 10  # as it was told, not as it would be told now
    part.clusterer.labels[-1] = NOISE  # one that it doesn't explain
    assert part.proven == 0


def test_what_scatters_by_more_than_is_right_is_not_proven() -> None:
    part, rng = WorldModel(TEAM, targets=[GAP]), np.random.default_rng(0)
    for step in walks(400, SECOND):
        noisy = step.after.replace({(name, "gap"): step.after[name]["gap"] + rng.normal() for name in "abcd"})
        compare_and_learn(part, Transition(step.before, noisy), part.predict_one(step.before))
    assert part.property_model("agent", "gap").proven == 0


def test_a_mode_that_scatters_by_more_than_is_right_is_to_prove_itself() -> None:
    exact = learned(SECOND, 20).property_model("agent", "gap")
    assert exact.reliable == set(exact.classifier.modes) != set()
    model, rng = WorldModel(TEAM, {"clustering": {"noise_std": 1.0}}, targets=[GAP]), np.random.default_rng(0)
    for step in walks(100, SECOND):
        anywhere = step.after.replace({(name, "gap"): rng.normal() for name in "abcd"})
        compare_and_learn(model, Transition(step.before, anywhere), model.predict_one(step.before))
    loose = model.property_model("agent", "gap")
    assert loose.classifier.modes and loose.accounted_for  # within a noise that is declared
    assert loose.reliable == set()
