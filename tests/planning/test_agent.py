from __future__ import annotations

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from relgym.errors import ConfigError
from relgym.experiments.plan.pit import Pit, falls
from relgym.planning import PlanningAgent, TreeSearch
from relgym.planning import agent as planning_agent

SEARCH = TreeSearch(horizon=8, expansions=64, batch=32)


def agent(**options: Any) -> PlanningAgent:
    env = gym.make("relgym/TruckPush-v0", n_boxes=1)
    return PlanningAgent(env, **{"search": SEARCH, "random_steps": 40, "seed": 3} | options)


def test_it_learns_and_covers_each_real_step() -> None:
    made = agent().learn(60)
    assert made.steps == 60 == made.model.seen
    assert made.coverage is not None and len(made.coverage) == 60
    assert made.learn(60).steps == 60  # of all calls together


def test_same_seed_same_model() -> None:
    first, second = (agent().learn(60).model.to_json() for _ in range(2))
    assert first == second


def test_it_acts_as_policies_do() -> None:
    made = agent(task="given").learn(60)
    env = gym.make("relgym/TruckPush-v0", n_boxes=1)
    seen, _ = env.reset(seed=0)
    action, state = made.predict(seen)
    assert env.action_space.contains(action) and len(state) == 1
    stacked = {name: np.stack([part, part]) for name, part in seen.items()}
    actions, state = made.predict(stacked, None, np.array([True, True]))
    assert actions.shape == (2, 1) and len(state) == 2


def test_decisions_may_last_several_steps() -> None:
    made = agent(repeat=2).learn(41)
    assert 41 <= made.steps <= 42


def test_a_callback_ends_learning() -> None:
    assert agent().learn(60, callback=lambda each: each.steps < 5).steps == 5


@pytest.mark.parametrize(
    "options",
    [
        *({"exploration": -1.0}, {"random_steps": -1}, {"task": "known"}, {"repeat": 0}),
        {"task": None, "exploration": 0.0},
    ],
)
def test_settings_out_of_range_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="expected"):
        agent(**options)


def test_a_task_that_is_given_must_be_there() -> None:
    with pytest.raises(ConfigError, match="no task"):
        PlanningAgent(gym.make("CartPole-v1"), task="given")


def test_a_safe_agent_does_not_walk_into_a_pit_that_it_never_saw() -> None:
    # Six steps lead no farther than 10.03, so while it learns it can't reach the edge: each step forward pays, and that
    # is all it knows.
    search = TreeSearch(horizon=6, expansions=128, batch=64)
    bold, careful = (
        PlanningAgent(Pit(begin=11.0, steps=6), search=search, random_steps=150, safe=safe).learn(150)
        for safe in (False, True)
    )
    assert falls(bold, 5, begin=11.0) == 5
    assert falls(careful, 20, begin=11.0) == 0


def test_in_doubt_it_acts_at_random_and_learns_again() -> None:
    made = agent(random_steps=60).learn(100)
    assert 0.0 <= made.doubt <= 1.0
    assert made.model.seen == 100  # whichever model is at work has learned from all


def test_where_more_was_paid_than_it_can_account_for_it_looks_again() -> None:
    made = agent(task="learned").learn(60)
    assert made.coverage is not None
    weight = made.exploration * made._size.scale
    objective = made._objective(explores=True)
    assert objective.curiosity == weight > 0.0
    assert made._objective(explores=False).bonus is None


def test_without_a_task_nothing_pays_and_what_is_unknown_is_worth_most() -> None:
    made = agent(task=None, random_steps=0).learn(60)
    assert made.model.seen == 60 and not made._at_random  # its plans are random actions where all is unknown
    assert made.coverage is not None and not made.coverage._paid  # though the env pays for the truck's way
    objective = made._objective(explores=True)
    assert objective.bonus is not None and objective.curiosity is not None
    # More than all that follows could show, were every step of it entirely new.
    assert objective.curiosity >= made.exploration * sum(made.discount**k for k in range(1_000)) > 0.0
    seen, _ = made.env.reset(seed=0)
    assert made.env.action_space.contains(made.predict(seen)[0])


def test_who_discounts_nothing_counts_as_far_as_the_search_looks() -> None:
    made = agent(task=None, discount=1.0, random_steps=0).learn(4)
    assert made._objective(explores=True).curiosity == made.exploration * SEARCH.horizon


def test_careful_without_a_task_it_stays_where_it_was() -> None:
    search = TreeSearch(horizon=6, expansions=128, batch=64)
    made = PlanningAgent(Pit(begin=11.0, steps=6), search=search, task=None, safe=True).learn(150)
    assert falls(made, 10, begin=11.0) == 0


@pytest.mark.parametrize("options", [{"random_steps": 20}, {"task": None, "random_steps": 0}])
def test_episodes_that_were_cut_short_tell_how_long_they_may_last(options: dict[str, Any]) -> None:
    made = PlanningAgent(Pit(begin=60.0, steps=6), search=SEARCH, **options).learn(30)
    assert made._limit == 6


