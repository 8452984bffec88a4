"""Points of contact and the islands that they tie bodies into, by hand."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from relgym.laws.points import Points, across, lever

FIRST, SECOND = np.array([0, 1, 0, 1]), np.array([3, 3, 1, 2])
"""Pairs: 0 and the floor, 1 and the floor, 0 and 1, 1 and 2."""

MOVES = np.array([True, True, True, False])


def points_of(*where: tuple[int, int]) -> Points:
    """Points by scene and pair; their normals tell which they are."""
    scene, pair = (np.array([each[k] for each in where], dtype=np.intp) for k in (0, 1))
    number = np.arange(float(len(where)))
    return Points(scene, pair, np.stack([number, -number]), np.zeros((2, 2, len(where))))


def islands(points: Points) -> list[list[int]]:
    found = []
    for island in points.islands(FIRST, SECOND, MOVES):
        assert island.points.normal[0].tolist() == island.rows.tolist()
        found += island.rows.tolist()
    return sorted(found)


def test_turning_moves_points_across_the_arm() -> None:
    assert across(np.array([3.0, 4.0, 2.0]), np.array([1.0, 0.0])).tolist() == [3.0, 6.0]
    assert across(np.array([3.0, 4.0, 2.0]), np.array([0.0, 0.5])).tolist() == [2.0, 4.0]
    assert lever(np.array([1.0, 0.0]), np.array([0.0, 1.0])) == 1.0
    assert lever(np.array([0.0, 2.0]), np.array([3.0, 0.0])) == -6.0


def test_what_does_not_move_ties_nothing() -> None:
    # Both lie on the floor, 0 with two points.
    assert islands(points_of((0, 0), (0, 0), (0, 1))) == [[0, 1], [2]]


def test_bodies_that_touch_are_tied_also_through_others() -> None:
    # 0 on the floor leans on 1, and 1 on 2; in the next scene only 1 and 2 touch.
    assert islands(points_of((0, 0), (0, 2), (0, 3), (1, 0), (1, 3))) == [[0, 1, 2], [3], [4]]


def test_islands_of_equal_size_come_together() -> None:
    sizes = [
        island.rows.shape
        for island in points_of((0, 0), (1, 1), (2, 2), (2, 3)).islands(FIRST, SECOND, MOVES)
    ]
    assert sizes == [(2, 1), (1, 2)]
    assert list(points_of().islands(FIRST, SECOND, MOVES)) == []


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), max_size=12))
def test_every_point_is_in_one_island_and_islands_share_no_moving_body(where: list[tuple[int, int]]) -> None:
    ordered = sorted(where)
    found = islands(points_of(*ordered))
    assert sorted(row for rows in found for row in rows) == list(range(len(ordered)))
    bodies = []
    for rows in found:
        told = [ordered[row] for row in rows]
        moving = {
            (scene, int(side[pair])) for scene, pair in told for side in (FIRST, SECOND) if MOVES[side[pair]]
        }
        assert len({scene for scene, _ in told}) == 1
        bodies += sorted(moving)
    assert len(bodies) == len(set(bodies))
