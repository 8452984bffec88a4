"""What modes say of examples: their functions laid over slots, and the role bindings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import Example
from relgym.classification.exemplars import Exemplars
from relgym.clustering.clusterer import ModeClusterer
from relgym.clustering.columns import SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE, Mode
from relgym.clustering.roles import Binding, bind
from relgym.config import ModelConfig
from relgym.config.constants import SEARCHED_CELLS
from relgym.model.target.casting import Casting
from relgym.scene.objects import SceneLayout

__all__ = ["BoundFunctions", "ModeFunctions", "Verdict", "bodies_of"]


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a property model says of n examples: arrays of shape ``(n,)``; NaN where it predicts nothing."""

    values: NDArray[np.float64]
    modes: NDArray[np.int64]
    outcomes: NDArray[np.int8]
    margins: NDArray[np.float64]


class BoundFunctions:
    """Functions laid over signatures; a cache.

    A refit changes a mode's function and not its id, so each entry remembers whose it is.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], tuple[Mode, Binding | None]] = {}

    def __getstate__(self) -> dict[str, Any]:
        return {"_known": {}}  # keyed by identity, which a copy doesn't share

    def of(
        self, signature: SlotSignature, number: int, mode: Mode, places: tuple[int, ...] = ()
    ) -> Binding | None:
        """A function over a signature's columns, asked for by number; None where its roles have no objects.

        `places`: as for `bind`.
        """
        known = self._known.get((id(signature), number))
        if known is None or known[0] is not mode:
            known = self._known[id(signature), number] = (mode, bind(mode, signature, places))
        return known[1]

    def clear(self) -> None:
        """Forget all."""
        self._known.clear()


class ModeFunctions:
    """The functions of a target's modes, with their roles filled.

    Parameters
    ----------
    clusterer, casting
        Knows the modes and binds objects to their roles.
    config
        Free parameters.

    Attributes
    ----------
    places
        Of modes with roles that several objects without a body could play, and that no relation can describe
        therefore: numbers of the players among the others of their types, with which every example so far agrees. A
        single choice is taken: the first of the other agents, say, is always bound to it.
    """

    def __init__(self, clusterer: ModeClusterer, casting: Casting, config: ModelConfig) -> None:
        self.config = config
        self.clusterer = clusterer
        self.casting = casting
        self.bound = BoundFunctions()
        self.places: dict[int, frozenset[tuple[int, ...]]] = {}

    def mode(self, number: int) -> Mode:
        """The mode of that id."""
        return self.clusterer.clusters[number].mode

    def values_many(
        self, table: ExampleTable, rows: NDArray[np.integer], ids: tuple[int, ...]
    ) -> NDArray[np.float64]:
        """What the modes predict on rows of the table, shape ``(n, len(ids))``; NaN where roles are open."""
        values = np.full((len(rows), len(ids)), np.nan)
        signatures = table.signature_ids[rows]
        for number in np.unique(signatures):
            part = np.flatnonzero(signatures == number)
            values[part] = self.values(table.signatures[int(number)], table.x[rows[part]], ids)
        return values

    def binding(self, signature: SlotSignature, mode: int) -> Binding | None:
        """A mode's function over a signature's columns; None where its roles have no objects."""
        return self.bound.of(signature, mode, self.mode(mode), self.place(mode))

    def place(self, mode: int) -> tuple[int, ...]:
        """Number of the player of each role of a mode but the target's, where that is always the same; else nothing."""
        places = self.places.get(mode, frozenset())
        return next(iter(places)) if len(places) == 1 else ()

    def find_places(self, table: ExampleTable) -> None:
        """Find anew where those stand that are bound to roles which relations can't describe."""
        clusterer = self.clusterer
        self.places = {}
        for number, cluster in clusterer.clusters.items():
            roles = cluster.mode.open_roles
            if not roles or any(role.type in self.casting.vocabulary.unary for role in roles):
                continue
            examples = np.flatnonzero(clusterer.labels == number)
            if (found := self._agreed(table, number, examples)) is not None:
                self.places[number] = found
        self.bound.clear()

    def confirm_places(self, table: ExampleTable, number: int, mode: int) -> None:
        """Keep only those places with which another example of a mode agrees, too."""
        if (known := self.places.get(mode)) and (
            found := self._agreed(table, mode, np.array([number]))
        ) is not None:
            self.places[mode] = known & found
            if self.places[mode] != known:
                self.bound.clear()

    def places_to_json(self) -> list[Any]:
        """Plain data."""
        return [[mode, sorted(list(each) for each in found)] for mode, found in sorted(self.places.items())]

    def restore_places(self, data: Iterable[Any]) -> None:
        """Take over what `places_to_json` wrote."""
        self.places = {int(mode): frozenset(map(tuple, found)) for mode, found in data}
        self.bound.clear()

    def _agreed(
        self, table: ExampleTable, mode: int, examples: NDArray[np.intp]
    ) -> frozenset[tuple[int, ...]] | None:
        """Numbers of the players with which all of some examples of a mode agree; None where there is no choice."""
        clusterer, found = self.clusterer, None
        kinds = [role.type for role in clusterer.clusters[mode].mode.open_roles]
        signatures = table.signature_ids[clusterer.rows[examples]]
        for number in np.unique(signatures):
            binding = clusterer.clusters[mode].binding(table, int(number))
            if binding is None or not binding.open:
                continue
            part = examples[signatures == number][-(SEARCHED_CELLS // len(binding.assignments)) :]
            off = np.abs(binding.values(table.x[clusterer.rows[part]]) - clusterer.y[part][:, None])
            agree = (off <= clusterer.scale.tolerance).all(axis=0)
            alike = [binding.signature.slots_by_type[kind] for kind in kinds]
            here = frozenset(
                tuple(among.index(slot) for among, slot in zip(alike, slots, strict=True))
                for slots in binding.slots[agree].tolist()
            )
            found = here if found is None else found & here
        return found

    def values(
        self, signature: SlotSignature, x: NDArray[np.float64], ids: tuple[int, ...]
    ) -> NDArray[np.float64]:
        """What the modes predict on n rows with one signature, shape ``(n, len(ids))``; NaN where roles are open."""
        values = np.full((len(x), len(ids)), np.nan)
        for k, mode in enumerate(ids):
            binding = self.binding(signature, mode)
            if binding is not None and not binding.open:
                values[:, k] = binding.values(x)[:, 0]
        return values

    def values_one(self, signature: SlotSignature, x: list[float], ids: tuple[int, ...]) -> list[float]:
        """`values` of a single row, bit for bit."""
        values = []
        for mode in ids:
            binding = self.binding(signature, mode)
            known = binding is not None and not binding.open
            values.append(binding.value(x) if known and binding is not None else float("nan"))
        return values

    def played(self, table: ExampleTable, numbers: NDArray[np.intp], mode: int) -> NDArray[np.int64]:
        """Bodies in a mode's embodied roles, by the assignment that fits each example best (§3.2.4).

        Shape ``(n, roles)``.
        """
        if mode == NOISE or not self.casting.embodied(self.mode(mode)):
            return np.zeros((len(numbers), 0), dtype=np.int64)
        if not table.signatures[0].types[0].has_body:  # what has no body stands alone in its examples
            return np.zeros((len(numbers), 0), dtype=np.int64)
        roles = self.mode(mode).open_roles
        chosen = [k for k, role in enumerate(roles) if role in self.casting.embodied(self.mode(mode))]
        rows, y = self.clusterer.rows[numbers], self.clusterer.y[numbers]
        cluster, scale = self.clusterer.clusters[mode], self.clusterer.scale
        _, assignment = cluster.errors(table, rows, y, scale)
        played = np.full((len(numbers), len(chosen)), -1, dtype=np.int64)
        signatures = table.signature_ids[rows]
        for number in np.unique(signatures):
            binding = cluster.binding(table, int(number))
            if binding is None:
                continue
            part = np.flatnonzero(signatures == number)
            slots = binding.slots[assignment[part]][:, chosen]
            played[part] = np.take_along_axis(table.bodies[rows[part]], slots, axis=1)
        return played

    def played_one(self, table: ExampleTable, number: int, mode: int) -> list[int]:
        """`played` of one example."""
        if mode == NOISE or not table.signatures[0].types[0].has_body:
            return []
        embodied = self.casting.embodied(self.mode(mode))
        if not embodied:
            return []
        row, y = int(self.clusterer.rows[number]), float(self.clusterer.y[number])
        cluster = self.clusterer.clusters[mode]
        binding = cluster.binding(table, int(table.signature_ids[row]))
        chosen = [k for k, role in enumerate(self.mode(mode).open_roles) if role in embodied]
        if binding is None:
            return [-1] * len(chosen)
        _, assignment = cluster.closest_one(table, row, y, self.clusterer.scale)
        slots = binding.roles_of(assignment)
        return [int(table.bodies[row, slots[k]]) for k in chosen]

    def recast(self, table: ExampleTable, exemplars: Exemplars) -> None:
        """Bind objects anew to the roles of the remembered examples' modes."""
        numbers = exemplars.rows.astype(np.intp)
        labels = self.clusterer.labels[numbers]
        roles = exemplars.columns["roles"]
        roles[:] = -1
        for mode in np.unique(labels[labels != NOISE]):
            part = np.flatnonzero(labels == mode)
            played = self.played(table, numbers[part], int(mode))
            width = min(played.shape[1], roles.shape[1])
            roles[part, :width] = played[:, :width]

    def cast(
        self, mode: int, binding: Binding, example: Example, order: NDArray[np.intp], layout: SceneLayout
    ) -> tuple[int, ...] | None:
        """Slots of a mode's open roles, by the role classifiers; None if they can't be filled."""
        bodies = bodies_of(order, layout)
        place = {body: slot for slot, body in enumerate(bodies) if body >= 0}
        played = self.casting.assign(self.mode(mode), example, tuple(place), sure=self.config.abstain)
        if played is None:
            return None
        cast = iter(played)
        slots = []
        for role, forced in zip(self.mode(mode).open_roles, binding.forced, strict=True):
            embodied = role.type in self.casting.vocabulary.unary
            body = next(cast) if embodied else -1
            if forced < 0:
                if not embodied:
                    return None
                slots.append(place[body])
        return tuple(slots)


def bodies_of(order: NDArray[np.intp], layout: SceneLayout) -> tuple[int, ...]:
    """Number of the body in each slot, -1 for bodiless objects."""
    numbers = {index: body for body, index in enumerate(layout.bodies)}
    return tuple(numbers.get(int(index), -1) for index in order)