@pytest.mark.parametrize(("restarts", "lengths"), [(False, {6}), (True, {1, 2, 4, 6})])
def test_most_random_episodes_are_short(restarts: bool, lengths: set[int]) -> None:
    # The env cuts them after six steps; what the agent would let last for 8, 16, … lasts so long.
    made = PlanningAgent(Pit(begin=60.0, steps=6), search=SEARCH, random_steps=240, restarts=restarts)
    made.learn(240, lambda each: each._lasts is None or 4 * each._hold <= max(4, each._lasts))
    assert made.steps == 240  # an action is never held for more than a quarter of its episode
    assert set(np.bincount(made._episodes)[1:-1].tolist()) == lengths


def test_planned_episodes_are_whole() -> None:
    made = PlanningAgent(Pit(begin=60.0, steps=6), search=SEARCH, random_steps=40).learn(40)
    made._wrong.clear()
    made._wrong.append(False)  # no doubt
    made._observation = None
    first = made._begun + 1
    made.learn(60)
    assert np.bincount(made._episodes)[first:-1].tolist() == [6] * (made._begun - first)


@pytest.mark.parametrize(
    ("costs", "lessons"),
    [
        ([9.0, 9.0], 1),  # as good as what it had
        (
            [9.0, 7.0, 5.0, 5.0],
            3 + 1,
        ),  # the second time the same; and once more for what it makes of new steps
        ([9.0, 10.0, 11.0, 8.0, 12.0, 7.0, 10.0], 6 + 1),
    ],
)
def test_orders_are_tried_until_two_come_to_the_same(
    costs: list[float], lessons: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = agent(random_steps=40).learn(40)
    told, called, learned_again = iter(costs), 0, planning_agent.learned_again

    def counted(*arguments: Any, **options: Any) -> Any:
        nonlocal called
        called += 1
        return learned_again(*arguments, **options)

    monkeypatch.setattr(planning_agent, "learned_again", counted)
    monkeypatch.setattr(planning_agent, "missed", lambda *_: 0)
    monkeypatch.setattr(planning_agent, "length", lambda _: next(told))
    made._next_review = 10**9
    made._wrong.append(True)
    made._review()
    assert called == lessons and next(told, None) is None


def test_an_approximation_is_doubted_by_what_matters_and_learned_again_less_often(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counts: list[int] = []

    def counted(model: Any, seen: Any, **options: Any) -> Any:
        counts.append(len(seen))
        return learned_again(model, seen, **options)

    learned_again = planning_agent.learned_again
    monkeypatch.setattr(planning_agent, "learned_again", counted)
    made = PlanningAgent(gym.make("CartPole-v1"), search=SEARCH, random_steps=100, seed=0).learn(130)
    assert np.mean(made._wrong) > 0.9  # to the last digit hardly anything was foreseen
    assert made.doubt < 0.2
    assert counts and set(counts) <= {75, 100}  # not after 111 and 123 steps, as where laws are exact
    assert made._next_again == 200


class Sledge(gym.Env[Any, Any]):
    """A position and a push that moves it; after so many steps of all episodes it moves it by a third as much."""

    observation_space = gym.spaces.Box(-1e3, 1e3, (1,))
    action_space = gym.spaces.Box(-1.0, 1.0, (1,))

    def __init__(self, changes: int) -> None:
        self.left, self.at, self.age = changes, 0.0, 0

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.at, self.age = float(self.np_random.uniform(-1.0, 1.0)), 0
        return np.array([self.at]), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.left, self.age = self.left - 1, self.age + 1
        self.at += float(action[0]) * (0.9 if self.left >= 0 else 0.3)
        return np.array([self.at]), -abs(self.at), False, self.age == 16, {}


def test_in_a_changed_world_it_goes_on_with_what_it_learned_since() -> None:
    made = PlanningAgent(Sledge(150), search=SEARCH, task="learned", random_steps=60, seed=1).learn(150)
    assert made.doubt == 0.0 and made.model.seen == 150
    made.learn(270)
    assert 100 <= made.model.seen <= 120  # of the world as it is now
    assert made.doubt == 0.0


def test_where_it_has_never_been_is_no_other_world() -> None:
    made = PlanningAgent(Sledge(10**6), search=SEARCH, task="learned", random_steps=60, seed=1).learn(200)
    learned = made.model
    made._wrong.extend([False] * 100 + [True] * 100)
    made._review_change()
    assert made.model is learned  # which explains all that was seen


def test_an_agent_is_pickled_in_mid_life() -> None:
    made = agent().learn(50)
    again = pickle.loads(pickle.dumps(made))
    assert again.learn(54).model.to_json() == made.learn(54).model.to_json()
