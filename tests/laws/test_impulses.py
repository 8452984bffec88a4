"""Impulses at the points of an island, by hand: bouncing, friction, stacks, and what is left open."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relgym.laws.impulses import FEATURES, Rows, solve, table_of
from relgym.laws.records import ONE, ZERO, AxisLaw, Piece

LETTERS = ("n", "t")
KINDS = (("block", "floor"),)


def law(operator: str, *pieces: Piece) -> AxisLaw:
    return AxisLaw(pieces, operator, KINDS)  # type: ignore[arg-type]


REST = law("max", Piece((("u_n", 1.0),)), ZERO)
BOUNCE = law("max", Piece((("u_n", 1.0),)), Piece((("v_n", -0.5),)))
SMOOTH = law("max", Piece((("u_t", 1.0),)))
ROUGH = law("max", Piece((("u_t", 1.0), ("J_n", -0.2))), ZERO)
STICKY = law("max", ZERO)


def island(
    normal: AxisLaw, slip: AxisLaw, gain: list[list[float]], free: list[float], now: list[float] | None = None
) -> Rows:
    """An island all of whose points obey the same two laws."""
    points = len(free) // 2
    told = [table_of(normal, 0, LETTERS, 2)] * points + [table_of(slip, 1, LETTERS, 2)] * points
    tables, signs = (np.array([each[k] for each in told])[None] for k in (0, 1))
    numbers = [np.array(each, dtype=float)[None] for each in (gain, free, free if now is None else now)]
    return Rows(*numbers, tables, signs)


def after(rows: Rows) -> tuple[list[float], list[float], bool]:
    """Impulses, velocities after them, and whether all is settled."""
    found = solve(rows)
    velocity = rows.free + (rows.gain * found.impulse[:, None]).sum(axis=2)
    return found.impulse[0].tolist(), velocity[0].tolist(), bool(found.settled[0])


def test_laws_are_read_as_weights() -> None:
    assert FEATURES == ("u", "v", "u_other", "v_other", "J_n", ONE)
    table, sign = table_of(ROUGH, 1, LETTERS, 3)
    assert table.tolist() == [[1.0, 0.0, 0.0, 0.0, -0.2, 0.0], [0.0] * 6, [0.0] * 6]
    assert sign == 1.0
    pushed = law("min", Piece((("v_n", -0.9), ("u_t", 0.1), ("v_t", 0.3), (ONE, 2.0), (ONE, 0.5))))
    table, sign = table_of(pushed, 0, LETTERS, 2)
    assert table.tolist() == [[0.0, -0.9, 0.1, 0.3, 0.0, 2.5]] * 2
    assert sign == -1.0


def test_a_ball_bounces_and_one_that_leaves_is_let_go() -> None:
    unit = [[1.0, 0.0], [0.0, 1.0]]
    assert after(island(BOUNCE, SMOOTH, unit, [-1.0, 0.25])) == ([1.5, 0.0], [0.5, 0.25], True)
    assert after(island(BOUNCE, SMOOTH, unit, [1.0, 0.25])) == ([0.0, 0.0], [1.0, 0.25], True)
    # What it was before counts for the bounce, what it is without the contact for letting go.
    assert after(island(BOUNCE, SMOOTH, unit, [-1.1, 0.0], [-1.0, 0.0]))[1] == [0.5, 0.0]
    # A body of half the mass takes half the impulse to the same velocity.
    impulse, velocity, _ = after(island(BOUNCE, SMOOTH, [[2.0, 0.0], [0.0, 2.0]], [-1.0, 0.25]))
    assert (impulse, velocity) == ([0.75, 0.0], [0.5, 0.25])


def test_friction_goes_with_the_normal_impulse_and_against_slip() -> None:
    unit = [[1.0, 0.0], [0.0, 1.0]]
    # Stopped at rest from a fall of 1, the normal impulse is 1, and slip loses 0.2 of its size, to 0 at most.
    for slip, left in ((0.5, 0.3), (-0.5, -0.3), (0.15, 0.0), (-0.15, 0.0)):
        impulse, velocity, settled = after(island(REST, ROUGH, unit, [-1.0, slip]))
        assert settled
        assert velocity == pytest.approx([0.0, left], abs=1e-15)
        assert impulse == pytest.approx([1.0, left - slip], abs=1e-15)
    # Where slip is easier to change than the normal velocity, the same impulse changes it by more.
    _, velocity, _ = after(island(REST, ROUGH, [[1.0, 0.0], [0.0, 3.0]], [-1.0, 1.0]))
    assert velocity == pytest.approx([0.0, 1.0 - 3.0 * 0.2])


def test_a_stack_rests_on_the_sum_of_its_weights() -> None:
    # A on the floor, B of the same mass on A; both fall by 1 without contacts. Rows: v_A, v_B - v_A, and the slips.
    normal = np.array([[1.0, -1.0], [-1.0, 2.0]])
    gain = np.zeros((4, 4))
    gain[:2, :2] = gain[2:, 2:] = normal
    impulse, velocity, settled = after(island(REST, SMOOTH, gain.tolist(), [-1.0, 0.0, 0.0, 0.0]))
    assert settled
    assert impulse == pytest.approx([2.0, 1.0, 0.0, 0.0])
    assert velocity == pytest.approx([0.0] * 4, abs=1e-15)
    # If B is thrown up, A rests alone.
    impulse, velocity, _ = after(island(REST, SMOOTH, gain.tolist(), [-1.0, 3.0, 0.0, 0.0]))
    assert impulse == pytest.approx([1.0, 0.0, 0.0, 0.0])
    assert velocity == pytest.approx([0.0, 2.0, 0.0, 0.0])


def test_two_points_of_a_flat_face_share_the_weight() -> None:
    """Any two impulses of that sum would do; the smallest are taken, and as they move nothing, all is settled."""
    gain = np.zeros((4, 4))
    gain[:2, :2] = 1.0
    gain[2:, 2:] = 1.0
    impulse, velocity, settled = after(island(REST, SMOOTH, gain.tolist(), [-1.0, -1.0, 0.0, 0.0]))
    assert settled
    assert impulse == pytest.approx([0.5, 0.5, 0.0, 0.0])
    assert velocity == pytest.approx([0.0] * 4, abs=1e-15)


def test_of_laws_that_contradict_one_another_nothing_is_settled() -> None:
    # Both points are the same, and one is to go up at 1, the other at 2.
    rows = island(
        REST, SMOOTH, [[1.0, 1.0, 0, 0], [1.0, 1.0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], [-1.0, -1.0, 0, 0]
    )
    tables = rows.tables.copy()
    tables[0, 0, :, 5], tables[0, 1, :, 5] = 1.0, 2.0
    tables[0, :2, :, 0] = 0.0
    assert not solve(Rows(rows.gain, rows.free, rows.now, tables, rows.signs)).settled[0]


def test_of_two_points_that_cannot_both_stick_one_slips() -> None:
    """A brick bounces off both its lower corners, one of which lies deeper by 1e-4; as it turns both can't stick.

    Held by impulses against each other, which grow from sweep to sweep, one of them gives way where they reach the
    bound on friction.
    """
    bounce, gap = law("max", Piece((("u_n", 1.0),)), Piece((("v_n", -1.0),))), 1e-4
    # Unit mass and moment; arms to the points (-1, -1) and (1, -1 + gap). Rows: both normals, both slips.
    arms = np.array([[-1.0, -1.0], [1.0, -1.0 + gap]])
    jacobian = np.array([[0.0, 1.0, x] for x, _ in arms] + [[-1.0, 0.0, y] for _, y in arms])
    gain = jacobian @ jacobian.T
    free = jacobian @ np.array([0.1, -2.0, -0.1])
    rows = island(bounce, ROUGH, gain.tolist(), free.tolist(), free.tolist())
    impulse, velocity, settled = after(rows)
    assert settled
    assert velocity[:2] == pytest.approx((-free[:2]).tolist(), abs=1e-12)
    slips = [abs(v) > 1e-9 for v in velocity[2:]]
    assert slips.count(True) == 1
    slipping = slips.index(True)
    assert abs(impulse[2 + slipping]) == pytest.approx(0.2 * impulse[slipping], rel=1e-9)
    assert abs(impulse[3 - slipping]) <= 0.2 * impulse[1 - slipping] + 1e-12


@st.composite
def _islands(draw: st.DrawFn) -> Rows:
    """Bodies that lie about anyhow, on rough or smooth points."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    points, count = draw(st.integers(1, 3)), draw(st.integers(1, 5))
    slip = draw(st.sampled_from([SMOOTH, ROUGH, STICKY]))
    some = []
    for _ in range(count):
        jacobian = rng.normal(size=(2 * points, 3 * points + 2))
        gain = jacobian @ jacobian.T
        free = rng.normal(size=2 * points)
        some.append(island(REST, slip, gain.tolist(), free.tolist(), rng.normal(size=2 * points).tolist()))
    return Rows(*(np.concatenate([getattr(r, name) for r in some]) for name in Rows.__dataclass_fields__))


