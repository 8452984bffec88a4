"""Impulses at the points of an island: each obeys its law given what all others do.

At every point there is a law along the normal and one along the slip direction: two *rows*. A row's own impulse x
changes its own velocity by the yield g of the two bodies there, and through them that of every other row; v = b + G x.
The free motion of a row is everything except itself, u = v - g x, and its law says v' from u. Laws are maxima or minima
of linear pieces, so that the impulses which satisfy all of them solve a linear system as soon as it is known which
piece holds where: that is found by trying (a semismooth Newton method; Qi and Sun, *A nonsmooth version of Newton's
method*, 1993), and else by sweeps over the rows (Gauss-Seidel).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ALIKE, ROUNDED, ROUNDINGS, SWEEPS, TOLD
from relgym.laws.records import ONE, AxisLaw
from relgym.scene.geometry.vectors import FloatArray

__all__ = ["FEATURES", "Rows", "Solved", "solve", "table_of"]

FEATURES = ("u", "v", "u_other", "v_other", "J_n", ONE)
"""What laws of a row read: its own axis' velocities, the other axis', the normal impulse, and 1."""

SLACK = TOLD * ROUNDINGS * float(np.finfo(np.float64).eps)
"""A row obeys its law up to so many times the velocities of its island: what is less tells nothing."""


@dataclass(frozen=True, slots=True)
class Rows:
    """The rows of m islands of c points: first the normals, then the slip directions of all points, r = 2 c.

    Attributes
    ----------
    gain
        How the impulse of each row changes the velocity of each, shape ``(m, r, r)``.
    free, now
        Velocities of the rows without any contact, and at present, shape ``(m, r)``.
    tables
        Weights of each row's pieces on `FEATURES`, shape ``(m, r, pieces, 6)``; pieces that are missing repeat others.
    signs
        1 where a row's law is a maximum, -1 where it is a minimum, shape ``(m, r)``.
    """

    gain: FloatArray
    free: FloatArray
    now: FloatArray
    tables: FloatArray
    signs: FloatArray

    def of(self, some: NDArray[np.intp]) -> Rows:
        """The rows of some islands."""
        return Rows(self.gain[some], self.free[some], self.now[some], self.tables[some], self.signs[some])


@dataclass(frozen=True, slots=True)
class Solved:
    """What became of m islands.

    Attributes
    ----------
    impulse
        Of each row, shape ``(m, r)``.
    settled
        Whether every row obeys its law (as far as that can be), and no other impulses with the same pieces would give
        other velocities; shape ``(m,)``.
    """

    impulse: FloatArray
    settled: NDArray[np.bool_]


def table_of(law: AxisLaw, axis: int, letters: tuple[str, ...], pieces: int) -> tuple[FloatArray, float]:
    """A law's pieces as weights on `FEATURES`, shape ``(pieces, 6)``, and its sign."""
    own, other = letters[axis], letters[1 - axis]
    read = (f"u_{own}", f"v_{own}", f"u_{other}", f"v_{other}", "J_n", ONE)
    table = np.zeros((pieces, len(FEATURES)))
    for k in range(pieces):
        for name, weight in law.pieces[min(k, len(law.pieces) - 1)].terms:
            table[k, read.index(name)] += weight
    return table, -1.0 if law.operator == "min" else 1.0


def solve(rows: Rows) -> Solved:
    """Find impulses that satisfy all laws.

    Notes
    -----
    Cost: one singular value decomposition of ``(r, r)`` a trial. A scene's result doesn't depend on its company.
    """
    m, r = rows.free.shape
    impulse, settled = np.zeros((m, r)), np.zeros(m, dtype=bool)
    active = np.arange(m)
    for round_ in range(SWEEPS):
        part = rows.of(active)
        found, done, fit = _tried(part, impulse[active], stepwise=round_ % 2 == 1)
        impulse[active[done]] = found[done]
        settled[active[done]] = fit[done]
        active = active[~done]
        if not len(active):
            break
        impulse[active] = _swept(rows.of(active), impulse[active])
    # A body that lies flat touches in two points, at heights that differ by their overlaps: both can't stick while it
    # turns by however little. Impulses against each other grow from sweep to sweep, and engines stop somewhere.
    settled[active] = _obeyed(rows.of(active), impulse[active], ALIKE)
    return Solved(impulse, settled)


