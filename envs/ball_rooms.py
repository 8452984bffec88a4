"""Draws rooms and what stands in them: what all worlds of balls share."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from relgym.envs.draws import Draws, Range

__all__ = [
    "ATTEMPTS",
    "CLEARANCE",
    "RADIUS",
    "EmptyRoom",
    "Placed",
    "Stand",
    "empty_room",
    "furnished",
    "room_options",
]

WALL = 0.5
"""Thickness of floor, walls and ceiling, in units."""

CLEARANCE = 0.02
"""Least distance, in units, of a ball on the floor from what stands or lies beside it at the start."""

_ROOM = {"room_width": Range(4.5, 6.0, 1.0, 200.0), "room_height": Range(2.5, 3.5, 1.0, 200.0)}
_EXTRA_WIDTH = 2.0  # of the room, for each standing object beyond two
_SHIFT = Range(-5.0, 5.0, -9000.0, 9000.0)
_LEFT_SHARE = Range(0.3, 0.7, 0.0, 1.0)
_GAP_RADII = Range(4.0, 8.0, 0.0, 100.0)
_SIZES = {
    "box": {"width": Range(0.6, 1.0, 0.05, 20.0), "height": Range(0.4, 0.9, 0.05, 20.0)},
    "ramp": {"base": Range(1.0, 1.5, 0.05, 20.0)},
}
_RAMP_HIGHEST = Range(1.0, 1.0, 0.05, 20.0)
RADIUS = Range(0.08, 0.15, 0.01, 1.0)
"""Of a ball."""

ATTEMPTS = 1000
"""How often a room is drawn anew when a ball finds no place in it."""


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
class Stand:
    """An object on the floor: its left and right edge and its height."""

    name: str
    left: float
    right: float
    height: float


@dataclass(frozen=True, slots=True)
class EmptyRoom:
    """Inner width and height of a room whose lower left corner is the origin, and what stands in it."""

    width: float
    height: float
    stands: tuple[Stand, ...]


def room_options(standing: Mapping[str, str]) -> list[str]:
    """All options of `empty_room` for these standing objects (name to kind), and those of the shift."""
    names = [*_ROOM, "shift_x", "shift_y"]
    if standing:
        names += ["left_share"]
    if len(standing) > 1:
        names += ["touching", "ramp" if _has_pair(standing) else "order"]
    names += [_gap_option(i) for i in range(len(standing) - 1)]
    for name, kind in standing.items():
        names += [f"{name}_{quantity}" for quantity in _SIZES[kind]]
    if "ramp" in standing.values():
        names.append("ramp_highest")
    return names


def empty_room(
    standing: Mapping[str, str], inclines: Mapping[str, float], radius: float, draws: Draws
) -> EmptyRoom | None:
    """Draw a room and what stands in it; ``None`` if that is too wide.

    Parameters
    ----------
    standing
        Kind (``"box"`` or ``"ramp"``) of each object that stands on the floor, by name.
    inclines
        Angle of each ramp's slope in radians, by name.
    radius
        Of the ball: the measure of gaps.
    draws
        Where numbers come from.
    """
    width, height = (draws.number(name, span) for name, span in _ROOM.items())
    if "room_width" not in draws.options:
        width = draws.taken["room_width"] = width + _EXTRA_WIDTH * max(0, len(standing) - 2)
    stands = _stand_row(standing, inclines, width, radius, draws)
    return None if stands is None else EmptyRoom(width, height, tuple(stands))


def furnished(room: EmptyRoom, balls: Mapping[str, Placed], draws: Draws) -> dict[str, Placed]:
    """All objects of a room by name, shifted to where the room lies in the world."""
    objects = {**balls, **{s.name: _standing(s) for s in room.stands}, **_shell(room.width, room.height)}
    shift = (draws.number("shift_x", _SHIFT), draws.number("shift_y", _SHIFT))
    return {name: _shifted(placed, *shift) for name, placed in objects.items()}


def _stand_row(
    standing: Mapping[str, str],
    inclines: Mapping[str, float],
    room_width: float,
    radius: float,
    draws: Draws,
) -> list[Stand] | None:
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
        row.append(Stand(name, left, left + width, height))
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
    highest = draws.given("ramp_highest", _RAMP_HIGHEST.high, _RAMP_HIGHEST)
    scale = min(1.0, highest / (base * slope))
    return base * scale, base * scale * slope


def _standing(s: Stand) -> Placed:
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
