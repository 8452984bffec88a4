from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulated import Line

from relgym.errors import ConfigError
from relgym.planning import CrossEntropy, Planner

SEARCH = CrossEntropy(horizon=6, candidates=64, rounds=4)


def play(planner: Planner, *, push: float = 0.0) -> tuple[float, Any]:
    """Ten steps of a real line whose second step is pushed."""
    x, state = np.array([0.0]), None
    for k in range(10):
        action, state = planner.predict(x, state)
        x = x + np.asarray(action, dtype=np.float64) + (push if k == 1 else 0.0)
        if abs(x[0] - 3.0) < 0.05:
            break
    return float(x[0]), state


def test_a_planner_reaches_the_aim_with_one_search() -> None:
    planner = Planner(Line(), SEARCH, commit=6)
    x, (thread,) = play(planner)
    assert abs(x - 3.0) < 0.3
    assert thread.surprises == 0


def test_a_surprise_is_followed_by_a_search() -> None:
    planner = Planner(Line(), SEARCH, commit=6)
    x, (thread,) = play(planner, push=-1.0)
    assert thread.surprises == 1
    assert abs(x - 3.0) < 0.3


def test_plans_are_looked_at_again_after_so_many_decisions() -> None:
    world = Line()
    planner = Planner(world, CrossEntropy(horizon=3, candidates=8, rounds=1), commit=2)
    x, state = np.array([-1.5]), None
    for _ in range(4):  # too far for plans of three decisions to end there
        action, state = planner.predict(x, state)
        x = x + 0.5 * np.asarray(action, dtype=np.float64) * 0.0
        state[0].plan.states[:] = x  # the world as it was predicted
    assert world.calls == 2


def test_batches_are_planned_one_by_one_and_forgotten_where_episodes_begin() -> None:
    planner = Planner(Line(), SEARCH)
    seen = np.array([[0.0], [6.0]])
    actions, state = planner.predict(seen)
    assert actions.shape == (2, 1) and actions[0, 0] > 0.0 > actions[1, 0]
    _, later = planner.predict(seen, state, np.array([True, False]))
    assert later[0] is not state[0] and later[1] is state[1]
    assert later[0].searches == 1


def test_an_agents_observation_may_be_another_than_the_models() -> None:
    planner = Planner(Line(), SEARCH, source=lambda hidden: np.array([hidden["x"]]))
    action, _ = planner.predict({"x": 0.0})
    assert action.shape == (1,)


@pytest.mark.parametrize(
    "options",
    [{"commit": 0}, {"tolerance": -1.0}, {"seconds": np.nan}, {"seed": -1}],
)
def test_settings_out_of_range_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="expected"):
        Planner(Line(), SEARCH, **options)


def test_what_cannot_be_stepped_is_refused() -> None:
    with pytest.raises(ConfigError, match="ModelSimulator"):
        Planner("truck.json")  # type: ignore[arg-type]
