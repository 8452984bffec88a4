"""Which mode each example belongs to (§3.2.4), and what becomes of examples when modes come and go."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from streams import ALONE, V, mode_of

from relgym.clustering.discovery import Scale
from relgym.clustering.em import Cluster
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE
from relgym.clustering.population import ClusterReport, Population
from relgym.config import ClusteringConfig
from relgym.config.constants import MOST_ROWS

PERSIST, DOUBLE, STILL = mode_of(("v", 1.0)), mode_of(("v", 2.0)), mode_of()
MIRROR = mode_of(("v", -1.0), ("w", 1.0))


def made(
    rows: list[tuple[float, float]],
    values: list[float],
    *modes: object,
    labels: list[int] | None = None,
    states: list[bytes] | None = None,
    sigma: float = 0.01,
) -> tuple[Population, ExampleTable]:
    """Examples with columns (v, w), and modes by number from 1; four examples found one."""
    table, population = ExampleTable(), Population(V, ClusteringConfig(min_examples=4))
    population.scale = Scale(sigma, 4.0, 8.0)
    for k, (row, y) in enumerate(zip(rows, values, strict=True)):
        state = b"" if states is None else states[k]
        population.log.append(table.add(ALONE, np.array(row), state, [-1]), y)
    for mode in modes:
        number = population.next_id
        population.clusters[number] = Cluster(replace(mode, id=number))  # type: ignore[type-var]
        population.next_id += 1
    population.labels[:] = NOISE if labels is None else labels
    return population, table


# ---------------------------------------------------------------------- who explains what
def test_errors_and_fits_by_hand() -> None:
    # The tolerance is 4 σ = 0.04.
    population, table = made([(1.0, 0.0), (0.01, 0.0), (3.0, 0.0)], [1.04, 0.02, 7.0], PERSIST, DOUBLE, STILL)
    errors = [population.errors_of(table, k) for k in range(3)]
    assert errors[0] == pytest.approx({1: 0.04, 2: 0.96, 3: 1.04})
    assert errors[1] == pytest.approx({1: 0.01, 2: 0.0, 3: 0.02})
    ids, found = population.fits(table, np.array([2, 1]))
    assert ids == (1, 2, 3)
    assert found.tolist() == [[False, False, False], [True, True, True]]
    assert population.least_errors(table, np.arange(3)) == pytest.approx([0.04, 0.0, 1.0])
    assert population.least_errors(table, np.array([2]), [population.clusters[1]]).tolist() == [4.0]
    assert population.explained(table, population.clusters[1], np.array([2, 1])).tolist() == [1]


def test_misfit_counts_squares_up_to_the_tail() -> None:
    # The tail is 8 σ = 0.08: half of it is a quarter, and whatever is beyond it, one.
    population, table = made([(1.0, 0.0), (1.0, 0.0), (1.0, 0.0)], [1.0, 1.04, 99.0], PERSIST)
    assert population.misfit(table, population.clusters.values()) == pytest.approx(1.25)
    assert population.misfit(table, []) == 3.0


def test_what_modes_leave_is_a_root_mean_square_of_their_own_examples() -> None:
    population, table = made(
        [(1.0, 0.0)] * 4, [1.03, 0.96, 2.0, 5.0], PERSIST, DOUBLE, labels=[1, 1, 2, NOISE]
    )
    assert population.residual_spread(table) == pytest.approx(math.sqrt((0.03**2 + 0.04**2) / 3))
    empty, table = made([(1.0, 0.0)], [1.0])
    assert empty.residual_spread(table) == 0.0


def test_the_simplest_that_explains_an_example_has_it() -> None:
    population, table = made([(0.0, 0.0), (1.0, 2.0)], [0.0, 1.0], PERSIST, MIRROR, STILL)
    assert population.choose(table, 0, population.errors_of(table, 0)) == 3
    assert population.choose(table, 1, population.errors_of(table, 1)) == 1
    assert population.choose(table, 1, {1: 0.041, 2: 0.05, 3: 1.0}) == NOISE


# ---------------------------------------------------------------------- where noise is large
def test_evidence_against_a_mode_by_hand() -> None:
    # Sizes are 30 and 10, of 40; PERSIST has one parameter, MIRROR two.
    population, _ = made([], [], PERSIST, MIRROR)
    population.clusters[1].fitted, population.clusters[1].unfitted = 20, 10
    population.clusters[2].fitted = 10
    cost = population._cost(
        np.array([1, 2]), np.array([[0.0, 0.01], [0.04, 0.041]]), np.array([[3.0, 0.0], [0.0, 1.0]])
    )
    assert cost[0] == pytest.approx([-math.log(3.75) + 1.0, 0.5 - math.log(0.25) + 2.0])
    assert cost[1, 0] == pytest.approx(8.0 - math.log(0.75) + 1.0)
    assert cost[1, 1] == math.inf  # beyond the tolerance


def test_where_noise_is_large_the_state_tells_too() -> None:
    # v' = v is off by 2.5 σ, v' = 2 v by none. In state a 20 were v' = v: 3.125 - ln 20.5 < -ln 0.5; none in b.
    rows, values = [(0.025, 0.0)] * 22, [0.025] * 20 + [0.05] * 2
    states = [b"a"] * 21 + [b"b"]
    population, table = made(rows, values, PERSIST, DOUBLE, labels=[1] * 20 + [NOISE] * 2, states=states)
    errors = {1: 0.025, 2: 0.0}
    assert [population.choose(table, k, errors) for k in (20, 21)] == [2, 2]
    population.chancy = True
    assert [population.choose(table, k, errors) for k in (20, 21)] == [1, 2]
    assert population.choose(table, 20, {1: 0.05, 2: 0.0}) == 2  # the only one that explains it
    # Older examples than so many are not asked.
    population.log._size = 20
    for _ in range(MOST_ROWS):
        population.log.append(21, 0.05)
    population.labels[:20] = 1
    last = population.log.append(20, 0.05)
    assert population.choose(table, last, errors) == 2


def test_all_are_assigned_anew_state_by_state() -> None:
    """Of five in state a that both explain, four others say v' = v; in b three others say v' = 2 v."""
    rows = [(0.02, 0.0)] * 5 + [(0.04, 0.0)] * 4 + [(1.0, 0.0)]
    values = [0.02] * 4 + [0.04] + [0.08] * 3 + [0.06] + [50.0]
    labels = [1, 1, 1, 1, 2, 2, 2, 2, 1, 1]
    population, table = made(rows, values, PERSIST, DOUBLE, labels=labels, states=[b"a"] * 5 + [b"b"] * 5)
    population.reassign_all(table)
    # The fifth: 2 - ln(4 + 1/2) + 1 for v' = v, -ln(1/2) + 1 for the other. The ninth, off by 2 σ from both, follows
    # its state; the last one is explained by none.
    assert population.labels.tolist() == [1] * 5 + [2] * 4 + [NOISE]
    assert (population.clusters[1].fitted, population.clusters[2].fitted) == (5, 4)
    none, table = made([(1.0, 0.0)], [1.0])
    none.reassign_all(table)
    assert none.labels.tolist() == [NOISE]


# ---------------------------------------------------------------------- modes come and go
def test_a_new_mode_takes_the_noise_and_what_less_simple_ones_had() -> None:
    # Both explain (1, 2) → 1; v' = v is simpler than v' = -v + w, and takes it, but not what it doesn't explain.
    rows = [(1.0, 2.0)] * 3 + [(1.0, 3.0)] * 3 + [(2.0, 0.0)] * 2
    values = [1.0] * 3 + [2.0] * 3 + [2.0] * 2
    population, table = made(rows, values, MIRROR, labels=[1] * 6 + [NOISE] * 2)
    assert population.install(table, Cluster(PERSIST), ()) == 2
    assert population.labels.tolist() == [2] * 3 + [1] * 3 + [2] * 2
    assert population.clusters[2].mode.id == 2 and population.clusters[2].fitted == 5
    assert population.next_id == 3
    # The other way round it gets the noise only.
    population, table = made(rows, values, PERSIST, labels=[1] * 3 + [NOISE] * 3 + [1] * 2)
    population.install(table, Cluster(MIRROR), ())
    assert population.labels.tolist() == [1] * 3 + [2] * 3 + [1] * 2


def test_a_mode_takes_over_those_that_it_absorbs_forgotten_ones_included() -> None:
    three, five = mode_of(constant=3.0), mode_of(constant=5.0)
    rows = [(3.0, 0.0)] * 4 + [(5.0, 0.0)] * 4 + [(7.0, 0.0)]
    population, table = made(
        rows, [3.0] * 4 + [5.0] * 4 + [7.0], three, five, labels=[1] * 4 + [2] * 4 + [NOISE]
    )
    population.log.forgotten.update({1: 10, 2: 20, NOISE: 1})
    assert population.install(table, Cluster(PERSIST), (1, 2)) == 3
    assert population.labels.tolist() == [3] * 9
    assert population.log.forgotten == {3: 30, NOISE: 1}
    assert [(mode.id, mode.examples) for mode in population.modes] == [(3, 39)]
    assert population.noise_examples == 1


def test_a_mode_that_absorbs_one_with_its_own_function_is_known_as_that_one() -> None:
    rows = [(3.0, 0.0)] * 4 + [(0.0, 0.0)] * 4
    population, table = made(rows, [3.0] * 4 + [0.0] * 4, PERSIST, STILL, labels=[1] * 4 + [2] * 4)
    population.log.forgotten.update({1: 10})
    assert population.install(table, Cluster(PERSIST), (1, 2)) == 1
    assert population.labels.tolist() == [1] * 8
    assert population.log.forgotten[1] == 10
    assert (population.next_id, population.installed) == (3, 1)


def test_a_mode_that_is_removed_leaves_its_examples_to_the_noise() -> None:
    population, _ = made([(1.0, 0.0)] * 3, [1.0, 1.0, 2.0], PERSIST, DOUBLE, labels=[1, 1, 2])
    population.log.forgotten.update({1: 5, 2: 7})
    population.remove(1)
    assert population.labels.tolist() == [NOISE, NOISE, 2]
    assert population.log.forgotten == {NOISE: 5, 2: 7}
    assert population.noise_examples == 7


def test_modes_of_less_than_half_as_many_as_found_one_are_deleted() -> None:
    # Four found a mode, so one with a single example goes. It is v' = 2 v at rest, which v' = v explains as well.
    rows = [(1.0, 0.0)] * 4 + [(0.0, 0.0)]
    population, table = made(rows, [1.0] * 4 + [0.0], PERSIST, DOUBLE, labels=[1] * 4 + [2])
    population.prune(table)
    assert sorted(population.clusters) == [1]
    assert population.labels.tolist() == [1] * 5
    # One with two examples stays, and so does the last one, however few it has.
    rows = [(1.0, 0.0)] * 4
    population, table = made(rows, [1.0, 1.0, 2.0, 2.0], PERSIST, DOUBLE, labels=[1, 1, 2, 2])
    population.prune(table)
    assert sorted(population.clusters) == [1, 2]
    population, table = made(rows, [1.0, 9.0, 9.0, 9.0], PERSIST, labels=[1] + [NOISE] * 3)
    population.prune(table)
    assert sorted(population.clusters) == [1]


def test_starting_over_forgets_no_example() -> None:
    population, _ = made([(1.0, 0.0)] * 2, [1.0, 2.0], PERSIST, labels=[1, NOISE])
    population.log.forgotten.update({1: 3, NOISE: 4})
    population.chancy = True
    population.start_over()
    assert (population.clusters, population.chancy) == ({}, False)
    assert population.labels.tolist() == [NOISE, NOISE]
    assert population.log.forgotten == {NOISE: 7}
    assert population.noise_examples == 9
    assert population.next_id == 2  # ids are never used again


def test_a_model_without_its_examples_knows_how_many_there_were() -> None:
    population = Population(V, ClusteringConfig())
    population.clusters = {2: Cluster(replace(DOUBLE, examples=9)), 1: Cluster(replace(PERSIST, examples=8))}
    population.known_noise = 5
    assert [mode.examples for mode in population.modes] == [8, 9]
    assert population.noise_examples == 5


def test_what_changes_the_set_of_modes() -> None:
    assert not ClusterReport(1, (1, 2)).changed
    assert ClusterReport(1, (1,), created=(3,)).changed
    assert ClusterReport(1, (1,), removed=(3,)).changed
    assert ClusterReport(1, (1,), reassigned=True).changed


def test_what_nobody_explains_stands_for_others_too() -> None:
    population, _ = made(
        [(1.0, 0.0)] * 8, [2.0] * 8, DOUBLE, labels=[1, 1, NOISE, NOISE, NOISE, NOISE, NOISE, NOISE]
    )
    population.log.passed[NOISE] = 40
    assert population.noise_examples == 6  # those there are
    assert population.unexplained == 36
    assert [mode.examples for mode in population.modes] == [12]
    population.log.passed[1] = 4  # of which it is known what they follow
    assert population.unexplained == 36
    assert [mode.examples for mode in population.modes] == [16]
