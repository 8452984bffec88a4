"""Numbers that stand for situations: the set of what is there, whoever comes first and however many there are."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from relgym.logic.situations import situation


def told(table: np.ndarray, unary: np.ndarray, target: int, exists: np.ndarray | None = None) -> int:
    """The number of one world: relations ``(r, K, K)`` and ``(u, K)``."""
    there = np.ones(table.shape[1], dtype=bool) if exists is None else exists
    return int(situation(table[None], unary[None], np.array([target]), there[None])[0])


@st.composite
def worlds(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, int]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    k = draw(st.integers(1, 5))
    return rng.random((2, k, k)) < 0.4, rng.random((2, k)) < 0.5, int(rng.integers(k))


def box_on_floor(*, stacked: bool = False) -> tuple[np.ndarray, np.ndarray, int]:
    """A ball (0) on the floor (1), beside two boxes (2, 3) on the floor or one on the other."""
    on = np.zeros((1, 4, 4), dtype=bool)
    on[0, 0, 1] = on[0, 2, 1] = True
    on[0, 3, 2 if stacked else 1] = True
    kinds = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]], dtype=bool)
    return on, kinds, 0


@settings(max_examples=60)
@given(worlds(), st.randoms(use_true_random=False))
def test_the_order_of_objects_says_nothing(world: tuple[np.ndarray, np.ndarray, int], random: object) -> None:
    table, unary, target = world
    order = list(range(table.shape[1]))
    random.shuffle(order)  # type: ignore[attr-defined]
    moved = table[:, order][:, :, order], unary[:, order], order.index(target)
    assert told(*moved) == told(table, unary, target)


@settings(max_examples=60)
@given(worlds())
def test_what_does_not_exist_says_nothing(world: tuple[np.ndarray, np.ndarray, int]) -> None:
    table, unary, target = world
    more = np.pad(table, ((0, 0), (0, 2), (0, 2)), constant_values=False)
    wider = np.pad(unary, ((0, 0), (0, 2)), constant_values=True)
    exists = np.arange(table.shape[1] + 2) < table.shape[1]
    assert told(more, wider, target, exists) == told(table, unary, target)


def test_ten_more_of_the_same_are_no_other_situation_and_a_stack_is() -> None:
    on, kinds, ball = box_on_floor()
    many = np.pad(on, ((0, 0), (0, 10), (0, 10)))
    many[0, 4:, 1] = True  # all on the floor
    boxes = np.pad(kinds, ((0, 0), (0, 10)))
    boxes[2, 4:] = True
    assert told(many, boxes, ball) == told(on, kinds, ball)
    assert told(*box_on_floor(stacked=True)) != told(on, kinds, ball)


def test_who_is_the_target_and_each_relation_count() -> None:
    on, kinds, ball = box_on_floor()
    known = told(on, kinds, ball)
    assert told(on, kinds, 2) != known
    assert told(on, kinds, 3) == told(on, kinds, 2)  # boxes alike
    assert told(on.swapaxes(1, 2), kinds, ball) != known
    assert told(on, kinds[[1, 0, 2]], ball) != known
    off = on.copy()
    off[0, 0, 1] = False
    assert told(off, kinds, ball) != known


@settings(max_examples=40)
@given(st.lists(worlds(), min_size=2, max_size=6))
def test_worlds_together_have_the_numbers_that_they_have_alone(
    some: list[tuple[np.ndarray, np.ndarray, int]],
) -> None:
    k = max(table.shape[1] for table, *_ in some)
    wide = [
        (
            np.pad(t, ((0, 0), (0, k - t.shape[1]), (0, k - t.shape[1]))),
            np.pad(u, ((0, 0), (0, k - t.shape[1]))),
        )
        for t, u, _ in some
    ]
    exists = np.array([np.arange(k) < t.shape[1] for t, *_ in some])
    targets = np.array([target for *_, target in some])
    together = situation(np.stack([t for t, _ in wide]), np.stack([u for _, u in wide]), targets, exists)
    assert together.tolist() == [told(*world) for world in some]
