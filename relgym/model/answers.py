"""What the model of one target answers: votes, roles filled, and the value (§3.6)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import Example
from relgym.classification.mode_classifier import ModeClassifier
from relgym.classification.ranking import RankingBatch
from relgym.clustering.clusterer import ModeClusterer
from relgym.clustering.columns import SlotSignature
from relgym.clustering.mode import NOISE
from relgym.clustering.roles import Binding
from relgym.config import ModelConfig
from relgym.model.calibration import Assessment, Calibration, Key
from relgym.model.casting import Casting
from relgym.model.conditions import Conditions
from relgym.model.functions import Verdict
from relgym.model.grouping import distinct, members
from relgym.model.hindsight import Hindsight
from relgym.model.limits import Limits
from relgym.model.perception import Percept, Situation
from relgym.model.prediction import OUTCOMES, Outcome, Prediction
from relgym.model.spread import Spreads
from relgym.model.stand_ins import StandIns
from relgym.model.stops import Stops

__all__ = ["Answers"]

_PREDICTED, _NO_MODE, _NO_ROLES, _OUTSIDE, _UNEXPLAINED = (
    OUTCOMES.index(o)
    for o in (Outcome.PREDICTED, Outcome.NO_MODE, Outcome.NO_ROLES, Outcome.OUTSIDE, Outcome.UNEXPLAINED)
)


_NOTHING = Calibration()


class Answers(StandIns):
    """Predicts one target, in single scenes and in many, from what others have learned.

    Parameters
    ----------
    clusterer, classifier, casting
        Who knows the modes, when each holds, and which objects their roles are bound to.
    conditions
        Next values that clauses may test.
    config
        Free parameters.

    Attributes
    ----------
    spreads
        How far examples scatter about their modes.
    limits
        Which modes are limits: they take no part in the vote but cut off what its winner predicts.
    stops
        Which modes are walls at work: they take no part in the vote either.
    hindsight
        How the latest predictions came out, if somebody looked back at them.
    calibration
        How right predictions of every kind were, if somebody looked back at them, and who gives their values.
    latest
        Id of the mode that explained the latest example that any mode did.
    leaned_on
        Whether laws of other properties read this one's next value. Then its modes answer as long as it has any: what a
        guess leaves would be magnified in those laws.
    """

    def __init__(
        self,
        clusterer: ModeClusterer,
        classifier: ModeClassifier,
        casting: Casting,
        conditions: Conditions,
        config: ModelConfig,
    ) -> None:
        super().__init__(clusterer, casting, config)
        self.classifier = classifier
        self.conditions = conditions
        self.spreads = Spreads()
        self.limits = Limits()
        self.stops = Stops()
        self.hindsight = Hindsight()
        self.calibration = Calibration(config.claim_probability, config.claim_slips)
        self.latest = NOISE
        self._unsettled = True
        self.leaned_on = False

    def bounds(self, mode: int) -> bool:
        """Whether a mode takes no part in the vote, but stands in where the others would lead too far."""
        return mode in self.limits or mode in self.stops

    @property
    def unexplained(self) -> bool:
        """Whether it is known by now that modes don't describe the target: just some of its examples, or not when."""
        return self._unexplained or self.undecided

    @property
    def undecided(self) -> bool:
        """Whether modes cover the examples, but nothing tells which of them holds when (`relgym.model.hindsight`).

        With a single mode there is no choice; whether it holds is told by the examples that it leaves over.
        """
        return len(self.classifier.modes) > 1 and self.hindsight.undecided

    def assess(self, key: Key, values: Sequence[float]) -> Assessment:
        """Who gives the value of a prediction, and how right it will be."""
        return self._record.assess(key, values)

    def assess_many(
        self, key: Key, values: NDArray[np.float64]
    ) -> Iterator[tuple[NDArray[np.intp], Assessment]]:
        """`assess` of n predictions in one cell, ``values`` of shape ``(n, experts)``."""
        return self._record.assess_many(key, values)

    def claims(self, key: Key, told: Assessment) -> bool:
        """Whether a prediction of a mode or a law is claimed; what nobody ever looked back at isn't doubted."""
        return self._record.claims(key, told)

    @property
    def doubtful(self) -> bool:
        """Whether no kind of its modes' predictions came true often enough to be claimed."""
        kinds = [(key, told) for key, _, told in self._record.kinds(_PREDICTED)]
        return bool(kinds) and not any(self.claims(key, told) for key, told in kinds)

    def latest_values(
        self, percept: Percept, index: int, following: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """What the mode that held last says of one object of n scenes, shape ``(n,)``; None where nobody asks it.

        Nobody does where the vote's winners are mostly right. NaN where its roles are open.
        """
        known = self.latest in self.clusterer.clusters and not self.bounds(self.latest)
        asked = self.rough or self._record.doubts(_PREDICTED)
        if not known or not asked or len(self.classifier.modes) < 2:
            return None
        x = percept.rows(index, following, ordered=False)
        return self._values(percept.situation(index).signature, x, (self.latest,))[:, 0]

    @property
    def _record(self) -> Calibration:
        """What is known of earlier predictions; of a model that always answers nothing."""
        return self.calibration if self.config.abstain else _NOTHING

    @property
    def rough(self) -> bool:
        """Whether so much is unexplained, or explained only roughly, that regressions may know better."""
        return self._guessable or self._unsettled

    @property
    def _lost(self) -> bool:
        """Whether modes aren't asked: nothing is explained, or an approximation errs more than the guess."""
        return self._unexplained or (not self.leaned_on and self.guess is not None and self.guesses.superior)

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
        outcome = Outcome.UNEXPLAINED if self._lost else Outcome.NO_MODE
        nothing = Prediction("", "", float("nan"), outcome)
        if self._lost or not self.classifier.modes:
            return nothing
        casts = self._casts(situation.signature)
        row = percept.rows(index, following[None], ordered=casts)
        x = row[0].tolist()
        if not self.scope.covers_one(x, situation.signature):
            return replace(nothing, outcome=Outcome.UNEXPLAINED)
        example = self._shown(situation, row)
        ranking = self.classifier.rank(
            example, self._values_one(situation.signature, x, self.classifier.modes)
        )
        if self.config.abstain and not ranking.seen and len(self.classifier.modes) > 1:
            return self._leaning(ranking.modes[0], situation.signature, row)
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
            outcome = Outcome.UNEXPLAINED if self.undecided else Outcome.PREDICTED
            value = self.within(binding.value(x, slots), situation.signature, row)
            found = Prediction("", "", value, outcome, mode, roles, margin)
            found = self._stopped(self.limits.cut_off(found), situation.signature, row)
            return replace(found, spread=self.spreads.at(found.mode, situation.signature, x))
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
        if self._lost:
            verdict.outcomes[:] = _UNEXPLAINED
        if self._lost or not modes:
            return verdict
        situation = percept.situation(index)
        x = percept.rows(index, following, ordered=self._casts(situation.signature))
        ranking = self._rank_batch(situation, x)
        verdict.outcomes[:] = _NO_ROLES
        said = _UNEXPLAINED if self.undecided else _PREDICTED
        outside = ~ranking.seen if self.config.abstain and len(modes) > 1 else np.zeros(n, dtype=np.bool_)
        beyond = ~self.scope.covers(x, situation.signature)
        verdict.outcomes[outside], verdict.outcomes[beyond] = _OUTSIDE, _UNEXPLAINED
        waiting = ~(outside | beyond)
        for place in range(len(modes)):
            for mode in np.unique(ranking.modes[waiting, place]):
                binding = self._binding(situation.signature, int(mode))
                if binding is None:
                    continue
                part = np.flatnonzero(waiting & (ranking.modes[:, place] == mode))
                done, values = self._apply(int(mode), binding, percept, situation, x, part)
                verdict.values[done], verdict.modes[done] = values, mode
                verdict.outcomes[done] = said
                verdict.margins[done] = ranking.margin[done] if place == 0 else 0.0
                waiting[done] = False
                if self.config.abstain:  # in doubt about the players
                    verdict.outcomes[part[waiting[part]]] = _OUTSIDE
                    waiting[part] = False
            if not waiting.any():
                break
        verdict.values[:] = self.all_within(verdict.values, situation.signature, x)
        self.limits.cut_off_all(verdict.values, verdict.modes)
        self.stops.apply(situation.signature, x, verdict.values, verdict.modes)
        self._lean(verdict, ranking.modes[:, 0], outside & ~beyond, situation.signature, x)
        return verdict

    def _leaning(self, mode: int, signature: SlotSignature, row: NDArray[np.float64]) -> Prediction:
        """Outside experience: no claim, but the value that the vote's winner gives, if none of its roles is open."""
        binding = self._binding(signature, mode)
        if binding is None or binding.open:
            return Prediction("", "", float("nan"), Outcome.OUTSIDE)
        x = row[0].tolist()
        value, spread = self.within(binding.value(x), signature, row), self.spreads.at(mode, signature, x)
        return Prediction("", "", value, Outcome.OUTSIDE, spread=spread)

    def _lean(
        self,
        verdict: Verdict,
        winners: NDArray[np.int64],
        outside: NDArray[np.bool_],
        signature: SlotSignature,
        x: NDArray[np.float64],
    ) -> None:
        """`_leaning` of all scenes that are outside experience, shape ``(n,)``."""
        for mode in np.unique(winners[outside]):
            binding = self._binding(signature, int(mode))
            if binding is not None and not binding.open:
                part = outside & (winners == mode)
                verdict.values[part] = self.all_within(binding.values(x[part])[:, 0], signature, x[part])

    def _stopped(self, found: Prediction, signature: SlotSignature, row: NDArray[np.float64]) -> Prediction:
        """The prediction, or the constant of a stop that it runs into."""
        if not self.stops.every:
            return found
        values, modes = np.array([found.value]), np.array([found.mode])
        self.stops.apply(signature, row, values, modes)
        if modes[0] == found.mode:
            return found
        return replace(found, value=float(values[0]), mode=int(modes[0]), roles=found.roles[:1])

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
        """Rank the modes for n examples; a single mode has no runner-up and needs no look at the scene."""
        modes, n = self.classifier.modes, len(x)
        if len(modes) == 1:
            sure = np.ones(n, dtype=np.bool_)
            return RankingBatch(np.full((n, 1), modes[0]), np.zeros((n, 1)), np.full(n, np.inf), sure, sure)
        shown = situation.preview(self.classifier.relations)
        if self.conditions.pairs:
            ahead = self.conditions.values(situation.signature, x)
            shown = replace(shown, own=np.concatenate([shown.own, ahead], axis=1))
        return self.classifier.rank_batch(shown, self._values(situation.signature, x, modes))
