"""The model of one target: its modes, when each holds, and which objects play its roles (Figure 1.4)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import NOISE as UNKNOWN
from relgym.classification.examples import Example, Vocabulary
from relgym.classification.mode_classifier import ModeClassifier
from relgym.classification.ranking import RankingBatch
from relgym.clustering.clusterer import ClusterReport, ModeClusterer
from relgym.clustering.columns import SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE
from relgym.clustering.roles import Binding
from relgym.config import ModelConfig
from relgym.model.casting import Casting
from relgym.model.conditions import Conditions, needed
from relgym.model.functions import ModeFunctions, Verdict, bodies_of
from relgym.model.grouping import distinct, members
from relgym.model.limits import Limits, find_limits
from relgym.model.perception import Percept, Situation
from relgym.model.prediction import OUTCOMES, Outcome, Prediction
from relgym.model.spread import Spreads, action_columns, measure
from relgym.scene.objects import SceneSchema, Target

__all__ = ["PropertyModel", "Verdict", "bodies_of"]

_PREDICTED, _NO_MODE, _NO_ROLES, _OUTSIDE, _UNEXPLAINED = (
    OUTCOMES.index(o)
    for o in (Outcome.PREDICTED, Outcome.NO_MODE, Outcome.NO_ROLES, Outcome.OUTSIDE, Outcome.UNEXPLAINED)
)

MEASURE_EVERY = 256
"""Spreads are measured after so many examples, and whenever the modes change."""

HOPELESS, DOUBTFUL = 200, 500
"""Without a mode after so many examples there is no law; with most of so many recent ones unexplained, hardly one."""


class PropertyModel(ModeFunctions):
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
        The learners of modes, of their preconditions and of who plays their roles.
    spreads
        How far examples scatter about their modes.
    limits
        Which modes are limits: they take no part in the vote but cut off what its winner predicts.
    """

    def __init__(
        self, target: Target, vocabulary: Vocabulary, config: ModelConfig, schema: SceneSchema
    ) -> None:
        self.target = target
        self.schema = schema
        self.conditions = Conditions(schema, target)
        self._base = vocabulary
        clusterer = ModeClusterer(target, config.clustering, seed=config.seed)
        super().__init__(clusterer, Casting(vocabulary, config.classification), config)
        self.classifier = ModeClassifier(self.conditions.vocabulary(vocabulary, ()), config.classification)
        self.spreads = Spreads()
        self._unexplained = False
        self.limits = Limits()

    @property
    def unexplained(self) -> bool:
        """Whether it is known by now that modes don't describe the target, or just some of its examples."""
        return self._unexplained

    def _judge(self) -> bool:
        seen = self.clusterer.seen
        if not self.clusterer.clusters:
            return seen >= HOPELESS
        return seen >= DOUBTFUL and bool((self.clusterer.labels[-DOUBTFUL:] == NOISE).mean() > 0.5)

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
        """
        report = self.clusterer.learn_one(table, row, y)
        self._unexplained = self._judge()
        if report.changed or self.clusterer.seen % MEASURE_EVERY == 0:
            self.spreads = measure(self.clusterer, table)
        if report.changed or self.limits.overstepped(y, self.clusterer.scale.tolerance):
            self._follow(table)
        number = len(self.clusterer.y) - 1
        x = table.x[row : row + 1]
        own = np.concatenate([example.own, self.conditions.values(situation.signature, x)[0]])
        seen = replace(example, row=number, own=own)
        fits = np.array([i in report.fits for i in self.classifier.modes], dtype=bool)
        values = np.array(self._values_one(situation.signature, x[0].tolist(), self.classifier.modes))
        assigned = UNKNOWN if report.mode == NOISE or report.mode in self.limits else report.mode
        played = self._played(table, np.array([number]), report.mode)[0].tolist()
        self.classifier.observe(seen, assigned, fits, values, roles=played)
        if played:
            self.casting.observe(self.mode(report.mode), seen, played)
        return report

    @property
    def base_features(self) -> int:
        """Number of own features that classifiers are shown, next values left aside."""
        return len(self._base.own)

    def follow(self, table: ExampleTable) -> None:
        """The modes changed from outside: classifiers and spreads follow."""
        self._follow(table)
        self.spreads, self._unexplained = measure(self.clusterer, table), self._judge()

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

    def refresh(self, budget: int | None) -> int:
        """Re-learn stale classifiers within a budget of work (None: all); returns the work spent."""
        left = float("inf") if budget is None else budget
        spent = self.classifier.refresh(left)
        return spent + self.casting.refresh(self.classifier.exemplars, left - spent)

    def retarget(self, target: Target, table: ExampleTable) -> None:
        """Be given other next values: modes and classifiers are learned again, from what is remembered."""
        self.target = target
        self.conditions = Conditions(self.schema, target)
        self.clusterer.retarget(target)
        self.casting = Casting(self._base, self.config.classification)
        self._follow(table)
        self._widen(table, self.classifier.vocabulary.follows)

    def lead(self, prop: str, step: float, table: ExampleTable) -> None:
        """Take note that ``prop' = prop + step * target'``: clauses may test where that leads to."""
        others = tuple(pair for pair in self.classifier.vocabulary.follows if pair[0] != prop)
        self._widen(table, (*others, (prop, step)))

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
        numbers = self.classifier.exemplars.rows.astype(np.intp)
        known, fits = self.clusterer.fits(table, numbers)
        ids = tuple(i for i in known if i not in self.limits)
        fits = fits[:, [i not in self.limits for i in known]]
        values = self._values_many(table, self.clusterer.rows[numbers], ids)
        labels = self.clusterer.labels[numbers].astype(np.int64)
        self.classifier.sync(ids, np.where(np.isin(labels, ids), labels, UNKNOWN), fits, values)
        self.casting.sync({m.id: m for m in self.modes})
        self._recast(table, self.classifier.exemplars)

    # ------------------------------------------------------------------ prediction (§3.6)
    def mode_values(self, percept: Percept, index: int, following: NDArray[np.float64]) -> list[float]:
        """What every mode would predict, in the order of ``classifier.modes``; NaN where its roles are open.

        Arguments as of `predict_one`.
        """
        x = percept.rows(index, following[None])[0].tolist()
        return self._values_one(percept.situation(index).signature, x, self.classifier.modes)

    def example(self, percept: Percept, index: int, following: NDArray[np.float64]) -> Example:
        """What the classifiers are shown of a single scene; arguments as of `predict_one`."""
        situation = percept.situation(index)
        # Conditions are of objects alone of their type, so their order doesn't matter.
        x = percept.rows(index, following[None], ordered=False)
        return replace(self._shown(situation, x), key=situation.keys[0])

    def _shown(self, situation: Situation, x: NDArray[np.float64]) -> Example:
        """`example` without the key, by which examples are kept and not classified."""
        first = situation.examples[0]
        if not self.conditions.pairs:
            return first
        ahead = self.conditions.values(situation.signature, x)[0]
        return replace(first, own=np.concatenate([first.own, ahead]))

    def predict_one(self, percept: Percept, index: int, following: NDArray[np.float64]) -> Prediction:
        """Predict for one object of a single scene; the caller fills in names.

        Parameters
        ----------
        percept
            The scene.
        index
            The object.
        following
            Next values predicted so far, shape ``(width,)``.
        """
        situation = percept.situation(index)
        outcome = Outcome.UNEXPLAINED if self._unexplained else Outcome.NO_MODE
        nothing = Prediction("", "", float("nan"), outcome)
        if self._unexplained or not self.classifier.modes:
            return nothing
        casts = self._casts(situation.signature)
        row = percept.rows(index, following[None], ordered=casts)
        x, example = row[0].tolist(), self._shown(situation, row)
        ranking = self.classifier.rank(
            example, self._values_one(situation.signature, x, self.classifier.modes)
        )
        if self.config.abstain and not ranking.seen and len(self.classifier.modes) > 1:
            return replace(nothing, outcome=Outcome.OUTSIDE)
        layout, order = percept.layout, situation.order[0] if casts else situation.plain
        for place, mode in enumerate(ranking.modes):
            binding = self._binding(situation.signature, mode)
            if binding is None:
                continue
            slots: tuple[int, ...] | None = ()
            if binding.open:
                slots = self._cast(mode, binding, example, order, layout)
            if slots is None:
                if not self.config.abstain:
                    continue
                # What lost the vote doesn't become likely because the winner's players are in doubt.
                return replace(nothing, outcome=Outcome.OUTSIDE)
            rest = iter(slots)
            played = (0, *(s if s >= 0 else next(rest) for s in binding.forced))
            roles = tuple(layout.names[order[s]] for s in played)
            margin = ranking.margin if place == 0 else 0.0
            found = Prediction("", "", binding.value(x, slots), Outcome.PREDICTED, mode, roles, margin)
            found = self.limits.cut_off(found)
            action = tuple(x[k] for k in action_columns(situation.signature).tolist())
            return replace(found, spread=self.spreads.of(found.mode, action))
        return replace(nothing, outcome=Outcome.NO_ROLES)

    def predict_batch(self, percept: Percept, index: int, following: NDArray[np.float64]) -> Verdict:
        """Predict for one object of n scenes; bit for bit what `predict_one` gives.

        Parameters
        ----------
        percept
            The scenes.
        index
            The object.
        following
            Next values predicted so far, shape ``(n, width)``.
        """
        n = len(percept)
        verdict = Verdict(
            np.full(n, np.nan), np.zeros(n, dtype=np.int64), np.full(n, _NO_MODE, dtype=np.int8), np.zeros(n)
        )
        modes = self.classifier.modes
        if self._unexplained:
            verdict.outcomes[:] = _UNEXPLAINED
        if self._unexplained or not modes:
            return verdict
        situation = percept.situation(index)
        x = percept.rows(index, following, ordered=self._casts(situation.signature))
        ranking = self._rank_batch(situation, x)
        verdict.outcomes[:] = _NO_ROLES
        waiting = np.ones(n, dtype=bool)
        if self.config.abstain and len(modes) > 1:
            waiting = ranking.seen.copy()
            verdict.outcomes[~waiting] = _OUTSIDE
        for place in range(len(modes)):
            for mode in np.unique(ranking.modes[waiting, place]):
                binding = self._binding(situation.signature, int(mode))
                if binding is None:
                    continue
                part = np.flatnonzero(waiting & (ranking.modes[:, place] == mode))
                done, values = self._apply(int(mode), binding, percept, situation, x, part)
                verdict.values[done], verdict.modes[done] = values, mode
                verdict.outcomes[done] = _PREDICTED
                verdict.margins[done] = ranking.margin[done] if place == 0 else 0.0
                waiting[done] = False
                if self.config.abstain:  # in doubt about the players
                    verdict.outcomes[part[waiting[part]]] = _OUTSIDE
                    waiting[part] = False
            if not waiting.any():
                break
        self.limits.cut_off_all(verdict.values, verdict.modes)
        return verdict

    def _apply(
        self,
        mode: int,
        binding: Binding,
        percept: Percept,
        situation: Situation,
        x: NDArray[np.float64],
        part: NDArray[np.intp],
    ) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Those of the given examples whose roles can be filled, and the mode's values there."""
        if not binding.open:
            return part, binding.values(x[part])[:, 0]
        examples, order = situation.examples, situation.order
        done, values = np.zeros(len(part), dtype=np.bool_), np.full(len(part), np.nan)
        # Players depend on the relations and the order alone: one search for all scenes that share them.
        first, which = distinct(examples.table[part], order[part])
        for i, alike in zip(part[first].tolist(), members(which), strict=True):
            slots = self._cast(mode, binding, examples[i], order[i], percept.layout)
            if slots is not None:
                done[alike], values[alike] = True, binding.values_as(x[part[alike]], slots)
        return part[done], values[done]

    def _casts(self, signature: SlotSignature) -> bool:
        """Whether some mode has a role that several objects could play."""
        bindings = (self._binding(signature, mode) for mode in self.classifier.modes)
        return any(binding is not None and bool(binding.open) for binding in bindings)

    def _rank_batch(self, situation: Situation, x: NDArray[np.float64]) -> RankingBatch:
        """Rank the modes for n examples; a single mode has no rival and needs no look at the scene."""
        modes, n = self.classifier.modes, len(x)
        if len(modes) == 1:
            sure = np.ones(n, dtype=np.bool_)
            return RankingBatch(np.full((n, 1), modes[0]), np.zeros((n, 1)), np.full(n, np.inf), sure, sure)
        shown = situation.glimpse(self.classifier.relations)
        if self.conditions.pairs:
            ahead = self.conditions.values(situation.signature, x)
            shown = replace(shown, own=np.concatenate([shown.own, ahead], axis=1))
        return self.classifier.rank_batch(shown, self._values(situation.signature, x, modes))

    # ------------------------------------------------------------------ saving
    def to_json(self, *, history: bool) -> dict[str, Any]:
        """Plain data: modes, classifiers and roles; exemplars only with history."""
        return {
            "clusterer": self.clusterer.to_json(),
            "unexplained": self._unexplained,
            "spreads": self.spreads.to_json(),
            "classifier": self.classifier.to_dict(exemplars=history),
            "casting": self.casting.to_json(),
            "limits": self.limits.to_json(),
        }

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """What further learning needs beside `to_json`."""
        return self.clusterer.to_arrays()

    def restore(self, data: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
        """Take over what `to_json` and `to_arrays` wrote."""
        self.clusterer.restore(data["clusterer"], arrays)
        self._unexplained = bool(data["unexplained"])
        self.spreads = Spreads.from_json(data["spreads"])
        self.classifier = ModeClassifier.from_dict(data["classifier"], self.config.classification)
        self.casting.restore(data["casting"])
        self.limits = Limits.from_json(data.get("limits", {}))
        self._bindings.clear()
