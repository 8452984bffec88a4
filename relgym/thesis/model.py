"""The thesis' system as a whole (Figures 1.4 and 1.5): one learner for each target, and prediction (§3.6).

It is asked as a `relgym.model.world_model.WorldModel` is (`relgym.model.protocol.SceneLearner`): wrappers teach it, and
dreams and roll-outs are made of its predictions.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import array_of, refusing_calls
from relgym.clustering.mode import Mode
from relgym.errors import ConfigError, QueryError, SchemaError
from relgym.model.learning.transition import LearnReport
from relgym.model.predicting.prediction import OUTCOMES, BatchPrediction, Outcome, Prediction, ScenePrediction
from relgym.model.reports.tables import ClauseRow, ModelReport, ModeRow, PairTable, RoleRow, TargetReport
from relgym.scene.objects import POSE, Scene, SceneLayout, Target, Transition
from relgym.scene.relations import Extractor
from relgym.scene.schema import SceneSchema
from relgym.thesis.classifier import Pair, Sample, learn_pair, ranking
from relgym.thesis.clusterer import Clusterer
from relgym.thesis.examples import Arrangement
from relgym.thesis.facts import Facts, Observer, joined
from relgym.thesis.files import StoredExamples, read_examples, write_examples
from relgym.thesis.modes import Casting, Cluster
from relgym.thesis.roles import RoleRule, assign, learn_role
from relgym.thesis.settings import ThesisSettings

__all__ = ["TargetModel", "ThesisModel"]

Floats = NDArray[np.float64]

_POSITIONS = POSE[:3]


@dataclass
class TargetModel:
    """What is known of one target.

    Attributes
    ----------
    target
        Type and property.
    clusterer
        Its modes.
    pairs, rules
        Binary classifiers, and the rules of each mode's roles, as of the last `ThesisModel.finish`.
    """

    target: Target
    clusterer: Clusterer
    pairs: tuple[Pair, ...] = ()
    rules: dict[int, tuple[RoleRule, ...]] = field(default_factory=dict)
    learned: int = -1

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes as records, the oldest first."""
        return tuple(
            cluster.mode(self.target, len(self.clusterer.members(cluster.number)))
            for cluster in self.clusterer.clusters
        )


