"""Draws rooms with balls, boxes and ramps: the distribution of initial scenes of ``relgym/BallBoxRamp-v0``.

The thesis names the 40 configurations (§4.2, Table 4.1) and leaves sizes and speeds open. Those below are
this project's, and all of its figures hold for them: changing one means a new version of the env.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from relgym.envs.draws import Draws, Range
from relgym.envs.physics import TIME_STEP
from relgym.errors import ConfigError

__all__ = ["BALL_PLACES", "Placed", "Room", "ball_places", "draw_room", "option_names"]

BALL_PLACES = ("leftmost", "above-left", "between", "above-right", "rightmost")
"""Where a ball may start (Table 4.1)."""

WALL = 0.5
"""Thickness of floor, walls and ceiling, in units."""

CLEARANCE = 0.02
"""Least distance, in units, of a ball on the floor from what stands or lies beside it at the start."""

_ROOM = {"room_width": Range(4.5, 6.0, 1.0, 200.0), "room_height": Range(2.5, 3.5, 1.0, 200.0)}
_EXTRA_WIDTH = 2.0  # of the room, for each standing object beyond two
_SHIFT = Range(-5.0, 5.0, -9000.0, 9000.0)
_LEFT_SHARE = Range(0.3, 0.7, 0.0, 1.0)
_GAP_RADII = Range(4.0, 8.0, 0.0, 100.0)
_SHARE = Range(0.0, 1.0, 0.0, 1.0)
_SIZES = {
    "box": {"width": Range(0.6, 1.0, 0.05, 20.0), "height": Range(0.4, 0.9, 0.05, 20.0)},
    "ramp": {"base": Range(1.0, 1.5, 0.05, 20.0)},
}
_RAMP_HIGHEST = 1.0
_RADIUS = Range(0.08, 0.15, 0.01, 1.0)
_SINK = Range(0.001, 0.010, 0.0, 0.5)
_FLOOR_SPEED = Range(3.0, 6.0, 0.0, 20.0)
_AIR_SPEED = Range(0.5, 4.0, 0.0, 20.0)
_DROP_ABOVE = Range(0.1, 0.8, 0.0, 100.0)
_DROP_BETWEEN = Range(0.05, 0.6, 0.0, 100.0)
_ATTEMPTS = 1000


@dataclass(frozen=True, slots=True)
class Placed:
    """Centre, full extents and last displacement of one object, in units (per step)."""

    x: float
    y: float
    width: float
    height: float
    dx: float = 0.0
    dy: float = 0.0


@dataclass(frozen=True, slots=True)
class Room:
    """What `draw_room` drew: all objects by name, and the options that give the same room again."""

    objects: Mapping[str, Placed]
    configuration: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class _Stand:
    """An object on the floor: its left and right edge and its height."""

    name: str
    left: float
    right: float
    height: float


def ball_places(n_standing: int) -> tuple[str, ...]:
    """Where a ball may start beside that many standing objects."""
    absent = {0: {"above-left", "between", "above-right"}, 1: {"between"}}.get(n_standing, set())
    return tuple(place for place in BALL_PLACES if place not in absent)


def option_names(standing: Mapping[str, str], balls: tuple[str, ...]) -> list[str]:
    """All options of `draw_room` for these standing objects (name to kind) and balls."""
    names = [*_ROOM, "shift_x", "shift_y"]
    if standing:
        names += ["left_share"]
    if len(standing) > 1:
        names += ["touching", "ramp" if _has_pair(standing) else "order"]
    names += [_gap_option(i) for i in range(len(standing) - 1)]
    for name, kind in standing.items():
        names += [f"{name}_{quantity}" for quantity in _SIZES[kind]]
    for ball in balls:
        names += [ball, _direction_option(ball)]
        names += [f"{ball}_{quantity}" for quantity in ("radius", "floor", "x", "sink", "drop", "speed")]
        names += [f"{ball}_gap"] if len(standing) > 2 else []
    return names


def draw_room(
    standing: Mapping[str, str],
    balls: tuple[str, ...],
    inclines: Mapping[str, float],
    *,
    options: Mapping[str, Any],
    rng: np.random.Generator,
) -> Room:
    """Draw a room.

    Parameters
    ----------
    standing
        Kind (``"box"`` or ``"ramp"``) of each object that stands on the floor, by name.
    balls
        Names of the balls.
    inclines
        Angle of each ramp's slope in radians, by name.
    options
        Values that replace draws.

    Raises
    ------
    ConfigError
        An option outside its range, or options that leave a ball no room.
    """
    for _ in range(_ATTEMPTS):
        room = _attempt(standing, balls, inclines, Draws(options, rng))
        if room is not None:
            return room
    raise ConfigError(
        f"the reset options {dict(options)} leave no room for a ball: {_ATTEMPTS} draws didn't fit; "
        "enlarge room_width, or fix fewer sizes"
    )


def _attempt(
    standing: Mapping[str, str], balls: tuple[str, ...], inclines: Mapping[str, float], draws: Draws
) -> Room | None:
    radii = {ball: draws.number(f"{ball}_radius", _RADIUS) for ball in balls}
    width, height = (draws.number(name, span) for name, span in _ROOM.items())
    if "room_width" not in draws.options:
        width = draws.taken["room_width"] = width + _EXTRA_WIDTH * max(0, len(standing) - 2)
    stands = _stand_row(standing, inclines, width, radii[balls[0]], draws)
    if stands is None:
        return None
    placed = {ball: _place_ball(ball, radii[ball], stands, width, draws) for ball in balls}
    found = {ball: p for ball, p in placed.items() if p is not None}
    if len(found) < len(balls) or _overlapping(list(found.values())):
        return None
    if any(p.y + radii[ball] > height - CLEARANCE for ball, p in found.items()):
        return None
    objects = {**found, **{s.name: _stand(s) for s in stands}, **_shell(width, height)}
    shift = (draws.number("shift_x", _SHIFT), draws.number("shift_y", _SHIFT))
    return Room({name: _shifted(p, *shift) for name, p in objects.items()}, draws.taken)


def _stand_row(
    standing: Mapping[str, str],
    inclines: Mapping[str, float],
    room_width: float,
    radius: float,
    draws: Draws,
) -> list[_Stand] | None:
    sizes = {name: _size(name, kind, inclines, draws) for name, kind in standing.items()}
    order = _order(standing, draws)
    touching = bool(draws.choice("touching", (True, False))) if len(standing) > 1 else False
    gaps = [draws.number(_gap_option(i), _GAP_RADII) * radius for i in range(len(order) - 1)]
    gaps = [0.0 if touching else gap for gap in gaps]
    free = room_width - sum(w for w, _ in sizes.values()) - sum(gaps)
    if free < 0.0:
        return None
    left = free * draws.number("left_share", _LEFT_SHARE) if standing else 0.0
    row = []
    for name, gap in zip(order, [*gaps, 0.0], strict=False):
        width, height = sizes[name]
        row.append(_Stand(name, left, left + width, height))
        left += width + gap
    return row


def _order(standing: Mapping[str, str], draws: Draws) -> tuple[str, ...]:
    """Names of the standing objects from left to right."""
    names = tuple(standing)
    if _has_pair(standing):
        ramp_first = draws.choice("ramp", ("left", "right")) == "left"
        return tuple(sorted(names, key=lambda name: (standing[name] == "ramp") != ramp_first))
    return draws.order("order", names) if len(names) > 1 else names


def _has_pair(standing: Mapping[str, str]) -> bool:
    """Whether exactly a ramp and a box stand there, the thesis' world."""
    return sorted(standing.values()) == ["box", "ramp"]


