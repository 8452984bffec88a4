"""Scenes with the thesis' frequencies: sizes, places and speeds under which each mode is as frequent as in its tables.

What is known (§4.1, §4.2): a room with a floor, a ceiling and two walls; a box and a ramp that touch or don't; five
places for the ball, two directions; 200 steps of a frictionless or a rough world; sizes and places vary with the seed,
and everything is shifted at random. Of the engine: what the tables' coefficients tell (`relgym.envs.physics`).

What is fitted, to the counts of tables 4.2 and 4.9, on seeds that are used nowhere else: all numbers of `SCENES`. Those
of experiment 1 differ from the others': of 9,169 examples of flight 334 end on a level surface, so balls fall
from low; and most of these bounces are told from sliding by how deep they go (Table 4.5), which is a twentieth of the
diameter, so balls are small.

The tables also tell where a ball begins: two of five balls lie on the floor (two in five examples slide), and those
above a box often lie on it (clauses that mention boxes cover 772 examples of sliding and bouncing in experiment 2).

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

TOLD_APART: Final[Mapping[tuple[int, str], Mapping[int, int]]] = {(2, "y"): {0: 17847, 3: 49, 4: 51}}
"""By experiment and axis of tables 4.2 and 4.9: printed counts less what another function explains as well, where
Table 4.14 tells that, by the mode's place; flying has what flies straight down."""


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
    floor_speed, air_speed
        Of balls that lie on the floor, and of others.
    over_box, over_ramp, over_both
        Heights that a ball falls from above the box, above the ramp, and above where they touch.
    over_gap
        Its height over the floor between them.
    on_floor
        Chance that a ball between them lies on the floor.
    on_box
        Chance that a ball above the box lies on it.
    """

    room_width: Span = (4.5, 6.0)
    room_height: Span = (2.5, 3.5)
    radius: Span = (0.08, 0.15)
    box_width: Span = (0.6, 1.0)
    box_height: Span = (0.4, 0.9)
    ramp_base: Span = (2.0, 2.6)
    ramp_highest: float = 1.6
    gap: Span = (4.0, 8.0)
    left_share: Span = (0.3, 0.7)
    sink: Span = (0.001, 0.010)
    floor_speed: Span = (3.0, 5.0)
    air_speed: Span = (1.5, 5.0)
    over_box: Span = (0.2, 0.9)
    over_ramp: Span = (0.02, 0.2)
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
        speeds = [float(rng.uniform(*span)) for span in (self.floor_speed, self.air_speed)]
        spans = (self.over_box, self.over_ramp, self.over_both, self.over_gap)
        box, ramp, both, over = (float(rng.uniform(*span)) for span in spans)
        lies, drop = case["ball"] in ("leftmost", "rightmost"), both
        if case["ball"] == "between" and not case.get("touching", True):
            lies = chance < self.on_floor
            height = min(found["ramp_base"] * math.tan(math.radians(incline)), self.ramp_highest)
            drop = over - max(height, found["box_height"])
            # The whole ball fits between them.
            margin = (found["ball_radius"] + CLEARANCE) / (found["gap"] * found["ball_radius"])
            share = share if lies else margin + share * (1.0 - 2.0 * margin)
        elif case["ball"].startswith("above"):
            drop = ramp
            if _stands(case) == "box":
                drop = -found["ball_sink"] if chance < self.on_box else box
        found |= {
            "ball_floor": lies,
            "ball_x": share,
            "ball_drop": drop,
            "ball_speed": speeds[0 if lies else 1],
        }
        return {**found, **case}


SCENES: Final[Mapping[int, ThesisScenes]] = {
    1: ThesisScenes(
        room_width=(3.6, 4.8),
        radius=(0.016, 0.026),
        box_width=(0.3, 0.6),
        box_height=(0.06, 0.14),
        ramp_base=(1.4, 2.0),
        gap=(32.0, 50.0),
        sink=(0.0001, 0.0012),
        floor_speed=(2.9, 4.5),
        air_speed=(1.0, 3.2),
        over_box=(0.02, 0.06),
        over_ramp=(0.02, 0.1),
        over_both=(0.03, 0.08),
        over_gap=(0.03, 0.08),
        on_floor=0.25,
        on_box=0.0,
    ),
    2: ThesisScenes(),
    3: ThesisScenes(),
}
"""Of experiments 1, 2 and 3. Experiment 2 changes "some other simulation parameters", too (§4.4)."""


def _stands(case: Mapping[str, Any]) -> str:
    """What the ball is above: box or ramp; where only one stands, the env's options say which (`ramp`)."""
    if "ramp" not in case:
        return str(case.get("only", "box"))
    return "ramp" if case["ball"] == f"above-{case['ramp']}" else "box"
