"""What a world model is made of: schema, config, what perceives, and one property model per target."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import finite
from relgym.classification.rows import RowPool
from relgym.clustering.columns import SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.config import ModelConfig
from relgym.config.constants import LAYOUTS, MOST_TARGETS
from relgym.errors import ConfigError, ObservationError, QueryError, SchemaError
from relgym.model.percepts.perception import Percept, Perception
from relgym.model.percepts.scenes import Arrival, mismatch, next_values, passage
from relgym.model.percepts.screening import Screen
from relgym.model.predicting.chaining import Inquiry, Look, in_order
from relgym.model.predicting.motion import Laws, possible_targets
from relgym.model.predicting.regression import Regressed, Regression
from relgym.model.target.property_model import PropertyModel
from relgym.scene.objects import ACTION, TASK, TERMINATED, Scene, SceneLayout, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.sizes import check_sizes
from relgym.scheduling.agenda import Agenda

__all__ = ["Answer", "Parts"]


class Answer(NamedTuple):
    """One property of one object that is predicted.

    Attributes
    ----------
    target, model
        Which property of which type it is, and the model of that.
    number, column
        Which object, and where the property stands in a state vector.
    turn
        Length of a full turn, of an angle; 0 of anything else.
    """

    target: Target
    model: PropertyModel
    number: int
    column: int
    turn: float


class Parts:
    """The state of a world model; learning, querying and storage are functions of it.

    Parameters
    ----------
    schema
        The scenes' schema.
    config
        Free parameters.
    targets
        What to learn, in causal order; None: every property that turns out to change.

    Attributes
    ----------
    open
        Whether targets are found while learning.
    targets
        Targets so far, in causal order.
    models
        The property model of each target.
    by_type
        Targets of each type, in causal order, and their models.
    tables
        Regression rows by type name, shared by all targets of a type.
    pools
        What their classifiers remember of the numbers of objects, by type name.
    regressions
        What least squares on everything says, by type name.
    perception
        Turns scenes into relations and rows.
    laws
        Laws of motion; None with ``frames="world"``.
    looks
        Targets to be looked at for laws with next values, one in a step.
    inquiry
        The look that is being taken.
    agenda
        How much may be searched in a step, and what waits for its next piece.
    idle
        Whether it is known that nothing is under way or due, as long as nothing is learned.
    screen
        Tells gross errors in observations, which aren't learned from.
    arrival
        The scene that the latest transition came to; None before any.
    """

    def __init__(self, schema: SceneSchema, config: ModelConfig, targets: Sequence[Target] | None) -> None:
        check_targets(schema, targets or ())
        self.schema = schema
        self.config = config
        self.open = targets is None
        self.targets: tuple[Target, ...] = ()
        self.by_type: dict[str, tuple[tuple[Target, PropertyModel], ...]] = {}
        given = tuple(dict.fromkeys(pair for t in targets or () for pair in t.given))
        chained = tuple((t.type, t.property) for t in possible_targets(schema)) if self.open else ()
        self.perception = Perception(
            schema,
            given,
            config.geometry,
            chained=chained,
            features=config.features,
            parting=config.classification.contact_facts,
        )
        self.models: dict[Target, PropertyModel] = {}
        self.tables: dict[str, ExampleTable] = {}
        self.pools: dict[str, RowPool] = {}
        self.regressions: dict[str, Regression] = {}
        self.looks: list[Look] = []
        self.inquiry: Inquiry | None = None
        self.agenda = Agenda(earned=config.cells_per_step, most=config.most_cells, saved=config.saved_cells)
        self.idle = False
        self.screen = Screen()
        self.arrival: Arrival | None = None
        self.laws: Laws | None = None
        if config.frames == "auto":
            self.laws = Laws(schema, None if targets is None else tuple(targets), config)
        self._kin: dict[int, SceneSchema] = {}
        self._fine: Scene | None = None  # the last one whose numbers were found finite
        self._checked: Scene | None = None  # the last one that passed `check`
        self._known: dict[int, SceneLayout] = {}
        self._answers: dict[int, tuple[SceneLayout, dict[tuple[str, str], Answer]]] = {}
        self._undiscovered: dict[int, tuple[SceneLayout, list[tuple[Target, int, int]]]] = {}
        for target in targets or ():
            self.add_target(target)

    def __getstate__(self) -> dict[str, Any]:
        by_identity = ("_kin", "_known", "_answers", "_undiscovered")  # a copy's objects are others
        return self.__dict__ | {name: {} for name in by_identity} | {"_fine": None, "_checked": None}

    def admits(self, scene: object) -> bool:
        """Whether a scene is known to follow the schema and holds finite numbers; sizes aren't asked."""
        if not isinstance(scene, Scene):
            return False
        schema = scene.schema
        if schema is not self.schema and self._kin.get(id(schema)) is not schema:
            return False  # `check` looks at it once
        return self._finite(scene)

    def _finite(self, scene: Scene) -> bool:
        """Whether all numbers of a scene are finite; of the one that was asked last that is known."""
        if scene is self._fine:
            return True
        fine = finite(scene.vector)
        if fine:
            self._fine = scene
        return fine

    def knows(self, layout: SceneLayout) -> bool:
        """Whether it can predict scenes of a layout; `checked_batch` says why not."""
        if self._known.get(id(layout)) is layout:
            return True
        own = {t.name: t for t in self.schema.types}
        if any(own.get(t.name) != t for t in layout.types):
            return False
        self._known[id(layout)] = layout  # kept alive, so that its id stays its own
        return True

    @property
    def recalls(self) -> bool:
        """Whether the mode that held last is asked of what follows the latest transition, which programs can't do."""
        return self.arrival is not None and any(
            m.asks_latest for t, m in self.models.items() if not self.governs(t)
        )

    def resumes(self, layout: SceneLayout, vector: NDArray[np.float64]) -> bool:
        """Whether the mode that held last is asked of a scene."""
        return self.arrival is not None and self.arrival.begins(layout, vector) and self.recalls

    def resumed(self, layout: SceneLayout, vectors: NDArray[np.float64]) -> NDArray[np.intp]:
        """Of which of n scenes the mode that held last is asked, ascending."""
        rows = np.empty(0, dtype=np.intp) if self.arrival is None else self.arrival.rows(layout, vectors)
        return rows if len(rows) and self.recalls else rows[:0]

    def check(self, scene: Scene) -> None:
        """Raise `ObservationError` for NaN, infinity, what is no scene, or one of another schema.

        `ShapeError` where a body can't be: an extent isn't positive, or a sphere isn't round.
        """
        if scene is self._checked:
            return
        if not isinstance(scene, Scene):
            raise ObservationError(
                f"expected a Scene, got {type(scene).__name__}; of an observation and an action a learner's "
                "predict(observation, action) makes one, or view.with_action(view.scene(observation), action)"
            )
        schema = scene.schema
        if schema is not self.schema and self._kin.get(id(schema)) is not schema:
            difference = mismatch(schema, self.schema)
            if difference:
                raise ObservationError(
                    f"the scene follows another schema than the model: {difference}; numbers and names of objects may "
                    "differ, their types may not"
                )
            self._kin[id(schema)] = schema  # kept alive, so that its id stays its own
        if not self._finite(scene):
            schema.scene(scene.values())  # raises, naming object and property
        if scene.layout.bodies:
            check_sizes(scene)
        self._checked = scene

    def checked_batch(self, layout: SceneLayout, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """State vectors as contiguous float64; `ObservationError` for other types or width, NaN or infinity."""
        if self._known.get(id(layout)) is not layout:
            # Types that it doesn't know are obstacles to it, and laws of contact hold for them.
            own = {t.name: t for t in self.schema.types}
            other = [t for t in layout.types if own.get(t.name, t) != t]
            if other or not any(t.name in own for t in layout.types):
                raise ObservationError(
                    f"the scenes hold objects of the types {[(t.name, t.properties) for t in other or layout.types]}: "
                    f"the model knows {[(t.name, t.properties) for t in self.schema.types]}; numbers and names of "
                    "objects may differ, their types may not"
                )
            self._known[id(layout)] = layout  # kept alive, so that its id stays its own
        vectors = np.ascontiguousarray(vectors, dtype=np.float64)
        if vectors.ndim != 2 or vectors.shape[1] != layout.width:
            raise ObservationError(f"expected vectors of shape (n, {layout.width}), got {vectors.shape}")
        if not np.isfinite(vectors).all():
            row = int(np.flatnonzero(~np.isfinite(vectors).all(axis=1))[0])
            self.check(Scene(self.schema, layout, vectors[row].copy()))
        return vectors

    def add_target(self, target: Target) -> None:
        """Learn one more target, after all others in causal order.

        Raises
        ------
        SchemaError
            Its type has no such property.
        ConfigError
            The property comes from outside the world.
        """
        self.idle = False
        t = self.schema.type(target.type)
        if target.property not in t.properties:
            raise SchemaError(f"target {target}: type {t.name!r} has no property {target.property!r}")
        if t.name == ACTION or target.property in t.exogenous:
            raise ConfigError(
                f"target {target} can't be learned: it comes from outside the world; leave it out"
            )
        if self.open and t.name == TASK:
            target = replace(target, given=self._bearing_on(target))
        vocabulary = self.perception.vocabulary(t)
        pool = self.pools.setdefault(target.type, RowPool(len(vocabulary.own)))
        self.models[target] = PropertyModel(target, vocabulary, self.config, self.schema, pool)
        if self.laws is not None:
            self.laws.mark(self.models)
        targets = (*self.targets, target)
        self._set_targets(in_order(targets) if self.open else targets)
        self.tables.setdefault(target.type, ExampleTable())
        self.regressions.setdefault(target.type, Regression(self.config.regression_columns))

    def _bearing_on(self, target: Target) -> tuple[tuple[str, str], ...]:
        """Next values that a property of the task is given: worth is a function of what was, was done and came of it.

        Of the task itself, that the episode ends is given to what a step is paid: it is what pays most often.
        """
        end = (TASK, TERMINATED)
        return tuple(
            p for p in self.perception.chained if p[0] != TASK or (p == end and target.property != TERMINATED)
        )

    def discover_targets(self, before: Scene, after: Scene) -> tuple[Target, ...]:
        """Every property that changes becomes a target; it sees all transitions from its first change on. Those found.

        What the task says is asked for, and a target at once: of ends, that most steps are none is half the story.
        """
        layout = before.layout
        if not (open_ := self._undiscovered_in(layout)):
            return ()
        stays = passage(layout, after.layout).stays
        changed = before.vector != next_values(before, after)
        found = dict.fromkeys(
            target
            for target, index, column in open_
            if stays[index] and (changed[column] or target.type == TASK)
        )
        if not found:
            return ()
        check_number(len(self.targets) + len(found))
        for target in found:
            self.add_target(target)
        names = {
            (target.type, target.property) for target in found
        }  # those of the task are given what follows
        return tuple(t for t in self.targets if (t.type, t.property) in names)

    def _undiscovered_in(self, layout: SceneLayout) -> list[tuple[Target, int, int]]:
        """What may become a target, the object and the column of each; cached until there is another target."""
        known = self._undiscovered.get(id(layout))
        if known is not None and known[0] is layout:
            return known[1]
        taken = {(t.type, t.property) for t in self.targets}
        taken |= {(k.type, k.property) for k in self.schema.kinematics}
        found = [
            (Target(t.name, prop), index, layout.offsets[index] + k)
            for index, t in enumerate(layout.types)
            if t.name != ACTION
            for k, prop in enumerate(t.properties)
            if (t.name, prop) not in taken and prop not in t.exogenous
        ]
        if len(self._undiscovered) >= LAYOUTS:
            self._undiscovered.clear()
        self._undiscovered[id(layout)] = layout, found
        return found

    def retarget(self, target: Target, other: Target) -> None:
        """Put another target of the same property in a target's place; it begins anew, order included."""
        model = self.models.pop(target)
        model.retarget(other, self.tables[target.type])
        self.models[other] = model
        self._set_targets(in_order(other if t == target else t for t in self.targets))

    def answers(self, layout: SceneLayout) -> dict[tuple[str, str], Answer]:
        """What is predicted in a layout, in the order of prediction, by (object, property); cached."""
        known = self._answers.get(id(layout))
        if known is not None and known[0] is layout:
            return known[1]
        found: dict[tuple[str, str], Answer] = {}
        for target in self.targets:
            for index in layout.of_type(target.type):
                column = layout.column(index, target.property)
                turn = math.tau if target.property in layout.types[index].angles else 0.0
                key = layout.names[index], target.property
                found[key] = Answer(target, self.models[target], index, column, turn)
        if len(self._answers) >= LAYOUTS:
            self._answers.clear()
        self._answers[id(layout)] = layout, found
        return found

    def _set_targets(self, targets: tuple[Target, ...]) -> None:
        self.targets = targets
        types = dict.fromkeys(t.type for t in targets)
        self.by_type = {name: tuple((t, self.models[t]) for t in targets if t.type == name) for name in types}
        self._answers.clear()
        self._undiscovered.clear()
        read = {pair for t in targets if t.type != TASK for pair in t.given}
        for target, model in self.models.items():
            model.leaned_on = (target.type, target.property) in read

    def lead(self, rate: tuple[str, str], prop: str, step: float) -> None:
        """Take note that a property follows a rate: ``prop' = prop + step * rate'``."""
        model = self.property_model(*rate)
        model.lead(prop, step, self.tables[rate[0]])

    def signature_of(self, names: tuple[str, ...]) -> SlotSignature:
        """The slot signature of types of these names."""
        return self.perception.signature_of(tuple(self.schema.type(name) for name in names))

    def property_model(self, type_name: str, prop: str) -> PropertyModel:
        """The model of one target; `QueryError` when there is none."""
        for target in self.targets:
            if (target.type, target.property) == (type_name, prop):
                return self.models[target]
        raise QueryError(f"{type_name}.{prop} is no target; the model has {[str(t) for t in self.targets]}")

    def relied_on(self, model: PropertyModel) -> frozenset[tuple[str, str]]:
        """(type, property) pairs whose next values a target's modes read, as far as laws tell these exactly.

        What is only approximated is never quite right: how right a target is that reads it, its own record tells.
        """
        if not model.target.given:
            return frozenset()
        needs = model.needs
        return frozenset(
            (target.type, target.property)
            for target, read in self.models.items()
            if (target.type, target.property) in needs and (self.governs(target) or not read.fallback.lawless)
        )

    def regressed(self, percept: Percept, index: int, prop: str) -> NDArray[np.float64] | None:
        """Changes of a property that regressions predict for an object of n scenes, shape ``(n,)``."""
        regression = self.regressions[percept.layout.types[index].name]
        if prop not in regression.targets:
            return None
        found = self._asked(regression, percept, index)
        return None if found is None else found.changes[:, regression.targets.index(prop)]

    def distance(self, percept: Percept, index: int, prop: str) -> NDArray[np.float64] | None:
        """How far n scenes of an object lie from what regressions of a property learned, shape ``(n,)``; None: no such.

        Squared, and about 1 in the mean of what was learned (`Regression.values`).
        """
        regression = self.regressions[percept.layout.types[index].name]
        found = self._asked(regression, percept, index) if prop in regression.targets else None
        return None if found is None else found.distances

    def _asked(self, regression: Regression, percept: Percept, index: int) -> Regressed | None:
        """What regressions say of an object of n scenes; asked once for all properties."""
        known = percept.regressed.get(index)
        if known is None or known[0] != regression.revision:
            signature = percept.situation(index).signature
            # Only present values are read, and of objects alone of their type: their order doesn't matter.
            x = percept.rows(index, percept.vectors, ordered=False)
            known = percept.regressed[index] = (regression.revision, regression.values(signature, x))
        return known[1]

    def governs(self, target: Target) -> bool:
        """Whether laws of motion, not modes, predict a target."""
        return self.laws is not None and self.laws.governs(target)


def check_number(count: int) -> None:
    """Raise `ConfigError` for more targets than one model learns."""
    if count > MOST_TARGETS:
        raise ConfigError(
            f"{count} properties change, and one model learns at most {MOST_TARGETS}: name those that matter "
            "(targets=['type.property', ...]), or declare others exogenous; all may still be read"
        )


def check_targets(schema: SceneSchema, targets: Sequence[Target]) -> None:
    """Raise an error unless targets are in causal order, each of them once.

    Raises
    ------
    ConfigError
        No target, one that stands there twice, or one that is given what is no earlier target: then the present value
        would be read for the next one.
    SchemaError
        A type or property that isn't there, or one that follows from declared kinematics.
    """
    derived = {(law.type, law.property) for law in schema.kinematics}
    known: set[tuple[str, str]] = set()
    check_number(len(targets))
    for target in targets:
        if not isinstance(target, Target):
            raise ConfigError(f"target {target!r}: expected a Target, as Target('ball', 'vx')")
        own = (target.type, target.property)
        if own in known:
            raise ConfigError(f"target {target} stands there twice; leave one out")
        if own in derived:
            raise SchemaError(f"target {target} follows from declared kinematics; leave out one of the two")
        for pair in target.given:
            if pair not in known:
                raise ConfigError(
                    f"target {target} is given {'.'.join(pair)}, which is no target before it: put that one first "
                    "(causal order; what follows from kinematics comes last, give its rate), or leave it out"
                )
        known.add(own)