@refusing_calls(ConfigError)
class ThesisModel:
    """Learns a schema's targets by chapter III and predicts with what it has learned.

    Parameters
    ----------
    schema
        Of the scenes.
    settings
        `ThesisSettings.thesis` (default) or `ThesisSettings.original`.
    targets
        What to learn; default: those that the schema declares. The thesis' system finds none by itself.

    Attributes
    ----------
    extra : dict
        Plain data of the caller's, kept in files.
    seen : int
        Number of transitions learned from.

    Raises
    ------
    SchemaError
        There are no targets, neither given nor declared.

    Notes
    -----
    It keeps all examples: a few hundred bytes each. A transition takes some 0.1 ms to learn. Classifiers are learned
    anew from all examples, which takes up to seconds, by `finish` and wherever something is asked after further
    learning: let a `ModelLearner` teach it with ``predict=False``.

    Examples
    --------
    >>> from itertools import islice
    >>> from relgym.experiments.data import ball_episodes
    >>> from relgym.thesis.settings import ThesisSettings
    >>> episodes = list(islice(ball_episodes(1, seed=900), 3))
    >>> model = ThesisModel(episodes[0].schema, ThesisSettings.thesis())
    >>> for transition in (t for episode in episodes for t in episode.transitions()):
    ...     _ = model.learn_one(transition)
    >>> [mode.formula(3) for mode in model.modes("ball", "vy")][:2]
    ["vy' = 0", "vy' = vy - 0.00098"]
    """

    def __init__(
        self,
        schema: SceneSchema,
        settings: ThesisSettings | None = None,
        *,
        targets: Sequence[Target] | None = None,
    ) -> None:
        chosen = tuple(schema.targets or ()) if targets is None else tuple(targets)
        if not chosen:
            raise SchemaError(
                "the thesis' system learns declared targets: pass targets=, or give the schema some"
            )
        self._schema, self._targets = schema, chosen
        self.settings = settings or ThesisSettings.thesis()
        self.seen, self.frozen = 0, False
        self.extra: dict[str, Any] = {}
        self._models = {
            (t.type, t.property): TargetModel(
                t, Clusterer(replace(self.settings, seed=self.settings.seed + k))
            )
            for k, t in enumerate(chosen)
        }
        self._extractor = Extractor(schema)
        self._close = Observer(self._extractor, close=self.settings.context == "close")
        self._whole = Observer(self._extractor, close=False)

    def __repr__(self) -> str:
        known = ", ".join(f"{t}: {len(self.modes(t.type, t.property))} modes" for t in self.targets)
        return f"ThesisModel({known}; {self.seen} transitions)"

    @property
    def schema(self) -> SceneSchema:
        """Of the scenes."""
        return self._schema

    @property
    def targets(self) -> tuple[Target, ...]:
        """What it learns."""
        return self._targets

    @property
    def discovers(self) -> bool:
        """Whether it finds targets by itself: never."""
        return False

    def governs(self, target: Target) -> bool:
        """Whether laws of motion predict a target: never, modes do."""
        return False

    def model_of(self, type_name: str, prop: str) -> TargetModel:
        """What is known of a target; `QueryError` if there is no such one."""
        found = self._models.get((type_name, prop))
        if found is None:
            raise QueryError(f"no target {type_name}.{prop}; there are {[str(t) for t in self.targets]}")
        return found

    def modes(self, type_name: str, prop: str) -> tuple[Mode, ...]:
        """Modes of a target, the oldest first."""
        return self.model_of(type_name, prop).modes

    def noise(self, type_name: str, prop: str) -> int:
        """Examples of a target that no mode explains."""
        return self.model_of(type_name, prop).clusterer.noise

    # ------------------------------------------------------------------ learning
    def learn_one(self, transition: Transition) -> LearnReport:
        """Take up a transition: an example for each target of each object that is still there afterwards."""
        before, after = transition.before, transition.after
        self.seen += 1
        found = {}
        for part in self._models.values():
            for index in before.layout.of_type(part.target.type):
                name, prop = before.layout.names[index], part.target.property
                if name in after:
                    found[name, prop] = part.clusterer.learn_one(
                        before.layout, index, before.vector, after[name][prop]
                    )
        return LearnReport(found, 0)

    def take_up(
        self,
        transition: Transition,
        prediction: ScenePrediction,
        residuals: Mapping[tuple[str, str], float],
        precision: float = 0.0,
    ) -> LearnReport:
        """`learn_one`: the thesis' system learns nothing from how its predictions came out."""
        return self.learn_one(transition)

    def finish(self) -> None:
        """Learn classifiers of modes and roles from all examples."""
        for part in self._models.values():
            if part.learned != self.seen:
                self._classify(part)
                part.learned = self.seen

    def _classify(self, part: TargetModel) -> None:
        rng = np.random.default_rng([self.settings.seed, self.seen])
        known = part.clusterer
        modes = [c.number for c in known.clusters]
        sample = self._sample(part)
        labels = known.labels
        part.pairs = tuple(
            learn_pair((a, b), sample, labels, self.settings, rng)
            for k, a in enumerate(modes)
            for b in modes[k + 1 :]
        )
        part.rules = {c.number: self._rules(part, c, rng) for c in known.clusters if len(c.roles) > 1}

    def _sample(self, part: TargetModel) -> Sample:
        """All training examples of a target."""
        examples = part.clusterer.examples
        parts: list[Facts] = []
        state = np.empty(examples.count, dtype=np.intp)
        names = self._own(part.target)
        numbers = np.empty((examples.count, len(names)))
        at = 0
        for group, arrangement in enumerate(examples.arrangements):
            rows, x = examples.rows(group)
            facts, which, _ = self._close.facts(arrangement.layout, x, arrangement.target)
            state[rows] = at + which
            numbers[rows] = x[:, [arrangement.layout.column(arrangement.target, n) for n in names]]
            parts.append(facts)
            at += len(facts)
        return (
            Sample(joined(parts), state, numbers, names)
            if parts
            else Sample(_nothing(self._close), state, numbers, names)
        )

    def _own(self, target: Target) -> tuple[str, ...]:
        """Properties of the target that trees test: all but where it is (§3.4.4)."""
        return tuple(p for p in self.schema.type(target.type).properties if p not in _POSITIONS)

    def _rules(self, part: TargetModel, cluster: Cluster, rng: np.random.Generator) -> tuple[RoleRule, ...]:
        """Learn which objects play a mode's roles, from those that did so in its examples."""
        examples = part.clusterer.examples
        members = part.clusterer.members(cluster.number)
        played: list[list[tuple[int, int, int, bool]]] = [[] for _ in cluster.roles[1:]]
        kinds = [role.kind for role in cluster.roles]
        alike = [[j for j, other in enumerate(kinds) if j and other == kind] for kind in kinds]
        parts: list[Facts] = []
        at = 0
        for group in np.unique(examples.groups[members]).tolist():
            arrangement = examples.arrangements[group]
            layout, target = arrangement.layout, arrangement.target
            rows = members[examples.groups[members] == group]
            x, y = examples.x(group, rows), examples.y[rows]
            facts, which, objects = self._whole.facts(layout, x, target)
            casts = cluster.castings(arrangement)
            for row, number in enumerate(cluster.cast(arrangement, x, y).tolist()):
                place = {int(i): k for k, i in enumerate(objects[which[row]].tolist()) if i >= 0}
                for k, role in enumerate(cluster.roles[1:]):
                    if not self.schema.type(role.type).has_body:
                        continue
                    for i in layout.of_type(role.type):
                        if i != target:
                            # Whoever plays one of several equal roles plays all of them (§3.5.1).
                            does = i in {casts[number].objects[j] for j in alike[k + 1]}
                            played[k].append((at + int(which[row]), place[target], place[i], does))
            parts.append(facts)
            at += len(facts)
        facts = joined(parts)
        return tuple(
            learn_role(role, facts, those, self.settings, rng) if those else RoleRule(role, ())
            for role, those in zip(cluster.roles[1:], played, strict=True)
        )

    # ------------------------------------------------------------------ prediction (§3.6)
    def predict_batch(self, layout: SceneLayout, vectors: Floats) -> BatchPrediction:
        """Predict the next step of scenes with the same objects, shape ``(n, layout.width)``."""
        self.finish()
        vectors = array_of("vectors", vectors, (None, layout.width), ConfigError)
        after = vectors.copy()
        parts, modes, outcomes = [], [], []
        for part in self._models.values():
            for index in layout.of_type(part.target.type):
                values, chosen, outcome = self._predict(part, layout, vectors, index)
                column = layout.column(index, part.target.property)
                after[:, column] = np.where(np.isfinite(values), values, vectors[:, column])
                parts.append((layout.names[index], part.target.property))
                modes.append(chosen)
                outcomes.append(outcome)
        for law in self.schema.derivations:
            for index in layout.of_type(law.type):
                rate = (after if law.uses_next else vectors)[:, layout.column(index, law.rate)]
                after[:, layout.column(index, law.property)] += law.step * rate
        return BatchPrediction(
            layout,
            after,
            tuple(parts),
            np.stack(modes, axis=1),
            np.stack(outcomes, axis=1),
            np.zeros((len(vectors), len(parts))),
            ("world",) * len(parts),
        )

    def predict_one(self, scene: Scene) -> ScenePrediction:
        """Predict the next scene; what can't be predicted keeps its value."""
        found = self.predict_batch(scene.layout, scene.vector[None])
        after = Scene(self.schema, scene.layout, found.vectors[0])
        parts = tuple(
            Prediction(name, prop, float(after[name][prop]), OUTCOMES[outcome], int(mode), (name,))
            for (name, prop), outcome, mode in zip(
                found.parts, found.outcomes[0].tolist(), found.modes[0].tolist(), strict=True
            )
        )
        return ScenePrediction(after, parts)

    def mode_values(self, type_name: str, prop: str, layout: SceneLayout, vectors: Floats) -> Floats:
        """What each mode would predict, shape ``(n, modes)``; NaN where other objects' roles are open."""
        part = self.model_of(type_name, prop)
        (index,) = layout.of_type(type_name)
        values = np.full((len(vectors), len(part.clusterer.clusters)), np.nan)
        for k, cluster in enumerate(part.clusterer.clusters):
            casts = list(_castings(cluster, layout, index))
            if len(casts) == 1:
                values[:, k] = casts[0].values(vectors)
        return values

    def _predict(
        self, part: TargetModel, layout: SceneLayout, vectors: Floats, index: int
    ) -> tuple[Floats, NDArray[np.int64], NDArray[np.int8]]:
        """Values, modes and outcomes for one object."""
        n = len(vectors)
        values, chosen = np.full(n, np.nan), np.zeros(n, dtype=np.int64)
        clusters = {c.number: c for c in part.clusterer.clusters}
        if not clusters:
            return values, chosen, np.full(n, OUTCOMES.index(Outcome.NO_MODE), dtype=np.int8)
        facts, which, _ = self._close.facts(layout, vectors, index)
        own = [layout.column(index, name) for name in self._own(part.target)]
        sample = Sample(facts, which, vectors[:, own], self._own(part.target))
        ranked = ranking(part.pairs, list(clusters), sample)
        whole = self._whole.facts(layout, vectors, index) if part.rules else None
        open_rows = np.arange(n)
        for rank in range(ranked.shape[1]):
            for number in np.unique(ranked[open_rows, rank]).tolist():
                rows = open_rows[ranked[open_rows, rank] == number]
                values[rows] = self._values(part, clusters[number], layout, vectors[rows], rows, index, whole)
                chosen[rows] = np.where(np.isfinite(values[rows]), number, 0)
            open_rows = np.flatnonzero(~np.isfinite(values))
            if not len(open_rows):
                break
        said = OUTCOMES.index(Outcome.PREDICTED), OUTCOMES.index(Outcome.NO_ROLES)
        return values, chosen, np.where(chosen > 0, *said).astype(np.int8)

    def _values(
        self,
        part: TargetModel,
        cluster: Cluster,
        layout: SceneLayout,
        vectors: Floats,
        rows: NDArray[np.intp],
        index: int,
        whole: tuple[Facts, NDArray[np.intp], NDArray[np.intp]] | None,
    ) -> Floats:
        """A mode's values, NaN where its roles can't be filled."""
        casts = {c.objects: c for c in _castings(cluster, layout, index)}
        if len(cluster.roles) == 1:
            (only,) = casts.values()
            return only.values(vectors)
        assert whole is not None, "modes with roles have rules"
        facts, which, objects = whole
        found = np.full(len(vectors), np.nan)
        rules = part.rules[cluster.number]
        for state in np.unique(which[rows]).tolist():
            cast = assign(rules, layout, facts, state, objects[state], index)
            here = which[rows] == state
            if cast is not None:
                found[here] = casts[cast].values(vectors[here])
        return found

    # ------------------------------------------------------------------ text
    def report(self, *, digits: int = 7) -> ModelReport:
        """Tables of modes, clauses and roles."""
        self.finish()
        return ModelReport(self.seen, tuple(_target_report(p, digits) for p in self._models.values()))

    def describe(self) -> str:
        """The tables as text."""
        return str(self.report())

    # ------------------------------------------------------------------ files
    def save(self, path: str | os.PathLike[str], *, history: bool = True) -> None:
        """Write the examples to one file, atomically: the same examples teach the same model (`load`).

        Parameters
        ----------
        path
            Where to write.
        history
            Without effect: the examples are all that is written, and what further learning needs.
        """
        stored = StoredExamples(
            self.schema,
            self.targets,
            self.settings,
            self.seen,
            self.extra,
            [self.model_of(t.type, t.property).clusterer.examples.stream() for t in self.targets],
        )
        write_examples(path, stored)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ThesisModel:
        """Read what `save` wrote, and learn it again: as long as it took to learn.

        Raises
        ------
        ModelFileError
            Truncated, edited, foreign, of another version, or inconsistent.
        """
        return _restored(read_examples(path))


