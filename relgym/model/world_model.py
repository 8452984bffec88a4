"""The whole model of a world: one property model per target, composed (§1.2.6, design §5)."""

from __future__ import annotations

import copy
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.clusterer import ClusterReport
from relgym.clustering.examples import ExampleTable
from relgym.config import ModelConfig
from relgym.errors import ConfigError, ModelFileError, ObservationError, QueryError, SchemaError
from relgym.laws.book import LawBook
from relgym.model.motion import Laws
from relgym.model.perception import Percept, Perception, Situation
from relgym.model.prediction import OUTCOMES, BatchPrediction, Outcome, Prediction, ScenePrediction
from relgym.model.property_model import PropertyModel, Verdict, bodies_of
from relgym.model.scenes import mismatch, next_values, with_action
from relgym.model.storage import (
    read_model,
    schema_from_json,
    schema_to_json,
    target_from_json,
    target_to_json,
    write_model,
)
from relgym.scene.objects import ACTION, Scene, SceneLayout, SceneSchema, Target, Transition

__all__ = ["LearnReport", "WorldModel", "with_action"]


@dataclass(frozen=True, slots=True)
class LearnReport:
    """What one transition taught.

    Attributes
    ----------
    parts
        Per (object, property): what its clusterer did; not for targets whose modes rest, since laws suffice.
    work
        Deterministic units of work spent on re-learning classifiers.
    """

    parts: dict[tuple[str, str], ClusterReport]
    work: int

    @property
    def changed(self) -> bool:
        """Whether any target's set of modes changed."""
        return any(part.changed for part in self.parts.values())


