"""From scenes to what the learners see: relations, rows and situations, once for all targets."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import ExampleBatch, Vocabulary
from relgym.clustering.columns import SlotSignature, slot_order
from relgym.clustering.features import check_entries, library_of
from relgym.config.constants import ANSWERS, LAYOUTS, MOST_BYTES
from relgym.model.percepts.grouping import distinct
from relgym.model.percepts.sight import Seen, Sight
from relgym.model.predicting.regression import Regressed
from relgym.model.running.compiled import KERNEL
from relgym.program.records import BeyondError
from relgym.scene.context import order_and_ties, slots, state_keys
from relgym.scene.objects import ACTION, ObjectType, SceneLayout, poses
from relgym.scene.relations import Extractor, Relations
from relgym.scene.schema import SceneSchema
from relgym.scene.surroundings import surroundings

__all__ = ["Percept", "Perception", "Situation"]


class Standing(NamedTuple):
    """How an object stands among the others of a layout, whatever the scene.

    Attributes
    ----------
    body
        Its number among the bodies; -1 where it has none.
    head
        Objects of the first slots, which have no order: itself, and those without a body, shape ``(h,)``.
    plain
        Object in each slot where nobody asks which of several alike comes first, shape ``(slots,)``.
    signature
        Types of the slots.
    bodies
        Index of each body, shape ``(K,)``.
    """

    body: int
    head: NDArray[np.intp]
    plain: NDArray[np.intp]
    signature: SlotSignature
    bodies: NDArray[np.intp]


LinedUp: TypeAlias = tuple[NDArray[np.intp], list[bytes]]
"""The other bodies of each scene in canonical order, shape ``(n, K - 1)``, and each scene's relational state."""


class Situation:
    """A batch of scenes as one object sees them; each part is worked out when it is asked for.

    Parameters
    ----------
    percept
        The scenes.
    target
        Index of the object.
    """

    def __init__(self, percept: Percept, target: int) -> None:
        self._percept, self._target = percept, target
        self._standing = percept.perception.standing(percept.layout, target)
        self._body, self._head = self._standing.body, self._standing.head

    @property
    def plain(self) -> NDArray[np.intp]:
        """Object index in each slot where nobody asks which of several alike comes first, shape ``(slots,)``."""
        return self._standing.plain

    @property
    def signature(self) -> SlotSignature:
        """Types of the slots, the same in all scenes."""
        return self._standing.signature

    @cached_property
    def order(self) -> NDArray[np.intp]:
        """Object index in each slot, shape ``(n, slots)``; slot 0 is the object itself."""
        n = len(self._percept)
        if self._body < 0:
            return self.plain[None] if n == 1 else np.broadcast_to(self.plain, (n, len(self.plain)))
        return np.concatenate(
            [self._head[None].repeat(n, axis=0), self._standing.bodies[self._numbers]], axis=1
        )

    @cached_property
    def keys(self) -> list[bytes]:
        """Relational state of each scene under that order."""
        if self._body < 0:
            return [b""] * len(self._percept)
        return self._lined_up[1]

    @cached_property
    def _seen(self) -> Seen | None:
        """What the object sees of a single scene, by the kernel; None: arrays look."""
        return None if self._body < 0 else self._percept.perception.see(self._percept, self._body)

    @property
    def _table(self) -> NDArray[np.bool_]:
        """Which relation holds for which pair of bodies, shape ``(n, R, K, K)``."""
        return self._percept.relations.table if self._seen is None else self._seen.table

    @cached_property
    def examples(self) -> ExampleBatch:
        """Relations and numbers for classifiers."""
        return replace(self._bare, table=self._table) if self._body >= 0 else self._bare

    def preview(self, relations: Collection[str]) -> ExampleBatch:
        """`examples` in which only these binary relations can be told; the others hold nowhere."""
        if self._body < 0:
            return self._bare
        if self._seen is not None:
            return replace(self._bare, table=self._seen.table)
        return replace(self._bare, table=self._percept.relations.table_of(relations))

    @cached_property
    def _bare(self) -> ExampleBatch:
        """`examples` without binary relations."""
        return self._percept.bare_examples(self._target, self._body, self._seen)

    @property
    def _numbers(self) -> NDArray[np.intp]:
        return self._lined_up[0]

    @cached_property
    def _lined_up(self) -> LinedUp:
        return self._percept.perception.lined_up(self._percept, self._body, self._seen)


