"""Scenes with the thesis' frequencies: sizes, places and speeds under which each mode is as frequent as in its tables.

What is known (§4.1, §4.2): a room with a floor, a ceiling and two walls; a box and a ramp that touch or don't; five
places for the ball, two directions; 200 steps of a frictionless or a rough world; sizes and places vary with the seed,
and everything is shifted at random. Of the engine: what the tables' coefficients tell (`relgym.envs.physics`).

What is fitted, on seeds that are used nowhere else, are all numbers of `SCENES`: to the counts of tables 4.2 and 4.9,
and to what the tables of clauses count beside them.

- *Balls are large beside their speeds.* Most balls that hit something upright in flight are not yet x-aligned with it
  (Table 4.5: 88 of some 110; Table 4.14: 90 of 100): they overlap it by less than a twentieth of their width.
- *Floor bounces are few, and balls fall far.* At most 37 of 15,574 examples of constant x velocity are y-aligned with
  a floor or a box that they touch (Table 4.3), and only 16 flights still overlap a floor (Table 4.5).
- *Most bounces of experiment 1 are on the box.* Of 183 level bounces 168 are not covered by clauses of the floor's
  (Table 4.5): balls above the box begin just over it.
- *Some 440 of its 6,550 slides are on the box.* Of mode 2's examples 6,114 are on the floor, 211 and 228 elsewhere
  (Table 4.5): most balls above the box lie on it, and slide off its edge.
- *Two of five balls lie on the floor*: two in five examples slide.
- *Balls of experiment 2 that begin above the ramp move fast along it*: 42 examples slide up it, and fewer than T down.

Counts of modes that also explain other modes' examples can't be compared as they are printed: of the 437 and 359
examples of "bounce on vertical surface" in Table 4.9, 388 and 308 touch nothing (Table 4.14: ¬intersect(A, *)). Those
fly straight down, where both functions say what flying does; 49 and 51 are bounces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from relgym.envs.ball_rooms import CLEARANCE

__all__ = ["SCENES", "TOLD_APART", "ThesisScenes"]

Span = tuple[float, float]

TOLD_APART: Final[Mapping[tuple[int, str], Mapping[int, int]]] = {
    (1, "y"): {1: 6553, 2: 183},
    (2, "y"): {0: 17847, 3: 49, 4: 51},
}
"""By experiment and axis of tables 4.2 and 4.9: printed counts less what another function explains as well, where
tables 4.5 and 4.14 tell that, by the mode's place; flying has what flies straight down.

