"""The Dyna experiments' tasks, each with a tiny budget."""

from __future__ import annotations

import json
from typing import Any

import pytest

from relgym.experiments.dyna import asleep as dyna_asleep
from relgym.experiments.dyna import course as dyna
from relgym.experiments.dyna import trials as dyna_trials

pytestmark = pytest.mark.sb3


def plain(value: Any) -> Any:
    return json.loads(json.dumps(value))


@pytest.fixture(autouse=True)
def few_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    class Few(dyna.Examination):
        def __init__(self, course: Any, episodes: int = 3, **arguments: Any) -> None:
            super().__init__(course, episodes, **arguments)

    monkeypatch.setattr(dyna, "Examination", Few)
    monkeypatch.setattr(dyna_asleep, "Examination", Few)


def test_a_course_through_a_world_that_changes_goes_on_to_its_end() -> None:
    change = {"after": 250, "arguments": {"gravity": 5.0}}
    found = plain(dyna_trials.learning(course="truck", arm="sac", seed=100, steps=500, change=change))
    assert [at for at, _ in found["curve"]] == [250, 500]
    assert (found["steps"], found["accepted"]) == (500, 0.0)


def test_a_model_of_another_world_is_right_there_and_not_accepted_here(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(dyna_trials, "_LESSONS", 900)
    arguments = {"gravity": 5.0}
    found = plain(dyna_trials.misled(course="truck", arm="relgym", seed=100, steps=250, arguments=arguments))
    assert found["right_there"] > 0.9
    assert found["run"]["accepted"] == 0.0


def test_agents_that_train_in_dreams_alone() -> None:
    found = plain(dyna_asleep.asleep(course="truck", seed=100, real=200, updates=320))
    assert 0 <= found["successes"] <= 3 and found["seconds"] > 0.0
    among = plain(dyna_asleep.among(seed=100, real=300, updates=640, bystanders=[2, 4]))
    assert sorted(among["successes"]) == ["2", "4"]
