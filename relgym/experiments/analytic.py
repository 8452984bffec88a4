"""The modes by physics: what a perfect learner of world-axis linear functions would end with.

Ball: a contact with unit normal n, elasticity e and friction mu changes the velocity v (units per step) to

    v' = v + g + J n - mu J s t,   J = -((1 + e) v.n + g.n),   t = rot90(n),

where s is the direction of sliding along t; or, when friction suffices to end the sliding, to ``v' = -e
(v.n) n``. For a given normal both are linear in v. The same function often covers several cases: they are
one mode.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from relgym.envs.truck_push import BOX_MASS, GRAVITY, TRUCK_MASS
from relgym.envs.truck_scenes import partitions
from relgym.scene.objects import Float1D, Float2D

__all__ = [
    "GRAVITY_STEP",
    "REST",
    "AnalyticMode",
    "AnalyticModes",
    "Case",
    "TruckMode",
    "analytic_modes",
    "contact_law",
    "truck_modes",
]

GRAVITY_STEP = 9.8e-4
"""Change of the ball's y velocity in one free step, in units per step."""

REST = 1e-12
"""Largest |v_n|, in units per step, of a ball that slides rather than bounces."""

_SAME = 1e-12

SLIPS = ("forward", "backward", "halt")
"""Directions of sliding along rot90 of the normal (on a floor: left, right), and friction ending it."""


@dataclass(frozen=True, slots=True, order=True)
class Case:
    """What happens to the ball, physically.

    Parameters
    ----------
    surface
        ``"none"`` (flying), ``"floor"``, ``"ceiling"``, ``"left face"``, ``"right face"`` or ``"slope"``.
    slip
        ``"none"`` without friction, otherwise one of `SLIPS`.
    friction
        The coefficient mu of the surface.
    sliding
        Whether the ball has no velocity along the normal of a level floor.
    """

    surface: str
    slip: str = "none"
    friction: float = 0.0
    sliding: bool = False

    def __str__(self) -> str:
        if self.surface == "none":
            return "fly"
        verb = "slide" if self.sliding else "bounce"
        return f"{verb}, {self.surface}" + (
            f", {self.slip}, mu {self.friction:g}" if self.slip != "none" else ""
        )


@dataclass(frozen=True, slots=True)
class AnalyticMode:
    """One linear function ``v_i' = weights . (vx, vy) + intercept``, and the cases it covers."""

    weights: tuple[float, float]
    intercept: float
    cases: tuple[Case, ...]

    @property
    def name(self) -> str:
        """Name of the first case that it covers."""
        return str(self.cases[0])

    def predict(self, velocities: Float2D) -> Float1D:
        """Predicted component for velocities of shape ``(n, 2)``."""
        values: Float1D = (
            self.weights[0] * velocities[:, 0] + self.weights[1] * velocities[:, 1] + self.intercept
        )
        return values


@dataclass(frozen=True)
class AnalyticModes:
    """All analytic modes of a world, for both components of the ball's velocity."""

    x: tuple[AnalyticMode, ...]
    y: tuple[AnalyticMode, ...]

    def explaining(self, axis: str, before: Float2D, after: Float2D, tol: float = 1e-9) -> NDArray[np.bool_]:
        """Which modes explain each transition, whatever really happened.

        Parameters
        ----------
        axis
            ``"x"`` or ``"y"``.
        before, after
            Velocities at t and t + 1, shape ``(n, 2)``, in units per step.
        tol
            Largest residual, in units per step. Nothing lies between 1e-14 and 1e-6: a step fits or it
            doesn't.

        Returns
        -------
        Shape ``(n, number of modes)``.
        """
        modes, column = (self.x, 0) if axis == "x" else (self.y, 1)
        return np.stack([np.abs(m.predict(before) - after[:, column]) <= tol for m in modes], axis=1)

    def index(self, axis: str, case: Case) -> int:
        """Number of the mode that covers `case`; -1 when none does."""
        modes = self.x if axis == "x" else self.y
        return next((k for k, mode in enumerate(modes) if case in mode.cases), -1)


