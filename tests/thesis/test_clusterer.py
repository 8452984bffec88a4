"""Figure 3.2 by hand: new modes, unification (§3.2.5), expectation maximisation (§3.2.4)."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.clustering.mode import NOISE, Role
from relgym.scene.objects import ACTION, ObjectType
from relgym.scene.schema import SceneSchema
from relgym.thesis.clusterer import Clusterer, _occam
from relgym.thesis.modes import Cluster
from relgym.thesis.settings import ThesisSettings

SCHEMA = SceneSchema(
    (ObjectType("cart", ("x", "v")), ObjectType(ACTION, ("push",))), (("cart", "cart"), (ACTION, ACTION))
)
LAYOUT = SCHEMA.layout()
OWN = LAYOUT.index("cart")


def teach(clusterer: Clusterer, rows: np.ndarray, y: np.ndarray) -> list[int]:
    """The mode of each example as it came."""
    found = []
    for row, value in zip(rows, y.tolist(), strict=True):
        found.append(clusterer.learn_one(LAYOUT, OWN, row, value).mode)
    return found


def told(clusterer: Clusterer) -> list[tuple[tuple[Role, ...], float, int]]:
    return [(c.roles, c.intercept, len(clusterer.members(c.number))) for c in clusterer.clusters]


def rows(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-5.0, 5.0, (n, 3))


def test_a_mode_is_found_with_the_fortieth_example() -> None:
    clusterer, x = Clusterer(ThesisSettings.thesis()), rows(45)
    modes = teach(clusterer, x, 0.5 * x[:, 1])
    assert modes == [NOISE] * 39 + [1] * 6
    ((roles, intercept, members),) = told(clusterer)
    assert [role.type for role in roles] == ["cart"] and intercept == 0.0 and members == 45
    ((name, weight),) = roles[0].terms
    assert name == "v" and weight == pytest.approx(0.5, rel=1e-12)
    assert clusterer.noise == 0


def test_reports_name_what_is_new() -> None:
    clusterer, x = Clusterer(ThesisSettings.thesis()), rows(41)
    reports = [clusterer.learn_one(LAYOUT, OWN, row, 3.0 * row[0]) for row in x]
    assert [r.created for r in reports] == [()] * 39 + [(1,), ()]
    assert reports[-1].fits == (1,) and reports[0].fits == ()


def test_two_behaviours_are_two_modes() -> None:
    clusterer, x = Clusterer(ThesisSettings.thesis()), rows(120)
    left = x[:, 0] < 0.0
    teach(clusterer, x, np.where(left, 0.5 * x[:, 1], x[:, 1] + x[:, 2]))
    assert len(clusterer.clusters) == 2 and clusterer.noise == 0
    by_side = [set(clusterer.labels[side].tolist()) for side in (left, ~left)]
    assert all(len(side) == 1 for side in by_side) and by_side[0] != by_side[1]


def test_a_constant_is_united_with_the_law_that_covers_it() -> None:
    """v' = v / 2 of one speed is a constant, 0.5; once other speeds are known it is what the law says there."""
    clusterer, x = Clusterer(ThesisSettings.thesis()), rows(100)
    x[:50, 1] = 1.0
    teach(clusterer, x[:50], 0.5 * x[:50, 1])
    assert told(clusterer) == [((Role("cart", ()),), 0.5, 50)]
    teach(clusterer, x[50:], 0.5 * x[50:, 1])
    ((roles, intercept, members),) = told(clusterer)
    ((name, weight),) = roles[0].terms
    assert (name, members, intercept) == ("v", 100, 0.0) and weight == pytest.approx(0.5, rel=1e-12)
    assert clusterer.clusters[0].number > 1  # the united mode is a new one