@settings(max_examples=60, deadline=None)
@given(_islands())
def test_what_is_settled_obeys_every_law(rows: Rows) -> None:
    """Nothing is pulled, nothing goes on into another body, and what pushes does not leave."""
    found = solve(rows)
    c = rows.free.shape[1] // 2
    velocity = rows.free + (rows.gain * found.impulse[:, None]).sum(axis=2)
    size = 1e-9 * (1.0 + np.abs(rows.free).max() + np.abs(found.impulse).max() * np.abs(rows.gain).max())
    if not rows.tables[:, c:, 0, 4].any() and rows.tables[:, c:, 0, 0].all():
        assert found.settled.all()  # without friction there always are such impulses
    push, leaving = found.impulse[found.settled, :c], velocity[found.settled, :c]
    assert (push >= -size).all() and (leaving >= -size).all()
    assert (np.minimum(push, leaving) <= size).all()


@settings(max_examples=30, deadline=None)
@given(_islands())
def test_an_islands_impulses_do_not_depend_on_the_others(rows: Rows) -> None:
    whole = solve(rows)
    for k in range(len(rows.free)):
        alone = solve(rows.of(np.array([k])))
        assert alone.impulse.tobytes() == whole.impulse[k : k + 1].tobytes()
        assert alone.settled[0] == whole.settled[k]
