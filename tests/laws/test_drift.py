"""Is what no free law explains noise, or motion that goes on? Sums by hand."""

from __future__ import annotations

import json

import numpy as np
import pytest

from relgym.config.constants import ENOUGH
from relgym.laws.drift import Drift


def fed(changes: list[float], name: str = "a") -> Drift:
    """Velocities of one object, the next one always that which came."""
    drift, now = Drift(), np.zeros(2)
    for change in changes:
        after = now + np.array([change, 0.0])
        drift.add(name, now, after)
        now = after
    return drift


def test_sums_by_hand() -> None:
    # Changes 1, 3, -2: their sum is 2, of squares 14; they differ by 2 and -5, of squares 29.
    drift = fed([1.0, 3.0, -2.0])
    assert (drift.count, drift.pairs, drift.squares, drift.steps) == (3, 2, 14.0, 29.0)
    assert drift.total == [2.0, 0.0, 0.0]


def test_only_consecutive_changes_of_one_object_are_pairs() -> None:
    drift = fed([1.0, 2.0])
    drift.add("b", np.array([3.0, 0.0]), np.array([4.0, 0.0]))  # another one, though as fast
    assert drift.pairs == 1
    drift.add("a", np.array([7.0, 0.0]), np.array([8.0, 0.0]))  # it was elsewhere in the meantime
    assert drift.pairs == 1
    drift.add("b", np.array([4.0, 0.0]), np.array([6.0, 0.0]))
    assert (drift.pairs, drift.steps) == (2, 1.0 + 1.0)
    assert drift.count == 5


def test_a_velocity_that_is_changed_later_is_not_what_was_remembered() -> None:
    drift, after = Drift(), np.array([1.0, 0.0])
    drift.add("a", np.zeros(2), after)
    after[0] = 5.0
    drift.add("a", np.array([1.0, 0.0]), np.array([2.0, 0.0]))
    assert drift.pairs == 1


def test_so_few_pairs_tell_nothing() -> None:
    steady = [1.0 + 0.1 * k for k in range(ENOUGH + 1)]
    assert fed(steady[:-1]).noisy()
    assert not fed(steady).noisy()


@pytest.mark.parametrize(("correlation", "noisy"), [(0.0, True), (0.4, True), (0.6, False), (0.95, False)])
def test_at_a_correlation_of_one_half_noise_ends(correlation: float, noisy: bool) -> None:
    """Differences of changes with a correlation r have 2 (1 - r) times their variance."""
    rng, changes = np.random.default_rng(0), [0.0]
    for _ in range(4_000):
        changes.append(correlation * changes[-1] + (1.0 - correlation**2) ** 0.5 * float(rng.normal()))
    assert (
        fed([3.0 + change for change in changes]).noisy() is noisy
    )  # a steady change is no matter of either


def test_saved_and_read_a_new_run_begins() -> None:
    drift, again = fed([1.0, 3.0, -2.0]), Drift()
    again.restore(json.loads(json.dumps(drift.to_json())))
    assert again.to_json() == drift.to_json()
    for each in (drift, again):
        each.add("a", np.array([2.0, 0.0]), np.array([2.5, 0.0]))
    assert (drift.pairs, again.pairs) == (3, 2)
    assert (drift.count, again.count) == (4, 4)
