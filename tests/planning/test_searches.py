from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from simulated import Corridor, Line

from relgym.errors import ConfigError
from relgym.planning import (
    ActionCoder,
    CrossEntropy,
    Objective,
    PathIntegral,
    Plan,
    RandomShooting,
    Search,
    Simulator,
    TreeSearch,
)
from relgym.planning.sequences import held_noise

SEARCHES: list[Search] = [
    CrossEntropy(horizon=6, candidates=64, rounds=4),
    PathIntegral(horizon=6, candidates=128, rounds=4),
    RandomShooting(horizon=6, candidates=512),
    TreeSearch(horizon=6, expansions=1024, batch=32),
]


def search(how: Search, simulator: Simulator, start: list[float], **kwargs: Any) -> Plan:
    options: dict[str, Any] = {"warm": None, "rng": np.random.default_rng(0), "deadline": None} | kwargs
    coder = ActionCoder(simulator.action_space)
    return how.plan(simulator, coder, np.array(start), Objective(), **options)


@pytest.mark.parametrize("how", SEARCHES, ids=lambda s: type(s).__name__)
def test_each_search_comes_near_the_best_plan(how: Search) -> None:
    plan = search(how, Line(), [0.0])
    # The best is 1, 1, 1: worth -3. Standing still is worth -18.
    assert plan.worth > -4.5
    assert plan.known
    assert abs(plan.states[-1, 0] - 3.0) < 0.5


@pytest.mark.parametrize("how", SEARCHES, ids=lambda s: type(s).__name__)
def test_a_plan_is_what_the_simulator_does(how: Search) -> None:
    world = Line()
    plan = search(how, world, [0.0])
    assert len(plan.states) == len(plan.actions) + 1
    for k, action in enumerate(plan.actions):
        stepped = world.step(plan.states[k][None], action[None])
        assert stepped.states[0] == pytest.approx(plan.states[k + 1])
        assert stepped.rewards[0] == pytest.approx(plan.rewards[k])


@pytest.mark.parametrize("how", SEARCHES, ids=lambda s: type(s).__name__)
def test_same_seed_same_plan(how: Search) -> None:
    first, second = (search(how, Line(), [0.0]) for _ in range(2))
    assert np.array_equal(first.actions, second.actions)


@pytest.mark.parametrize("how", SEARCHES, ids=lambda s: type(s).__name__)
def test_a_search_out_of_time_still_has_a_plan(how: Search) -> None:
    assert len(search(how, Line(), [0.0], deadline=0.0)) >= 1


@pytest.mark.parametrize("how", SEARCHES, ids=lambda s: type(s).__name__)
def test_nothing_leads_into_the_unknown_where_another_way_is_known(how: Search) -> None:
    plan = search(how, Line(), [-1.9])
    assert plan.known and plan.states.min() >= -2.0


def test_where_nothing_is_known_there_is_an_action_all_the_same() -> None:
    class Blank(Line):
        def step(self, states: Any, actions: Any) -> Any:
            return replace(super().step(states, actions), known=np.zeros(len(states), dtype=np.bool_))

    for how in SEARCHES:
        plan = search(how, Blank(), [0.0])
        assert not plan.known and len(plan.actions) == 1


def test_a_last_plan_is_never_made_worse() -> None:
    how = CrossEntropy(horizon=6, candidates=8, rounds=1)
    good = np.array([[1.0], [1.0], [1.0], [0.0], [0.0], [0.0]])
    assert search(how, Line(), [0.0], warm=good).worth == pytest.approx(-3.0)


def test_choices_are_searched_as_numbers_are() -> None:
    class Steps3(Line):
        def step(self, states: Any, actions: Any) -> Any:
            return super().step(states, np.asarray(actions, dtype=np.float64)[:, None] - 1.0)

    world = Steps3(action_space=spaces.Discrete(3))
    for how in SEARCHES:
        plan = search(how, world, [0.0])
        assert plan.actions.tolist() == [2, 2, 2] and plan.terminates


def test_a_tree_gets_out_of_a_trap_in_which_sequences_stay() -> None:
    caught = search(CrossEntropy(horizon=16, candidates=64, rounds=4), Corridor(), [0.9, 0.0])
    free = search(TreeSearch(horizon=16, expansions=4_096), Corridor(), [0.9, 0.0])
    assert free.terminates and free.worth > 10.0
    assert not caught.terminates and caught.worth < 1.0


def test_a_search_may_refine_the_trees_plan() -> None:
    tree = TreeSearch(horizon=6, expansions=64, batch=16)
    rough = search(tree, Line(), [0.0])
    fine = search(replace(tree, refine=CrossEntropy(horizon=6, candidates=64, rounds=4)), Line(), [0.0])
    assert fine.worth >= rough.worth


def test_noise_is_held_and_standard_normal() -> None:
    drawn = held_noise(4_000, 8, 1, rng=np.random.default_rng(0))
    assert abs(drawn.mean()) < 0.05 and abs(drawn.std() - 1.0) < 0.05
    changes = (np.diff(drawn[:, :, 0], axis=1) != 0.0).sum(axis=1)
    assert changes.min() == 0 and changes.max() == 7


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: CrossEntropy(horizon=0),
        lambda: CrossEntropy(elites=1.0),
        lambda: CrossEntropy(candidates=2.5),  # type: ignore[arg-type]
        lambda: PathIntegral(temperature=0.0),
        lambda: RandomShooting(candidates=1),
        lambda: TreeSearch(expansions=0),
        lambda: TreeSearch(greedy=1.5),
    ],
)
def test_settings_out_of_range_are_refused(wrong: Any) -> None:
    with pytest.raises(ConfigError, match="expected"):
        wrong()


class Brink(Line):
    """Every step to the right pays 1; right of 3 the episode is over at a loss of 10."""

    def step(self, states: Any, actions: Any) -> Any:
        stepped = super().step(states, actions)
        over = stepped.states[:, 0] > 3.0
        moved = stepped.states[:, 0] - states[:, 0]
        return replace(stepped, rewards=np.where(over, moved - 10.0, moved), terminated=over)


def test_a_tree_does_not_take_the_road_to_the_brink_for_the_best_one() -> None:
    plan = search(TreeSearch(horizon=6, expansions=1024, batch=64), Brink(), [0.0])
    assert len(plan) == 6 and not plan.terminates
    assert 2.0 < plan.worth <= 3.0


def test_with_curiosity_a_plan_leads_into_what_is_not_known() -> None:
    class Fog(Line):
        def step(self, states: Any, actions: Any) -> Any:
            stepped = super().step(states, actions)
            return replace(stepped, known=stepped.states[:, 0] < 2.0)

    for how in SEARCHES:
        options: dict[str, Any] = {"warm": None, "rng": np.random.default_rng(0), "deadline": None}
        coder = ActionCoder(Fog().action_space)
        plan = how.plan(Fog(), coder, np.array([0.0]), Objective(curiosity=100.0), **options)
        assert not plan.known
        assert len(plan.states) == len(plan.actions) == len(plan.rewards) + 1
        assert Fog().step(plan.states[-1][None], plan.actions[-1][None]).known.tolist() == [False]
