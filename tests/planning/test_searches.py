from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from simulated import Corridor, Line, Table

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
from relgym.planning.sequences import _varied, held_noise
from relgym.planning.tree import _Tree

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


# ---------------------------------------------------------------------- all plans of a small world, one by one
HORIZON = 3
THOROUGH: list[Search] = [
    CrossEntropy(horizon=HORIZON, candidates=512, rounds=2),
    PathIntegral(horizon=HORIZON, candidates=512, rounds=2),
    RandomShooting(horizon=HORIZON, candidates=1024),
    TreeSearch(horizon=HORIZON, expansions=1024, batch=128, patience=1024),
]
"""All but the tree look at every plan: it keeps one branch of each cell, the best as far as it goes."""


def worth_of(world: Table, actions: tuple[int, ...], discount: float) -> float | None:
    """What a plan from state 0 pays; None where it leads into what isn't known."""
    state, total = 0, 0.0
    for k, action in enumerate(actions):
        if world.leads[state, action] < 0:
            return None
        total += discount**k * float(world.pays[state, action])
        if world.ends[state, action]:
            break
        state = int(world.leads[state, action])
    return total


PAYS = st.integers(-4, 4).map(float)


@pytest.mark.parametrize("how", THOROUGH, ids=lambda s: type(s).__name__)
@settings(max_examples=12, deadline=None)
@given(
    leads=arrays(np.int64, (5, 3), elements=st.integers(0, 4)),
    pays=arrays(np.float64, (5, 3), elements=PAYS),
    ends=arrays(np.bool_, (5, 3), elements=st.integers(0, 3).map(lambda k: k == 0)),
    discount=st.sampled_from((1.0, 0.5)),
)
def test_no_plan_of_a_small_world_is_better(
    how: Search, leads: Any, pays: Any, ends: Any, discount: float
) -> None:
    world = Table(leads, pays, ends)
    worths = [worth_of(world, plan, discount) for plan in itertools.product(range(3), repeat=HORIZON)]
    coder = ActionCoder(world.action_space)
    options: dict[str, Any] = {"warm": None, "rng": np.random.default_rng(0), "deadline": None}
    plan = how.plan(world, coder, np.array([0.0]), Objective(discount=discount), **options)
    best = max(w for w in worths if w is not None)
    assert plan.worth == pytest.approx(best, abs=1e-12) or (isinstance(how, TreeSearch) and plan.worth < best)
    assert plan.worth == pytest.approx(worth_of(world, tuple(plan.actions.tolist()), discount), abs=1e-12)
    assert plan.known and len(plan.rewards) == len(plan.actions)


@pytest.mark.parametrize("how", THOROUGH[:3], ids=lambda s: type(s).__name__)
def test_what_is_not_known_is_worth_what_curiosity_says(how: Search) -> None:
    """Action 0 pays 1 a step; action 2 leads nowhere known: worth 2 a step there, not 1.5 after two steps of 1."""
    leads = np.array([[0, 0, -1]] * 5)
    pays, ends = np.array([[1.0, 0.0, 0.0]] * 5), np.zeros((5, 3), dtype=np.bool_)
    world, coder = Table(leads, pays, ends), ActionCoder(spaces.Discrete(3))
    options: dict[str, Any] = {"warm": None, "rng": np.random.default_rng(0), "deadline": None}
    plan = how.plan(world, coder, np.array([0.0]), Objective(curiosity=2.0), **options)
    assert plan.actions.tolist() == [0, 0, 2] and not plan.known and plan.worth == 4.0
    assert plan.rewards.tolist() == [1.0, 1.0] and plan.states.ravel().tolist() == [0.0, 0.0, 0.0]
    plan = how.plan(world, coder, np.array([0.0]), Objective(), **options)
    assert plan.actions.tolist() == [0, 0, 0] and plan.known and plan.worth == 3.0


