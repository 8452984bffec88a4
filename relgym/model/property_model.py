"""The model of one target: its modes, when each holds, and which objects its roles are bound to (Figure 1.4)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import NOISE as UNKNOWN
from relgym.classification.examples import Example, Vocabulary
from relgym.classification.mode_classifier import ModeClassifier
from relgym.clustering.clusterer import ClusterReport, ModeClusterer
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE
from relgym.config import ModelConfig
from relgym.model.answers import Answers
from relgym.model.casting import Casting
from relgym.model.conditions import Conditions, needed
from relgym.model.functions import Verdict, bodies_of
from relgym.model.guess import Guesses
from relgym.model.hindsight import Hindsight
from relgym.model.limits import Limits, find_limits
from relgym.model.perception import Situation
from relgym.model.scope import EVERYWHERE, LEAF, Scope, find_scope
from relgym.model.spread import Spreads, measure
from relgym.model.stops import Stops, find_stops
from relgym.scene.objects import Target
from relgym.scene.schema import SceneSchema
from relgym.scheduling.agenda import Budget

__all__ = ["PropertyModel", "Verdict", "bodies_of"]

MEASURE_EVERY = 256
"""Spreads are measured after so many examples, and whenever the modes change."""

HOPELESS, DOUBTFUL = 200, 500
"""Without a mode after so many examples there is no law; with most of so many recent ones unexplained, hardly one."""


RECENT, LEFT = 200, 0.05
"""Where a larger share of so many recent examples is unexplained, regressions may know better."""


class PropertyModel(Answers):
    """Learns and predicts one target.

    Parameters
    ----------
    target
        What it predicts.
    vocabulary
        Names of what its classifiers are shown, next values left aside.
    config
        Free parameters.
    schema
        The scenes' schema.

    Attributes
    ----------
    clusterer, classifier, casting
        The learners of modes, of their preconditions and of role bindings.
    spreads
        How far examples scatter about their modes.
    limits
        Which modes are limits: they take no part in the vote but cut off what its winner predicts.
    stops
        Which modes are walls at work: they take no part in the vote either.
    """

    def __init__(
        self, target: Target, vocabulary: Vocabulary, config: ModelConfig, schema: SceneSchema
    ) -> None:
        self.target = target
        self.schema = schema
        self._base = vocabulary
        conditions = Conditions(schema, target)
        super().__init__(
            ModeClusterer(target, config.clustering, seed=config.seed),
            ModeClassifier(conditions.vocabulary(vocabulary, ()), config.classifying),
            Casting(vocabulary, config.classification),
            conditions,
            config,
        )

    def _assess(self) -> bool:
        seen = self.clusterer.seen
        if not self.clusterer.clusters:
            return seen >= HOPELESS
        return seen >= DOUBTFUL and _noisy(self.clusterer.labels[-DOUBTFUL:]) > 0.5

    @property
    def needs(self) -> frozenset[tuple[str, str]]:
        """(type, property) pairs whose next values a mode's function reads or a clause tests."""
        modes = [c.mode for c in self.clusterer.clusters.values()]
        return needed(self.target, modes, self.classifier.classifiers)

    # ------------------------------------------------------------------ learning
    def learn_one(
        self,
        table: ExampleTable,
        row: int,
        y: float,
        situation: Situation,
        example: Example,
        budget: Budget | None = None,
    ) -> ClusterReport:
        """Take up one example: cluster it, then let the classifiers see where it belongs.

        Parameters
        ----------
        table, row
            The example's regression row.
        y
            The property's next value.
        situation, example
            How the target object is situated, in a single scene.
        budget
            What may be spent on searches; default: as much as they take.
        """
        self._compare(situation, example, table.x[row], y)
        report = self.clusterer.learn_one(table, row, y, budget)
        self._unsettled = _noisy(self.clusterer.labels[-RECENT:]) > LEFT
        if report.mode != NOISE and self.latest not in report.fits:
            self.latest = report.mode
        self._unexplained = self._assess()
        if report.changed or self.clusterer.seen % MEASURE_EVERY == 0:
            self._measure(table)
        x = table.x[row : row + 1]
        refuted = self.limits.overstepped(y, self.clusterer.scale.tolerance)
        if report.changed or refuted or self.stops.contradicted(report.mode, situation.signature, x[0]):
            self._follow(table)
        number = len(self.clusterer.y) - 1
        own = np.concatenate([example.own, self.conditions.values(situation.signature, x)[0]])
        seen = example.with_own(own, number)
        fits = np.array([i in report.fits for i in self.classifier.modes], dtype=bool)
        values = np.array(self._values_one(situation.signature, x[0].tolist(), self.classifier.modes))
        assigned = UNKNOWN if report.mode == NOISE or self.bounds(report.mode) else report.mode
        played = self._played_one(table, number, report.mode)
        self.classifier.observe(seen, assigned, fits, values, roles=played)
        if played:
            self.casting.observe(self.mode(report.mode), seen, played)
        return report

    def _compare(self, situation: Situation, example: Example, x: NDArray[np.float64], y: float) -> None:
        """Let the guess and the modes predict an example before it is learned from."""
        binding = self._guessing(situation.signature)
        if binding is None or self._unexplained or not self.classifier.modes:
            return
        row = x[: len(situation.signature.columns)].tolist()
        if not self.scope.covers_one(row, situation.signature):
            return
        values = self._values_one(situation.signature, row, self.classifier.modes)
        own = np.concatenate([example.own, self.conditions.values(situation.signature, x[None])[0]])
        first = self.classifier.rank(example.with_own(own), values).modes[0]
        said = values[self.classifier.modes.index(first)]
        if np.isfinite(said):
            self.guesses.compare(said - y, binding.value(row) - y)

    @property
    def flags(self) -> frozenset[str]:
        """Names, as clauses use them, of the numbers that are 1 or 0 as something holds or not."""
        others = {f"{t.name}.{prop}" for t in self.schema.types for prop in t.flags}
        return frozenset(others.union(self.schema.type(self.target.type).flags))

    @property
    def base_features(self) -> int:
        """Number of own features that classifiers are shown, next values left aside."""
        return len(self._base.own)

    def follow(self, table: ExampleTable) -> None:
        """The modes changed from outside: classifiers and spreads follow."""
        self._follow(table)
        self._unexplained = self._assess()
        self._measure(table)

    def _measure(self, table: ExampleTable) -> None:
        """How far examples scatter, and how far approximations go."""
        self.spreads = measure(self.clusterer, table)
        # Of bodies relations may tell what the numbers of a row don't.
        bodiless = not any(t.has_body for t in self.schema.types)
        bounded = self._guessable or (bodiless and self.clusterer.noise_examples >= LEAF)
        asked = self.config.abstain and bounded and len(self.clusterer.rows)
        self.scope = find_scope(self.clusterer, table, guessing=self._guessable) if asked else EVERYWHERE

    def start_over(self, table: ExampleTable) -> None:
        """Learn all classifiers anew, of what they remember."""
        self._widen(table, self.classifier.vocabulary.follows)

    def remember(self, table: ExampleTable, example: Example, weight: float) -> None:
        """Let the classifiers remember one more of the examples there are, by its number in ``example.row``."""
        number = np.array([example.row])
        assigned = int(self.clusterer.labels[example.row])
        modes = self.classifier.modes
        known, fits = self.clusterer.fits(table, number)
        shown = np.array([bool(fits[0, known.index(i)]) for i in modes], dtype=bool)
        values = self._values_many(table, self.clusterer.rows[number], modes)[0]
        played = self._played(table, number, assigned)[0].tolist()
        label = assigned if assigned in modes else UNKNOWN
        self.classifier.exemplars.add(example, label, shown, values, roles=played, weight=weight)
        if played:
            self.casting.observe(self.mode(assigned), example, played)

    def keep(self, rows: NDArray[np.bool_]) -> None:
        """Forget the examples of dropped rows of the example table, shape ``(rows,)``."""
        numbers = self.clusterer.keep(rows)
        exemplars = self.classifier.exemplars.columns["row"]
        exemplars[:] = numbers[exemplars]

    def go_on(self, table: ExampleTable, budget: Budget) -> None:
        """Go on with a search for modes that is under way, as far as the budget goes."""
        if self.clusterer.go_on(table, budget):
            self.follow(table)

    def approximate(self, table: ExampleTable, budget: Budget) -> None:
        """Look for an approximation if one is due, as far as the budget goes."""
        if self.clusterer.due and self.clusterer.approximate_now(table, budget):
            self.follow(table)

    def search(self, table: ExampleTable, budget: Budget) -> None:
        """Finish the searches that are under way or due."""
        changed = False
        while self.clusterer.searching or self.clusterer.due:
            changed |= self.clusterer.go_on(table, budget) | self.clusterer.approximate_now(table, budget)
        if changed:
            self.follow(table)

    def refresh(self, budget: int | None) -> int:
        """Re-learn stale classifiers within a budget of work (None: all); returns the work spent."""
        left = float("inf") if budget is None else budget
        spent = self.classifier.refresh(left)
        return spent + self.casting.refresh(self.classifier.exemplars, left - spent)

    def reconsider(self, table: ExampleTable, budget: Budget) -> None:
        """Guess anew where nothing is explained and it is time, as far as the budget goes."""
        if self._guessable and self.guesses.stale(self.clusterer.seen):
            self.guesses.renew(self.clusterer, table, self.scope, budget)

    def retarget(self, target: Target, table: ExampleTable) -> None:
        """Be given other next values: modes and classifiers are learned again, from what is remembered."""
        self.target = target
        self.conditions = Conditions(self.schema, target)
        self.clusterer.retarget(target)
        self.casting = Casting(self._base, self.config.classification)
        self.guesses.drop()
        self.hindsight = Hindsight()  # what follows is another model's word
        self.calibration.forget()
        self._follow(table)
        self._widen(table, self.classifier.vocabulary.follows)

    def lead(self, prop: str, step: float, table: ExampleTable) -> None:
        """Take note that ``prop' = prop + step * target'``: clauses may test where that leads to."""
        others = tuple(pair for pair in self.classifier.vocabulary.follows if pair[0] != prop)
        self._widen(table, (*others, (prop, step)))
        self._follow(table)

    def _widen(self, table: ExampleTable, follows: tuple[tuple[str, float], ...]) -> None:
        exemplars = self.classifier.exemplars
        rows = self.clusterer.rows[exemplars.rows.astype(np.intp)]
        ahead = np.full((len(rows), len(self.conditions.pairs)), np.nan)
        for number in np.unique(table.signature_ids[rows]):
            part = np.flatnonzero(table.signature_ids[rows] == number)
            ahead[part] = self.conditions.values(table.signatures[int(number)], table.x[rows[part]])
        own = exemplars.columns["own"][:, : len(self._base.own)]
        vocabulary = self.conditions.vocabulary(self._base, follows)
        self.classifier.widen(vocabulary, np.concatenate([own, ahead], axis=1))

    def _follow(self, table: ExampleTable) -> None:
        """The set of modes changed: what the classifiers remember is labelled anew."""
        self._bindings.clear()
        self.limits = find_limits(self.clusterer, table)
        self.stops = self._find_stops(table)
        numbers = self.classifier.exemplars.rows.astype(np.intp)
        known, fits = self.clusterer.fits(table, numbers)
        ids = tuple(i for i in known if not self.bounds(i))
        fits = fits[:, [not self.bounds(i) for i in known]]
        values = self._values_many(table, self.clusterer.rows[numbers], ids)
        labels = self.clusterer.labels[numbers].astype(np.int64)
        self.calibration.keep(ids)
        self.classifier.sync(ids, np.where(np.isin(labels, ids), labels, UNKNOWN), fits, values)
        self.casting.sync({m.id: m for m in self.modes})
        self._recast(table, self.classifier.exemplars)
        self.casting.recall(self.classifier.exemplars)

    def _find_stops(self, table: ExampleTable) -> Stops:
        given = [prop for name, prop in self.conditions.pairs if name == self.target.type]
        taken = (self.limits.low, self.limits.high)
        return find_stops(self.clusterer, table, self.classifier.vocabulary.follows, given, taken)

    # ------------------------------------------------------------------ saving
    def to_json(self, *, history: bool) -> dict[str, Any]:
        """Plain data: modes, classifiers and roles; exemplars only with history."""
        return {
            "clusterer": self.clusterer.to_json(),
            "unexplained": self._unexplained,
            "guess": self.guesses.to_json(),
            "spreads": self.spreads.to_json(),
            "scope": self.scope.to_json(),
            "latest": self.latest,
            "unsettled": self._unsettled,
            "classifier": self.classifier.to_dict(exemplars=history),
            "casting": self.casting.to_json(),
            "limits": self.limits.to_json(),
            "stops": self.stops.to_json(),
        }

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """What further learning needs beside `to_json`."""
        return self.clusterer.to_arrays()

    def restore(self, data: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
        """Take over what `to_json` and `to_arrays` wrote."""
        self.clusterer.restore(data["clusterer"], arrays)
        self._unexplained = bool(data["unexplained"])
        self.guesses = Guesses.from_json(self.target, data.get("guess", {}))
        self.spreads = Spreads.from_json(data["spreads"])
        self.scope = Scope.from_json(data.get("scope", {}))
        self.latest = int(data.get("latest", NOISE))
        self._unsettled = bool(data.get("unsettled", False))
        self.classifier = ModeClassifier.from_dict(data["classifier"], self.config.classifying)
        self.casting.restore(data["casting"])
        self.limits = Limits.from_json(data.get("limits", {}))
        self.stops = Stops.from_json(data.get("stops", {}))
        self._bindings.clear()


def _noisy(labels: NDArray[np.int32]) -> float:
    """Share of some examples, one at least, that no mode explains."""
    return np.count_nonzero(labels == NOISE) / len(labels)
