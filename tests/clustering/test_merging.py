"""What a new mode absorbs, one after the other (§3.2.5, Figure 3.2), and families of constants."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from streams import BALL, V, mode_of

from relgym.clustering.columns import SlotSignature
from relgym.clustering.discovery import Scale
from relgym.clustering.em import Cluster
from relgym.clustering.examples import ExampleTable
from relgym.clustering.merging import Known, generalise
from relgym.clustering.mode import Mode, Role
from relgym.config import ClusteringConfig
from relgym.config.constants import FEWEST
from relgym.numeric.stepwise import LinearFit
from relgym.scene.objects import ObjectType
from relgym.scene.shapes import Box

BOXED = SlotSignature((BALL, ObjectType("box", ("friction",), Box())))
SCALE = Scale(1e-12, 4.0, 8.0)


def known_of(rows: np.ndarray, values: np.ndarray, labels: list[int], *modes: Mode) -> Known:
    """What is known of a ball beside a box, columns (v, w, friction); modes by number from 1."""
    table = ExampleTable()
    numbers = np.array([table.add(BOXED, row, b"", [-1, -1]) for row in rows], dtype=np.int64)
    clusters = {k: Cluster(replace(mode, id=k)) for k, mode in enumerate(modes, 1)}
    return Known(
        table,
        numbers,
        np.asarray(values, dtype=float),
        np.array(labels, dtype=np.int32),
        clusters,
        V,
        SCALE,
        ClusteringConfig(),
    )


def test_a_function_becomes_a_mode_with_roles() -> None:
    known = known_of(np.ones((1, 3)), np.ones(1), [0])
    made = known.cluster(LinearFit((0, 2), (1.0, -2.5), 0.5, 0.0), 0)
    assert made.mode.id == 0 and made.mode.sigma == SCALE.sigma
    assert made.mode.roles == (Role("ball", (("v", 1.0),)), Role("box", (("friction", -2.5),)))
    assert made.mode.intercept == 0.5
    assert known_of(np.ones((4, 3)), np.ones(4), [2, 1, 2, 0]).members(2).tolist() == [0, 2]


def test_a_general_mode_absorbs_all_that_it_covers(rng: np.random.Generator) -> None:
    """Three constants that persist; of the law of another kind it leaves the examples alone."""
    x = rng.normal(size=(80, 3))
    for k, constant in enumerate((3.0, 5.0, 7.0)):
        x[20 * k : 20 * k + 20, 0] = constant
    y = np.append(x[:60, 0], -0.9 * x[60:, 0])
    modes = [mode_of(constant=c) for c in (3.0, 5.0, 7.0)] + [mode_of(("v", -0.9))]
    known = known_of(x, y, [1] * 20 + [2] * 20 + [3] * 20 + [4] * 20, *modes)
    cluster, absorbed = generalise(known, Cluster(mode_of(("v", 1.0))), np.arange(60), rng=rng)
    assert cluster.mode.formula() == "v' = v"
    assert sorted(absorbed) == [1, 2, 3]


def test_what_two_constants_unify_to_absorbs_the_third(rng: np.random.Generator) -> None:
    x = rng.normal(size=(60, 3))
    for k, constant in enumerate((3.0, 5.0, 7.0)):
        x[20 * k : 20 * k + 20, 0] = constant
    known = known_of(
        x, x[:, 0].copy(), [1] * 20 + [2] * 20 + [0] * 20, mode_of(constant=3.0), mode_of(constant=5.0)
    )
    cluster, absorbed = generalise(known, Cluster(mode_of(constant=7.0)), np.arange(40, 60), rng=rng)
    assert cluster.mode.formula() == "v' = v"
    assert absorbed == (1, 2)


def test_a_mode_like_no_other_absorbs_none(rng: np.random.Generator) -> None:
    x = rng.normal(size=(40, 3))
    y = np.append(x[:20, 0], -0.9 * x[20:, 0])
    known = known_of(x, y, [1] * 20 + [0] * 20, mode_of(("v", 1.0)))
    new = Cluster(mode_of(("v", -0.9)))
    assert generalise(known, new, np.arange(20, 40), rng=rng) == (new, ())


@pytest.mark.parametrize(("others", "unified"), [(8, True), (FEWEST, True), (FEWEST - 1, False)])
def test_a_family_differs_in_its_constant_only(others: int, unified: bool, rng: np.random.Generator) -> None:
    """Friction is constant while an episode lasts: each teaches ``v' = v - c``, and many the law of c."""
    frictions = rng.uniform(0.1, 1.0, others + 1)
    x = rng.normal(size=(14 * len(frictions), 3))
    x[:, 2] = np.repeat(frictions, 14)
    modes = [mode_of(("v", 1.0), constant=float(-2.5 * c)) for c in frictions]
    known = known_of(
        x, x[:, 0] - 2.5 * x[:, 2], np.repeat(np.arange(1, others + 2), 14).tolist(), *modes[:-1]
    )
    new = np.arange(14 * others, len(x))
    known.labels[new] = 0
    cluster, absorbed = generalise(known, Cluster(modes[-1]), new, rng=rng)
    if unified:
        assert cluster.mode.formula(6) == "v' = v - 2.5 box.friction"
        assert sorted(absorbed) == list(range(1, others + 1))
    else:
        assert (cluster.mode.formula(6), absorbed) == (modes[-1].formula(6), ())


@pytest.mark.parametrize("missing", ["a constant", "plain terms"])
def test_only_plain_functions_with_a_constant_are_a_family(missing: str, rng: np.random.Generator) -> None:
    """Eight modes differ in their constant, which friction (or w) explains; the ninth one does not fit among them."""
    frictions = np.append(rng.uniform(0.1, 1.0, 8), 0.0)
    x = rng.normal(size=(126, 3))
    labels = np.repeat(np.arange(1, 10), 14)
    labels[-14:] = 0
    if missing == "a constant":
        x[:, 2] = np.repeat(frictions, 14)
        y, others = x[:, 0] - 2.5 * x[:, 2], []
    else:  # they take part in another object already
        x[:, 1] = np.repeat(frictions + 1.0, 14)
        y, others = x[:, 0] + x[:, 2] - 2.5 * x[:, 1], [Role("box", (("friction", 1.0),))]
        frictions = frictions + 1.0
    modes = [mode_of(("v", 1.0), others=others, constant=float(-2.5 * c)) for c in frictions]
    known = known_of(x, y, labels.tolist(), *modes[:-1])
    assert modes[-1].intercept == 0.0 or missing == "plain terms"
    assert generalise(known, Cluster(modes[-1]), np.arange(112, 126), rng=rng)[1] == ()
