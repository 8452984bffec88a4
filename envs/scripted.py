"""Scripted policies: how well the tasks can be done, and what those miss who ignore a part of the world.

A policy is a function from a scene (without an action) to an action of the env.
"""

from __future__ import annotations

import math
from itertools import count

import numpy as np
from numpy.typing import NDArray

from relgym.envs.truck_push import BOX_MASS, GRAVITY, TRUCK_MASS
from relgym.envs.truck_scenes import loads, stacks_of
from relgym.scene.objects import Scene, SceneObject

__all__ = ["ball_home", "deliver", "push_as_if_unstacked", "push_knowing"]

_NEAR = 0.01  # units from the goal at which to stop: float32 actions leave less
_CERTAIN = 0.98  # of the greatest deceleration: what is left makes sure that the last step ends at rest

_STRIDE = 0.2  # units that a pusher goes in a decision of 10 steps

_OVER, _BELOW = 0.3, 0.05  # units within which a ball counts as over its goal, and not under it
_SPARE = 1.3  # radii over an obstacle's top


def push_knowing(scene: Scene) -> NDArray[np.float32]:
    """Push to the goal and stop, knowing which box rests on the ground under how many others.

    Parameters
    ----------
    scene
        A scene of ``TruckPush-v0`` with the task ``push``.

    Returns
    -------
    An action, shape ``(1,)``.
    """
    carried = loads(stacks_of(scene))
    return _push(scene, sum(load * scene[name]["friction"] for name, load in carried.items()))


def push_as_if_unstacked(scene: Scene) -> NDArray[np.float32]:
    """Push as if every box stood on the ground: `push_knowing` without an eye for stacks."""
    boxes = (name for stack in stacks_of(scene) for name in stack)
    return _push(scene, sum(scene[name]["friction"] for name in boxes))


def _push(scene: Scene, constants: float) -> NDArray[np.float32]:
    """The action of a controller that takes the sum of friction constants x loads to be `constants`."""
    _, low, high = scene.schema.action_scale[0]
    pushed = sum(map(len, stacks_of(scene)))
    mass = TRUCK_MASS + BOX_MASS * pushed
    rub = BOX_MASS * GRAVITY * constants
    v, d = scene["truck"]["vx"], scene["goal"]["ahead"]
    force = rub + mass * (_planned(v, d, slowing=rub / mass, speeding=(high - rub) / mass) - v)
    share = (np.clip(force, low, high) - low) / (high - low)
    return np.array([2.0 * share - 1.0], dtype=np.float32)


def _planned(v: float, d: float, *, slowing: float, speeding: float) -> float:
    """The next velocity of the fastest plan that ends at rest on the goal.

    A plan takes velocities n b, (n - 1) b, …, b, 0: it covers b n (n + 1) / 2. The first velocity must be within
    reach, and b no more than friction can take away in a step.
    """
    if d <= _NEAR:
        return -math.inf  # brake: only friction makes an end of motion that is exactly 0
    for n in count(1):
        step = 2.0 * d / (n * (n + 1))
        if n * step <= v + speeding and step <= _CERTAIN * slowing:
            return n * step
    raise AssertionError("a long enough plan is slow enough")


def ball_home(scene: Scene) -> NDArray[np.float32]:
    """Bounce over what stands between, glide to the goal, and brake there.

    Thrust along the motion gives bounces energy, thrust against it takes energy away: that is all the height control
    there is, and all that is needed.

    Parameters
    ----------
    scene
        A scene of ``BallGoal-v0``.

    Returns
    -------
    An action, shape ``(2,)``; good for decisions of 5 steps.
    """
    ball, goal = scene["ball"], scene["goal"]
    along, against = (1.0, -1.0) if ball["vy"] > 0.0 else (-1.0, 1.0)
    if abs(goal["dx"]) < _OVER and goal["dy"] < _BELOW:
        return _thrust(ball, goal["dx"], against)
    if ball["py"] < _clearance(scene):
        return _thrust(ball, 0.0, along)
    return _thrust(ball, goal["dx"], 1.0)


def deliver(scene: Scene) -> NDArray[np.float32]:
    """Go behind the parcel, seen from the goal, and push it there; go round it again when it slips away.

    Parameters
    ----------
    scene
        A scene of ``BoxPush-v0``.

    Returns
    -------
    An action, shape ``(2,)``; good for decisions of 1 to 10 steps.
    """
    pusher, parcel, goal = scene["pusher"], scene["parcel"], scene["goal"]
    way = np.array([goal["dx"], goal["dy"]])
    ahead = way / max(float(np.hypot(*way)), 1e-9)
    side = np.array([-ahead[1], ahead[0]])
    from_parcel = np.array([pusher["px"] - parcel["px"], pusher["py"] - parcel["py"]])
    behind, beside = -float(from_parcel @ ahead), float(from_parcel @ side)
    radius, reach = pusher["sx"] / 2.0, float(np.hypot(parcel["sx"], parcel["sy"])) / 2.0
    if behind > radius and abs(beside) < 0.3 * reach:
        # Pushing on one side of the centre turns the parcel: pushing at the middle needs to be corrected all the time.
        wanted = ahead - 5.0 * beside * side
    else:
        wanted = _round_to(from_parcel, -(reach + radius + 0.1) * ahead, reach + radius + 0.04) / _STRIDE
    return np.asarray(wanted / max(1.0, float(np.abs(wanted).max())), dtype=np.float32)


def _round_to(place: NDArray[np.float64], there: NDArray[np.float64], clear: float) -> NDArray[np.float64]:
    """Direction from a place to another one, round a circle about the origin where that is in the way."""
    way = there - place
    along = float(np.clip(-(place @ way) / max(float(way @ way), 1e-12), 0.0, 1.0))
    if float(np.hypot(*(place + along * way))) >= clear:
        return way
    out = place / max(float(np.hypot(*place)), 1e-9)
    round_ = np.array([-out[1], out[0]])
    if float(round_ @ way) < 0.0:
        round_ = -round_
    return _STRIDE * round_ + 3.0 * max(0.0, clear + 0.02 - float(np.hypot(*place))) * out


def _thrust(ball: SceneObject, way: float, up: float) -> NDArray[np.float32]:
    """Thrust that leads along x by `way` and brakes in time, with a given thrust upwards."""
    return np.array([np.clip(4.0 * way - 150.0 * ball["vx"], -1.0, 1.0), up], dtype=np.float32)


def _clearance(scene: Scene) -> float:
    """The height at which nothing stands between the ball and the point over its goal."""
    ball, dx = scene["ball"], scene["goal"]["dx"]
    r, low, high = ball["sx"] / 2, min(ball["px"], ball["px"] + dx), max(ball["px"], ball["px"] + dx)
    floor = scene["floor"]["py"] + scene["floor"]["sy"] / 2
    standing = (o for o in scene if o.type.has_body and abs(o["py"] - o["sy"] / 2 - floor) < 1e-6)
    between = (o for o in standing if o["px"] - o["sx"] / 2 < high + r and o["px"] + o["sx"] / 2 > low - r)
    return max((o["py"] + o["sy"] / 2 + _SPARE * r for o in between), default=-math.inf)
