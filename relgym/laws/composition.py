"""Several contacts at once: each sees the free motion and what all others do to it, until nothing changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.laws.frames import Bearings, axes_of, axis_names
from relgym.laws.joints import Joint, Joints
from relgym.laws.records import AxisLaw, PairLaw
from relgym.laws.touching import Group
from relgym.scene.geometry.vectors import FloatArray, dot

__all__ = ["SWEEPS", "Engaged", "compose", "respond", "within"]

SWEEPS = 400
"""Most sweeps over the contacts of a scene."""

SETTLED = 1e-15
"""Change of an impulse, in length per step, below which it has settled."""


@dataclass(frozen=True, slots=True)
class Engaged:
    """The pairs of a cast, with the laws in force.

    Attributes
    ----------
    law
        The law of pairs.
    chosen
        For each axis and pair the number of the law in ``law.axes[axis]``, -1 where there is none; shape
        ``(axes, P)``.
    first, second
        Bodies of each pair, shape ``(P,)``.
    """

    law: PairLaw
    chosen: NDArray[np.intp]
    first: NDArray[np.intp]
    second: NDArray[np.intp]


def respond(
    laws: Sequence[Sequence[AxisLaw]],
    chosen: NDArray[np.intp],
    frame: str,
    bearings: Bearings,
    now: FloatArray,
    free: FloatArray,
) -> FloatArray:
    """Change of the relative velocity at n contacts, shape ``(d, n)``.

    Parameters
    ----------
    laws, chosen
        Laws of each axis, and which of them holds at each contact, shape ``(axes, n)``.
    frame, bearings
        Where the laws are stated.
    now, free
        Relative velocities before, and without the contact, shape ``(d, n)``.
    """
    axes = axes_of(frame, bearings, free)
    letters = axis_names(frame, len(now))
    features: dict[str, FloatArray] = {}
    for letter, axis in zip(letters, axes, strict=True):
        features[f"u_{letter}"], features[f"v_{letter}"] = dot(free, axis), dot(now, axis)
    change = np.zeros(free.shape)
    for k, (letter, axis) in enumerate(zip(letters, axes, strict=True)):
        u = features[f"u_{letter}"]
        after = u
        for number in np.unique(chosen[k][chosen[k] >= 0]).tolist():
            after = np.where(chosen[k] == number, laws[k][number].values(features, u), after)
        features[f"J_{letter}"] = after - u
        change = change + features[f"J_{letter}"] * axis
    return change


def compose(
    engaged: Engaged, group: Group, joints: Joints, now: FloatArray, free: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Next velocities of all bodies in scenes with equally many contacts.

    Returns velocities of the shape of `free` and each contact's change of the relative velocity of its two
    bodies, ``(d, m, c)``.

    Parameters
    ----------
    engaged, group
        The laws and the contacts.
    joints
        Who takes which part of each contact's impulse.
    now, free
        Velocities (and spins) before, and of free bodies, shape ``(d [+ 1], m, K)``.

    Notes
    -----
    The velocity before stays what it is; only the free motion of a pair is replaced by *everything except
    itself*. Gauss-Seidel sweeps; every scene stops when its own impulses have settled, so that a scene's
    result doesn't depend on its company. Cost O(sweeps * contacts).
    """
    velocity = free.copy()
    impulse = np.zeros(group.bearings.normal.shape)
    active = np.arange(len(group.pairs))
    for _ in range(SWEEPS):
        change = np.zeros(len(active))
        for k in range(group.pairs.shape[1]):
            joint, there = _joint(engaged, group, joints, active, k)
            own = impulse[:, active, k]
            others = joint.relative(velocity) - own
            chosen = engaged.chosen[:, group.pairs[active, k]]
            new = respond(engaged.law.axes, chosen, engaged.law.frame, there, joint.relative(now), others)
            joint.apply(new - own, velocity)
            impulse[:, active, k] = new
            change = np.maximum(change, np.abs(new - own).max(axis=0))
        active = active[change > SETTLED]
        if not len(active) or group.pairs.shape[1] == 1:
            break
    return velocity, impulse


def _joint(
    engaged: Engaged, group: Group, joints: Joints, scenes: NDArray[np.intp], contact: int
) -> tuple[Joint, Bearings]:
    """One contact of some scenes, and the directions there."""
    pair = group.pairs[scenes, contact]
    there = group.bearings.take((scenes, contact))
    return joints.at(scenes, contact, engaged.first[pair], engaged.second[pair], there.normal), there


def within(
    engaged: Engaged, group: Group, joints: Joints, velocity: FloatArray, impulse: FloatArray, slack: float
) -> NDArray[np.bool_]:
    """Contacts that don't turn bodies back in a sense in which none was seen to, shape ``(m, c)``.

    A contact turns a body back where the body moves, along an axis, in a sense in which it wouldn't without
    the contact. What a contact slows down, or lets go, needs no precedent.

    Parameters
    ----------
    engaged, group, joints
        The laws, the contacts and their bodies.
    velocity, impulse
        What `compose` gave.
    slack
        Velocities up to this count as 0.
    """
    seen = np.ones(group.pairs.shape, dtype=bool)
    scenes = np.arange(len(group.pairs))
    for k in range(group.pairs.shape[1]):
        joint, there = _joint(engaged, group, joints, scenes, k)
        after = joint.relative(velocity)
        free = after - impulse[..., k]
        for j, axis in enumerate(axes_of(engaged.law.frame, there, free)):
            value, without = dot(after, axis), dot(free, axis)
            back, forth = (value < -slack) & (without >= -slack), (value > slack) & (without <= slack)
            below, above = np.array([law.signs for law in engaged.law.axes[j]]).T[
                :, engaged.chosen[j][group.pairs[:, k]]
            ]
            seen[:, k] &= ~(back & ~below) & ~(forth & ~above)
    return seen