def test_a_united_mode_stands_where_the_older_one_stood() -> None:
    """v' = v of one speed, then v' = -v, then v' = v of others: what stands still is told by the older of the two."""
    clusterer, x = Clusterer(ThesisSettings.thesis()), rows(150)
    x[:50, 1], x[50:, 1] = 1.0, np.where(np.arange(100) < 50, x[50:, 1] + 7.0, x[50:, 1])
    teach(clusterer, x[:50], x[:50, 1])
    teach(clusterer, x[50:100], -x[50:100, 1])
    teach(clusterer, x[100:], x[100:, 1])
    assert [role.terms[0][1] for roles, _, _ in told(clusterer) for role in roles] == pytest.approx(
        [1.0, -1.0]
    )
    united, other = clusterer.clusters
    assert united.number > other.number
    still = np.zeros(3)
    assert teach(clusterer, still[None], np.zeros(1)) == [united.number]


def test_two_speeds_at_a_time_make_no_law() -> None:
    """Any two are too few values for a weight and a constant (`varied`), and a new mode meets one old one at a time."""
    clusterer = Clusterer(ThesisSettings.thesis())
    counts = []
    for speed in (1.0, 2.0, 3.0):
        x = rows(50, seed=int(speed))
        x[:, 1] = speed
        teach(clusterer, x, 0.5 * x[:, 1])
        counts.append(len(clusterer.clusters))
    assert counts == [1, 2, 3]
    assert [(intercept, n) for _, intercept, n in told(clusterer)] == [(0.5, 50), (1.0, 50), (1.5, 50)]


@pytest.mark.parametrize(
    ("general", "old", "new", "better"),
    [
        (1, 1, 1, True),
        (2, 1, 1, False),  # more than either
        (1, 1, 0, False),  # not fewer than both together: v' = 0 stays beside -0.9 v
        (2, 2, 1, True),
        (0, 0, 0, False),
    ],
)
def test_one_function_must_be_simpler_than_two(general: int, old: int, new: int, better: bool) -> None:
    def mode(count: int) -> Cluster:
        return Cluster(1, (Role("cart", tuple((f"p{k}", 2.0) for k in range(count))),), 0.0)

    assert _occam(mode(general), mode(old), mode(new)) is better


def test_the_programs_first_step_is_a_constant() -> None:
    """40 equal values make a mode without a search, whatever else there is."""
    x = rows(60)
    y = np.random.default_rng(9).uniform(1.0, 2.0, 60)
    y[:40] = 0.25
    clusterer = Clusterer(ThesisSettings.original())
    modes = teach(clusterer, x, y)
    assert modes[38:40] == [NOISE, 1]
    assert told(clusterer)[0] == ((Role("cart", ()),), 0.25, 40)
    assert clusterer.noise == 20


def test_em_gives_an_example_to_the_closer_mode() -> None:
    """Both modes, 0.15 and -0.05, fit either within the tolerance of 2 sigma = 0.2."""
    clusterer = Clusterer(ThesisSettings.thesis(noise_variance=0.01))
    teach(clusterer, rows(2), np.array([0.0, 0.1]))
    for number, intercept in ((1, 0.15), (2, -0.05)):
        clusterer._add(Cluster(number, (Role("cart", ()),), intercept))
    clusterer._converge()
    assert clusterer.labels.tolist() == [2, 1] and clusterer.noise == 0


@pytest.mark.parametrize(("further", "mode"), [(1e-16, 1), (1e-9, 2)])
def test_of_equally_likely_modes_the_oldest_has_an_example(further: float, mode: int) -> None:
    """The younger one is nearer by rounding (equal likelihoods to double precision), or by a thirtieth of σ."""
    clusterer = Clusterer(ThesisSettings.thesis())
    clusterer._add(Cluster(1, (Role("cart", ()),), 0.5 + further))
    clusterer._add(Cluster(2, (Role("cart", ()),), 0.5))
    assert teach(clusterer, rows(1), np.array([0.5])) == [mode]
    clusterer._converge()
    assert clusterer.labels.tolist() == [mode]


def test_a_mode_that_lost_its_examples_goes() -> None:
    clusterer = Clusterer(ThesisSettings.thesis(noise_variance=0.01))
    teach(clusterer, rows(1), np.array([0.0]))
    clusterer._add(Cluster(1, (Role("cart", ()),), 5.0))
    clusterer._converge()
    assert clusterer.clusters == [] and clusterer.labels.tolist() == [NOISE] and clusterer.noise == 1
