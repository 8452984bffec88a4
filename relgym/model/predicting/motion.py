"""Laws of motion beside the property models: which types they govern, and what they say of each target."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.config.constants import ENOUGH
from relgym.laws.account import accounts
from relgym.laws.book import Motion
from relgym.laws.description import CONSTANT_BITS, EXCEPTION_BITS
from relgym.laws.learner import LawLearner
from relgym.laws.records import PairLaw
from relgym.laws.touching import Cast, Contacts
from relgym.model.percepts.perception import Percept
from relgym.model.predicting.prediction import OUTCOMES, Outcome, Prediction, ScenePrediction
from relgym.model.target.property_model import PropertyModel, Verdict
from relgym.program.records import FREE, TOUCHING
from relgym.scene.objects import ACTION, Target
from relgym.scene.schema import SceneSchema

__all__ = ["Laws", "mode_bits", "possible_targets"]

_PREDICTED, _OUTSIDE = OUTCOMES.index(Outcome.PREDICTED), OUTCOMES.index(Outcome.OUTSIDE)


class Laws:
    """The laws of a world model, in force for those types that they describe in fewer bits than modes do.

    Parameters
    ----------
    schema
        The scenes' schema.
    targets
        The model's targets; None: everything that may turn out to change.
    config
        Free parameters.

    Attributes
    ----------
    learner
        Learns the laws.
    governed
        Names of the types whose velocity the laws predict at present.
    """

    def __init__(self, schema: SceneSchema, targets: tuple[Target, ...] | None, config: ModelConfig) -> None:
        noise = config.clustering.noise_std
        known = possible_targets(schema) if targets is None else targets
        self.learner = LawLearner(schema, known, seed=config.seed, noise_std=noise)
        self.governed: frozenset[str] = frozenset()
        self._components = {
            (name, prop): k for name, s in self.learner.sources.items() for k, prop in enumerate(s.moving)
        }
        self._columns = max(2, sum(len(schema.type(t).properties) for _, t in schema.objects))
        self._seen = 0
        self._governs: tuple[frozenset[str] | None, PairLaw | None, set[tuple[str, str]]] = (
            None,
            None,
            set(),
        )
        self._wanted: tuple[Cast, tuple[Any, ...], dict[int, tuple[str, ...]]] | None = None
        self._last: tuple[Percept, Contacts, Motion] | None = None  # predicted last, and often learned next

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_last": None, "_wanted": None, "_governs": (None, None, set())}

    def governs(self, target: Target) -> bool:
        """Whether the laws predict a target."""
        if not self.governed:
            return False
        pair = self.learner.book.pair
        if self._governs[0] is not self.governed or self._governs[1] is not pair:
            own = {(t, p) for t in self.governed for p in self.learner.book.components(t)}
            self._governs = self.governed, pair, own.intersection(self._components)
        return (target.type, target.property) in self._governs[2]

    def beyond_modes(self, target: Target) -> bool:
        """Whether a target is for laws alone to claim, and they don't govern it.

        What contacts do to bodies that turn depends on where they are touched: that is no function of properties along
        the world's axes, and no clause tells when there is a point of contact. Modes may guess what comes next; how
        right they are changes with every contact. Where none was ever seen, modes are as good as elsewhere.
        """
        own = self.learner.sources.get(target.type)
        meets = self.learner.book.turning and self.learner.contacts_seen > 0
        return meets and own is not None and target.property in own.moving and not self.governs(target)

    def mark(self, models: Mapping[Target, PropertyModel]) -> bool:
        """Say which models' predictions are not to be claimed (`beyond_modes`); whether they are others than before."""
        changed = False
        for target, part in models.items():
            before, part.surmise = part.surmise, self.beyond_modes(target)
            changed |= part.surmise != before
        return changed

    def suffice(self, type_name: str, targets: Sequence[Target]) -> bool:
        """Whether the laws predict all targets of a type and have long been right: its modes may rest.

        Modes rest until the laws are wrong more often than laws may be, and go on learning then.
        """
        if type_name not in self.governed or not self.learner.settled(type_name):
            return False
        return all(self.governs(t) for t in targets if t.type == type_name)

    # ------------------------------------------------------------------ learning
    def learn_one(
        self,
        percept: Percept,
        following: NDArray[np.float64],
        stays: Mapping[int, bool],
        models: Mapping[Target, PropertyModel],
        told: ScenePrediction | None = None,
    ) -> bool:
        """Take up one transition, then weigh laws against modes; whether laws may say something else.

        They are weighed whenever the laws change, and after every `ENOUGH` transitions. Nobody calls it where there is
        nothing that moves (`LawLearner.sources`).

        What was predicted of it may be told: what came as predicted is only counted, and offered to what is kept.
        """
        self._seen += 1
        changed, tolerance = False, self.learner.book.tolerance
        known = told is not None and self._confirmed(percept, following, stays, told)
        if not known:
            motion = self._last[2] if self._last is not None and self._last[0] is percept else None
            contacts = self._contacts(percept) if motion is None or self._last is None else self._last[1]
            changed = self.learner.learn_one(contacts, percept.vectors[0], following, stays, motion)
        self._last = None  # what the laws say may have changed
        weighed = (changed or self._seen % ENOUGH == 0) and self._weigh(models)
        return changed or weighed or not known or self.learner.book.tolerance != tolerance

    def _confirmed(
        self,
        percept: Percept,
        following: NDArray[np.float64],
        stays: Mapping[int, bool],
        told: ScenePrediction,
    ) -> bool:
        """Whether a transition came as the laws said, and was taken up as such."""
        layout = percept.layout
        if told.scene.layout is not layout or not all(stays.values()):
            return False
        cast = self.learner.book.cast(layout)
        bodies, wanted = cast.bodies, self._predicted(cast)
        said = dict.fromkeys(wanted, 0)
        off: dict[int, float] = {}
        touched: dict[int, list[int]] = {}
        places, came = layout.places, following.tolist()
        for one in told.parts:
            name, prop = one.object, one.property
            body = bodies.get(name, -1)
            if prop not in wanted.get(body, ()):
                continue
            if not one.ok or len(one.roles) < one.mode or one.mode not in (FREE, TOUCHING):
                return False  # a batch tells no roles
            error = abs(one.value - came[places[name, prop]])
            said[body] += 1
            if not error <= off.get(body, 0.0):
                off[body] = error
            touched[body] = [bodies[other] for other in one.roles[1:]]
        for body, components in wanted.items():
            if not components or said[body] != len(components):
                return False
            off.setdefault(body, 0.0)
        perception = percept.perception
        return self.learner.confirm(
            cast,
            percept.vectors[0],
            following,
            touched,
            off,
            lambda vectors: self._contacts(perception.percept(layout, vectors)),
        )

    def _predicted(self, cast: Cast) -> dict[int, tuple[str, ...]]:
        """What the laws in force predict of each body of a cast; worked out once."""
        book, known = self.learner.book, self._wanted
        grounds = self.governed, book.pair, book.turning
        if known is None or known[0] is not cast or known[1] != grounds:
            found = {
                body: book.components(source.type.name) if source.type.name in self.governed else ()
                for body, (source, _) in cast.sources.items()
            }
            known = self._wanted = cast, grounds, found
        return known[2]

    def _weigh(self, models: Mapping[Target, PropertyModel]) -> bool:
        """Laws that describe what came in fewer bits than modes come in force, and are believed accordingly.

        What modes would say is not known while they rest: laws that have long been right stay in force.
        """
        leads = {name: self._lead(name, models) for name in self.learner.types}
        targets = tuple(models)
        resting = {name for name in self.governed if self.suffice(name, targets)}
        governed = frozenset(name for name, lead in leads.items() if lead > 0.0 or name in resting)
        for target, part in models.items():
            if target.type in governed - self.governed:
                part.calibration.vouch(leads[target.type])
        before, self.governed = self.governed, governed
        return self.mark(models) or governed != before

    def _lead(self, type_name: str, models: Mapping[Target, PropertyModel]) -> float:
        """Bits by which laws describe a type's motion better than modes of every component; 0 without laws."""
        if not self.learner.ready(type_name):
            return 0.0
        governed = self.learner.book.components(type_name)
        parts = [part for t, part in models.items() if t.type == type_name and t.property in governed]
        if len(parts) < len(governed):
            return 0.0
        seen = self.learner.seen(type_name)
        return sum(mode_bits(part, self._columns, seen) for part in parts) - self.learner.bits(type_name)

    # ------------------------------------------------------------------ prediction
    def speak(self, percept: Percept) -> Motion | None:
        """What the laws say of a batch of scenes; None where they govern nothing."""
        if not self.governed:
            return None
        contacts = self._contacts(percept)
        motion = self.learner.book.motion(contacts, percept.vectors)
        if len(percept) == 1:
            self._last = (percept, contacts, motion)
        return motion

    def _contacts(self, percept: Percept) -> Contacts:
        cast = self.learner.book.cast(percept.layout)
        return Contacts.of(cast, percept.relations, percept.vectors)

    def verdict(self, motion: Motion, percept: Percept, index: int, target: Target) -> Verdict:
        """What the laws say of one target of an object in n scenes."""
        body = percept.layout.bodies.index(index)
        known = motion.known[:, body]
        value = motion.velocity[self._components[target.type, target.property], :, body]
        modes = np.where(known, np.where(motion.touched[:, body], TOUCHING, FREE), 0)
        return Verdict(
            np.where(known, value, np.nan),
            modes.astype(np.int64),
            np.where(known, _PREDICTED, _OUTSIDE).astype(np.int8),
            np.where(known, np.inf, 0.0),
        )

    def prediction(self, motion: Motion, percept: Percept, index: int, target: Target) -> Prediction:
        """`verdict` for a single scene, with the objects that are touched as roles."""
        verdict = self.verdict(motion, percept, index, target)
        layout, mode = percept.layout, int(verdict.modes[0])
        roles: tuple[str, ...] = ()
        if mode:
            body = layout.bodies.index(index)
            touched = percept.relations.relation("intersect")[0, body].nonzero()[0]
            roles = (layout.names[index], *(layout.names[layout.bodies[k]] for k in touched.tolist()))
        pair = self.learner.book.pair
        frame = pair.frame if mode == TOUCHING and pair is not None else "world"
        outcome = OUTCOMES[int(verdict.outcomes[0])]
        margin = float(verdict.margins[0])
        return Prediction("", "", float(verdict.values[0]), outcome, mode, roles, margin, frame)

    def lines(self, percept: Percept, index: int, digits: int) -> tuple[str, ...]:
        """What the laws say of an object of a single scene, for people: the free law, then each contact."""
        layout, book = percept.layout, self.learner.book
        name = layout.types[index].name
        free = book.free.get(name)
        if free is None:
            return ()
        body = layout.bodies.index(index)
        sources, places = book.cast(layout).sources[body]
        state = book.cast(layout).padded(percept.vectors)[places]
        inside = free.at(dict(zip(sources.names, state, strict=True)))
        pairs = zip(book.components(name), inside, strict=False)
        first = ", ".join(f"{v}' = {piece.formula(digits)}" for v, piece in pairs)
        contacts = Contacts.of(book.cast(layout), percept.relations, percept.vectors)
        told = [
            a for a in accounts(book, contacts, percept.vectors, digits) if layout.names[index] in a.objects
        ]
        head = f"free: {first}" if told else f"{first}, since it touches nothing"
        return (head, *(line for account in told for line in str(account).split("\n")))

    # ------------------------------------------------------------------ saving
    def to_json(self, *, history: bool) -> dict[str, Any]:
        """Plain data that `restore` reads back."""
        laws = self.learner.to_json(history=history)
        return {"laws": laws, "governed": sorted(self.governed), "seen": self._seen}

    def restore(self, data: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]] | None) -> None:
        """Take over what `to_json` and the learner's `to_arrays` wrote."""
        self.learner.restore(data["laws"], arrays)
        self.governed = frozenset(str(name) for name in data["governed"])
        self._seen = int(data["seen"])