class WorldModel:
    """Learns, one transition at a time, what happens next in a world of objects.

    Parameters
    ----------
    schema
        The scenes' schema.
    config
        Free parameters.
    targets
        What to learn, in causal order; default: the schema's targets, and if it names none, every property
        that changes (kinematics and exogenous properties apart).

    Examples
    --------
    >>> from relgym.scene.objects import ObjectType, SceneSchema, Target, Transition
    >>> ball = ObjectType("ball", ("v",))
    >>> schema = SceneSchema((ball,), (("b", "ball"),), targets=(Target("ball", "v"),))
    >>> model = WorldModel(schema)
    >>> v = 8.0
    >>> for _ in range(12):
    ...     _ = model.learn_one(Transition(schema.scene({"b": [v]}), schema.scene({"b": [0.5 * v]})))
    ...     v *= 0.5
    >>> model.modes("ball", "v")[0].formula()
    "v' = 0.5 v"
    >>> model.predict_one(schema.scene({"b": [3.0]})).scene["b"]["v"]
    1.5
    """

    def __init__(
        self,
        schema: SceneSchema,
        config: ModelConfig | None = None,
        *,
        targets: Sequence[Target] | None = None,
    ) -> None:
        self.schema = schema
        self.config = config or ModelConfig()
        self.seen = 0
        self.frozen = False
        self.extra: dict[str, Any] = {}
        self._kin: dict[int, SceneSchema] = {}
        named = schema.targets if targets is None else tuple(targets)
        self._open = named is None
        self.targets: tuple[Target, ...] = ()
        given = tuple(dict.fromkeys(pair for t in named or () for pair in t.given))
        self._perception = Perception(schema, given, self.config.geometry)
        self._models: dict[Target, PropertyModel] = {}
        self._tables: dict[str, ExampleTable] = {}
        self._percept: tuple[Scene, Percept] | None = None
        self._laws: Laws | None = None
        if self.config.frames == "auto":
            self._laws = Laws(schema, None if named is None else tuple(named), self.config)
        for target in named or ():
            self._add_target(target)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_percept": None, "_kin": {}}

    def __repr__(self) -> str:
        parts = ", ".join(f"{t}: {len(self._models[t].modes)} modes" for t in self.targets)
        return f"WorldModel({parts or 'no targets yet'}; {self.seen} transitions)"

    # ------------------------------------------------------------------ targets
    def _add_target(self, target: Target) -> None:
        t = self.schema.type(target.type)
        if target.property not in t.properties:
            raise SchemaError(f"target {target}: type {t.name!r} has no property {target.property!r}")
        if t.name == ACTION or target.property in t.exogenous:
            raise ConfigError(
                f"target {target} can't be learned: it comes from outside the world; leave it out"
            )
        self.targets = (*self.targets, target)
        self._models[target] = PropertyModel(target, self._perception.vocabulary(t), self.config)
        self._tables.setdefault(target.type, ExampleTable())

    def _discover_targets(self, before: Scene, after: Scene) -> None:
        """Every property that changes becomes a target; it sees all transitions from its first change on."""
        derived = {(k.type, k.property) for k in self.schema.kinematics}
        for i, t in enumerate(before.layout.types):
            if t.name == ACTION or before.layout.names[i] not in after:
                continue
            was, now = before.vector[before.layout.slice(i)], after[before.layout.names[i]].values
            for k in np.flatnonzero(was != now):
                prop = t.properties[k]
                known = any(x.type == t.name and x.property == prop for x in self.targets)
                if not known and (t.name, prop) not in derived and prop not in t.exogenous:
                    self._add_target(Target(t.name, prop))

    def property_model(self, type_name: str, prop: str) -> PropertyModel:
        """The model of one target; `QueryError` when there is none."""
        for target in self.targets:
            if (target.type, target.property) == (type_name, prop):
                return self._models[target]
        raise QueryError(f"{type_name}.{prop} is no target; the model has {[str(t) for t in self.targets]}")

    def modes(self, type_name: str, prop: str) -> tuple[Any, ...]:
        """Modes of one target, by id; `QueryError` when it is none."""
        return self.property_model(type_name, prop).modes

    # ------------------------------------------------------------------ learning
    def learn_one(self, transition: Transition) -> LearnReport:
        """Take up one transition.

        Parameters
        ----------
        transition
            A scene (with its action) and the scene that followed.

        Raises
        ------
        ObservationError
            NaN or infinity somewhere, or another schema; the model is unchanged.
        ModelFileError
            The model was loaded without its history and can't go on learning.

        Notes
        -----
        Cost: relations once, then per target O(modes); searches and re-learning when an example is news.
        """
        before, after = transition.before, transition.after
        self._check(before)
        self._check(after)
        if self.frozen:
            raise ModelFileError(
                "this model was loaded without its history and can only predict; "
                "save it with save(path, history=True) to go on learning"
            )
        percept = self._perceive(before)  # first, for it may refuse a shape
        if self._open:
            self._discover_targets(before, after)
        after_values = next_values(before, after)
        parts: dict[tuple[str, str], ClusterReport] = {}
        for type_name in dict.fromkeys(t.type for t in self.targets):
            if self._laws is not None and self._laws.suffice(type_name, self.targets):
                continue
            for index in before.layout.of_type(type_name):
                if before.layout.names[index] in after:
                    self._learn_object(percept, index, after_values, parts)
        if self._laws is not None:
            stays = {i: name in after for i, name in enumerate(before.layout.names)}
            self._laws.learn_one(percept, after_values, stays, self._models)
        self.seen += 1
        work = self._refresh()
        return LearnReport(parts, work)

    def _learn_object(
        self,
        percept: Percept,
        index: int,
        following: NDArray[np.float64],
        parts: dict[tuple[str, str], ClusterReport],
    ) -> None:
        layout = percept.layout
        type_name = layout.types[index].name
        situation = percept.situation(index)
        table = self._tables[type_name]
        x = percept.rows(index, following[None])[0]
        bodies = bodies_of(situation.order[0], layout)
        row = table.add(situation.signature, x, situation.keys[0], bodies)
        example = replace(situation.examples[0], key=situation.keys[0])
        for target in self.targets:
            if target.type == type_name:
                y = float(following[layout.column(index, target.property)])
                report = self._models[target].learn_one(table, row, y, situation, example)
                parts[layout.names[index], target.property] = report

    def _refresh(self) -> int:
        budget, spent = self.config.work_per_step, 0
        for target in self.targets:
            if not self.governs(target):  # no clause is asked where laws predict
                spent += self._models[target].refresh(budget - spent)
            if spent >= budget:
                break
        return spent

    def finish(self) -> int:
        """Re-learn every stale classifier now, without a budget; returns the work spent.

        A model without its history has nothing to learn from and stays as it is.
        """
        if self.frozen:
            return 0
        return sum(self._models[t].refresh(None) for t in self.targets if not self.governs(t))

    @property
    def laws(self) -> LawBook | None:
        """Laws of motion learned so far, in force or not; None with ``frames="world"``."""
        return None if self._laws is None else self._laws.learner.book

    @property
    def governed(self) -> frozenset[str]:
        """Names of the types whose velocity laws of motion predict at present."""
        return frozenset() if self._laws is None else self._laws.governed

    def governs(self, target: Target) -> bool:
        """Whether laws of motion, not modes, predict a target: they describe its transitions in fewer bits."""
        return self._laws is not None and self._laws.governs(target)

    def _check(self, scene: Scene) -> None:
        schema = scene.schema
        if schema is not self.schema and id(schema) not in self._kin:
            difference = mismatch(schema, self.schema)
            if difference:
                raise ObservationError(
                    f"the scene follows another schema than the model: {difference}; numbers and names of objects may "
                    "differ, their types may not"
                )
            self._kin[id(schema)] = schema  # kept alive, so that its id stays its own
        if not np.isfinite(scene.vector).all():
            schema.scene(scene.values())  # raises, naming object and property

    def _perceive(self, scene: Scene) -> Percept:
        """Relations of a scene; the last one's are remembered, since prediction comes before learning."""
        if self._percept is None or self._percept[0] is not scene:
            self._percept = (scene, self._perception.percept(scene.layout, scene.vector[None]))
        return self._percept[1]

    # ------------------------------------------------------------------ prediction
    def predict_one(self, scene: Scene) -> ScenePrediction:
        """Predict the scene that follows (Figure 1.5, §3.6).

        Raises
        ------
        ObservationError
            NaN or infinity somewhere, or another schema.
        """
        self._check(scene)
        layout, percept = scene.layout, self._perceive(scene)
        following = scene.vector.copy()
        parts: list[Prediction] = []
        lost: set[tuple[str, str]] = set()
        motion = None if self._laws is None else self._laws.speak(percept)
        for target in self.targets:
            for index in layout.of_type(target.type):
                if motion is not None and self._laws is not None and self._laws.governs(target):
                    verdict = self._laws.prediction(motion, percept, index, target)
                else:
                    verdict = self._models[target].predict_one(percept, index, following)
                if not lost.isdisjoint(target.given):
                    verdict = Prediction("", "", np.nan, Outcome.DEPENDS)
                column = layout.column(index, target.property)
                if not np.isfinite(verdict.value):
                    # A mode whose value overflows has left its experience; other verdicts say why they are empty.
                    outcome = Outcome.OUTSIDE if verdict.ok else verdict.outcome
                    verdict = replace(verdict, value=float(scene.vector[column]), outcome=outcome, mode=0)
                following[column] = verdict.value
                if not verdict.ok:
                    lost.add((target.type, target.property))
                parts.append(replace(verdict, object=layout.names[index], property=target.property))
        self._derive(layout, scene.vector[None], following[None])
        return ScenePrediction(Scene(scene.schema, layout, following), tuple(parts))

    def predict_batch(self, layout: SceneLayout, vectors: NDArray[np.float64]) -> BatchPrediction:
        """Predict what follows n scenes with the same objects; bit for bit what `predict_one` gives.

        Parameters
        ----------
        layout
            The scenes' layout.
        vectors
            State vectors, shape ``(n, layout.width)``.
        """
        vectors = np.ascontiguousarray(vectors, dtype=np.float64)
        if vectors.ndim != 2 or vectors.shape[1] != layout.width:
            raise ObservationError(f"expected vectors of shape (n, {layout.width}), got {vectors.shape}")
        if not np.isfinite(vectors).all():
            row = int(np.flatnonzero(~np.isfinite(vectors).all(axis=1))[0])
            self._check(Scene(self.schema, layout, vectors[row].copy()))
        percept = self._perception.percept(layout, vectors)
        following = vectors.copy()
        keys: list[tuple[str, str]] = []
        verdicts: list[Verdict] = []
        lost: dict[tuple[str, str], NDArray[np.bool_]] = {}
        nowhere = np.zeros(len(vectors), dtype=bool)
        motion = None if self._laws is None else self._laws.speak(percept)
        for target in self.targets:
            for index in layout.of_type(target.type):
                if motion is not None and self._laws is not None and self._laws.governs(target):
                    verdict = self._laws.verdict(motion, percept, index, target)
                else:
                    verdict = self._models[target].predict_batch(percept, index, following)
                for pair in target.given:
                    verdict.values[lost.get(pair, nowhere)] = np.nan
                    verdict.outcomes[lost.get(pair, nowhere)] = OUTCOMES.index(Outcome.DEPENDS)
                column = layout.column(index, target.property)
                known = np.isfinite(verdict.values)
                following[known, column] = verdict.values[known]
                overflowed = ~known & (verdict.outcomes == OUTCOMES.index(Outcome.PREDICTED))
                verdict.outcomes[overflowed] = OUTCOMES.index(Outcome.OUTSIDE)
                verdict.modes[~known] = 0
                key = (target.type, target.property)
                lost[key] = lost.get(key, nowhere) | ~known
                keys.append((layout.names[index], target.property))
                verdicts.append(verdict)
        self._derive(layout, vectors, following)
        n = len(vectors)
        return BatchPrediction(
            layout,
            following,
            tuple(keys),
            np.stack([v.modes for v in verdicts], axis=1) if keys else np.zeros((n, 0), dtype=np.int64),
            np.stack([v.outcomes for v in verdicts], axis=1) if keys else np.zeros((n, 0), dtype=np.int8),
            np.stack([v.margins for v in verdicts], axis=1) if keys else np.zeros((n, 0)),
            tuple(self._frame(target) for target in self.targets for _ in layout.of_type(target.type)),
        )

    def _frame(self, target: Target) -> str:
        """Axes in which a target's contacts are described."""
        pair = None if self.laws is None else self.laws.pair
        return pair.frame if pair is not None and self.governs(target) else "world"

    def _derive(self, layout: SceneLayout, now: NDArray[np.float64], following: NDArray[np.float64]) -> None:
        """Declared kinematics, in place: simulate, then derive (§4.8)."""
        for law in self.schema.kinematics:
            for index in layout.of_type(law.type):
                place, rate = layout.column(index, law.property), layout.column(index, law.rate)
                source = following if law.uses_next else now
                following[:, place] = now[:, place] + law.step * source[:, rate]

    def rollout(
        self, scene: Scene, steps: int, actions: Sequence[Sequence[float]] | NDArray[np.float64] | None = None
    ) -> list[ScenePrediction]:
        """Predict `steps` steps ahead, each from the last prediction; stops early where a mode fails.

        Parameters
        ----------
        scene
            Where to start.
        steps
            Number of steps, at least 1.
        actions
            Properties of the action object at each step (physical units), shape ``(steps, properties)``;
            default: those of `scene` throughout.

        Returns
        -------
        One prediction per step; the last one is not `ok` when the roll-out ended early.
        """
        if steps < 1:
            raise ConfigError(f"steps must be at least 1, got {steps}")
        predictions: list[ScenePrediction] = []
        for k in range(steps):
            if actions is not None:
                scene = with_action(scene, actions[k])
            predictions.append(self.predict_one(scene))
            if not predictions[-1].ok:
                break
            scene = predictions[-1].scene
        return predictions

    # ------------------------------------------------------------------ for people
    def describe(
        self, *, digits: int = 7, frame: str | None = None, incline: float | Sequence[float] = (0.0, 90.0)
    ) -> str:
        """Laws, modes, functions, clauses and roles as text (tables 3.1-3.2, 4.2-4.5).

        With ``frame="world"`` also what the laws in force give along the world's axes on surfaces with some
        inclines, in degrees (`relgym.model.report.describe`).
        """
        from relgym.model.report import describe

        return describe(self, digits=digits, frame=frame, incline=incline)

    def law_lines(self, scene: Scene, index: int, digits: int = 7) -> tuple[str, ...]:
        """What laws of motion say of an object: its free law, then every contact, a line each."""
        return () if self._laws is None else self._laws.lines(self._perceive(scene), index, digits)

    def explain(self, scene: Scene) -> str:
        """Why this prediction: mode, function, roles, clause and rival of every target."""
        from relgym.model.explain import explain

        return explain(self, scene)

    def percept(self, scene: Scene) -> Percept:
        """What the learners see of a scene."""
        return self._perceive(scene)

    def situation(self, scene: Scene, index: int) -> Situation:
        """How the object with this index is situated in a scene."""
        return self._perceive(scene).situation(index)

    # ------------------------------------------------------------------ files
    def save(
        self, path: str | os.PathLike[str], *, history: bool = False, extra: dict[str, Any] | None = None
    ) -> None:
        """Write the model to one file, atomically.

        Parameters
        ----------
        path
            Where to write.
        history
            Whether to keep what further learning needs; without it the loaded model can only predict.
        extra
            Plain data of the caller's; default: the attribute `extra`, where a learner around an env keeps its spaces.
        """
        if not history:
            finished = copy.deepcopy(self)  # saving must not change what is learned from here on
            finished.finish()
            write_model(path, finished.to_json() | {"extra": self.extra if extra is None else extra}, None)
            return
        if self.frozen:
            raise ModelFileError(
                "this model was loaded without its history: save it with history=False, or load it from a file "
                "that was saved with history=True"
            )
        arrays: dict[str, NDArray[Any]] = {}
        for k, type_name in enumerate(sorted(self._tables)):
            arrays |= {f"table{k}.{name}": a for name, a in self._tables[type_name].to_arrays().items()}
        for k, target in enumerate(self.targets):
            arrays |= {f"target{k}.{name}": a for name, a in self._models[target].to_arrays().items()}
        if self._laws is not None:
            arrays |= {f"laws.{name}": a for name, a in self._laws.learner.to_arrays().items()}
        write_model(
            path, self.to_json(history=True) | {"extra": self.extra if extra is None else extra}, arrays
        )

    def to_json(self, *, history: bool = False) -> dict[str, Any]:
        """Plain data: schema, config and everything learned."""
        return {
            "schema": schema_to_json(self.schema),
            "config": self.config.to_json(),
            "open": self._open,
            "seen": self.seen,
            "given": [list(pair) for pair in self._perception.given],
            "targets": [
                {"target": target_to_json(t), "model": self._models[t].to_json(history=history)}
                for t in self.targets
            ],
            "tables": [self._tables[name].to_json() for name in sorted(self._tables)] if history else [],
            "laws": None if self._laws is None else self._laws.to_json(history=history),
        }

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> WorldModel:
        """Read a model file.

        Raises
        ------
        ModelFileError
            Truncated, edited, foreign or of another version.
        """
        return cls.load_with_extra(path)[0]

    @classmethod
    def load_with_extra(cls, path: str | os.PathLike[str]) -> tuple[WorldModel, dict[str, Any]]:
        """Read a model file and the caller's data in it."""
        body, arrays = read_model(path)
        try:
            model = cls._from_json(body, arrays)
            model.extra = dict(body["extra"])
            return model, model.extra
        except (KeyError, TypeError, IndexError) as error:
            raise ModelFileError(
                f"{path}: a part of the model is missing or malformed ({error!r}); save it again"
            ) from None

    @classmethod
    def _from_json(cls, body: dict[str, Any], arrays: dict[str, NDArray[Any]] | None) -> WorldModel:
        schema = schema_from_json(body["schema"])
        targets = [target_from_json(part["target"]) for part in body["targets"]]
        model = cls(schema, ModelConfig.from_json(body["config"]), targets=targets)
        model._open = bool(body["open"])
        if model._laws is not None and model._open:
            model._laws = Laws(schema, None, model.config)
        model.seen = int(body["seen"])
        model.frozen = arrays is None
        for k, type_name in enumerate(sorted(model._tables)):
            if arrays is not None:
                types = {t.name: t for t in schema.types}
                part = {n.split(".", 1)[1]: a for n, a in arrays.items() if n.startswith(f"table{k}.")}
                model._tables[type_name].restore(body["tables"][k], part, types)
        for k, target in enumerate(targets):
            part = {n.split(".", 1)[1]: a for n, a in (arrays or {}).items() if n.startswith(f"target{k}.")}
            model._models[target].restore(body["targets"][k]["model"], part)
        if model._laws is not None and body["laws"] is not None:
            part = {n.split(".", 1)[1]: a for n, a in (arrays or {}).items() if n.startswith("laws.")}
            model._laws.restore(body["laws"], part)
        return model