class Perception:
    """Turns scenes of one schema into percepts; holds only caches.

    Parameters
    ----------
    schema
        The scenes' schema.
    given
        (type, property) pairs whose next values some target may use.
    geometry
        ``"arrays"`` (default) or ``"fcl"``.
    chained
        The same for pairs whose causal order is still to be found.
    features
        Non-linear features, as in `ModelConfig.features`.
    parting
        Whether a body that the target is leaving is left out of its close set, if it touches another one (default).
        It is a contact fact: the thesis knew none, and there such a body is as close as any that is touched.
    """

    def __init__(
        self,
        schema: SceneSchema,
        given: tuple[tuple[str, str], ...] = (),
        geometry: Literal["arrays", "fcl"] = "arrays",
        *,
        chained: tuple[tuple[str, str], ...] = (),
        features: tuple[str, ...] = (),
        parting: bool = True,
    ) -> None:
        self.schema = schema
        self.parting = parting
        self.given = given
        self.chained = chained
        check_entries(features, {t.name: t.properties for t in schema.types if t.name != ACTION})
        self.libraries = {t.name: library_of(features, t.name, t.angles) for t in schema.types}
        self.extractor = Extractor(schema, geometry=geometry)
        self._contact_names = self.extractor.features
        self._pair_names = tuple(sorted({p for t in schema.types if t.has_body for p in _free(t)}))
        self._unary_names = self.extractor.unary_names
        self._forget()

    def _forget(self) -> None:
        self._signatures: dict[tuple[ObjectType, ...], SlotSignature] = {}
        self._standings: dict[tuple[int, int], Standing] = {}
        self._gathers: dict[tuple[int, tuple[int, ...]], NDArray[np.intp]] = {}
        self._layouts: dict[int, SceneLayout] = {}
        self._own_columns: dict[tuple[int, int], NDArray[np.intp]] = {}
        self._unary: dict[int, NDArray[np.bool_]] = {}
        self._features: dict[int, NDArray[np.intp]] = {}
        self._vocabularies: dict[str, Vocabulary] = {}
        self._states: dict[tuple[int, int, bytes, bytes], list[bytes]] = {}
        self._sights: dict[int, Sight | None] = {}

    def __getstate__(self) -> dict[str, Any]:
        # Caches are keyed by identity, which a copy doesn't share.
        caches = (
            "_signatures",
            "_standings",
            "_gathers",
            "_layouts",
            "_own_columns",
            "_unary",
            "_features",
            "_vocabularies",
            "_states",
            "_sights",
        )
        return {name: value for name, value in self.__dict__.items() if name not in caches}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._forget()

    def percept(self, layout: SceneLayout, vectors: NDArray[np.float64]) -> Percept:
        """What is seen of a batch of scenes, shape ``(n, layout.width)``, as far as somebody asks for it."""
        self._layouts[id(layout)] = layout  # keeps it alive, so that its id stays its own
        return Percept(self, layout, vectors)

    def vocabulary(self, target: ObjectType) -> Vocabulary:
        """Names of what classifiers of a type's targets are shown; cached, so that they all share them."""
        if (known := self._vocabularies.get(target.name)) is not None:
            return known
        bodiless = [t for t in self.schema.types if not t.has_body and t.name != target.name]
        own = [
            *_free(target),
            *(f"{t.name}.{p}" for t in sorted(bodiless, key=_by_name) for p in t.properties),
        ]
        binary = tuple(self.extractor.names)
        taken = {*binary, *self._unary_names, *own}
        pair = [*self._contact_names, *(f"other-{p}" if p in taken else p for p in self._pair_names)]
        contact = frozenset({*self._contact_names, "approaching", "approaching-fastest"})
        found = Vocabulary(binary, self._unary_names, tuple(pair), tuple(own), contact)
        self._vocabularies[target.name] = found
        return found

    def signature_of(self, types: tuple[ObjectType, ...]) -> SlotSignature:
        """The slot signature of these types."""
        if (known := self._signatures.get(types)) is None:
            library = self.libraries[types[0].name]
            known = self._signatures[types] = SlotSignature(types, self.given, self.chained, library)
        return known

    def standing(self, layout: SceneLayout, target: int) -> Standing:
        """How an object stands in a layout of which there is a percept; cached."""
        if (known := self._standings.get((id(layout), target))) is None:
            body = layout.bodies.index(target) if target in layout.bodies else -1
            head = np.array(slot_order(layout, target, ()), dtype=np.intp)
            numbers = [k for _, those in slots(layout, body) for k in those.tolist()]
            others = [layout.bodies[k] for k in numbers] if body >= 0 else layout.bodies
            plain = np.array([*head, *others], dtype=np.intp)
            kind = self.signature_of(tuple(layout.types[i] for i in plain))
            bodies = np.array(layout.bodies, dtype=np.intp)
            known = self._standings[id(layout), target] = Standing(body, head, plain, kind, bodies)
            self._layouts[id(layout)] = layout  # keeps it alive, so that its id stays its own
        return known

    def see(self, percept: Percept, body: int) -> Seen | None:
        """What a body sees of a single scene, by the kernel; None: there is none, or it can't look at that."""
        if len(percept) != 1 or (machine := KERNEL.after(1)) is None:
            return None
        key = id(percept.layout)
        if key not in self._sights:
            held = sum(sight.nbytes for sight in self._sights.values() if sight is not None)
            if len(self._sights) >= LAYOUTS or held >= MOST_BYTES:
                self._sights.clear()
            numbers = self.feature_columns(percept.layout)
            try:
                found = Sight(machine, self.extractor, percept.layout, numbers, parting=self.parting)
            except BeyondError:
                self._sights[key] = None
            else:
                self._sights[key] = found
        sight = self._sights[key]
        return None if sight is None else sight.see(percept.vectors[0], body)

    def lined_up(self, percept: Percept, body: int, seen: Seen | None) -> LinedUp:
        """How the other bodies of scenes are lined up for one of them, and what state that makes.

        The state is remembered for single scenes, of which the kernel tells the order: it mostly holds for many steps.
        """
        layout = percept.layout
        if seen is None:
            order, _ = order_and_ties(
                percept.relations, body, lambda rows: poses(layout, percept.vectors[rows])
            )
            return order, state_keys(percept.relations.table, layout, body, order)
        key = (id(layout), body, seen.table.tobytes(), seen.order.tobytes())
        if (known := self._states.get(key)) is None:
            if len(self._states) >= ANSWERS:
                self._states.clear()
            known = self._states[key] = state_keys(seen.table, layout, body, seen.order)
        return seen.order, known

    def gather(self, layout: SceneLayout, sig: SlotSignature, order: tuple[int, ...]) -> NDArray[np.intp]:
        """Columns of a regression row in the concatenation of a state vector and its next one; cached."""
        key = (id(layout), order)
        if (known := self._gathers.get(key)) is None:
            if len(self._gathers) >= ANSWERS:
                self._gathers.clear()
            known = self._gathers[key] = sig.gather(layout, order)
        return known

    def own_columns(self, layout: SceneLayout, target: int) -> NDArray[np.intp]:
        """Where the vocabulary's own features lie in a state vector that a NaN was appended to."""
        key = (id(layout), target)
        if (known := self._own_columns.get(key)) is None:
            places = [layout.column(target, p) for p in _free(layout.types[target])]
            for t in sorted(self.schema.types, key=_by_name):
                if t.has_body or t.name == layout.types[target].name:
                    continue
                where = layout.of_type(t.name)
                places += [
                    layout.column(where[0], p) if len(where) == 1 else layout.width for p in t.properties
                ]
            known = self._own_columns[key] = np.array(places, dtype=np.intp)
        return known

    def unary_table(self, layout: SceneLayout) -> NDArray[np.bool_]:
        """Truth of the unary relations, shape ``(U, bodies)``."""
        if (known := self._unary.get(id(layout))) is None:
            rows = [self.extractor.unary(layout)[name] for name in self._unary_names]
            known = self._unary[id(layout)] = np.array(rows, dtype=bool).reshape(
                len(rows), len(layout.bodies)
            )
        return known

    def feature_columns(self, layout: SceneLayout) -> NDArray[np.intp]:
        """Columns of the bodies' own numbers, shape ``(bodies, P)``; that of a NaN where missing."""
        if (known := self._features.get(id(layout))) is None:
            table = np.full((len(layout.bodies), len(self._pair_names)), layout.width, dtype=np.intp)
            for row, i in enumerate(layout.bodies):
                for k, name in enumerate(self._pair_names):
                    if name in _free(layout.types[i]):
                        table[row, k] = layout.column(i, name)
            known = self._features[id(layout)] = table
        return known


