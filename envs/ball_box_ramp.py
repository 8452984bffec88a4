"""The ball-box-ramp domain (§4.1) as a Gymnasium env."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from relgym.arguments import refusing
from relgym.envs.arguments import Coefficient, check_options, checked_count, numbered
from relgym.envs.ball_env import BallEnv, body_values
from relgym.envs.ball_scenes import BALL_PLACES, draw_room, option_names
from relgym.errors import ConfigError
from relgym.scene.objects import Float1D

__all__ = ["BallBoxRampEnv", "configurations"]


def configurations() -> tuple[dict[str, Any], ...]:
    """The thesis' 40 initial configurations (Table 4.1), as reset options."""
    return tuple(
        {"ramp": ramp, "touching": touching, "ball": place, "direction": direction}
        for ramp in ("left", "right")
        for touching in (True, False)
        for place in BALL_PLACES
        for direction in ("left", "right")
    )


class BallBoxRampEnv(BallEnv):
    """A ball flies, bounces and slides in a room with a box and a ramp; nobody acts.

    Description
    -----------
    The world of the thesis' experiments (§4.1). A ball that doesn't rotate moves under gravity among a
    floor, a ceiling, two walls and what stands on the floor. One step is 0.01 s. The pair of position and
    velocity at one step determines the next: with g = (0, -9.8e-4), a contact's unit normal n, elasticity e
    and friction mu, ``J = max(0, -((1+e) v.n + g.n))`` and ``v' = v + g + J n + friction``, where friction
    opposes sliding and is at most ``mu J``. Balls have elasticity and friction 1, so that a contact has the
    coefficients of the obstacle.

    Action Space
    ------------
    ``Discrete(1)``: watch. The schema has no action object.

    Observation Space
    -----------------
    ``Dict``, object name -> ``Box(float64)`` in the order of the type's properties:

    ===================  ========================================  =======  ========  =======
    property             meaning                                   unit     min       max
    ===================  ========================================  =======  ========  =======
    px, py, pz           position of the centre (pz = 0)           unit     -1e4      1e4
    rx, ry, rz           rotation (0)                              radian   -pi       pi
    sx, sy, sz           full extents; a ball's diameter           unit     0         1e3
    vx, vy (balls only)  last displacement, p_t - p_{t-1}          unit     -1        1
    ===================  ========================================  =======  ========  =======

    Objects: ``ball``; ``box``, ``ramp``; ``floor``, ``ceiling``, ``left_wall``, ``right_wall``. A ramp's
    vertical side is on its left, wherever it stands; its incline is sy / sx.

    Rewards
    -------
    Always 0.

    Starting State
    --------------
    Room 4.5–6 wide and 2.5–3.5 high; ball radius 0.08–0.15; box 0.6–1 wide, 0.4–0.9 high; ramp base 1–1.5,
    scaled down when it would be higher than 1. Box and ramp touch, or are 4–8 ball radii apart, with 30–70
    % of the free floor on their left. *Leftmost* and *rightmost*: on the floor, sunk 1–10 mm, 3–6 units/s;
    *above-left* and *above-right*: 0.1–0.8 over the object; *between*: 0.05–0.6 over the higher one, or on
    the floor in half of the cases where there is one between them. In the air: 0.5–4 units/s sideways.
    Everything is shifted by up to 5 along both axes. All uniform. The first velocity is the displacement
    that led to the first position.

    Reset options, all optional: ``ramp`` ("left", "right"), ``touching`` (bool), ``ball`` ("leftmost",
    "above-left", "between", "above-right", "rightmost"), ``direction`` ("left", "right"), and every other
    draw: ``room_width``, ``room_height``, ``left_share``, ``gap`` (in ball radii), ``shift_x``,
    ``shift_y``, ``box_width``, ``box_height``, ``ramp_base``, ``ball_radius``, ``ball_floor`` (bool),
    ``ball_x`` (0–1 along the place), ``ball_sink``, ``ball_drop`` (below 0: lower than that), ``ball_speed``;
    ``ramp_highest``, which isn't drawn. `reset_options` lists
    those of an instance: objects beyond the first of their kind have options of their own (``box2_width``,
    ``ball2``, ``ball2_direction``), and ``order`` replaces ``ramp`` when the standing objects aren't a box
    and a ramp. ``info["configuration"]`` holds what was drawn: passed as options, it gives the same scene
    again.

    Episode End
    -----------
    Never terminates; truncated after 200 steps by the registered time limit.

    Info
    ----
    ``info["contacts"]``: a tuple of `Contact`, the engine's own record of what touches what in the current
    state, which is what decides the next step. At reset also ``info["scene"]`` and
    ``info["configuration"]``.

    Arguments
    ---------
    incline
        Angle of the ramps in degrees, in (0, 90); a number, or a mapping by ramp name.
    elasticity, friction
        Coefficients e (0 to 1) and mu (>= 0) of a contact: a number, or a mapping by object name or type
        (``{"floor": 0.1, "ramp2": 0.3}``, the rest as by default). Two balls take the entry ``"ball"``.
    objects
        Kinds of the objects that stand on the floor: ``("box",)``, ``("box", "ramp", "ramp")``, or counts
        ``{"box": 1, "ramp": 2}``. Beyond two of them the room is 2 units wider for each.
    balls
        How many balls (>= 1): ``ball``, ``ball2``, …
    type_names
        ``"shape"``: ball, box, ramp, floor, wall, ceiling. ``"thesis"``: the coefficients are part of the
        type's name (§4.2), friction first: ``box_0.1_0.9``, ``ramp_0.3_0.8_60``; the parent is ``box``,
        ``ramp``.

    Version History
    ---------------
    * v0: initial version.
    """

    @refusing(ConfigError)
    def __init__(
        self,
        incline: Coefficient = 30.0,
        elasticity: Coefficient = 0.9,
        friction: Coefficient = 0.0,
        objects: Sequence[str] | Mapping[str, int] = ("box", "ramp"),
        balls: int = 1,
        type_names: str = "shape",
        render_mode: str | None = None,
    ) -> None:
        super().__init__(
            balls=numbered("ball", checked_count("balls", balls, 1, 100)),
            incline=incline,
            elasticity=elasticity,
            friction=friction,
            objects=objects,
            type_names=type_names,
            action_space=spaces.Discrete(1),
            render_mode=render_mode,
        )

    @property
    def reset_options(self) -> tuple[str, ...]:
        """Names of all options of `reset`."""
        return tuple(option_names(self._standing, self._balls))

    def _begin(self, options: Mapping[str, Any], *, rng: np.random.Generator) -> Float1D:
        check_options(options, self.reset_options)
        room = draw_room(self._standing, self._balls, self._inclines, options=options, rng=rng)
        self._configuration = room.configuration
        state = np.concatenate(
            [body_values(name, room.objects[name], self._balls) for name in self._layout.names]
        )
        return self._landed(state)

    def _advance(self, state: Float1D, action: Any) -> Float1D:
        before, _ = self._motion(state)
        self._engine.step()
        return self._read(state.copy(), before)

    def _hidden(self) -> Any:
        return tuple(self._engine.velocities())

    def _restore(self, vector: Float1D, hidden: Any) -> None:
        self._state = self._landed(vector)
        if hidden is not None:
            # The landing made the contacts known; now remove its rounding.
            self._state = vector.copy()
            self._engine.resume(self._motion(vector)[0], hidden)
