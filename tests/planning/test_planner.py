from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from numpy.typing import NDArray
from simulated import Line

from relgym.errors import ConfigError
from relgym.planning import CrossEntropy, Planner, Steps

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


@dataclass
class Advised(Line):
    """A line that takes advice: who doubts it adds to what it predicts, and it can guess what lies below -2."""

    error: NDArray[np.float64] | None = None
    guesses: bool = False

    def corrected(self, error: NDArray[np.float64] | None, *, guesses: bool = False) -> Advised:
        return replace(self, error=error, guesses=guesses)

    def step(self, states: NDArray[np.float64], actions: NDArray[Any]) -> Steps:
        found = super().step(states, actions)
        after = states + actions if self.guesses else found.states
        after = after if self.error is None else after + self.error
        off = np.abs(after[:, 0] - 3.0)
        return Steps(after, -off, off < 0.05, found.known | self.guesses)


def drift(planner: Planner, wind: float, x: float = 0.0) -> tuple[list[float], Any]:
    """Where a line leads whose wind nobody told the planner of."""
    state, seen = None, [x]
    for _ in range(8):
        action, state = planner.predict(np.array([seen[-1]]), state)
        seen.append(float(seen[-1] + np.asarray(action, dtype=np.float64)[0] + wind))
        if abs(seen[-1] - 3.0) < 0.05:
            break
    return seen, state


def test_what_it_was_off_by_once_is_expected_again() -> None:
    seen, (thread,) = drift(Planner(Advised(), SEARCH, commit=6), -0.3)
    assert thread.surprises == 1 and thread.error == pytest.approx([-0.3])
    assert abs(seen[-1] - 3.0) < 0.3
    _, (other,) = drift(Planner(Advised(), SEARCH, commit=6, adapts=False), -0.3)
    assert other.surprises > 1 and other.error is None


def test_an_error_that_is_over_is_forgotten() -> None:
    planner = Planner(Advised(), SEARCH, commit=6)
    _, (thread,) = play(planner, push=-1.0)
    assert thread.error is None and thread.surprises == 2  # the push, and that it was one push only


def test_where_no_outcome_is_known_it_plans_with_guesses() -> None:
    seen, (thread,) = drift(Planner(Advised(), SEARCH), 0.0, x=-5.0)
    assert abs(seen[-1] - 3.0) < 0.3 and thread.surprises == 0
    lost, _ = drift(Planner(Advised(), SEARCH, safe=True), 0.0, x=-5.0)
    assert lost[-1] < 2.0


def test_batches_are_planned_one_by_one_and_forgotten_where_episodes_begin() -> None:
    planner = Planner(Line(), SEARCH)
    seen = np.array([[0.0], [6.0]])
    actions, state = planner.predict(seen)
    assert actions.shape == (2, 1) and actions[0, 0] > 0.0 > actions[1, 0]
    _, later = planner.predict(seen, state, np.array([True, False]))
    assert later[0] is not state[0] and later[1] is state[1]
    assert later[0].searches == 1


@dataclass
class Parted(Line):
    """A line that is shown in parts, of which only one counts."""

    def state(self, observation: Any) -> NDArray[np.float64]:
        part = observation[0] if isinstance(observation, tuple) else observation["place"]["x"]
        return np.asarray(part, dtype=np.float64)


@pytest.mark.parametrize("named", [True, False])
def test_observations_in_parts_are_told_from_batches_of_them(named: bool) -> None:
    x, lamp = spaces.Box(-10.0, 10.0, (1,), np.float64), spaces.Discrete(2)
    space = spaces.Dict({"lamp": lamp, "place": spaces.Dict({"x": x})}) if named else spaces.Tuple((x, lamp))
    planner = Planner(Parted(observation_space=space), SEARCH)

    def shown(place: Any, lamp: Any) -> Any:
        return (
            {"place": {"x": place}, "lamp": lamp} if named else (place, lamp)
        )  # in another order than the space's

    action, _ = planner.predict(shown(np.array([0.0]), np.int64(1)))
    assert action.shape == (1,) and action[0] > 0.0
    actions, _ = planner.predict(shown(np.array([[0.0], [6.0]]), np.array([1, 0])))
    assert actions.shape == (2, 1) and actions[0, 0] > 0.0 > actions[1, 0]


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
