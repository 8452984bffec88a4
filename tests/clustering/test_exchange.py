"""Functions of what other objects have, whoever of them it is in each scene."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relgym.clustering.columns import SlotSignature
from relgym.clustering.discovery import Scale, find_mode, least_examples, verifying_combinations
from relgym.clustering.exchange import orders_of, readings
from relgym.config import ClusteringConfig
from relgym.numeric.stepwise import LinearFit
from relgym.scene.objects import ObjectType, Target
from relgym.scene.shapes import Box

TRUCK = ObjectType("truck", ("px", "vx"), Box())
BOX = ObjectType("box", ("px", "friction"), Box())
ACTION = ObjectType("action", ("force",))
SCALE, CONFIG = Scale(1e-14, 4.0, 6.0), ClusteringConfig()


def stacked(boxes: int) -> SlotSignature:
    return SlotSignature((TRUCK, ACTION, *(BOX,) * boxes))


def pushed(
    weights: tuple[float, ...], scenes: int, rng: np.random.Generator, rows: int = 6
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Speed, force and the frictions of as many boxes as there are weights; which box has which weight differs."""
    x, y = [], []
    for _ in range(scenes):
        order, friction = rng.permutation(len(weights)), rng.uniform(0.05, 0.5, len(weights))
        for _ in range(rows):
            v, force = rng.uniform(0.0, 10.0), rng.uniform(0.0, 250.0)
            x.append([v, force, *friction])
            y.append(v + 0.025 * force - sum(w * friction[k] for w, k in zip(weights, order, strict=True)))
    signature = stacked(len(weights))
    orders = orders_of(signature, signature.preference(Target("truck", "vx"))[0], CONFIG.draws)
    assert orders is not None
    return np.array(x), np.array(y), orders[:, : 2 + len(weights)]


def searched(
    x: np.ndarray, y: np.ndarray, orders: np.ndarray | None, rng: np.random.Generator
) -> LinearFit | None:
    """What is found among speed and force, then among these and the frictions."""
    stages, strata = (2, x.shape[1]), np.zeros(len(y), dtype=int)
    found = find_mode(
        x, y, strata, stages=stages, fresh=6, scale=SCALE, config=CONFIG, rng=rng, orders=orders
    )
    return None if found is None else found.fit


# ---------------------------------------------------------------------- orders
def test_all_orders_of_three_boxes_the_present_one_first() -> None:
    signature = stacked(3)
    columns, stages = signature.preference(Target("truck", "vx"))
    orders = orders_of(signature, columns, CONFIG.draws)
    assert orders is not None
    assert len(orders) == math.factorial(3)
    assert orders[0].tolist() == list(range(len(columns)))
    assert [signature.named(int(c)) for c in columns[: stages[1]]] == [
        "vx",
        "action.force",
        *["box.friction"] * 3,
    ]
    assert {tuple(order[2:5]) for order in orders.tolist()} == {
        (2, 3, 4), (2, 4, 3), (3, 2, 4), (3, 4, 2), (4, 2, 3), (4, 3, 2),
    }  # fmt: skip
    for order in orders:  # places go with frictions
        assert [signature.at(int(columns[k])).property for k in order] == [
            signature.at(int(c)).property for c in columns
        ]


def test_of_one_box_there_is_no_other_order_and_of_many_there_are_too_many() -> None:
    # Of 1,536 samples 39 have the right two of 39 orders: of five boxes, which have 120, they move up.
    for boxes, orders in ((1, None), (4, 24), (5, 5), (39, 39), (40, None)):
        signature = stacked(boxes)
        found = orders_of(signature, signature.preference(Target("truck", "vx"))[0], CONFIG.draws)
        assert (None if found is None else len(found)) == orders


# ---------------------------------------------------------------------- readings
def test_a_sum_is_written_out_for_each_object() -> None:
    x, _, orders = pushed((1.0, 2.0, 3.0), 2, np.random.default_rng(0))
    alike, apart = readings(x, orders)
    assert alike.parts == ((0,), (1,), (2, 3, 4))
    np.testing.assert_array_equal(alike.x[:, 2], x[:, 2] + x[:, 3] + x[:, 4])
    fit = alike.written_out(LinearFit((0, 2), (1.0, -2.5), 0.5, 0.0))
    assert (fit.columns, fit.weights, fit.intercept) == ((0, 2, 3, 4), (1.0, -2.5, -2.5, -2.5), 0.5)
    assert apart.written_out(fit) == fit


def test_objects_stand_in_the_order_that_suits_the_first_of_equal_ones() -> None:
    x, y, orders = pushed((5.0, 2.5, 0.0), 8, np.random.default_rng(1))
    _, apart = readings(x, orders)
    law = LinearFit((0, 1, 2, 3), (1.0, 0.025, -5.0, -2.5), 0.0, 0.0)
    read = apart.best(law, y, 1e-14)
    np.testing.assert_allclose(law.predict(read), y, atol=1e-12)
    same = apart.best(LinearFit((0,), (1.0,), 0.0, 0.0), y, 1e-14)
    np.testing.assert_array_equal(same, x)  # who has no say stays where he is


# ---------------------------------------------------------------------- what is found
@pytest.mark.parametrize("seed", range(4))
def test_two_boxes_that_change_places_are_told_from_a_few_scenes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y, orders = pushed((5.0, 2.5, 0.0), 5, rng)
    assert searched(x, y, None, np.random.default_rng(seed)) is None  # no order comes about often enough
    fit = searched(x, y, orders, np.random.default_rng(seed))
    assert fit is not None
    assert sorted(fit.weights) == pytest.approx([-5.0, -2.5, 0.025, 1.0], abs=1e-9)
    assert abs(fit.intercept) < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_boxes_that_count_alike_are_one_sum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y, orders = pushed((2.5, 2.5, 2.5), 3, rng)
    fit = searched(x, y, orders, np.random.default_rng(seed))
    assert fit is not None
    assert fit.columns == (0, 1, 2, 3, 4)
    assert fit.weights == pytest.approx((1.0, 0.025, -2.5, -2.5, -2.5), abs=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(2, 8))
@settings(max_examples=25, deadline=None)
def test_constants_of_scenes_are_no_law(seed: int, scenes: int) -> None:
    """What differs from scene to scene without a reason isn't explained by whoever stands there."""
    rng = np.random.default_rng(seed)
    x, y, orders = pushed((5.0, 2.5, 0.0), scenes, rng)
    y += np.repeat(rng.uniform(1.0, 2.0, scenes), 6)
    fit = searched(x, y, orders, rng)
    assert fit is None or not any(c >= 2 for c in fit.columns)


# ---------------------------------------------------------------------- how many are enough
def test_what_is_chosen_and_read_in_many_ways_needs_more_evidence() -> None:
    # 1e12 sizes of response: 40 bits each. Two of five columns, two of four combinations: log2(10 * 16) bits.
    assert verifying_combinations(2, 4, 5, 1e12) == 1
    assert verifying_combinations(2, 4, 5, 2.0**7.4) == 1
    assert verifying_combinations(2, 4, 5, 2.0**7.3) == 2
    assert verifying_combinations(2, 4, 5, 2.0) == 8
    y = np.linspace(0.0, 1.0, 100)
    noisy = Scale(2.0**-22, 4.0, 6.0)  # 20 bits each
    assert least_examples(y, noisy, CONFIG) == 20
    assert least_examples(y, noisy, CONFIG, choices=16) == 30
    assert least_examples(y, SCALE, CONFIG, choices=24) == 10
