from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulated import Line

from relgym.errors import ConfigError
from relgym.planning import Coverage, Explore, Familiar
from relgym.planning.exploration import relative_columns
from relgym.scene.objects import POSE, ObjectType, SceneLayout
from relgym.scene.shapes import Box


def test_what_was_seen_is_nothing_new() -> None:
    coverage = Coverage([0, 2])
    coverage.add(np.array([4.0, 99.0, -1.0]))
    assert coverage.novelty(np.array([[4.0, -7.0, -1.0], [-4.0, 99.0, 1.0]])).tolist() == [0.0, 1.0]


def test_two_values_that_were_never_seen_together_are_new() -> None:
    coverage = Coverage([0, 1])
    for state in ([4.0, 0.0], [0.0, 4.0], [4.0, 4.0]):
        coverage.add(np.array(state))
    # Alone each 0 is known; both at once (stopped, and at the goal) are one of the three pairs.
    assert coverage.novelty(np.array([[0.0, 0.0]])) == pytest.approx([1 / 3])


@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3), st.integers(1, 20))
def test_every_state_is_known_after_it_was_seen(values: list[float], more: int) -> None:
    rng = np.random.default_rng(more)
    coverage = Coverage(range(3), capacity=50)
    coverage.add(np.array(values))
    for _ in range(more):
        coverage.add(rng.standard_normal(3))
    assert coverage.novelty(np.array([values]))[0] == 0.0


def test_memory_is_bounded() -> None:
    coverage = Coverage([0], capacity=5)
    for k in range(20):
        coverage.add(np.array([float(k)]))
    assert len(coverage) == 5


def test_the_bonus_is_the_next_states() -> None:
    coverage = Coverage([0])
    coverage.add(np.array([1.0]))
    before, after = np.array([[1.0], [1.0]]), np.array([[1.0], [-1.0]])
    assert coverage.bonus(3.0)(before, np.zeros((2, 1)), after).tolist() == [0.0, 3.0]


def test_without_columns_nothing_is_new() -> None:
    coverage = Coverage([])
    coverage.add(np.zeros(3))
    assert coverage.novelty(np.ones((2, 3))).tolist() == [0.0, 0.0]


def test_a_capacity_of_nothing_is_refused() -> None:
    with pytest.raises(ConfigError, match="capacity"):
        Coverage([0], capacity=0)


def test_places_count_relative_to_one_another() -> None:
    layout = SceneLayout(
        ("a", "b", "mark"),
        (
            ObjectType("ball", (*POSE, "vx"), Box()),
            ObjectType("wall", POSE, Box()),
            ObjectType("mark", ("ahead",)),
        ),
    )
    found = relative_columns(layout, {("ball", "px"), ("ball", "vx"), ("mark", "ahead")})
    px, wall = POSE.index("px"), len(POSE) + 1 + POSE.index("px")
    assert found == [(px, wall), len(POSE), 2 * len(POSE) + 1]


def test_of_two_that_move_one_difference_counts() -> None:
    layout = SceneLayout(("a", "b"), (ObjectType("ball", POSE, Box()), ObjectType("ball", POSE, Box())))
    assert relative_columns(layout, {("ball", "px")}) == [(0, len(POSE))]


def test_a_difference_is_seen_wherever_it_is() -> None:
    coverage = Coverage([(0, 1)])
    coverage.add(np.array([5.0, 3.0]))
    assert coverage.novelty(np.array([[105.0, 103.0], [103.0, 105.0]])).tolist() == [0.0, 1.0]


def test_what_never_varied_within_an_episode_does_not_count() -> None:
    coverage = Coverage([0, 1], varying=True)
    coverage.add(np.array([1.0, 7.0]), before=np.array([0.0, 7.0]))
    assert coverage.novelty(np.array([[1.0, -7.0], [-1.0, 7.0]])).tolist() == [0.0, 1.0]


def test_where_the_model_was_surprised_there_is_something_to_learn() -> None:
    coverage = Coverage([0])
    coverage.add(np.array([1.0]), surprised=True)
    assert coverage.novelty(np.array([[1.0]])).tolist() == [1.0]
    coverage.add(np.array([1.0]))
    assert coverage.novelty(np.array([[1.0]])).tolist() == [0.0]


def test_nobody_looks_for_ever_where_there_is_only_noise() -> None:
    coverage = Coverage([0])
    for _ in range(10):
        coverage.add(np.array([1.0]), surprised=True)
    assert coverage.novelty(np.array([[1.0]])).tolist() == [0.0]


def test_a_surplus_is_expected_again_until_the_model_accounts_for_it() -> None:
    coverage = Coverage([0, 1])
    here, there = np.array([1.0, 0.0]), np.array([1.0, 1.0])
    coverage.add(here, surprised=True, surplus=2.0)
    coverage.add(there)
    both = np.stack([here, there])
    assert coverage.surplus(both).tolist() == [2.0, 0.0]
    coverage.add(here, surprised=True, surplus=0.0)  # it isn't paid every time
    assert coverage.surplus(both).tolist() == [1.0, 0.0]
    assert coverage.bonus(1.0)(both, None, both)[0] >= 1.0
    coverage.add(here, paid=2.0)  # as the model said
    assert coverage.surplus(both).tolist() == [0.0, 0.0]


def test_only_what_was_seen_is_familiar() -> None:
    coverage = Coverage([0])
    for place in (0.0, 1.0, 2.0):
        coverage.add(np.array([place]))
    world = Familiar(Line(), coverage)
    before = np.array([[0.0], [1.0]])
    stepped = world.step(before, np.array([[1.0], [-1.0]]))
    assert stepped.known.all()
    away = world.step(before, np.array([[-1.0], [1.0]]))
    assert away.known.tolist() == [False, True]  # -1 was never seen
    assert away.states[0, 0] == 0.0 and away.rewards[0] == 0.0


def test_explore_tells_how_new_each_step_is_and_pays_for_it() -> None:
    plain, paid = (
        Explore(gym.make("relgym/TruckPush-v0", n_boxes=1), weight=weight) for weight in (0.0, 2.0)
    )
    for env in (plain, paid):
        env.reset(seed=0)
    action = np.array([1.0], np.float32)
    _, reward, _, _, info = plain.step(action)
    _, more, _, _, _ = paid.step(action)
    assert float(more) == float(reward) + 2.0 * info["novelty"]
    novelties = [plain.step(action)[4]["novelty"] for _ in range(3)]
    assert all(0.0 <= each <= 1.0 for each in novelties)
    plain.reset(seed=0)
    assert plain.step(action)[4]["novelty"] == 0.0  # the same again


def test_explore_refuses_a_negative_weight() -> None:
    with pytest.raises(ConfigError, match="weight"):
        Explore(gym.make("relgym/TruckPush-v0"), weight=-1.0)