@dataclass(slots=True)
class Percept:
    """A batch of scenes with their relations; situations of its objects are made when asked for."""

    perception: Perception
    layout: SceneLayout
    vectors: NDArray[np.float64]
    _relations: Relations | None = None
    _situations: dict[int, Situation] = field(default_factory=dict)
    regressed: dict[int, tuple[int, Regressed | None]] = field(default_factory=dict)

    @property
    def relations(self) -> Relations:
        """The scenes' relations, extracted when somebody asks for them."""
        if self._relations is None:
            self._relations = self.perception.extractor.extract(self.layout, self.vectors)
        return self._relations

    def __len__(self) -> int:
        return len(self.vectors)

    def situation(self, target: int) -> Situation:
        """How the object with this index is situated."""
        if (known := self._situations.get(target)) is None:
            known = self._situations[target] = Situation(self, target)
        return known

    def rows(
        self, target: int, following: NDArray[np.float64], *, ordered: bool = True
    ) -> NDArray[np.float64]:
        """Regression rows of an object, shape ``(n, columns)``.

        Parameters
        ----------
        target
            Index of the object.
        following
            Next state vectors as far as known, shape ``(n, layout.width)``: primed columns are read from
            them.
        ordered
            Whether it matters which of several objects of a type comes first.
        """
        place = self.situation(target)
        both = np.concatenate([self.vectors, following], axis=1)
        if not ordered or len(self) == 1:
            order = place.order[0] if ordered else place.plain
            return both[:, self.perception.gather(self.layout, place.signature, tuple(order.tolist()))]
        first, which = distinct(place.order)
        orders = [tuple(order) for order in place.order[first].tolist()]
        columns = [self.perception.gather(self.layout, place.signature, order) for order in orders]
        return np.take_along_axis(both, np.array(columns)[which], axis=1)

    def bare_examples(self, target: int, body: int, seen: Seen | None) -> ExampleBatch:
        """What classifiers are shown of an object, its binary relations left aside; `Situation` says more."""
        return self._bodiless(target) if body < 0 else self._embodied(body, target, seen)

    def _padded(self) -> NDArray[np.float64]:
        return np.concatenate([self.vectors, np.full((len(self), 1), np.nan)], axis=1)

    def _embodied(self, body: int, target: int, seen: Seen | None) -> ExampleBatch:
        perception, n = self.perception, len(self)
        padded = self._padded()
        own = padded[:, perception.own_columns(self.layout, target)]
        table = perception.unary_table(self.layout)
        every = table[None] if n == 1 else np.broadcast_to(table, (n, *table.shape))
        nothing = np.zeros((n, 0, *table.shape[1:], *table.shape[1:]), dtype=bool)
        if seen is not None:
            return ExampleBatch(nothing, every, seen.close, seen.pair, own, body, seen.struck)
        numbers = padded[:, perception.feature_columns(self.layout)]
        close, struck, contacts = surroundings(
            self.relations,
            body,
            perception._contact_names,
            offsets=perception.schema.offsets,
            parting=perception.parting,
        )
        pair = np.concatenate([contacts, numbers], axis=2)
        pair[:, body] = np.nan
        return ExampleBatch(nothing, every, close, pair, own, body, struck)

    def _bodiless(self, target: int) -> ExampleBatch:
        """An object without a body stands alone: no relations, only numbers."""
        perception, n = self.perception, len(self)
        own = self._padded()[:, perception.own_columns(self.layout, target)]
        names = len(perception.vocabulary(self.layout.types[target]).pair)
        binary, single = len(perception.extractor.names), len(perception._unary_names)
        return ExampleBatch(
            np.zeros((n, binary, 1, 1), dtype=bool),
            np.zeros((n, single, 1), dtype=bool),
            np.ones((n, 1), dtype=bool),
            np.full((n, 1, names), np.nan),
            own,
            0,
        )


def _by_name(t: ObjectType) -> str:
    return t.name


def _free(t: ObjectType) -> tuple[str, ...]:
    """Properties that are no pose component: those that may be compared with thresholds (R2)."""
    pose = {k for k in t.pose_columns() if k >= 0} if t.has_body else set()
    return tuple(p for k, p in enumerate(t.properties) if k not in pose)