def _restored(found: StoredExamples) -> ThesisModel:
    """What the examples of a file teach."""
    model = ThesisModel(found.schema, found.settings, targets=found.targets)
    for target, examples in zip(found.targets, found.examples, strict=True):
        clusterer = model.model_of(target.type, target.property).clusterer
        for layout, index, x, y in examples:
            clusterer.learn_one(layout, index, x, y)
    model.seen, model.extra = found.seen, found.extra
    return model


def _nothing(observer: Observer) -> Facts:
    relations, types = observer.relations, observer.types
    return Facts(
        relations,
        types,
        np.zeros((0, len(relations), 1, 1), dtype=np.bool_),
        np.zeros((0, len(types), 1), dtype=np.bool_),
        np.zeros((0, 1), dtype=np.intp),
    )


def _castings(cluster: Cluster, layout: SceneLayout, index: int) -> Sequence[Casting]:
    return cluster.castings(Arrangement(layout, index))


def _target_report(part: TargetModel, digits: int) -> TargetReport:
    modes = tuple(ModeRow(m.id, m.examples, m.formula(digits)) for m in part.modes)
    pairs = []
    for pair in part.pairs:
        rows = tuple(
            ClauseRow(
                "else" if stage.clause is None else str(stage.clause),
                stage.right,
                stage.wrong,
                () if stage.tree is None else stage.tree.rules(),
            )
            for stage in pair.stages
        )
        pairs.append(PairTable(pair.positive, pair.negative, rows))
    roles = []
    for mode in part.modes:
        rules = {rule.role.kind: rule for rule in part.rules.get(mode.id, ())}
        for label, role in zip(mode.role_labels()[1:], mode.open_roles, strict=True):
            if role.kind in rules and (rules[role.kind].clauses or label != role.type):
                roles.append(RoleRow(mode.id, role.type, (label,), str(rules[role.kind])))
    return TargetReport(
        str(part.target), part.target.type, part.clusterer.noise, modes, tuple(pairs), tuple(roles)
    )
