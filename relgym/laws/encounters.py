"""Single contacts, kept raw: everything that laws are derived from can be derived again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import MOST_ROWS
from relgym.laws.book import LawBook
from relgym.laws.columns import Sources
from relgym.laws.frames import Bearings
from relgym.laws.free import free_motion
from relgym.laws.pair import Encounters
from relgym.laws.records import Kind, Share
from relgym.laws.shares import EXTENT, find_share
from relgym.laws.store import Store
from relgym.laws.touching import Cast, Contacts
from relgym.scene.axes import WORLD, Axes
from relgym.scene.geometry.vectors import FloatArray
from relgym.scene.schema import SceneSchema

__all__ = ["EncounterStore"]


class _Waiting(NamedTuple):
    """A contact that is kept and wasn't looked at yet: arguments of `EncounterStore.confirm`."""

    contacts: Callable[[NDArray[np.float64]], Contacts]
    cast: Cast
    pair: int
    vector: NDArray[np.float64]
    after: NDArray[np.float64]

    def finite(self) -> bool:
        """Whether all that is kept of it are numbers: those of its scene are, but what is read may not be there."""
        width, sources = self.cast.layout.width, self.cast.sources
        read = [sources[body][1] for body in self.cast.pairs[self.pair] if body in sources]
        return not any((places == width).any() for places in read)


