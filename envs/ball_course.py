"""Draws a room, a start and a goal in it: the initial scenes of ``relgym/BallGoal-v0``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from relgym.envs.ball_rooms import (
    ATTEMPTS,
    CLEARANCE,
    RADIUS,
    EmptyRoom,
    Placed,
    empty_room,
    furnished,
    room_options,
)
from relgym.envs.draws import Draws, Range
from relgym.errors import ConfigError

__all__ = ["Course", "course_options", "draw_course", "rest_places"]

_SHARE = Range(0.0, 1.0, 0.0, 1.0)
_DROP = Range(0.1, 0.3, 0.0, 100.0)
_APART = 1.0  # least distance along the floor of start and goal, in units


@dataclass(frozen=True, slots=True)
class Course:
    """What `draw_course` drew.

    Attributes
    ----------
    objects
        All bodies by name; the ball at its start.
    goal
        Where the ball's centre is when it rests at the goal.
    configuration
        The options that give the same course again.
    """

    objects: Mapping[str, Placed]
    goal: tuple[float, float]
    configuration: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a ball can come to rest: an interval of the floor, or the top of a box, and its height."""

    left: float
    right: float
    top: float


def rest_places(standing: Mapping[str, str]) -> tuple[str, ...]:
    """Names of the places where a ball can rest: gaps of the floor from left to right, and boxes."""
    gaps = (f"gap{k + 1}" for k in range(len(standing) + 1))
    return (*gaps, *(name for name, kind in standing.items() if kind == "box"))


def course_options(standing: Mapping[str, str]) -> list[str]:
    """All options of `draw_course` for these standing objects (name to kind)."""
    return [*room_options(standing), "ball_radius", "start", "start_x", "drop", "goal", "goal_x"]


def draw_course(
    standing: Mapping[str, str],
    inclines: Mapping[str, float],
    *,
    options: Mapping[str, Any],
    rng: np.random.Generator,
) -> Course:
    """Draw a course: start and goal at different places, at least one unit apart.

    Parameters
    ----------
    standing
        Kind (``"box"`` or ``"ramp"``) of each object that stands on the floor, by name.
    inclines
        Angle of each ramp's slope in radians, by name.
    options
        Values that replace draws.
    rng
        Source of all draws.

    Raises
    ------
    ConfigError
        An option outside its range, or options that leave no room for ball and goal.
    """
    for _ in range(ATTEMPTS):
        course = _attempt(standing, inclines, Draws(options, rng))
        if course is not None:
            return course
    raise ConfigError(
        f"the reset options {dict(options)} leave no room for ball and goal: {ATTEMPTS} draws didn't fit; start "
        f"and goal must be different places and {_APART:g} unit apart"
    )


def _attempt(standing: Mapping[str, str], inclines: Mapping[str, float], draws: Draws) -> Course | None:
    r = draws.number("ball_radius", RADIUS)
    room = empty_room(standing, inclines, r, draws)
    start, goal = (draws.choice(name, rest_places(standing)) for name in ("start", "goal"))
    shares = [draws.number(name, _SHARE) for name in ("start_x", "goal_x")]
    drop = draws.number("drop", _DROP)
    if room is None or start == goal:
        return None
    places = _places(room)
    begin, end = (_spot(places[name], x, r) for name, x in zip((start, goal), shares, strict=True))
    if begin is None or end is None or abs(begin[0] - end[0]) < _APART:
        return None
    if begin[1] + drop + 2 * r > room.height - CLEARANCE:
        return None
    # The goal is shifted with the room: as a body without extent it is drawn in with the rest.
    placed = {
        "ball": Placed(begin[0], begin[1] + drop + r, 2 * r, 2 * r),
        "goal": Placed(end[0], end[1] + r, 0.0, 0.0),
    }
    objects = furnished(room, placed, draws)
    target = objects.pop("goal")
    return Course(objects, (target.x, target.y), draws.taken)


def _places(room: EmptyRoom) -> dict[str, _Place]:
    """Gaps of the floor from left to right, and the tops of what stands there, by name."""
    edges = [0.0, *(edge for stand in room.stands for edge in (stand.left, stand.right)), room.width]
    gaps = zip(edges[::2], edges[1::2], strict=True)
    tops = {stand.name: _Place(stand.left, stand.right, stand.height) for stand in room.stands}
    return {f"gap{k + 1}": _Place(left, right, 0.0) for k, (left, right) in enumerate(gaps)} | tops


def _spot(place: _Place, share: float, r: float) -> tuple[float, float] | None:
    """A point of a place, and its height; ``None`` where a ball doesn't fit in."""
    margin = r + CLEARANCE
    free = place.right - place.left - 2 * margin
    return None if free < 0.0 else (place.left + margin + share * free, place.top)