A ball that slides has no vy, so that -0.9 vy is right, too: 151 such are among the 334 bounces of Table 4.2."""


@dataclass(frozen=True, slots=True)
class ThesisScenes:
    """Where scenes are drawn from, uniformly; lengths in units, speeds in units per second.

    Parameters
    ----------
    room_width, room_height, radius, box_width, box_height
        Sizes.
    ramp_base, ramp_highest
        Of the ramp, which is scaled down where it would be higher.
    gap
        Between box and ramp, if they don't touch, in radii.
    left_share
        Share of the free floor on the left of both.
    sink
        How deep a ball that lies on something overlaps it at the start.
    floor_speed, ramp_speed, air_speed
        Of balls that lie on the floor, of those above the ramp, and of others.
    over_box, over_ramp, over_both
        Heights that a ball begins at over the box, over the slope below it, and over the higher one where they touch.
    over_gap
        Its height over the floor between them.
    on_floor
        Chance that a ball between them lies on the floor.
    on_box
        Chance that a ball above the box lies on it.
    """

    room_width: Span = (6.2, 7.4)
    room_height: Span = (4.4, 5.2)
    radius: Span = (0.18, 0.28)
    box_width: Span = (0.9, 1.4)
    box_height: Span = (0.8, 1.4)
    ramp_base: Span = (1.4, 2.2)
    ramp_highest: float = 2.6
    gap: Span = (3.0, 6.0)
    left_share: Span = (0.3, 0.7)
    sink: Span = (0.001, 0.008)
    floor_speed: Span = (3.3, 5.0)
    ramp_speed: Span = (2.8, 5.2)
    air_speed: Span = (2.8, 5.4)
    over_box: Span = (0.1, 0.6)
    over_ramp: Span = (0.01, 0.15)
    over_both: Span = (0.2, 0.8)
    over_gap: Span = (0.04, 0.06)
    on_floor: float = 0.9
    on_box: float = 0.5

    def options(self, case: Mapping[str, Any], incline: float, rng: np.random.Generator) -> dict[str, Any]:
        """Reset options of ``relgym/BallBoxRamp-v0`` for one scene.

        Parameters
        ----------
        case
            The configuration (Table 4.1): place and direction of the ball, and what stands there if both do.
        incline
            Of the ramp, in degrees.
        rng
            What is drawn from.
        """
        drawn = {
            "room_width": self.room_width,
            "room_height": self.room_height,
            "ball_radius": self.radius,
            "box_width": self.box_width,
            "box_height": self.box_height,
            "ramp_base": self.ramp_base,
            "gap": self.gap,
            "left_share": self.left_share,
            "ball_sink": self.sink,
        }
        found: dict[str, Any] = {name: float(rng.uniform(*span)) for name, span in drawn.items()}
        found["ramp_highest"] = self.ramp_highest
        share, chance = float(rng.random()), float(rng.random())
        floor, slope, air = (
            float(rng.uniform(*span)) for span in (self.floor_speed, self.ramp_speed, self.air_speed)
        )
        speed = air
        spans = (self.over_box, self.over_ramp, self.over_both, self.over_gap)
        box, ramp, both, over = (float(rng.uniform(*span)) for span in spans)
        lies, drop = case["ball"] in ("leftmost", "rightmost"), both
        if case["ball"] == "between" and not case.get("touching", True):
            lies = chance < self.on_floor
            drop = over - max(_ramp_height(found, incline), found["box_height"])
            # The whole ball fits between them.
            margin = (found["ball_radius"] + CLEARANCE) / (found["gap"] * found["ball_radius"])
            share = share if lies else margin + share * (1.0 - 2.0 * margin)
        elif case["ball"].startswith("above"):
            drop, speed = ramp + _down_slope(found, share, incline), slope
            if _stands(case) == "box":
                drop, speed = -found["ball_sink"] if chance < self.on_box else box, air
        found |= {
            "ball_floor": lies,
            "ball_x": share,
            "ball_drop": drop,
            "ball_speed": floor if lies else speed,
        }
        return {**found, **case}


SCENES: Final[Mapping[int, ThesisScenes]] = {
    1: ThesisScenes(
        room_width=(6.6, 7.6),
        room_height=(4.0, 4.5),
        radius=(0.16, 0.26),
        box_width=(1.5, 2.2),
        box_height=(0.9, 1.5),
        ramp_base=(2.0, 2.6),
        ramp_highest=1.5,
        gap=(4.0, 8.0),
        sink=(0.0005, 0.006),
        floor_speed=(2.2, 4.0),
        ramp_speed=(0.3, 2.0),
        air_speed=(1.6, 2.4),
        over_box=(0.003, 0.012),
        over_ramp=(0.05, 1.0),
        over_both=(0.4, 2.0),
        over_gap=(0.0004, 0.004),
        on_floor=1.0,
        on_box=0.6,
    ),
    2: ThesisScenes(),
    3: ThesisScenes(),
}
"""Of experiments 1, 2 and 3. Experiment 2 changes "some other simulation parameters", too (§4.4)."""


def _down_slope(found: Mapping[str, Any], share: float, incline: float) -> float:
    """How much lower than its ramp's top a ball is that touches the slope, which falls to the right."""
    rise = 1.0 / math.cos(math.radians(incline)) - 1.0
    return float(found["ball_radius"]) * rise - share * _ramp_height(found, incline)


def _ramp_height(found: Mapping[str, Any], incline: float) -> float:
    """It is scaled down where it would be higher than the highest."""
    height: float = min(found["ramp_base"] * math.tan(math.radians(incline)), found["ramp_highest"])
    return height


def _stands(case: Mapping[str, Any]) -> str:
    """What the ball is above: box or ramp; where only one stands, the env's options say which (`ramp`)."""
    if "ramp" not in case:
        return str(case.get("only", "box"))
    return "ramp" if case["ball"] == f"above-{case['ramp']}" else "box"
