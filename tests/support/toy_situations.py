"""Made-up situations for the classification tests: a ball among surfaces, a truck before stacks of boxes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import Example, Vocabulary

BALL_VOCABULARY = Vocabulary(
    relations=("intersect", "x-greater-than", "x-less-than", "y-greater-than", "y-less-than"),
    unary=("ball", "box", "floor", "ramp", "wall"),
    pair=("approach", "distance", "normal-x", "normal-y"),
    own=("vx", "vy"),
    contact=frozenset({"approach", "distance", "normal-x", "normal-y"}),
)
FLY, BOUNCE, RAMP, FRICTION_LEFT, FRICTION_RIGHT, HALT = range(6)
"""Modes of the ball's horizontal velocity."""

_DECELERATION = 0.01
_SLOPE = (0.5, np.sqrt(0.75))
_TYPES = np.array([0, 1, 2, 3, 4, 4])  # ball, box, floor, ramp, two walls
# Lower and upper corners of box, floor, ramp, left and right wall.
_LOWER = np.array([[8.0, 0.0], [0.0, -1.0], [12.0, 0.0], [-1.0, 0.0], [20.0, 0.0]])
_UPPER = np.array([[10.0, 2.0], [20.0, 0.0], [15.0, 2.0], [0.0, 12.0], [21.0, 12.0]])
_RADIUS = 0.5


@dataclass(frozen=True)
class Labelled:
    """An example with the truth about it."""

    example: Example
    mode: int
    fits: NDArray[np.bool_]
    values: NDArray[np.float64]
    roles: tuple[int, ...] = ()


def ball_modes(vx: float, vy: float) -> NDArray[np.float64]:
    """What the six modes predict."""
    bounce, ramp = -0.9 * vx, 0.525 * vx - 0.8227 * vy + 4.2435e-4
    return np.array([vx, bounce, ramp, vx - _DECELERATION, vx + _DECELERATION, 0.0])


def ball_stream(
    n: int, *, rng: np.random.Generator, ramp_share: float = 20 / 16000, halt_share: float = 0.005
) -> Iterator[Labelled]:
    """A ball that flies, slides with friction, bounces off sides and the ramp, and leaves them again.

    The mode depends on which surface it touches, whether it approaches it, and its velocity's sign and size.
    """
    shares = np.array([0.5, 0.3, 0.08, 0.06, 0.05, ramp_share, halt_share])
    for row in range(n):
        place = int(rng.choice(7, p=shares / shares.sum()))
        yield _ball(place, row, rng)


def _ball(place: int, row: int, rng: np.random.Generator) -> Labelled:
    x, y = rng.uniform(1.0, 19.0), rng.uniform(2.6, 11.0)
    vx, vy = rng.uniform(-0.3, 0.3, size=2)
    normals: dict[int, tuple[float, float]] = {}
    if place in (1, 6) or (place == 3 and rng.random() < 0.3):
        x, y, vy = rng.uniform(1.0, 7.0), _RADIUS, 0.0
        normals[2] = (0.0, 1.0)
    if place == 2:
        x, y = 9.0, 2.0 + _RADIUS
        normals[1] = (0.0, 1.0)
    if place == 3:
        left = rng.random() < 0.5
        x = _RADIUS if left else 20.0 - _RADIUS
        normals[4 if left else 5] = (1.0 if left else -1.0, 0.0)
    if place == 4:
        x, y = 8.0 - _RADIUS, rng.uniform(0.6, 1.9)
        normals[1] = (-1.0, 0.0)
    if place == 5:
        x, y = 14.0, 1.5
        normals[3] = _SLOPE
    if place == 6:
        vx = rng.uniform(-1.0, 1.0) * _DECELERATION
    approach = {o: vx * nx + vy * ny for o, (nx, ny) in normals.items()}
    mode = _ball_mode(normals, approach, vx)
    values = ball_modes(vx, vy)
    return Labelled(
        _ball_example(x, y, vx, vy, normals, approach, row),
        mode,
        np.abs(values - values[mode]) < 1e-9,
        values,
    )


def _ball_mode(normals: dict[int, tuple[float, float]], approach: dict[int, float], vx: float) -> int:
    hit = {o for o, speed in approach.items() if speed < 0}
    if 3 in hit:
        return RAMP
    if any(abs(normals[o][0]) == 1.0 for o in hit):
        return BOUNCE
    if 2 in normals:
        return HALT if abs(vx) < _DECELERATION else (FRICTION_LEFT if vx > 0 else FRICTION_RIGHT)
    return FLY


