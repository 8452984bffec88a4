"""Draws a truck and stacks of boxes (Figure 3.1): the initial scenes of ``relgym/TruckPush-v0``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from relgym.envs.draws import Draws, Range
from relgym.errors import ObservationError
from relgym.scene.objects import Scene, SceneObject

__all__ = ["Placed", "Stacks", "draw_row", "layouts", "loads", "option_names", "partitions", "stacks_of"]

Stacks = tuple[tuple[str, ...], ...]
"""Names of the boxes of each stack from bottom to top; stacks from the truck outwards."""

_TRUCK_SIZES = {"width": Range(4.0, 6.0, 0.1, 100.0), "height": Range(2.0, 3.0, 0.1, 100.0)}
_BOX_SIZE = Range(3.0, 5.0, 0.1, 100.0)  # the truck is no higher than a box
_SHIFT_X = Range(-50.0, 50.0, -1e5, 1e5)
_SHIFT_Y = Range(-5.0, 5.0, -1e5, 1e5)
_SPEED = Range(0.0, 0.0, 0.0, 1e3)
_BYSTANDER_X = Range(-20.0, 120.0, -1e5, 1e5)
_TRACK_CLEARANCE = 8.0  # between the track's middle and the nearest bystander's, in depth
_BYSTANDER_STEP = 6.0  # more than a box is deep
_TOUCH = 1e-6


@dataclass(frozen=True, slots=True)
class Placed:
    """Centre and full extents of one object."""

    x: float
    y: float
    z: float
    width: float
    height: float
    depth: float


@cache
def layouts(n_boxes: int) -> tuple[tuple[int, ...], ...]:
    """Heights of the stacks in every layout; layout k (from 1) is the k-th entry.

    All compositions of `n_boxes`, the greatest first: ``(3,), (2, 1), (1, 2), (1, 1, 1)`` are
    configurations 1 to 4 of Figure 3.1.
    """
    return tuple(sorted(_compositions(n_boxes), reverse=True))


def partitions(n_boxes: int) -> tuple[tuple[int, ...], ...]:
    """Heights of the stacks regardless of their order, the greatest first: one mode each (Table 3.1)."""
    return tuple(sorted({tuple(sorted(c, reverse=True)) for c in _compositions(n_boxes)}, reverse=True))


def _compositions(n: int) -> Iterator[tuple[int, ...]]:
    if n == 0:
        yield ()
    for first in range(1, n + 1):
        yield from ((first, *rest) for rest in _compositions(n - first))


def option_names(boxes: Sequence[str], bystanders: Sequence[str]) -> list[str]:
    """All options of a reset with these boxes and bystanders."""
    names = ["layout", "order", "shift_x", "shift_y", "speed", *(f"truck_{q}" for q in _TRUCK_SIZES)]
    for name in (*boxes, *bystanders):
        names += [f"{name}_{quantity}" for quantity in ("width", "height", "depth", "friction")]
    return names + [f"{name}_x" for name in bystanders]


def draw_row(
    boxes: tuple[str, ...], bystanders: tuple[str, ...], draws: Draws
) -> tuple[dict[str, Placed], Stacks, float]:
    """Draw truck, stacks and bystanders.

    Returns
    -------
    Where everything is, the stacks, and the truck's speed in units per step.

    Notes
    -----
    A box on another one is no wider than that, so that stacks touch with their lowest boxes.
    """
    heights = layouts(len(boxes))[draws.choice("layout", range(1, 2 ** (len(boxes) - 1) + 1)) - 1]
    order = iter(draws.order("order", boxes))
    stacks: Stacks = tuple(tuple(next(order) for _ in range(height)) for height in heights)
    x, ground = draws.number("shift_x", _SHIFT_X), draws.number("shift_y", _SHIFT_Y)
    width, height = (draws.number(f"truck_{q}", span) for q, span in _TRUCK_SIZES.items())
    placed = {"truck": Placed(x, ground + height / 2, 0.0, width, height, _BOX_SIZE.low)}
    edge = x + width / 2
    for stack in stacks:
        placed.update(_stack(stack, edge, ground, draws))
        edge += placed[stack[0]].width
    for k, name in enumerate(bystanders):
        z = (1 if k % 2 else -1) * (_TRACK_CLEARANCE + _BYSTANDER_STEP * (k // 2))
        placed[name] = _box(name, draws.number(f"{name}_x", _BYSTANDER_X), ground, z, _BOX_SIZE.high, draws)
    return placed, stacks, draws.number("speed", _SPEED)


def _stack(names: Sequence[str], left: float, ground: float, draws: Draws) -> dict[str, Placed]:
    placed: dict[str, Placed] = {}
    centre, widest = left, _BOX_SIZE.high
    for name in names:
        box = _box(name, centre, ground, 0.0, widest, draws)
        if not placed:  # the lowest box touches what is on its left
            centre = left + box.width / 2
            box = Placed(centre, box.y, 0.0, box.width, box.height, box.depth)
        placed[name] = box
        ground, widest = ground + box.height, box.width
    return placed


def _box(name: str, x: float, ground: float, z: float, widest: float, draws: Draws) -> Placed:
    span = Range(_BOX_SIZE.low, max(widest, _BOX_SIZE.low), _BOX_SIZE.least, _BOX_SIZE.most)
    width = draws.number(f"{name}_width", span)
    height, depth = (draws.number(f"{name}_{q}", _BOX_SIZE) for q in ("height", "depth"))
    return Placed(x, ground + height / 2, z, width, height, depth)


def stacks_of(scene: Scene) -> Stacks:
    """Read the stacks from a scene: what the truck pushes, directly or through other boxes.

    Raises
    ------
    ObservationError
        Nothing touches the truck, or boxes on the track touch no others.
    """
    truck = scene["truck"]
    ground = truck["py"] - truck["sy"] / 2
    track = [o for o in scene if o.type.name == "box" and abs(o["pz"]) < _TRACK_CLEARANCE / 2]
    edge, stacks = truck["px"] + truck["sx"] / 2, []
    low = sorted((b for b in track if abs(_bottom(b) - ground) < _TOUCH), key=lambda b: b["px"])
    for base in low:
        if abs(base["px"] - base["sx"] / 2 - edge) > _TOUCH * max(1.0, abs(edge)):
            break
        edge = base["px"] + base["sx"] / 2
        stacks.append(tuple(_upwards(base, track)))
    if sum(map(len, stacks)) != len(track):
        raise ObservationError(
            f"the truck must push all {len(track)} boxes on the track, in stacks that touch; found {stacks}"
        )
    return tuple(stacks)


def _upwards(base: SceneObject, track: Sequence[SceneObject]) -> Iterator[str]:
    box: SceneObject | None = base
    while box is not None:
        yield box.name
        top, centre, reach = box["py"] + box["sy"] / 2, box["px"], box["sx"] / 2
        above = (b for b in track if abs(_bottom(b) - top) < _TOUCH and abs(b["px"] - centre) < reach)
        box = next(above, None)


def _bottom(box: SceneObject) -> float:
    return box["py"] - box["sy"] / 2


def loads(stacks: Stacks) -> Mapping[str, int]:
    """How many boxes rest on the ground through each lowest box, itself included."""
    return {stack[0]: len(stack) for stack in stacks}