class EncounterStore:
    """A bounded number of single contacts, as they were observed.

    Parameters
    ----------
    schema
        The scenes' schema.
    sources
        Columns of each type whose velocity is learned.
    seed
        Seed of the choice of contacts that make room.
    """

    def __init__(self, schema: SceneSchema, sources: Mapping[str, Sources], *, seed: int) -> None:
        self.sources = sources
        self.kinds: list[Kind] = []
        d = len(Axes.of(schema).used)
        self._d, moving = d, d + any(s.spin for s in sources.values())
        columns = max((len(s.names) for s in sources.values()), default=0)
        widths = {
            "kind": 1, "now_a": moving, "now_b": moving, "after_a": moving, "after_b": moving,
            "normal": d, "centres": d, "angles": len(WORLD), "arm_a": 1, "arm_b": 1, "extent_a": 1, "extent_b": 1,
            "x_a": columns, "x_b": columns,
        }  # fmt: skip
        ends = np.cumsum(list(widths.values())).tolist()
        self._at = {name: slice(end - w, end) for (name, w), end in zip(widths.items(), ends, strict=True)}
        self._store = Store(ends[-1], MOST_ROWS, seed=seed)
        self._waiting: dict[int, _Waiting] = {}

    def __getstate__(self) -> dict[str, Any]:
        self._look_at_waiting()
        return self.__dict__

    def __len__(self) -> int:
        return len(self._store.rows)

    @property
    def shape(self) -> tuple[int, int]:
        """Width of a contact's row, and most contacts kept."""
        return self._store.shape

    @property
    def seen(self) -> int:
        """Number of contacts so far, those no longer kept included."""
        return self._store.seen

    @seen.setter
    def seen(self, count: int) -> None:
        self._store.seen = count

    def add(
        self,
        contacts: Contacts,
        pair: int,
        vector: NDArray[np.float64],
        after: NDArray[np.float64],
        *,
        wrong: bool,
    ) -> None:
        """Keep a contact of a single scene; `after` are all bodies' next velocities (and spins)."""
        kind = contacts.cast.kinds[pair]
        if kind not in self.kinds:
            self.kinds.append(kind)
        row = self._rows(contacts, np.array([pair]), vector[None], after[None])[0]
        cell = self._cell(kind, wrong)
        if np.isfinite(row).all() and (place := self._store.draw(cell)) is not None:
            self._store.put(place, row, cell=cell)
            self._waiting.pop(place, None)

    def confirm(
        self,
        contacts: Callable[[NDArray[np.float64]], Contacts],
        cast: Cast,
        pair: int,
        vector: NDArray[np.float64],
        after: NDArray[np.float64],
    ) -> None:
        """`add` of a contact of a known kind that came as predicted, and of bodies that are where they can be.

        It is looked at, with others, when somebody wants the contacts kept, if it is drawn to be kept and still is.

        Parameters
        ----------
        contacts
            Gives who touches whom in some scenes of the cast's layout, shape ``(n, width)``.
        cast, pair, vector, after
            As of `add`.
        """
        cell, waiting = self._cell(cast.kinds[pair], False), _Waiting(contacts, cast, pair, vector, after)
        # Before anything is drawn: what `add` wouldn't keep, it doesn't count either.
        if waiting.finite() and (place := self._store.draw(cell)) is not None:
            self._store.put(place, np.zeros(self._store.shape[0]), cell=cell)
            self._waiting[place] = waiting

    def _look_at_waiting(self) -> None:
        """Look at the contacts that are kept and nobody has looked at yet."""
        waiting, self._waiting = self._waiting, {}
        casts = {id(each.cast): each.cast for each in waiting.values()}
        for cast in casts.values():
            places = [place for place, each in waiting.items() if each.cast is cast]
            some = [waiting[place] for place in places]
            vectors = np.array([each.vector for each in some])
            after = np.array([each.after for each in some])
            pairs = np.array([each.pair for each in some])
            self._store.rows[places] = self._rows(some[-1].contacts(vectors), pairs, vectors, after)

    def _cell(self, kind: Kind, wrong: bool) -> int:
        return 2 * self.kinds.index(kind) + wrong

    def _rows(
        self,
        contacts: Contacts,
        pairs: NDArray[np.intp],
        vectors: NDArray[np.float64],
        after: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """All that is kept of one contact in each of n scenes, shape ``(n, columns)``; after ``(n, components, K)``."""
        cast, scenes = contacts.cast, np.arange(len(pairs))
        state = cast.padded(vectors)
        there = contacts.bearings(scenes, pairs)
        rows = np.zeros((len(pairs), self._store.shape[0]))
        rows[:, self._at["kind"]] = np.array([[self.kinds.index(cast.kinds[k])] for k in pairs.tolist()])
        for side, bodies in (("a", cast.first[pairs]), ("b", cast.second[pairs])):
            rows[:, self._at[f"now_{side}"]] = state[cast.velocities[:, bodies], scenes].T
            rows[:, self._at[f"after_{side}"]] = after[scenes, :, bodies]
            rows[:, self._at[f"arm_{side}"]] = contacts.arms(scenes, bodies)[:, None]
            extent = contacts.pose[scenes, bodies, 6 + cast.axes.used[0]]
            rows[:, self._at[f"extent_{side}"]] = extent[:, None]
            start = self._at[f"x_{side}"].start
            for body in np.unique(bodies).tolist():
                if body in cast.sources:
                    part, places = np.flatnonzero(bodies == body), cast.sources[body][1]
                    rows[part, start : start + len(places)] = state[places][:, part].T
        still = ~cast.both[pairs]  # what isn't learned keeps its velocity
        rows[still, self._at["after_b"]] = rows[still, self._at["now_b"]]
        rows[:, self._at["normal"]], rows[:, self._at["centres"]] = there.normal.T, there.centres.T
        rows[:, self._at["angles"]] = there.angles.T
        return rows

    def encounters(self, book: LawBook) -> Encounters | None:
        """The contacts as laws see them, with the present free laws; None where none has one."""
        kinds = self._column("kind")[0].astype(np.intp)
        rows = self._store.rows
        usable = [
            k
            for k, (a, b) in enumerate(self.kinds)
            if a in book.free and (b in book.free or b not in self.sources)
        ]
        part = np.flatnonzero(np.isin(kinds, usable))
        if not len(part):
            return None
        free = [self._free(book, kinds, side)[:, part] for side in "ab"]
        now, after = ([self._column(f"{name}_{side}")[:, part] for side in "ab"] for name in ("now", "after"))
        arms = [self._column(f"arm_{side}")[0, part] for side in "ab"]
        relative = [np.asarray(a[: self._d] - b[: self._d]) for a, b in (now, free, after)]
        return Encounters(
            relative[0],
            relative[1],
            relative[2],
            Bearings(
                *(np.ascontiguousarray(rows[part, self._at[n]].T) for n in ("normal", "centres", "angles"))
            ),
            kinds[part],
            tuple(self.kinds),
            book.tolerance,
            part,
            self._store.arrived[part],
            self._store.cells[part] % 2 == 0,  # see `_cell`
            np.stack([a[-1] * arms[0] + b[-1] * arms[1] for a, b in (now, free, after)]),
        )

    def drop(self, places: NDArray[np.intp]) -> None:
        """Keep some contacts no longer (`Encounters.places`)."""
        self._look_at_waiting()
        self._store.drop(places)

    def shares(self, book: LawBook) -> dict[Kind, Share]:
        """How the two bodies of each kind of moving pair share an impulse, as far as that is known."""
        found: dict[Kind, Share] = {}
        kinds = self._column("kind")[0].astype(np.intp)
        free = [self._free(book, kinds, side) for side in "ab"]
        after = [self._column(f"after_{side}") for side in "ab"]
        for k, (a, b) in enumerate(self.kinds):
            if a not in book.free or b not in book.free:
                continue
            part = np.flatnonzero(kinds == k)
            mine, theirs = ((after[s] - free[s])[: self._d, part] for s in (0, 1))
            share = find_share(
                mine,
                mine - theirs,
                self._properties(a, "a", part),
                self._properties(b, "b", part),
                alike=a == b,
                tolerance=book.tolerance,
            )
            if share is not None:
                found[a, b] = share
        return found

    def _properties(self, name: str, side: str, part: NDArray[np.intp]) -> dict[str, FloatArray]:
        columns = self._column(f"x_{side}")[:, part]
        names = self.sources[name].names
        own = {n: columns[k] for k, n in enumerate(names) if "." not in n}
        return own | {EXTENT: self._column(f"extent_{side}")[0, part]}

    def _free(self, book: LawBook, kinds: NDArray[np.intp], side: str) -> FloatArray:
        """Free motion of one side of all contacts; the present velocity of what isn't learned."""
        velocity = self._column(f"now_{side}").copy()
        for k, kind in enumerate(self.kinds):
            name = kind["ab".index(side)]
            if name in book.free:
                part = np.flatnonzero(kinds == k)
                columns = self._column(f"x_{side}")[: len(self.sources[name].names), part]
                known = free_motion(book.free[name], self.sources[name].names, columns)
                velocity[: len(self.sources[name].moving), part] = np.nan
                velocity[: len(known), part] = known
        return velocity

    def _column(self, name: str) -> FloatArray:
        """One field of all contacts, components first."""
        self._look_at_waiting()
        return np.ascontiguousarray(self._store.rows[:, self._at[name]].T)

    # ------------------------------------------------------------------ saving
    def to_json(self) -> dict[str, Any]:
        """Everything but the contacts."""
        return {"kinds": [list(kind) for kind in self.kinds], "store": self._store.to_json()}

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The contacts."""
        self._look_at_waiting()
        return self._store.to_arrays()

    def restore(self, data: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over what `to_json` and `to_arrays` wrote."""
        self.kinds = [(str(a), str(b)) for a, b in data["kinds"]]
        self._store.restore(data["store"], arrays)
