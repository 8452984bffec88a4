from __future__ import annotations

import numpy as np
import pytest
from simulated import Line

from relgym.errors import ConfigError
from relgym.planning import Objective
from relgym.planning.rollouts import roll_out

ACTIONS = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0], [0.0, 0.0, 0.0]])[:, :, None]


def test_three_roll_outs_by_hand() -> None:
    found = roll_out(Line(), np.array([0.0]), ACTIONS, Objective())
    assert found.states[:, 0, 0].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert found.rewards[:, 0].tolist() == [-2.0, -1.0, 0.0]
    assert found.lengths.tolist() == [3, 2, 3]  # the second one leaves what is known
    assert found.terminated.tolist() == [True, False, False]
    assert found.known.tolist() == [True, False, True]
    # -4 - 5, and for the step that isn't known the least reward of all, -5
    assert found.worth == pytest.approx([-3.0, -14.0, -9.0])


def test_a_discount_counts_decisions() -> None:
    found = roll_out(Line(), np.array([0.0]), ACTIONS, Objective(discount=0.5))
    assert found.worth[0] == pytest.approx(-2.0 - 0.5)


def test_what_lies_beyond_the_horizon_counts_where_the_episode_goes_on() -> None:
    objective = Objective(value=lambda states: 100.0 + states[:, 0])
    found = roll_out(Line(), np.array([0.0]), ACTIONS, objective)
    assert found.worth == pytest.approx([-3.0, -14.0, 91.0])


def test_curiosity_pays_for_what_is_not_known() -> None:
    found = roll_out(Line(), np.array([0.0]), ACTIONS, Objective(curiosity=7.0))
    assert found.worth[1] == pytest.approx(-9.0 + 7.0)


def test_a_bonus_is_paid_for_what_was_followed() -> None:
    objective = Objective(bonus=lambda before, actions, after: after[:, 0] - before[:, 0])
    found = roll_out(Line(), np.array([0.0]), ACTIONS, objective)
    assert found.worth == pytest.approx([0.0, -14.0 - 2.0, -9.0])


def test_a_first_step_into_the_unknown_is_the_last_choice() -> None:
    found = roll_out(Line(), np.array([-1.5]), ACTIONS, Objective())
    assert found.worth[1] == -np.inf
    plan = found.plan(1, ACTIONS, ACTIONS)
    assert len(plan.actions) == 1 and len(plan.states) == 1 and not plan.known


@pytest.mark.parametrize("discount", [0.0, 1.5, -1.0])
def test_discounts_lie_between_0_and_1(discount: float) -> None:
    with pytest.raises(ConfigError, match="discount"):
        Objective(discount=discount)