def _ball_example(
    x: float,
    y: float,
    vx: float,
    vy: float,
    normals: dict[int, tuple[float, float]],
    approach: dict[int, float],
    row: int,
) -> Example:
    centre = np.array([[x, y]])
    lower = np.concatenate([centre - _RADIUS, _LOWER])
    upper = np.concatenate([centre + _RADIUS, _UPPER])
    table = np.zeros((5, 6, 6), dtype=np.bool_)
    for other in normals:
        table[0, 0, other] = table[0, other, 0] = True
    for axis, at in ((0, 1), (1, 3)):
        table[at] = lower[:, None, axis] >= upper[None, :, axis] - 0.05
        table[at + 1] = table[at].T
    np.einsum("rkk->rk", table)[...] = False
    gaps = np.maximum(np.maximum(_LOWER - centre, centre - _UPPER), 0.0)
    distance = np.linalg.norm(gaps, axis=1) - _RADIUS
    close = np.zeros(6, dtype=np.bool_)
    close[[0, *normals] if normals else [0, 1 + int(distance.argmin())]] = True
    pair = np.full((6, 4), np.nan)
    for other, normal in normals.items():
        pair[other] = (approach[other], 0.0, *normal)
    unary = _TYPES[None, :] == np.arange(5)[:, None]
    key = table.tobytes() + close.tobytes()
    return Example(table, unary, close, pair, np.array([vx, vy]), 0, key, row)


TRUCK_VOCABULARY = Vocabulary(
    relations=("intersect", "on-top", "x-greater-than", "y-aligned", "y-greater-than"),
    unary=("box", "truck"),
    pair=("friction",),
    own=("vx", "force"),
)
TRUCK_KINDS = {1: ("-7.5",), 2: ("-5.0", "-2.5"), 3: ("-2.5", "-2.5", "-2.5")}
"""Weights of the boxes' friction in Table 3.1, per mode."""

_LAYOUTS = (((0, 1, 2),), ((0, 1), (2,)), ((0,), (1, 2)), ((0,), (1,), (2,)))
"""Figure 3.1: stacks beside the truck from near to far, each from bottom to top."""


def truck_stream(episodes: int, *, rng: np.random.Generator, bystanders: int = 0) -> Iterator[Labelled]:
    """Ten examples per episode: a truck pushes three boxes, in the layouts of Figure 3.1 and any order."""
    for episode in range(episodes):
        stacks = _LAYOUTS[episode % 4]
        order = rng.permutation(3 + bystanders) + 1
        for step in range(10):
            yield _truck(stacks, order, 10 * episode + step, rng)


def _truck(
    stacks: tuple[tuple[int, ...], ...], order: NDArray[np.int64], row: int, rng: np.random.Generator
) -> Labelled:
    k = len(order) + 1
    column, level = np.zeros(k), np.zeros(k)
    for at, stack in enumerate(stacks):
        for height, box in enumerate(stack):
            column[order[box]], level[order[box]] = at + 1, height
    for beside, box in enumerate(order[3:]):
        column[box] = 10 + 2 * beside
    same_column, above = column[:, None] == column, level[:, None] - level
    on_top = same_column & (above == 1)
    beside_ = (np.abs(column[:, None] - column) == 1) & (level[:, None] == level)
    table = np.stack([on_top | on_top.T | beside_, on_top, column[:, None] > column, above == 0, above > 0])
    np.einsum("rkk->rk", table)[...] = False
    friction, force, v = rng.uniform(0.05, 0.5, size=k), rng.uniform(300, 500), rng.uniform(0, 9)
    bottoms = {len(stack): [] for stack in stacks}
    for stack in stacks:
        bottoms[len(stack)].append(int(order[stack[0]]))
    roles = tuple(box for size in sorted(bottoms, reverse=True) for box in sorted(bottoms[size]))
    mode = {(3,): 1, (1, 2): 2, (1, 1, 1): 3}[tuple(sorted(map(len, stacks)))]
    pair = np.full((k, 1), np.nan)
    pair[1:, 0] = friction[1:]
    unary = np.array([np.arange(k) > 0, np.arange(k) == 0])
    close = table[0, 0] | (np.arange(k) == 0)
    weights = np.array([float(w) for w in TRUCK_KINDS[mode]])
    values = np.full(3, np.nan)
    values[mode - 1] = v + 0.025 * force + weights @ friction[list(roles)]
    example = Example(table, unary, close, pair, np.array([v, force]), 0, table.tobytes(), row)
    return Labelled(example, mode, np.arange(3) == mode - 1, values, roles)
