"""Several contacts at once: each sees the free motion and what all others do to it, until nothing changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ROUNDINGS, SWEEPS, TOLD
from relgym.laws.frames import Bearings, axes_of, axis_names
from relgym.laws.joints import Joint, Joints
from relgym.laws.records import AxisLaw, PairLaw
from relgym.laws.touching import Group
from relgym.scene.geometry.vectors import FloatArray, dot

__all__ = ["Composed", "Engaged", "compose", "respond", "within"]


class Composed(NamedTuple):
    """What contacts do together.

    Attributes
    ----------
    velocity
        Next velocities of all bodies (and spins), shape ``(d [+ 1], m, K)``.
    impulse
        Each contact's change of the relative velocity of its two bodies, shape ``(d, m, c)``.
    settled
        Whether the scene's contacts came to agree with each other, shape ``(m,)``.
    """

    velocity: FloatArray
    impulse: FloatArray
    settled: NDArray[np.bool_]


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


def compose(engaged: Engaged, group: Group, joints: Joints, now: FloatArray, free: FloatArray) -> Composed:
    """Next velocities of all bodies in scenes with equally many contacts.

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

    A ball jammed between two rough surfaces needs thousands of sweeps, of which each changes the impulses like the
    one before: such a sequence is continued in a leap now and then (Aitken's extrapolation).
    """
    settling = _Settling(engaged, group, joints, now, free)
    if group.pairs.shape[1] == 1:
        settling.sweep()
        return settling.result(settled=True)
    eps = float(np.finfo(np.float64).eps)
    still = eps * np.maximum(1.0, ROUNDINGS * np.abs(free).max(axis=(0, 2)))
    before = np.empty(0)
    for sweep in range(1, SWEEPS * SWEEPS + 1):
        step = settling.sweep()
        going = np.abs(step).max(axis=(0, 2)) > still[settling.active]
        settling.keep(going)
        if not len(settling.active):
            break
        if sweep % SWEEPS == 0:
            settling.leap(before[:, going], step[:, going])
        before = step[:, going]
    return settling.result(settled=False)


class _Settling:
    """Impulses on their way to where they agree with each other, in scenes with equally many contacts.

    Attributes
    ----------
    velocity, impulse
        Of all scenes, as they are at present.
    active
        Scenes whose impulses still change.
    """

    def __init__(
        self, engaged: Engaged, group: Group, joints: Joints, now: FloatArray, free: FloatArray
    ) -> None:
        self.engaged, self.group, self.joints, self.now = engaged, group, joints, now
        self.velocity = free.copy()
        self.impulse = np.zeros(group.bearings.normal.shape)
        self._focus(np.arange(len(group.pairs)))

    def _focus(self, active: NDArray[np.intp]) -> None:
        self.active = active
        count = self.group.pairs.shape[1]
        self._parts = [_joint(self.engaged, self.group, self.joints, active, k) for k in range(count)]

    def keep(self, going: NDArray[np.bool_]) -> None:
        """Go on with some of the active scenes."""
        if not going.all():
            self._focus(self.active[going])

    def sweep(self) -> FloatArray:
        """Let every contact respond to all others, one after the other; how impulses changed, ``(d, n, c)``."""
        law, active = self.engaged.law, self.active
        steps = np.empty((len(self.impulse), len(active), self.group.pairs.shape[1]))
        for k, (joint, there) in enumerate(self._parts):
            own = self.impulse[:, active, k]
            others = joint.relative(self.velocity) - own
            chosen = self.engaged.chosen[:, self.group.pairs[active, k]]
            new = respond(law.axes, chosen, law.frame, there, joint.relative(self.now), others)
            steps[..., k] = new - own
            joint.apply(steps[..., k], self.velocity)
            self.impulse[:, active, k] = new
        return steps

    def result(self, *, settled: bool) -> Composed:
        """What has become of it; whether scenes that were active to the last count as settled."""
        done = np.ones(self.group.pairs.shape[:1], dtype=np.bool_)
        done[self.active] = settled
        return Composed(self.velocity, self.impulse, done)

    def leap(self, before: FloatArray, step: FloatArray) -> None:
        """Go on as two sweeps have gone, to where a sequence of steps with that ratio ends."""
        kept = along = np.zeros(len(self.active))
        for k in range(step.shape[2]):
            kept = kept + dot(before[..., k], before[..., k])
            along = along + dot(before[..., k], step[..., k])
        ratio = np.clip(along / np.where(kept > 0.0, kept, 1.0), 0.0, 1.0 - 1.0 / TOLD)
        steps = np.where(ratio > 0.5, ratio / (1.0 - ratio), 0.0)
        for k, (joint, _) in enumerate(self._parts):
            joint.apply(steps * step[..., k], self.velocity)
            self.impulse[:, self.active, k] += steps * step[..., k]


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