def _size(name: str, kind: str, inclines: Mapping[str, float], draws: Draws) -> tuple[float, float]:
    size = [draws.number(f"{name}_{quantity}", span) for quantity, span in _SIZES[kind].items()]
    if kind == "box":
        return size[0], size[1]
    base, slope = size[0], math.tan(inclines[name])
    scale = min(1.0, _RAMP_HIGHEST / (base * slope))
    return base * scale, base * scale * slope


def _place_ball(ball: str, r: float, stands: list[_Stand], room: float, draws: Draws) -> Placed | None:
    place = draws.choice(ball, ball_places(len(stands)))
    gap = draws.choice(f"{ball}_gap", range(len(stands) - 1)) if len(stands) > 2 else 0
    on_floor = _lies_on_floor(ball, place, gap, stands, draws)
    low, high, top = _where(place, gap, on_floor, r, stands, room)
    share = draws.number(f"{ball}_x", _SHARE)
    sink = draws.number(f"{ball}_sink", _SINK)
    drop = draws.number(f"{ball}_drop", _DROP_BETWEEN if place == "between" else _DROP_ABOVE)
    speed = draws.number(f"{ball}_speed", _FLOOR_SPEED if on_floor else _AIR_SPEED)
    sign = -1.0 if draws.choice(_direction_option(ball), ("left", "right")) == "left" else 1.0
    if high < low:
        return None
    y = r - sink if on_floor else top + drop + r
    return Placed(low + share * (high - low), y, 2 * r, 2 * r, sign * speed * TIME_STEP)


