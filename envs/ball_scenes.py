"""Draws rooms with balls, boxes and ramps: the distribution of initial scenes of ``relgym/BallBoxRamp-v0``.

The thesis names the 40 configurations (§4.2, Table 4.1) and leaves sizes and speeds open. Those below are
this project's, and all of its figures hold for them: changing one means a new version of the env.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from relgym.envs.ball_rooms import (
    ATTEMPTS,
    CLEARANCE,
    RADIUS,
    EmptyRoom,
    Placed,
    Stand,
    empty_room,
    furnished,
    room_options,
)
from relgym.envs.draws import Draws, Range
from relgym.envs.physics import TIME_STEP
from relgym.errors import ConfigError

__all__ = ["BALL_PLACES", "Placed", "Room", "ball_places", "draw_room", "option_names"]

BALL_PLACES = ("leftmost", "above-left", "between", "above-right", "rightmost")
"""Where a ball may start (Table 4.1)."""

_SHARE = Range(0.0, 1.0, 0.0, 1.0)
_SINK = Range(0.001, 0.010, 0.0, 0.5)
_FLOOR_SPEED = Range(3.0, 6.0, 0.0, 20.0)
_AIR_SPEED = Range(0.5, 4.0, 0.0, 20.0)
_DROP_ABOVE = Range(0.1, 0.8, -20.0, 100.0)
_DROP_BETWEEN = Range(0.05, 0.6, -20.0, 100.0)


@dataclass(frozen=True, slots=True)
class Room:
    """What `draw_room` drew: all objects by name, and the options that give the same room again."""

    objects: Mapping[str, Placed]
    configuration: Mapping[str, Any]


def ball_places(n_standing: int) -> tuple[str, ...]:
    """Where a ball may start beside that many standing objects."""
    absent = {0: {"above-left", "between", "above-right"}, 1: {"between"}}.get(n_standing, set())
    return tuple(place for place in BALL_PLACES if place not in absent)


def option_names(standing: Mapping[str, str], balls: tuple[str, ...]) -> list[str]:
    """All options of `draw_room` for these standing objects (name to kind) and balls."""
    names = room_options(standing)
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
    for _ in range(ATTEMPTS):
        room = _attempt(standing, balls, inclines, Draws(options, rng))
        if room is not None:
            return room
    raise ConfigError(
        f"the reset options {dict(options)} leave no room for a ball: {ATTEMPTS} draws didn't fit; "
        "enlarge room_width, or fix fewer sizes"
    )


def _attempt(
    standing: Mapping[str, str], balls: tuple[str, ...], inclines: Mapping[str, float], draws: Draws
) -> Room | None:
    radii = {ball: draws.number(f"{ball}_radius", RADIUS) for ball in balls}
    room = empty_room(standing, inclines, radii[balls[0]], draws)
    if room is None:
        return None
    placed = {ball: _place_ball(ball, radii[ball], room, draws) for ball in balls}
    found = {ball: p for ball, p in placed.items() if p is not None}
    if len(found) < len(balls) or _overlapping(list(found.values())):
        return None
    if any(p.y + radii[ball] > room.height - CLEARANCE for ball, p in found.items()):
        return None
    return Room(furnished(room, found, draws), draws.taken)


def _place_ball(ball: str, r: float, room: EmptyRoom, draws: Draws) -> Placed | None:
    stands = room.stands
    place = draws.choice(ball, ball_places(len(stands)))
    gap = draws.choice(f"{ball}_gap", range(len(stands) - 1)) if len(stands) > 2 else 0
    on_floor = _lies_on_floor(ball, place, gap, stands, draws)
    low, high, top = _where(place, gap, on_floor, r, stands, room.width)
    share = draws.number(f"{ball}_x", _SHARE)
    sink = draws.number(f"{ball}_sink", _SINK)
    drop = draws.number(f"{ball}_drop", _DROP_BETWEEN if place == "between" else _DROP_ABOVE)
    speed = draws.number(f"{ball}_speed", _FLOOR_SPEED if on_floor else _AIR_SPEED)
    sign = -1.0 if draws.choice(_direction_option(ball), ("left", "right")) == "left" else 1.0
    if high < low:
        return None
    y = r - sink if on_floor else top + drop + r
    return Placed(low + share * (high - low), y, 2 * r, 2 * r, sign * speed * TIME_STEP)


def _lies_on_floor(ball: str, place: str, gap: int, stands: Sequence[Stand], draws: Draws) -> bool:
    drawn = bool(draws.choice(f"{ball}_floor", (True, False)))
    if place in ("leftmost", "rightmost"):
        return True
    return drawn and place == "between" and stands[gap].right < stands[gap + 1].left


def _where(
    place: str, gap: int, on_floor: bool, r: float, stands: Sequence[Stand], room: float
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


def _direction_option(ball: str) -> str:
    return "direction" if ball == "ball" else f"{ball}_direction"
