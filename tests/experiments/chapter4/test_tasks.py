"""The tasks themselves, with tiny budgets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from relgym.errors import ConfigError
from relgym.experiments.chapter4 import comparison, pushing, rolled
from relgym.experiments.chapter4.learners import settings_of
from relgym.experiments.chapter4.lesson import fresh_episodes, lesson, taught_episodes
from relgym.experiments.chapter4.protocol import ABLATIONS
from relgym.experiments.chapter4.rolled import CAUSES, cause_of, trial_episodes
from relgym.experiments.chapter4.testing import true_modes
from relgym.experiments.data import BALL_EXPERIMENTS
from relgym.thesis.settings import ThesisSettings

TESTS = {"seeds": [110], "episodes": 3}
BATCH = {"experiment": 1, "seed": 100, "order": 0}


@pytest.fixture(scope="module")
def taught() -> dict[str, Any]:
    return lesson(learner="thesis", **BATCH, checkpoints=[1, 3], tests=TESTS)


def test_a_lesson_is_tested_on_the_way(taught: dict[str, Any]) -> None:
    assert [each["episodes"] for each in taught["scores"]] == [1, 3]
    for each in taught["scores"]:
        for score in each["targets"].values():
            assert score["all"]["examples"] == 600
            assert score["counted"]["examples"] == sum(m["examples"] for m in score["modes"])
            assert score["counted"]["wrong"] == (
                score["counted"]["unlearned"] + score["counted"]["misclassified"]
            )
    first, last = (each["targets"]["ball.vy"]["all"]["wrong"] for each in taught["scores"])
    assert last < first


def test_confusions_count_what_the_scores_count(taught: dict[str, Any]) -> None:
    for target, found in taught["confusions"].items():
        counts = np.array(found["table"])
        score = taught["scores"][-1]["targets"][target]["counted"]
        assert counts.sum() == score["examples"]
        assert counts[-1].sum() == score["abstained"]
        off = counts[:-1].sum() - np.trace(counts[:-1])
        assert off + score["abstained"] == score["strict"]


def test_training_examples_are_counted_by_what_really_happened(taught: dict[str, Any]) -> None:
    assert {sum(modes.values()) for modes in taught["training"].values()} == {600}
    assert {mode["function"] for mode in taught["modes"]["ball.vx"]} == {"vx' = vx"}


def test_laws_have_no_modes_to_confuse() -> None:
    found = lesson(learner="default", **BATCH, checkpoints=[3], tests=TESTS)
    assert found["confusions"] == {} and found["modes"] == {} and found["trees"] == []
    assert "unlearned" not in found["scores"][-1]["targets"]["ball.vx"]["all"]
    assert "along the world's axes" in found["text"]


def test_the_same_batch_gives_the_same_result(taught: dict[str, Any]) -> None:
    again = lesson(learner="thesis", **BATCH, checkpoints=[1, 3], tests=TESTS)
    costs = {"seconds": 0.0, "bytes": 0}
    assert taught["bytes"] > 1000
    assert again | costs == taught | costs


def test_stages_of_transfer_show_one_object_after_the_other() -> None:
    rooms = list(taught_episodes(1, 100, 0, 5, ("box", "ramp")))
    assert ["box" in room.layout.names for room in rooms] == [True, True, True, False, False]
    assert ["ramp" in room.layout.names for room in rooms] == [False, False, False, True, True]
    assert {room.schema for room in rooms} == {next(taught_episodes(1, 100, 0, 1)).schema}


def test_test_episodes_come_from_every_seed_in_equal_parts() -> None:
    episodes = fresh_episodes(1, {"seeds": [110, 111], "episodes": 4})
    assert len(episodes) == 4
    assert len({str(sorted(b.configuration.items())) for b in episodes}) == 4


def test_ablations_take_one_cause_away_each() -> None:
    original, *others = (settings_of(name) for name in ABLATIONS)
    assert original == ThesisSettings.original() and len({*others, original}) == len(ABLATIONS)


def test_unknown_learner() -> None:
    with pytest.raises(ConfigError, match="learner 'oracle': expected one of"):
        settings_of("oracle")


def test_box_pushing_finds_table_3_1() -> None:
    found = pushing.lesson(learner="thesis", seed=100, repeats=1)
    assert sorted(found["stated"].values()) == [0, 1, 2] and found["noise"] == 0


@pytest.mark.parametrize("shown", ["thesis", "contact"])
def test_regressors_are_scored_like_our_learner(shown: str) -> None:
    found = comparison.regress(
        baseline="constant-velocity", shown=shown, **BATCH, checkpoints=[1, 2], tests=TESTS
    )
    ours = lesson(learner="default", **BATCH, checkpoints=[1], tests=TESTS)
    for target in ("ball.vx", "ball.vy"):
        score = found["scores"][-1]["targets"][target]["all"]
        assert score["sum"] == pytest.approx(score["change"])  # it errs by what changes
        other = ours["scores"][-1]["targets"][target]["all"]
        assert (score["examples"], score["change"]) == (other["examples"], pytest.approx(other["change"]))


def test_a_regressor_of_changes_is_asked_for_values() -> None:
    found = comparison.regress(
        baseline="knn", shown="contact", **BATCH, checkpoints=[3], tests=TESTS, setting=1
    )
    score = found["scores"][-1]["targets"]["ball.vx"]["all"]
    assert score["wrong"] < 0.2 * score["examples"]
    assert found["setting"] == {"n_neighbors": 1, "weights": "uniform"}


def test_classifiers_are_right_where_the_mode_explains() -> None:
    found = comparison.classify(baseline="knn-1", shown="contact", **BATCH, checkpoints=[3], tests=TESTS)
    for score in found["scores"][-1]["targets"].values():
        assert score["wrong"] <= score["strict"] < 0.2 * score["examples"]


def test_roll_outs_and_why_they_fail() -> None:
    trained = {"learner": "thesis", "experiment": 1, "episodes": 3, "chosen_on": TESTS}
    found = rolled.imagine(**trained, batches=[[100, 0], [101, 1]], tests=[110], trials=4)
    assert len(found["trials"]) == 4
    alone = {
        batch[0]: rolled.imagine(**trained, batches=[batch], tests=[110], trials=4)
        for batch in ([100, 0], [101, 1])
    }
    assert found["batch"] in ([100, 0], [101, 1])
    assert found["trials"] == alone[found["batch"][0]]["trials"]
    for trial in found["trials"]:
        errors = np.array([[np.inf if e is None else e for e in axis] for axis in trial["errors"]])
        assert errors.shape == (2, 201) and not errors[:, 0].any()
        assert trial["failed"] == bool((errors > 1e-2).any()) == (trial["cause"] in CAUSES)
        if trial["failed"]:
            assert (errors[:, : trial["begins"]] <= 1e-6).all()
        for step, cause in trial["mended"]:
            assert cause in CAUSES[:2] and trial["imagined"][step] == trial["real"][step]
        assert trial["mended"] or trial["unmended"]["cause"] == trial["cause"]
        # What is mended happens before anything else goes wrong, and would have been the failure.
        if trial["mended"] and trial["unmended"]["cause"]:
            assert trial["unmended"]["cause"] == trial["mended"][0][1]


def test_causes_come_from_what_really_happened() -> None:
    causes: dict[str, list[str]] = {}
    for episode in trial_episodes(1, [110], 16):
        names = episode.truth.mode_names["ball.vx"]
        for step in range(len(episode)):
            wild = episode.columns("ball", "vx", "vy")[step] + 0.37  # what no surface does
            cause = cause_of(episode, step, 1, wild)
            if episode.truth.corner[step]:
                assert cause == "bounce against a corner"
            elif episode.truth.active[step] > 1:
                assert cause == "several contacts at once"
            elif episode.truth.active[step] == 1:
                causes.setdefault(names[episode.truth.mode["ball.vx"][step]], []).append(cause)
    assert set(causes["bounce, left face"]) == set(causes["bounce, slope"]) == {"misclassified ramp bounce"}
    assert set(causes["fly"]) == {"misclassified contact with a level surface"}


def test_a_ball_that_still_overlaps_is_not_pushed_again() -> None:
    found: dict[str, int] = {}
    for episode in trial_episodes(1, [110, 111], 80):
        truth = episode.truth
        for step in range(1, len(episode)):
            if (
                not truth.pushing[step - 1] & (truth.touched[step] - truth.pushing[step])
                or truth.corner[step]
            ):
                continue
            velocity, after = episode.columns("ball", "vx", "vy")[step : step + 2]
            for again, row in (
                (after * [1, 0] + velocity * [0, -0.9], 5),
                (after * [0, 1] + velocity * [-0.9, 0], 0),
            ):
                if np.abs(again - after).max() > 1e-6:
                    cause = cause_of(episode, step, 1, again)
                    assert cause in (CAUSES[row], "delayed falling")
                    found[cause] = found.get(cause, 0) + 1
            assert not cause_of(episode, step, 1, after + 0.37).startswith("bad collision")
    assert min(found[CAUSES[0]], found[CAUSES[5]]) > 3


def test_several_contacts_at_once_belong_to_the_simplest_mode_that_explains_them() -> None:
    laws = BALL_EXPERIMENTS[1].modes()
    found = 0
    for episode in trial_episodes(1, [110], 12):
        for target in ("ball.vx", "ball.vy"):
            logged, labels = episode.truth.mode[target], true_modes(episode, target, laws)
            np.testing.assert_array_equal(labels[logged >= 0], logged[logged >= 0])
            v = episode.columns("ball", "vx", "vy")
            names = episode.truth.mode_names[target]
            for step in np.flatnonzero((logged < 0) & (labels >= 0)):
                mode = (laws.x if target == "ball.vx" else laws.y)[labels[step]]
                assert abs(mode.predict(v[[step]])[0] - v[step + 1, int(target == "ball.vy")]) <= 1e-9
                if target == "ball.vy" and v[step, 1] == 0.0 == v[step + 1, 1]:
                    assert names[labels[step]] == "slide, floor"  # not a bounce at no speed
                found += 1
    assert found > 5
