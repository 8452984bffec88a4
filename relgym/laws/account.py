"""Why the laws say what they say of one scene: each contact, its laws and the piece that holds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import DIGITS, TOLD
from relgym.laws.book import LawBook
from relgym.laws.composition import Engaged, compose
from relgym.laws.frames import axes_of, axis_names, turned
from relgym.laws.impulses import solve
from relgym.laws.records import AxisLaw, Piece
from relgym.laws.touching import Contacts, Group
from relgym.laws.turning import eases, rows_of
from relgym.scene.geometry.vectors import FloatArray, dot

__all__ = ["AxisAccount", "ContactAccount", "accounts", "happens"]

NORMALS: Final = "nc"
"""Axes from one body to the other."""


@dataclass(frozen=True, slots=True)
class AxisAccount:
    """One axis of a contact.

    Attributes
    ----------
    axis
        Its letter.
    direction
        Its unit vector.
    law
        The law, such as ``max(u_n, -0.9 v_n)``.
    piece
        The piece that holds.
    value
        Relative velocity after the contact along the axis.
    impulse
        By how much the contact changed it.
    happens
        What that is, in a word or two: what touches at no speed and stays so rests, and doesn't bounce.
    """

    axis: str
    direction: tuple[float, ...]
    law: str
    piece: str
    value: float
    impulse: float
    happens: str


@dataclass(frozen=True, slots=True)
class ContactAccount:
    """One contact of a scene: its objects, the first of which moves, and what happens along each axis."""

    objects: tuple[str, str]
    frame: str
    axes: tuple[AxisAccount, ...]

    def __str__(self) -> str:
        lines = [f"{self.objects[0]} touches {self.objects[1]}"]
        for axis in self.axes:
            where = ", ".join(f"{c:.4g}" for c in axis.direction)
            lines.append(
                f"  {axis.happens}: v'_{axis.axis} = {axis.law} = {axis.value:.7g}, where {axis.piece} holds"
                f" (impulse {axis.impulse:.4g}, {axis.axis} = ({where}))"
            )
        return "\n".join(lines)


def accounts(
    book: LawBook, contacts: Contacts, vectors: NDArray[np.float64], digits: int = DIGITS
) -> tuple[ContactAccount, ...]:
    """Every contact of a single scene on which the laws have a say, in the order of the pairs.

    Parameters
    ----------
    book, contacts, vectors
        The laws, the scene's contacts and its state vector as a row, shape ``(1, layout.width)``.
    digits
        Significant digits of coefficients.
    """
    motion = book.motion(contacts, vectors)
    engaged = book.engaged(contacts.cast)
    if engaged is None:
        return ()
    if contacts.points is not None:
        return tuple(_of_points(book, engaged, contacts, vectors, digits, motion.known[0]))
    return tuple(
        account
        for group in contacts.groups()
        if motion.known[0, contacts.cast.first[group.pairs[0]]].all()
        for account in _of_group(book, engaged, contacts, vectors, group, digits)
    )


def _of_points(
    book: LawBook,
    engaged: Engaged,
    contacts: Contacts,
    vectors: NDArray[np.float64],
    digits: int,
    known: NDArray[np.bool_],
) -> Iterator[ContactAccount]:
    """Every point of contact, in the order of the islands."""
    cast, points = contacts.cast, contacts.points
    assert points is not None, "checked by the caller"
    now, free, columns = book.free_motion(cast, vectors)
    yields = eases(book.inertia, contacts, columns)
    sense = np.array([1.0, 1.0, cast.axes.turn])[:, None, None]
    moves = np.isin(np.arange(len(cast.layout.bodies)), cast.movers)
    for island in points.islands(cast.first, cast.second, moves):
        rows, _ = rows_of(island, cast, yields, engaged.law, engaged.chosen, sense * now, sense * free)
        count = island.rows.shape[1]
        for m in range(len(island.rows)):
            pairs = island.points.pair[m]
            if not known[cast.first[pairs]].all():
                continue
            one = rows.of(np.array([m]))
            impulse = solve(one).impulse
            others = (one.free + (one.gain * impulse[:, None]).sum(axis=2)) - np.diagonal(
                one.gain[0]
            ) * impulse
            for k, pair in enumerate(pairs.tolist()):
                normal = island.points.normal[:, m, k]
                side = turned(normal) * (-1.0 if others[0, count + k] < 0.0 else 1.0)
                axes = [normal[:, None], side[:, None]]
                # Velocities of the point's surfaces against each other; along t the other row's impulse counts as well.
                before, without = (
                    values[0, k] * normal + values[0, count + k] * turned(normal)
                    for values in (one.now, others)
                )
                told = _axes(
                    engaged, pair, axes, before[:, None], without[:, None], digits, TOLD * book.tolerance,
                    one.gain[0, count + k, count + k] / one.gain[0, k, k],
                )  # fmt: skip
                names = [
                    cast.layout.names[cast.layout.bodies[side_[pair]]] for side_ in (cast.first, cast.second)
                ]
                yield ContactAccount((names[0], names[1]), engaged.law.frame, tuple(told))


def _of_group(
    book: LawBook,
    engaged: Engaged,
    contacts: Contacts,
    vectors: NDArray[np.float64],
    group: Group,
    digits: int,
) -> Iterator[ContactAccount]:
    cast = contacts.cast
    now, free, columns = book.free_motion(cast, vectors)
    joints = book.joints(contacts, group, columns)
    velocity, impulse, _ = compose(engaged, group, joints, now, free)
    for k, pair in enumerate(group.pairs[0].tolist()):
        a, b = cast.first[[pair]], cast.second[[pair]]
        there = group.bearings.take((slice(None), k))
        joint = joints.at(np.zeros(1, dtype=np.intp), k, a, b, there.normal)
        others = joint.relative(velocity) - impulse[:, :, k]
        axes = axes_of(engaged.law.frame, there, others)
        told = _axes(engaged, pair, axes, joint.relative(now), others, digits, TOLD * book.tolerance)
        names = [cast.layout.names[cast.layout.bodies[body]] for body in (int(a[0]), int(b[0]))]
        yield ContactAccount((names[0], names[1]), engaged.law.frame, tuple(told))


def _axes(
    engaged: Engaged,
    pair: int,
    axes: list[FloatArray],
    before: FloatArray,
    others: FloatArray,
    digits: int,
    slack: float,
    pressed: float = 1.0,
) -> Iterator[AxisAccount]:
    letters = axis_names(engaged.law.frame, len(before))
    features: dict[str, FloatArray] = {}
    for letter, axis in zip(letters, axes, strict=True):
        features[f"u_{letter}"], features[f"v_{letter}"] = dot(others, axis), dot(before, axis)
    for k, (letter, axis) in enumerate(zip(letters, axes, strict=True)):
        law: AxisLaw = engaged.law.axes[k][engaged.chosen[k, pair]]
        free = features[f"u_{letter}"]
        values = [float(piece.values(features, free)[0]) for piece in law.pieces]
        holds = int(np.argmax(values) if law.operator == "max" else np.argmin(values))
        impulse = values[holds] - float(free[0])
        features[f"J_{letter}"] = np.array([pressed * impulse])
        yield AxisAccount(
            letter,
            tuple(float(c) + 0.0 for c in axis[:, 0]),
            law.formula(digits),
            law.pieces[holds].formula(digits),
            values[holds],
            impulse,
            happens(law.pieces[holds], letter, float(features[f"v_{letter}"][0]), slack),
        )


def happens(piece: Piece, letter: str, before: float, slack: float) -> str:
    """What a contact does along an axis where a piece of its law holds.

    Parameters
    ----------
    piece
        The piece.
    letter
        The axis.
    before
        Relative velocity along it before the contact.
    slack
        Velocities up to this count as 0.
    """
    weights = dict(piece.terms)
    if piece.releases(f"u_{letter}"):
        if len(weights) > 1:
            return "is slowed by friction"
        return "lets go" if letter in NORMALS else "slides freely"
    if not weights:
        return "is held" if letter in NORMALS else "sticks"
    if set(weights) == {f"v_{letter}"}:
        if abs(before) <= slack:
            return "rests"
        return "bounces" if weights[f"v_{letter}"] < 0.0 else "goes on"
    return "is pushed"