def _features(rows: Rows, x: FloatArray, sense: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """What the laws read at some impulses, shape ``(m, r, 6)``, and the sense of each row's axis, ``(m, r)``.

    The sense of a slip is that of its free motion, unless one is given.
    """
    m, r = x.shape
    c = r // 2
    yields = np.diagonal(rows.gain, axis1=1, axis2=2)
    u = (rows.free + _times(rows.gain, x)) - yields * x
    if sense is None:
        sense = np.ones((m, r))
        sense[:, c:] = np.where(u[:, c:] < 0.0, -1.0, 1.0)
    own, now = sense * u, sense * rows.now
    push = np.zeros((m, r))
    push[:, c:] = yields[:, c:] * x[:, :c]
    other = [np.concatenate([a[:, c:], a[:, :c]], axis=1) for a in (own, now)]
    return np.stack([own, now, *other, push, np.ones((m, r))], axis=2), sense


def _law(rows: Rows, features: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Velocities that the laws demand along the rows' axes, and which piece holds, shape ``(m, r)``."""
    values = _values(rows, features)
    choice = (rows.signs[..., None] * values).argmax(axis=2)
    return np.take_along_axis(values, choice[..., None], axis=2)[..., 0], choice


def _values(rows: Rows, features: FloatArray) -> FloatArray:
    """What each piece of the rows' laws says, shape ``(m, r, pieces)``."""
    found: FloatArray = (rows.tables * features[:, :, None]).sum(axis=-1)
    return found


def _times(gain: FloatArray, x: FloatArray) -> FloatArray:
    total: FloatArray = (gain * x[:, None]).sum(axis=2)
    return total


def _tried(
    rows: Rows, start: FloatArray, *, stepwise: bool
) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """Solve with the pieces that hold, until they are those that held before.

    Stepwise, on the way to a solution at most one piece changes at once: solving may otherwise go round in circles.
    """
    m = len(start)
    x, done, fit = start.copy(), np.zeros(m, dtype=bool), np.zeros(m, dtype=bool)
    active = np.arange(m)
    for _ in range(SWEEPS):
        part = rows.of(active)
        features, sense = _features(part, x[active])
        _, choice = _law(part, features)
        new, unique, ray = _solved(part, choice, sense)
        right = _obeyed(part, new)
        going = np.where(right[:, None], new, _leapt(part, new, ray, choice))
        if stepwise:
            ahead, _ = _features(part, new, sense)
            way = _until(part, features, ahead - features, choice)[:, None]
            early = (way > 0.0) & (way < 1.0) & ~right[:, None]
            going = np.where(early, x[active] + way * (new - x[active]), going)
        x[active] = going
        done[active[right]], fit[active[right]] = True, unique[right]
        active = active[~right]
        if not len(active):
            break
    return x, done, fit


def _obeyed(rows: Rows, x: FloatArray, slack: float = SLACK) -> NDArray[np.bool_]:
    features, sense = _features(rows, x)
    demanded, _ = _law(rows, features)
    reached = sense * (rows.free + _times(rows.gain, x))
    yields = np.diagonal(rows.gain, axis1=1, axis2=2)
    size = np.maximum(np.abs(rows.free), np.abs(rows.now)) + np.abs(yields * x)
    obeyed: NDArray[np.bool_] = (np.abs(demanded - reached) <= slack * size.max(axis=1, keepdims=True)).all(
        axis=1
    )
    return obeyed & np.isfinite(x).all(axis=1)


def _solved(
    rows: Rows, choice: NDArray[np.intp], sense: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """Impulses at which these pieces hold, of equals the smallest; whether velocities are the only ones; and a ray.

    The ray, shape ``(m, r)``, is how sweeps change impulses without end where the pieces contradict each other.
    """
    m, r = rows.free.shape
    c = r // 2
    weights = np.take_along_axis(rows.tables, choice[..., None, None], axis=2)[:, :, 0]
    yields = np.diagonal(rows.gain, axis1=1, axis2=2)
    other = np.concatenate([np.arange(c, r), np.arange(c)])
    # Velocity less own impulse of each row, as a linear function of all impulses.
    without = rows.gain * (1.0 - np.eye(r))
    turned = sense * sense[:, other]
    matrix = rows.gain - weights[:, :, 0, None] * without
    matrix -= (weights[:, :, 2] * turned)[..., None] * without[:, other]
    pushes = np.zeros((m, r, r))
    pushes[:, np.arange(c, r), np.arange(c)] = yields[:, c:]
    matrix -= (weights[:, :, 4] * sense)[..., None] * pushes
    value = weights[:, :, 0] * rows.free + weights[:, :, 1] * rows.now
    value += turned * (weights[:, :, 2] * rows.free[:, other] + weights[:, :, 3] * rows.now[:, other])
    value += sense * weights[:, :, 5] - rows.free
    # Rows of bodies that are hard to move weigh as much as others.
    scale = 1.0 / np.sqrt(yields)
    matrix = scale[:, :, None] * matrix * scale[:, None]
    left, sizes, right = np.linalg.svd(matrix)
    kept = sizes > ROUNDED * sizes[:, :1]
    inverse = np.where(kept, 1.0 / np.where(kept, sizes, 1.0), 0.0)
    inside = (left * (scale * value)[:, :, None]).sum(axis=1) * inverse
    x = scale * (right * inside[:, :, None]).sum(axis=1)
    # Impulses that the pieces leave open must not move anything.
    loose = np.where(kept[:, :, None], 0.0, right) * scale[:, None]
    moved = np.abs((rows.gain[:, None] * loose[:, :, None]).sum(axis=-1) * scale[:, None])
    against = np.where(kept, 0.0, (left * (scale * value)[:, :, None]).sum(axis=1))
    ray = (left * against[:, None]).sum(axis=2)
    ray = np.where(kept, 0.0, (right * ray[:, None]).sum(axis=2))
    ray = scale * (right * ray[:, :, None]).sum(axis=1)
    return x, moved.max(axis=(1, 2)) <= ALIKE, ray


def _leapt(rows: Rows, x: FloatArray, ray: FloatArray, choice: NDArray[np.intp]) -> FloatArray:
    """Go on along a ray to where another piece of some row's law holds.

    Where two points stick that can't both, impulses against each other grow alike from sweep to sweep, thousands of
    times, until one of them slips.
    """
    x = x.copy()
    active = np.flatnonzero(ray.any(axis=1))
    # Along a ray each slip turns back at most once.
    for _ in range(x.shape[1] // 2 + 1):
        part = rows.of(active)
        here, sense = _features(part, x[active])
        same = (_law(part, here)[1] == choice[active]).all(axis=1)
        active, part, here, sense = active[same], part.of(np.flatnonzero(same)), here[same], sense[same]
        if not len(active):
            break
        ahead, _ = _features(part, x[active] + ray[active], sense)
        x[active] += _until(part, here, ahead - here, choice[active])[:, None] * ray[active]
    return x


def _until(rows: Rows, here: FloatArray, change: FloatArray, choice: NDArray[np.intp]) -> FloatArray:
    """How many rays it takes from what laws read until another piece holds or a slip turns back, ``(m,)``."""
    values, growing = (rows.signs[..., None] * _values(rows, f) for f in (here, change))
    held, rising = (np.take_along_axis(f, choice[..., None], axis=2) for f in (values, growing))
    c = here.shape[1] // 2
    left = np.concatenate([(held - values).reshape(len(here), -1), here[:, c:, 0]], axis=1)
    closing = np.concatenate([(growing - rising).reshape(len(here), -1), -change[:, c:, 0]], axis=1)
    ahead = (closing > 0.0) & (left >= 0.0)
    until = np.where(ahead, left / np.where(ahead, closing, 1.0), np.inf).min(axis=1)
    return np.where(np.isfinite(until), (1.0 + ROUNDED) * until, 0.0)


def _swept(rows: Rows, start: FloatArray) -> FloatArray:
    """Let every row respond to all others, one after the other, a number of times."""
    r = start.shape[1]
    x = start.copy()
    yields = np.diagonal(rows.gain, axis1=1, axis2=2)
    for _ in range(SWEEPS):
        for k in (k for p in range(r // 2) for k in (p, p + r // 2)):
            features, sense = _features(rows, x)
            values = (rows.tables[:, k] * features[:, k, None]).sum(axis=2)
            sign = rows.signs[:, k]
            after = sign * (sign[:, None] * values).max(axis=1)
            x[:, k] = sense[:, k] * (after - features[:, k, 0]) / yields[:, k]
    return x
