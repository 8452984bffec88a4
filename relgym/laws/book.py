"""The laws learned so far, and the next velocities that they predict in a batch of scenes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import TOLD
from relgym.html import html_table
from relgym.laws.columns import Sources, vector_types
from relgym.laws.composition import Engaged, compose, within
from relgym.laws.frames import POINT
from relgym.laws.free import free_motion
from relgym.laws.impulses import Solved, solve
from relgym.laws.inertia import Inertia
from relgym.laws.joints import Joints
from relgym.laws.points import Points
from relgym.laws.records import FreeLaw, Kind, PairLaw, Share
from relgym.laws.shares import EXTENT, share_values
from relgym.laws.text import law_rows
from relgym.laws.touching import Cast, Contacts, Group
from relgym.laws.turning import eases, precedented, push, rows_of
from relgym.scene.geometry.vectors import FloatArray
from relgym.scene.objects import SceneLayout, Target
from relgym.scene.schema import SceneSchema

__all__ = ["LawBook", "Motion"]


@dataclass(frozen=True, slots=True)
class Motion:
    """What the laws predict for n scenes.

    Attributes
    ----------
    velocity
        Next velocities of all K bodies, and behind them their spins where some type has one; shape
        ``(d [+ 1], n, K)``.
    known
        Whether that is a prediction, shape ``(n, K)``: no alternative law disagrees, and it lies within experience.
        False for bodies that aren't movers.
    stated
        Whether any law applies, shape ``(n, K)``.
    touched
        Whether the body touches something, shape ``(n, K)``.
    columns
        What the laws read of each mover, by body number: shape ``(names, n)``.
    """

    velocity: FloatArray
    known: NDArray[np.bool_]
    stated: NDArray[np.bool_]
    touched: NDArray[np.bool_]
    columns: Mapping[int, FloatArray]

    def scene(self, number: int) -> Motion:
        """What they predict for one of the scenes."""
        part = slice(number, number + 1)
        columns = {body: x[:, part] for body, x in self.columns.items()}
        return Motion(
            self.velocity[:, part], self.known[part], self.stated[part], self.touched[part], columns
        )


class LawBook:
    """Free laws, the law of pairs, and how moving pairs share an impulse.

    Parameters
    ----------
    schema
        The scenes' schema.
    sources
        Columns of each type whose velocity is learned.

    Attributes
    ----------
    free
        The free law of each type that has one.
    pair
        The law of touching pairs, once there is one.
    shares
        Shares of moving pairs, by kind.
    inertia
        What is known of masses and moments, where bodies turn.
    turning
        Whether a type turns that isn't round: then laws are about points of contact.
    tolerance
        Largest residual of an explained velocity component.
    """

    def __init__(self, schema: SceneSchema, sources: Mapping[str, Sources]) -> None:
        self.schema = schema
        self.sources = sources
        self.free: dict[str, FreeLaw] = {}
        self.pair: PairLaw | None = None
        self.shares: dict[Kind, Share] = {}
        self.inertia = Inertia()
        self.turning = any(s.turns for s in sources.values())
        self.tolerance = float(np.finfo(np.float64).eps)
        self._casts: dict[SceneLayout, Cast] = {}
        self._latest: tuple[SceneLayout, Cast] | None = None
        self._rounded: dict[int, tuple[Cast, NDArray[np.intp]]] = {}
        self._engaged: dict[SceneLayout, list[Engaged]] = {}

    def _repr_html_(self) -> str:
        rows = [
            (row.subject, row.statement, f"{row.examples:,}", f"{row.unexplained:,}")
            for row in law_rows(self, self.free)
        ]
        return html_table("Laws of motion", ("about", "law", "examples", "unexplained"), rows)

    def cast(self, layout: SceneLayout) -> Cast:
        """What a layout means for the laws; cached."""
        if self._latest is not None and self._latest[0] is layout:  # a layout's hash takes long
            return self._latest[1]
        if (known := self._casts.get(layout)) is None:
            known = self._casts[layout] = Cast.of(self.schema, layout, self.sources)
        self._latest = (layout, known)
        return known

    def rounded(self, cast: Cast) -> NDArray[np.intp]:
        """Columns of the movers' positions and velocities, whose rounding the laws inherit; cached."""
        if (known := self._rounded.get(id(cast))) is None or known[0] is not cast:
            places = []
            for body in cast.movers:
                i = cast.layout.bodies[body]
                own = (*cast.layout.types[i].pose_columns()[:3], *cast.layout.types[i].velocity_columns())
                places += [cast.layout.offsets[i] + k for k in own if k >= 0]
            known = self._rounded[id(cast)] = (cast, np.array(places, dtype=np.intp))
        return known[1]

    def components(self, type_name: str) -> tuple[str, ...]:
        """Properties of a type that the laws predict: its velocity, and its spin if contacts act on surfaces."""
        sources = self.sources[type_name]
        surfaces = self.turning or (self.pair is not None and self.pair.frame == POINT)
        return sources.moving if surfaces else sources.velocity

    def forget(self) -> None:
        """The laws changed: forget what was worked out from them."""
        self._engaged.clear()

    # ------------------------------------------------------------------ prediction
    def motion(self, contacts: Contacts, vectors: NDArray[np.float64]) -> Motion:
        """Next velocities in n scenes.

        Parameters
        ----------
        contacts
            Who touches whom.
        vectors
            State vectors, shape ``(n, layout.width)``.
        """
        cast = contacts.cast
        now, velocity, columns = self.free_motion(cast, vectors)
        stated = np.zeros((len(vectors), len(cast.layout.bodies)), dtype=bool)
        for body in cast.movers:
            stated[:, body] = np.isfinite(velocity[: self._count(cast, body), :, body]).all(axis=0)
        motion = Motion(velocity, stated.copy(), stated, np.zeros_like(stated), columns)
        if contacts.points is not None:
            self._push(contacts, contacts.points, now, motion)
            return motion
        for group in contacts.groups():
            self._collide(contacts, group, now, motion)
        return motion

    def _push(self, contacts: Contacts, points: Points, now: FloatArray, motion: Motion) -> None:
        """Let contacts at points act, island by island, in place."""
        if not len(points):
            return
        cast = contacts.cast
        moves = np.zeros(len(cast.layout.bodies), dtype=bool)
        moves[list(cast.movers)] = True
        laws = self._engaged_pairs(cast)
        yields = eases(self.inertia, contacts, motion.columns)
        sense = np.array([1.0, 1.0, cast.axes.turn])[:, None, None]
        before, free = sense * now, sense * motion.velocity
        after = free.copy()
        slack = TOLD * self.tolerance
        for island in points.islands(cast.first, cast.second, moves):
            scene = island.points.scene
            ends = [side[island.points.pair] for side in (cast.first, cast.second)]
            for end in ends:
                motion.touched[scene, end] = True
            sure = np.zeros(len(scene), dtype=bool)
            stated = sure
            for number, engaged in enumerate(laws):
                rows, known = rows_of(island, cast, yields, engaged.law, engaged.chosen, before, free)
                some = np.flatnonzero(known)
                solved = Solved(np.zeros(rows.free.shape), np.zeros(len(known), dtype=bool))
                if len(some):
                    found = solve(rows.of(some))
                    solved.impulse[some], solved.settled[some] = found.impulse, found.settled
                if not number:
                    first, stated = solved, known
                    chosen = engaged.chosen[:, island.points.pair]
                    sure = known & solved.settled & precedented(rows, solved, engaged.law, chosen, slack)
                    continue
                # Of impulses that may be shared out differently only what they do to the points counts.
                change = (rows.gain * (solved.impulse - first.impulse)[:, None]).sum(axis=2)
                sure &= known & (np.abs(change) <= slack).all(axis=1)
            if laws:
                push(island, cast, yields, first, after, stated)
            for end in ends:
                motion.stated[scene, end] &= stated[:, None]
                motion.known[scene, end] &= sure[:, None]
        motion.velocity[:] = sense * np.where(motion.stated, after, free)

    def free_motion(
        self, cast: Cast, vectors: NDArray[np.float64]
    ) -> tuple[FloatArray, FloatArray, dict[int, FloatArray]]:
        """Velocities (and spins) now and next, if nothing touched anything, and what free laws read (`Motion`)."""
        state = cast.padded(vectors)
        now = state[cast.velocities].transpose(0, 2, 1)
        velocity, columns = now.copy(), {}
        for body in cast.movers:
            sources, places = cast.sources[body]
            columns[body] = state[places]
            law = self.free_law(sources.type.name)
            velocity[: len(sources.moving), :, body] = np.nan
            if law is not None:
                velocity[: len(law.components), :, body] = free_motion(law, sources.names, columns[body])
        return now, velocity, columns

    def free_law(self, type_name: str) -> FreeLaw | None:
        """The free law of a type; of one never seen that of its kin, if all types with the same parent agree."""
        if type_name in self.free:
            return self.free[type_name]
        parent = self.schema.type(type_name).parent
        kin = [
            law
            for t in self.schema.types
            if t.parent == parent and (law := self.free.get(t.name)) is not None
        ]
        stated = {law.says() for law in kin}
        known = all(law.reads() <= set(self.sources[type_name].names) for law in kin)
        return kin[0] if parent is not None and len(stated) == 1 and known else None

    def on(self, schema: SceneSchema, targets: tuple[Target, ...]) -> LawBook:
        """The same laws for scenes of another schema, of which `targets` are predicted."""
        book = LawBook(
            schema, {t.name: Sources.of(schema, t, targets) for t in vector_types(schema, targets)}
        )
        book.free, book.pair, book.shares = dict(self.free), self.pair, dict(self.shares)
        book.inertia, book.tolerance = self.inertia, self.tolerance
        return book

    def _count(self, cast: Cast, body: int) -> int:
        """Number of components that the laws predict of a mover."""
        return len(self.components(cast.sources[body][0].type.name))

    def _collide(self, contacts: Contacts, group: Group, now: FloatArray, motion: Motion) -> None:
        """Let the contacts of some scenes act, in place."""
        cast, scenes = contacts.cast, group.scenes
        involved = np.zeros((len(scenes), len(cast.layout.bodies)), dtype=bool)
        rows = np.arange(len(scenes))[:, None]
        involved[rows, cast.first[group.pairs]] = True
        involved[rows, cast.second[group.pairs]] = True
        motion.touched[scenes] = involved
        laws = self._engaged_pairs(cast)
        if not laws:
            motion.stated[scenes] &= ~involved
            motion.known[scenes] &= ~involved
            return
        joints = self.joints(contacts, group, motion.columns)
        before, free = now[:, scenes], motion.velocity[:, scenes]
        after, impulse, settled = compose(laws[0], group, joints, before, free)
        least = laws[0].chosen[:, group.pairs].min(axis=0)
        lawful = ((least >= 0) & joints.known()).all(axis=1, keepdims=True)
        governed = slice(None) if laws[0].law.frame == POINT else slice(cast.dimensions)
        stated = ~involved | (lawful & np.isfinite(after[governed]).all(axis=0))
        slack = TOLD * self.tolerance
        seen = within(laws[0], group, joints, after, impulse, slack).all(axis=1, keepdims=True)
        sure = stated & (~involved | (seen & settled[:, None]))
        for alternative in laws[1:]:
            other = compose(alternative, group, joints, before, free).velocity
            sure &= (np.abs(other - after)[governed] <= slack).all(axis=0) | ~involved
        motion.velocity[:, scenes] = np.where(involved & stated, after, free)
        motion.stated[scenes] &= stated
        motion.known[scenes] &= sure

    def joints(self, contacts: Contacts, group: Group, columns: Mapping[int, FloatArray]) -> Joints:
        """Who takes which part of what the contacts do; NaN where that is unknown."""
        cast, scenes = contacts.cast, group.scenes[:, None]
        arms = [contacts.arms(scenes, bodies[group.pairs]) for bodies in (cast.first, cast.second)]
        grip = None
        if self.pair is not None and self.pair.frame == POINT:
            grips = np.array([self.pair.grip(kind) for kind in cast.kinds])[group.pairs]
            grip = np.where(np.any(arms, axis=0), grips, 1.0)
        return Joints(self._share(contacts, group, columns), grip, np.stack(arms))

    def _share(
        self, contacts: Contacts, group: Group, columns: Mapping[int, FloatArray]
    ) -> NDArray[np.float64]:
        """The first body's share of each impulse, shape ``(m, c)``; 1 where the other doesn't move."""
        cast = contacts.cast
        share = np.where(cast.both[group.pairs], np.nan, 1.0)
        for pair in np.unique(group.pairs[cast.both[group.pairs]]).tolist():
            known = self.shares.get(cast.kinds[pair])
            if known is None:
                continue
            rows, k = np.nonzero(group.pairs == pair)
            scenes = group.scenes[rows]
            a, b = (
                self._properties(contacts, int(body), columns, scenes)
                for body in (cast.first[pair], cast.second[pair])
            )
            share[rows, k] = share_values(known, a, b)
        return share

    def _properties(
        self, contacts: Contacts, body: int, columns: Mapping[int, FloatArray], scenes: NDArray[np.intp]
    ) -> dict[str, FloatArray]:
        """What a share may read of a body: its own properties and its size."""
        names = contacts.cast.sources[body][0].names
        own = {name: columns[body][k, scenes] for k, name in enumerate(names) if "." not in name}
        return own | {EXTENT: contacts.pose[scenes, body, 6 + contacts.cast.axes.used[0]]}

    # ------------------------------------------------------------------ laws in force
    def engaged(self, cast: Cast) -> Engaged | None:
        """The law of pairs laid over a cast; None while there is none."""
        return next(iter(self._engaged_pairs(cast)), None)

    def _engaged_pairs(self, cast: Cast) -> list[Engaged]:
        """The law of pairs laid over a cast, then its alternatives; cached."""
        if (known := self._engaged.get(cast.layout)) is None:
            laws = [] if self.pair is None else [self.pair, *_alternatives(self.pair)]
            known = [Engaged(law, _chosen(law, cast.kinds), cast.first, cast.second) for law in laws]
            self._engaged[cast.layout] = known
        return known


def _chosen(law: PairLaw, kinds: tuple[Kind, ...]) -> NDArray[np.intp]:
    """Number of the law of each pair along each axis, shape ``(axes, P)``; -1 where none is reliable."""
    numbers = np.full((len(law.axes), len(kinds)), -1, dtype=np.intp)
    for k, laws in enumerate(law.axes):
        for pair, kind in enumerate(kinds):
            found = law.law_of(k, kind)
            if found is not None and found.trusted(kind):
                numbers[k, pair] = laws.index(found)
    return numbers


def _alternatives(law: PairLaw) -> Iterator[PairLaw]:
    """The law with one axis' law replaced by one that explains the examples equally well."""
    for k, laws in enumerate(law.axes):
        for j, each in enumerate(laws):
            for operator, pieces in each.alternatives:
                other = replace(each, operator=operator, pieces=pieces, alternatives=())
                changed = (*laws[:j], other, *laws[j + 1 :])
                yield replace(law, axes=(*law.axes[:k], changed, *law.axes[k + 1 :]))