def _lies_on_floor(ball: str, place: str, gap: int, stands: list[_Stand], draws: Draws) -> bool:
    drawn = bool(draws.choice(f"{ball}_floor", (True, False)))
    if place in ("leftmost", "rightmost"):
        return True
    return drawn and place == "between" and stands[gap].right < stands[gap + 1].left


def _where(
    place: str, gap: int, on_floor: bool, r: float, stands: list[_Stand], room: float
) -> tuple[float, float, float]:
    """Least and greatest x of the ball's centre, and the height it is dropped over."""
    margin = r + CLEARANCE
    if place == "leftmost":
        return margin, (stands[0].left if stands else room / 2) - margin, 0.0
    if place == "rightmost":
        return (stands[-1].right if stands else room / 2) + margin, room - margin, 0.0
    if place == "between":
        left, right = stands[gap], stands[gap + 1]
        top = max(left.height, right.height)
        if on_floor:
            return left.right + margin, right.left - margin, top
        if left.right < right.left:
            return left.right, right.left, top
        return left.right - r, left.right + r, top
    stand = stands[0] if place == "above-left" else stands[-1]
    return max(stand.left, margin), min(stand.right, room - margin), stand.height


def _overlapping(balls: list[Placed]) -> bool:
    return any(
        math.hypot(a.x - b.x, a.y - b.y) < (a.width + b.width) / 2 + CLEARANCE
        for a, b in combinations(balls, 2)
    )


def _stand(s: _Stand) -> Placed:
    return Placed((s.left + s.right) / 2, s.height / 2, s.right - s.left, s.height)


def _shell(width: float, height: float) -> dict[str, Placed]:
    """Floor, ceiling and walls around the room's inside, whose lower left corner is the origin."""
    outer = width + 2 * WALL
    return {
        "floor": Placed(width / 2, -WALL / 2, outer, WALL),
        "ceiling": Placed(width / 2, height + WALL / 2, outer, WALL),
        "left_wall": Placed(-WALL / 2, height / 2, WALL, height),
        "right_wall": Placed(width + WALL / 2, height / 2, WALL, height),
    }


def _shifted(p: Placed, x: float, y: float) -> Placed:
    return Placed(p.x + x, p.y + y, p.width, p.height, p.dx, p.dy)


def _gap_option(index: int) -> str:
    return "gap" if index == 0 else f"gap{index + 1}"


def _direction_option(ball: str) -> str:
    return "direction" if ball == "ball" else f"{ball}_direction"