def test_path_integrals_by_hand() -> None:
    """Two candidates, worths 1 and 0: weights e^(2 / 0.2) = e^10 to 1 where they spread by 0.5."""
    seen: list[Any] = []

    class Two(Line):
        def step(self, states: Any, actions: Any) -> Any:
            seen.append(np.asarray(actions, dtype=np.float64).ravel().copy())
            some = len(states)
            paid, no = np.linspace(1.0, 0.0, some), np.zeros(some, dtype=np.bool_)
            return replace(super().step(states, actions), rewards=paid, known=~no, terminated=no)

    how = PathIntegral(horizon=1, candidates=2, rounds=2, spread=1e-9)
    world = Two(action_space=spaces.Box(-1e3, 1e3, (1,), np.float64))
    how.plan(
        world,
        ActionCoder(world.action_space),
        np.array([0.0]),
        Objective(),
        warm=None,
        rng=np.random.default_rng(0),
        deadline=None,
    )
    (first, second), later = seen
    mean = (np.exp(10.0) * first + second) / (np.exp(10.0) + 1.0)
    # The best of the last round is kept; of the others half are drawn about the mean, hardly spread at all.
    assert later[0] == first and later[1] == pytest.approx(mean, abs=1e-4)


def test_noise_is_held_for_one_length_in_each_sequence() -> None:
    """Holds of 1, 2, 4, 8 decisions, from any phase: between two changes lies one length, or it is cut off."""
    lengths = set()
    for row in held_noise(400, 8, 2, rng=np.random.default_rng(1)):
        changes = np.flatnonzero((np.diff(row, axis=0) != 0.0).all(axis=1)) + 1
        assert len(changes) == len(np.flatnonzero((np.diff(row, axis=0) != 0.0).any(axis=1)))
        inner = set(np.diff(changes).tolist())
        assert len(inner) <= 1
        lengths |= inner
    assert lengths == {1, 2, 4}


def test_variations_change_one_stretch_of_a_kept_sequence() -> None:
    kept = np.arange(5.0)[None, :, None].repeat(2, axis=0) * np.array([1.0, 10.0])[:, None, None]
    noise = np.ones((200, 5, 1))
    for row in _varied(kept, noise, rng=np.random.default_rng(0))[:, :, 0]:
        off = np.stack([row - kept[0, :, 0], row - kept[1, :, 0]])
        mine = off[np.abs(off).max(axis=1).argmin()]
        assert np.unique(np.round(mine[mine != 0.0], 12)).size == 1  # one size of change
        places = np.flatnonzero(mine)
        assert len(places) and places.tolist() == list(range(places[0], places[-1] + 1))
        assert 0.02 <= mine[places[0]] <= 1.0


def tree_of(*ways: tuple[int, float, bool]) -> _Tree:
    """A tree grown by hand: parent, reward and whether that ended the episode, of nodes 1, 2, …; horizon 2."""
    tree = _Tree(np.array([0.0]), 32, 2, Objective())
    for parent, reward, ended in ways:
        one = np.array([reward])
        state = tree.states[[parent]] + reward
        tree.grow(np.array([parent]), state, one, one, np.zeros((1, 1)), np.array([ended]))
    return tree


def test_the_best_whole_branch_of_a_tree_by_hand() -> None:
    coder = ActionCoder(spaces.Box(-1.0, 1.0, (1,), np.float64))
    # 1 pays 5 and leads to 2, which costs 4: whole, worth 1. 3 ends the episode for 2.
    tree = tree_of((0, 5.0, False), (1, -4.0, False), (0, 2.0, True))
    assert (tree.whole, tree.whole_worth, tree.ended, tree.ended_worth) == (2, 1.0, 3, 2.0)
    plan = tree.branch(tree.best(), coder)
    assert (plan.worth, plan.terminates, plan.rewards.tolist()) == (2.0, True, [2.0])
    tree = tree_of((0, 5.0, False), (1, -2.0, False), (0, 2.0, True))
    plan = tree.branch(tree.best(), coder)
    assert (plan.worth, plan.terminates, plan.rewards.tolist()) == (3.0, False, [5.0, -2.0])
    assert plan.states.ravel().tolist() == [0.0, 5.0, 3.0]


def test_a_tree_of_nothing_but_its_root_has_an_action() -> None:
    coder = ActionCoder(spaces.Box(-1.0, 1.0, (1,), np.float64))
    plan = _Tree(np.array([4.0]), 32, 2, Objective()).branch(0, coder)
    assert len(plan) == 1 and not plan.known and plan.worth == -np.inf and plan.states.tolist() == [[4.0]]