def contact_law(
    normal: Sequence[float], elasticity: float, friction: float, slip: str
) -> tuple[Float2D, Float1D]:
    """Linear law of an active contact.

    Parameters
    ----------
    normal
        Unit vector along which the ball is pushed.
    elasticity, friction
        Coefficients e and mu.
    slip
        ``"none"``, or one of `SLIPS`.

    Returns
    -------
    Matrix A of shape ``(2, 2)`` and vector b of shape ``(2,)`` with ``v' = A v + b``.
    """
    n = np.asarray(normal, dtype=np.float64)
    if slip == "halt":
        return -elasticity * np.outer(n, n), np.zeros(2)
    t, g = np.array([-n[1], n[0]]), np.array([0.0, -GRAVITY_STEP])
    push = n - friction * {"none": 0.0, "forward": 1.0, "backward": -1.0}[slip] * t
    return np.eye(2) - (1 + elasticity) * np.outer(push, n), g - float(g @ n) * push


def surface_normals(incline: float) -> dict[str, tuple[float, float]]:
    """Normal of each kind of surface in a room whose ramps have this incline (degrees)."""
    angle = math.radians(incline)
    return {
        "floor": (0.0, 1.0),
        "ceiling": (0.0, -1.0),
        "left face": (-1.0, 0.0),
        "right face": (1.0, 0.0),
        "slope": (math.sin(angle), math.cos(angle)),
    }


def analytic_modes(incline: float, elasticity: float, friction: float | Sequence[float]) -> AnalyticModes:
    """All modes of a room (tables 4.2, 4.9 and 4.17, and those that the tables lack).

    Parameters
    ----------
    incline
        Angle of the ramps, in degrees.
    elasticity
        Coefficient e of all contacts.
    friction
        Coefficient mu of all contacts; several where rooms of several frictions are learned together (§4.5).
    """
    frictions = (friction,) if isinstance(friction, (int, float)) else tuple(friction)
    laws: dict[Case, tuple[Float2D, Float1D]] = {Case("none"): (np.eye(2), np.array([0.0, -GRAVITY_STEP]))}
    for mu, (surface, normal) in product(frictions, surface_normals(incline).items()):
        for slip in SLIPS if mu > 0 else ("none",):
            matrix, offset = contact_law(normal, elasticity, mu, slip)
            laws[Case(surface, slip, mu)] = matrix, offset
            if surface == "floor":
                # With v_y = 0 its weight can't be told: tables 4.2 and 4.17 list such functions without v_y.
                laws[Case(surface, slip, mu, sliding=True)] = matrix * np.array([1.0, 0.0]), offset
    return AnalyticModes(_distinct(laws, 0), _distinct(laws, 1))


def _distinct(laws: Mapping[Case, tuple[Float2D, Float1D]], row: int) -> tuple[AnalyticMode, ...]:
    """One mode for all cases with the same function of component `row`."""
    functions: list[tuple[Float1D, list[Case]]] = []
    for case, (matrix, offset) in laws.items():
        function = np.array([*matrix[row], offset[row]])
        known = next((cases for f, cases in functions if np.abs(f - function).max() <= _SAME), None)
        if known is None:
            functions.append((function, [case]))
        else:
            known.append(case)
    return tuple(
        AnalyticMode((float(f[0]), float(f[1])), float(f[2]), tuple(cases)) for f, cases in functions
    )


@dataclass(frozen=True, slots=True)
class TruckMode:
    """``v' = v + force_weight F + sum_i friction_weights[i] C_i``, C_i of stack i's lowest box (§3.2.6).

    `heights` are those of the stacks, the greatest first; their order on the ground doesn't matter.
    """

    heights: tuple[int, ...]
    force_weight: float
    friction_weights: tuple[float, ...]

    @property
    def name(self) -> str:
        """Such as ``stacks of 2, 1``."""
        return "stacks of " + ", ".join(map(str, self.heights))


def truck_modes(n_boxes: int) -> tuple[TruckMode, ...]:
    """All modes of the truck's velocity; for three boxes the three rows of Table 3.1."""
    mass = TRUCK_MASS + BOX_MASS * n_boxes
    return tuple(
        TruckMode(heights, 1.0 / mass, tuple(-height * BOX_MASS * GRAVITY / mass for height in heights))
        for heights in partitions(n_boxes)
    )
