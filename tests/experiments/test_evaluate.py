"""Errors by true mode, roll-outs and Table 3.1's check, on models whose quality is known beforehand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relgym.experiments.analytic import truck_modes
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import evaluate, explicable, mode_labels
from relgym.experiments.rollouts import imagined, rollouts
from relgym.experiments.truck_check import check_truck, truck_mode_of
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Float2D

LAWS = BALL_EXPERIMENTS[1].modes()


@pytest.fixture(scope="module")
def truck() -> WorldModel:
    episodes = list(truck_episodes(seed=0))
    model = WorldModel(episodes[0].schema)
    for episode in episodes:
        for transition in episode.transitions():
            model.learn_one(transition)
    model.finish()
    return model


@pytest.fixture(scope="module")
def fresh() -> list[Episode]:
    return list(truck_episodes(seed=1, test=True))


@pytest.fixture(scope="module")
def balls() -> list[Episode]:
    return list(ball_episodes(1, seed=3, episodes=40, test=True))


def _shifted(episode: Episode, row: int, by: float) -> Episode:
    """The episode with one value of the truck's velocity changed."""
    vectors: Float2D = episode.vectors.copy()
    layout = episode.layout
    vectors[row, layout.column(layout.index("truck"), "vx")] += by
    return replace(episode, vectors=vectors)


def test_a_learned_truck_is_right_everywhere(truck: WorldModel, fresh: list[Episode]) -> None:
    found = evaluate(truck, fresh)
    velocity = found["truck.vx"]
    assert {m.name: (m.examples, m.wrong) for m in velocity.modes} == {
        "stacks of 3": (480, 0),
        "stacks of 2, 1": (960, 0),
        "stacks of 1, 1, 1": (480, 0),
    }
    assert found["box.px"].total.examples == 3 * 1920 and found["box.px"].total.wrong == 0
    assert velocity.left_out == 0 and velocity.largest < 1e-9


def test_one_wrong_outcome_is_counted_once_and_in_its_mode(truck: WorldModel, fresh: list[Episode]) -> None:
    last = len(fresh[0])  # a row that nothing follows
    velocity = evaluate(truck, [_shifted(fresh[0], last, 1e-6), *fresh[1:]])["truck.vx"]
    assert velocity.total.wrong == 1 and velocity.total.abstained == 0
    own = velocity.modes[[m.wrong for m in velocity.modes].index(1)]
    names = fresh[0].truth.mode_names["truck.vx"]
    assert own.name == names[int(fresh[0].truth.mode["truck.vx"][-1])]


def test_an_empty_model_is_wrong_and_abstains_everywhere(fresh: list[Episode]) -> None:
    found = evaluate(WorldModel(fresh[0].schema), fresh[:4])
    for target in found.targets:
        assert target.total.wrong == target.total.abstained == target.total.examples > 0
    assert "100" in str(found)


def test_evaluation_sums_over_chunks(truck: WorldModel, fresh: list[Episode]) -> None:
    once, twice = evaluate(truck, fresh), evaluate(truck, [*fresh, *fresh, *fresh])
    assert twice["truck.vx"].total.examples == 3 * once["truck.vx"].total.examples


def test_only_inexplicable_steps_are_left_out(balls: list[Episode]) -> None:
    for episode in balls:
        plain = ~(episode.truth.corner | (episode.truth.active > 1))
        v = episode.columns("ball", "vx", "vy")
        for target, counted in explicable(episode, LAWS).items():
            assert counted[plain].all()
            linear = LAWS.explaining(target[-1], v[:-1], v[1:]).any(axis=1)
            np.testing.assert_array_equal(counted & ~plain, linear & ~plain)
        assert all(np.array_equal(counted, plain) for counted in explicable(episode, None).values())
    assert any(not c.all() for episode in balls for c in explicable(episode, LAWS).values())


def test_labels_name_all_cases_of_a_mode() -> None:
    labels = mode_labels(LAWS)
    assert labels["ball.vx"] == ("fly, floor, slide on floor, ceiling", "left face, right face", "slope")
    assert labels["ball.vy"] == ("fly, left face, right face", "floor, ceiling", "slide on floor", "slope")


def test_a_learned_truck_imagines_whole_episodes(truck: WorldModel, fresh: list[Episode]) -> None:
    found = rollouts(truck, fresh)
    assert (found.trials, found.steps, found.failed, found.stopped) == (48, 40, 0, 0)
    assert found.median < 1e-9


def test_rollouts_use_only_the_first_scene_and_what_comes_from_outside(
    truck: WorldModel, fresh: list[Episode]
) -> None:
    off = rollouts(truck, [_shifted(fresh[0], 20, 1.0), fresh[1]])
    assert off.failed == 0, "velocities on the way are the model's own, and positions are compared"
    assert rollouts(truck, [_shifted(fresh[0], 0, 1.0), fresh[1]]).failed == 1


def test_an_empty_model_stops_at_once(fresh: list[Episode]) -> None:
    model = WorldModel(fresh[0].schema)
    found = rollouts(model, fresh[:3])
    assert found.failed == found.stopped == 3 and np.isnan(found.median)
    dream, steps = imagined(model, fresh[0].vectors, fresh[0].layout)
    assert steps == 0
    np.testing.assert_array_equal(dream, np.repeat(fresh[0].vectors[:1], 41, axis=0))


def test_single_and_batched_rollouts_agree(truck: WorldModel, fresh: list[Episode]) -> None:
    dream, steps = imagined(truck, fresh[0].vectors, fresh[0].layout)
    assert steps == 40
    np.testing.assert_allclose(dream, fresh[0].vectors, rtol=0, atol=1e-9)


def test_a_learned_truck_is_table_3_1(truck: WorldModel, fresh: list[Episode]) -> None:
    found = check_truck(truck, fresh, every=8)
    assert found.perfect
    assert found.queries == found.right_mode == found.right_roles == 240
    assert "not learned" not in str(found)


def test_a_truck_that_saw_one_layout_is_not_table_3_1(fresh: list[Episode]) -> None:
    model = WorldModel(fresh[0].schema)
    seen = [b for b in truck_episodes(seed=0, repeats=1) if b.configuration["layout"] == 4]
    for episode in seen:
        for transition in episode.transitions():
            model.learn_one(transition)
    found = check_truck(model, fresh, every=20)
    assert not found.perfect
    assert [name for name, mode in found.laws if mode] == ["stacks of 1, 1, 1"]
    assert "not learned" in str(found)
    assert found.right_mode < found.queries


def test_functions_are_compared_in_all_their_numbers(truck: WorldModel) -> None:
    laws = truck_modes(3)
    for mode in truck.modes("truck", "vx"):
        assert truck_mode_of(mode, laws) is not None
        assert truck_mode_of(replace(mode, intercept=1e-6), laws) is None
        assert truck_mode_of(replace(mode, roles=mode.roles[:-1]), laws) is None