def mode_bits(part: PropertyModel, columns: int, seen: int) -> float:
    """Description length of a target's examples by modes: functions, which mode holds when, and noise.

    Parameters
    ----------
    part
        The target's model.
    columns
        Number of columns that a function may use.
    seen
        Number of the type's examples. Those that came while modes rested they would describe as they do others.
    """
    noise = part.clusterer.noise_examples
    counts = [mode.examples for mode in part.modes]
    n = max(2, sum(counts) + noise)
    constant = CONSTANT_BITS + 0.5 * math.log2(n)
    stated = 0.0
    for mode in part.modes:
        weights = [weight for role in mode.roles for _, weight in role.terms]
        stated += 1.0 + len(weights) * math.log2(columns)
        stated += constant * (sum(abs(w) != 1.0 for w in weights) + (mode.intercept != 0.0))
    labels = sum(-c * math.log2(c / n) for c in (*counts, noise) if c)
    missed = max(1.0, seen / max(1, part.clusterer.seen))
    return stated + missed * (labels + EXCEPTION_BITS * noise)


def possible_targets(schema: SceneSchema) -> tuple[Target, ...]:
    """Everything that may become a target when a model finds its targets itself."""
    derived = {(k.type, k.property) for k in schema.kinematics}
    return tuple(
        Target(t.name, prop)
        for t in schema.types
        for prop in t.properties
        if t.name != ACTION and prop not in t.exogenous and (t.name, prop) not in derived
    )
