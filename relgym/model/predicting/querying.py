"""Asking a world model: what follows one scene, or many with the same objects (Figure 1.5, §3.6)."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.model.parts import Parts
from relgym.model.percepts.perception import Percept
from relgym.model.percepts.scenes import wrap
from relgym.model.predicting.calibration import (
    EXPERTS,
    GUESS,
    LATEST,
    OWN,
    PERSISTENCE,
    REGRESSION,
    Audit,
    Key,
    far_bin,
    far_bins,
    key_of,
    keys_of,
)
from relgym.model.predicting.prediction import (
    OUTCOMES,
    BatchPrediction,
    LateAudit,
    Outcome,
    Prediction,
    ScenePrediction,
)
from relgym.model.target.property_model import PropertyModel, Verdict
from relgym.program.records import VALUED
from relgym.scene.objects import Scene, SceneLayout, Target
from relgym.scene.schema import SceneSchema

__all__ = ["Odds", "Said", "derive", "predict", "predict_many", "settled"]

_PREDICTED, _OUTSIDE, _DEPENDS, _UNEXPLAINED, _UNSURE = (
    OUTCOMES.index(o)
    for o in (Outcome.PREDICTED, Outcome.OUTSIDE, Outcome.DEPENDS, Outcome.UNEXPLAINED, Outcome.UNSURE)
)


class Odds:
    """How probably the predictions of a scene are right, as they are made, by (type, property).

    Whose record is of steps in which what it reads was right is right as probably as both are.
    """

    __slots__ = ("_least",)

    def __init__(self) -> None:
        self._least: dict[tuple[str, str], float] = {}

    def add(self, pair: tuple[str, str], probability: float) -> None:
        """Take note of one; of several objects the least probable counts, and NaN for certain."""
        if probability < self._least.get(pair, 1.0):
            self._least[pair] = probability

    def together(self, pairs: Collection[tuple[str, str]]) -> float:
        """How probably all of some are right, multiplied in the order of predictions."""
        found = 1.0
        for pair, probability in self._least.items() if pairs else ():
            if pair in pairs:
                found *= probability
        return found


class Said(NamedTuple):
    """What modes or laws say, before it is asked how right such predictions were; attributes as of `Prediction`."""

    value: float
    outcome: Outcome
    mode: int
    roles: tuple[str, ...]
    margin: float
    frame: str
    spread: float


def predict(parts: Parts, percept: Percept, scene: Scene) -> ScenePrediction:
    """Predict the scene that follows one whose numbers are finite."""
    layout, following = scene.layout, scene.vector.copy()
    found: list[Prediction] = []
    lost: set[tuple[str, str]] = set()
    odds = Odds()
    motion = None if parts.laws is None else parts.laws.speak(percept)
    for target in parts.targets:
        for index in layout.of_type(target.type):
            lawful = False
            if motion is not None and parts.laws is not None and parts.laws.governs(target):
                lawful = True
                one = parts.laws.prediction(motion, percept, index, target)
            else:
                one = parts.models[target].predict_one(percept, index, following)
            if not lost.isdisjoint(target.given) and not lost.isdisjoint(parts.models[target].needs):
                one = Prediction("", "", one.value, Outcome.DEPENDS, spread=one.spread)
            column = layout.column(index, target.property)
            if not np.isfinite(one.value):
                # A mode whose value overflows has left its experience; other outcomes say why they are empty.
                outcome = Outcome.OUTSIDE if one.ok else one.outcome
                one = one.replace(outcome=outcome, mode=0, spread=np.nan)
            one = settled(parts, parts.models[target], percept, index, following, one, odds, lawful=lawful)
            following[column] = one.value
            if not one.ok:
                lost.add((target.type, target.property))
            found.append(one)
    derive(parts.schema, layout, scene.vector[None], following[None])
    wrap(layout, following)
    return ScenePrediction(Scene(scene.schema, layout, following), tuple(found))


def settled(
    parts: Parts,
    model: PropertyModel,
    percept: Percept,
    index: int,
    following: NDArray[np.float64],
    one: Prediction | Said,
    odds: Odds,
    values: tuple[float, ...] | None = None,
    far: int | None = None,
    relied_on: Collection[tuple[str, str]] | None = None,
    *,
    lawful: bool,
) -> Prediction:
    """A prediction with the value of who codes such ones best, how right that will be, and what it is of.

    Parameters
    ----------
    parts, model, percept, index
        All that is learned, who predicts, and for which object of which scene.
    following
        Next values as far as they are predicted, the present one of this property, shape ``(width,)``.
    one
        What modes or laws say; its value is NaN where they say nothing.
    odds
        How probably predictions so far are right, of each (type, property) the least; this one's is added.
    values
        What all experts say, if that is known already.
    far
        The bin of how far the scene lies from what was learned (`far_bin`), where that counts, if it is known already.
    relied_on
        See `Parts.relied_on`, if it is known already.
    lawful
        Whether laws say it (`Parts.governs`).
    """
    target, mode, margin = model.target, one.mode, one.margin
    # Whether a target counts as undecided or not, what won its vote is as right as it is.
    if far is None:
        asks = mode != 0 and not lawful and model.tells_how_far
        away = parts.distance(percept, index, target.property) if asks else None
        far = 0 if away is None else far_bin(float(away[0]))
    far = VALUED if not mode and math.isfinite(one.value) else far
    key = key_of(_PREDICTED if mode else OUTCOMES.index(one.outcome), -mode if lawful else mode, margin, far)
    word = model.own_word(key) if values is None and math.isfinite(one.value) else None
    record: Audit | LateAudit
    if word is not None:  # what others would have said is asked if somebody looks back
        told, value, present = word, one.value, following.copy()
        claimed = model.claims(key, told)
        others = partial(_overruled, parts, target, percept, index, present, value, lawful=lawful, key=key)
        now = float(present[percept.layout.column(index, target.property)])
        record = LateAudit(others, key, OWN, now)
    else:
        if values is None:
            values = _experts_one(parts, target, percept, index, following, one.value, lawful=lawful)
        told, claimed = model.verdict(key, values)
        value, record = values[told.speaker], Audit(key, values, told.speaker)
    speaker, probability, _, spread = told
    if speaker == OWN and key.winner > 0:
        rests = odds.together(parts.relied_on(model) if relied_on is None else relied_on)
        probability = probability * rests if rests < 1.0 else probability
    odds.add((target.type, target.property), probability)
    roles = one.roles
    outcome = _outcome(one, speaker, claimed=claimed, known=bool(model.calibration.trials))
    if speaker == OWN:
        spread = one.spread
    elif speaker == LATEST and mode:
        mode, roles = model.latest, roles[:1]
    elif speaker == PERSISTENCE:
        spread = math.nan
    elif speaker >= len(EXPERTS):  # its word has nothing to do with modes
        mode, roles, margin = 0, (), 0.0
    elif speaker == GUESS:
        best = model.fallback.guess_at(percept, index, following)
        spread = one.spread if best is None else best.mode.sigma
    return Prediction(
        percept.layout.names[index],
        target.property,
        value,
        outcome,
        mode,
        roles,
        margin,
        one.frame,
        spread,
        probability,
        told.interval,
        record,
    )


def _overruled(
    parts: Parts,
    target: Target,
    percept: Percept,
    index: int,
    following: NDArray[np.float64],
    own: float,
    *,
    lawful: bool,
    key: Key,
) -> Audit | None:
    """What looking back needs of a prediction whose winner had the word; None once that is no target any more."""
    if target not in parts.models:
        return None
    values = _experts_one(parts, target, percept, index, following, own, lawful=lawful)
    return Audit(key, values, OWN)


def _latest_values(
    parts: Parts, model: PropertyModel, percept: Percept, index: int, following: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """What the mode that held last says of one object of n scenes, shape ``(n,)``; None where nobody asks it.

    NaN where its roles are open, and of all scenes but those that follow the latest transition: what decides which mode
    holds may be hidden, and of other scenes it would tell nothing.
    """
    if parts.arrival is None or not model.asks_latest:
        return None
    rows = parts.arrival.rows(percept.layout, percept.vectors)
    if not len(rows):
        return None
    found = np.full(len(following), np.nan)
    found[rows] = model.latest_values(percept, index, following)[rows]
    return found


def _experts_one(
    parts: Parts,
    target: Target,
    percept: Percept,
    index: int,
    following: NDArray[np.float64],
    own: float,
    *,
    lawful: bool,
) -> tuple[float, ...]:
    """`_experts` of a single scene."""
    model = parts.models[target]
    found = [math.nan] * model.calibration.experts
    present = found[PERSISTENCE] = float(following[percept.layout.column(index, target.property)])
    if math.isfinite(own):
        found[OWN] = own
    if model.fallback.guesses_something:
        guessed = model.fallback.guessed(percept, index, following[None])
        found[GUESS] = math.nan if guessed is None else float(guessed[0])
    if lawful:
        return tuple(found)
    latest = _latest_values(parts, model, percept, index, following[None])
    found[LATEST] = math.nan if latest is None else float(latest[0])
    changes = parts.regressed(percept, index, target.property) if model.asks_regressions else None
    if changes is not None:
        found[REGRESSION] = present + float(changes[0])
    if model.candidates:
        found[len(EXPERTS) :] = _hypothesised(parts, target, percept, index)[0].tolist()
    return tuple([value if math.isfinite(value) else math.nan for value in found])


def _outcome(one: Prediction | Said, speaker: int, *, claimed: bool, known: bool) -> Outcome:
    """What is known of a mode's predictions, or of a hypothesis', has the last word on whether one is claimed."""
    said = one.outcome
    if said is Outcome.PREDICTED or (speaker >= len(EXPERTS) and claimed):
        return Outcome.PREDICTED if claimed else Outcome.UNSURE
    trusted = one.mode and said is Outcome.UNEXPLAINED and claimed and known
    return Outcome.PREDICTED if trusted else said


def _experts(
    parts: Parts,
    target: Target,
    percept: Percept,
    index: int,
    following: NDArray[np.float64],
    own: NDArray[np.float64],
) -> NDArray[np.float64]:
    """What each of `EXPERTS` says of one object of n scenes, shape ``(n, experts)``; NaN: nothing."""
    model = parts.models[target]
    found = np.full((len(own), model.calibration.experts), np.nan)
    present = following[:, percept.layout.column(index, target.property)]
    found[:, OWN], found[:, PERSISTENCE] = np.where(np.isfinite(own), own, np.nan), present
    guessed = model.fallback.guessed(percept, index, following) if model.fallback.guesses_something else None
    if guessed is not None:
        found[:, GUESS] = np.where(np.isfinite(guessed), guessed, np.nan)
    latest = None if parts.governs(target) else _latest_values(parts, model, percept, index, following)
    if latest is not None:
        found[:, LATEST] = np.where(np.isfinite(latest), latest, np.nan)
    if model.asks_regressions and not parts.governs(target):
        changes = parts.regressed(percept, index, target.property)
        if changes is not None:
            told = present + changes
            found[:, REGRESSION] = np.where(np.isfinite(told), told, np.nan)
    if model.candidates and not parts.governs(target):
        found[:, len(EXPERTS) :] = _hypothesised(parts, target, percept, index)
    return found


def _hypothesised(parts: Parts, target: Target, percept: Percept, index: int) -> NDArray[np.float64]:
    """What hypotheses say of one object of n scenes, shape ``(n, hypotheses)``: they read what there is alone."""
    x = percept.rows(index, percept.vectors, ordered=False)
    return parts.models[target].candidates.values(percept.situation(index).signature, x)


def predict_many(
    parts: Parts, percept: Percept, layout: SceneLayout, vectors: NDArray[np.float64]
) -> BatchPrediction:
    """Predict what follows n scenes with the same objects; bit for bit what `predict` gives."""
    following = vectors.copy()
    keys: list[tuple[str, str]] = []
    verdicts: list[Verdict] = []
    probabilities: list[NDArray[np.float64]] = []
    intervals: list[NDArray[np.float64]] = []
    lost: dict[tuple[str, str], NDArray[np.bool_]] = {}
    odds: dict[tuple[str, str], NDArray[np.float64]] = {}
    nowhere = np.zeros(len(vectors), dtype=bool)
    motion = None if parts.laws is None else parts.laws.speak(percept)
    for target in parts.targets:
        for index in layout.of_type(target.type):
            if motion is not None and parts.laws is not None and parts.laws.governs(target):
                verdict = parts.laws.verdict(motion, percept, index, target)
            else:
                verdict = parts.models[target].predict_batch(percept, index, following)
            for pair in parts.models[target].needs if lost else ():
                rows = lost.get(pair, nowhere)
                verdict.outcomes[rows], verdict.margins[rows] = _DEPENDS, 0.0
            told = np.isfinite(verdict.values)
            known = told & (verdict.outcomes == _PREDICTED)
            verdict.outcomes[~told & (verdict.outcomes == _PREDICTED)] = _OUTSIDE
            # What is unexplained has a value only if a mode gave it, one that is too often the wrong one.
            verdict.modes[~(known | told & (verdict.outcomes == _UNEXPLAINED))] = 0
            column = layout.column(index, target.property)
            rests = np.ones(len(vectors))
            read = parts.relied_on(parts.models[target])
            for pair in odds:
                if pair in read:
                    rests *= odds[pair]
            values, probability, interval = _settled_many(
                parts, target, percept, index, following, verdict, rests
            )
            following[:, column] = values
            # What is claimed after all is known, though the answer is undecided.
            known = verdict.outcomes == _PREDICTED
            probabilities.append(probability)
            intervals.append(interval)
            key = (target.type, target.property)
            lost[key] = lost.get(key, nowhere) | ~known
            before = odds.get(key, np.ones(len(vectors)))
            odds[key] = np.where(probability < before, probability, before)
            keys.append((layout.names[index], target.property))
            verdicts.append(verdict)
    derive(parts.schema, layout, vectors, following)
    wrap(layout, following)
    frames = tuple(_frame(parts, target) for target in parts.targets for _ in layout.of_type(target.type))
    return _stacked(layout, following, tuple(keys), verdicts, frames, (probabilities, intervals))


def _settled_many(
    parts: Parts,
    target: Target,
    percept: Percept,
    index: int,
    following: NDArray[np.float64],
    verdict: Verdict,
    rests: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """`settled` of n scenes: values, probabilities and intervals, shape ``(n,)`` each; outcomes change in place.

    `rests`: how probably all that the target's modes rely on is right, shape ``(n,)``.
    """
    model = parts.models[target]
    said = _experts(parts, target, percept, index, following, verdict.values)
    values = np.full(len(said), np.nan)
    probability, interval = values.copy(), values.copy()
    winners = -verdict.modes if parts.governs(target) else verdict.modes
    outcomes = np.where(verdict.modes != 0, np.int8(_PREDICTED), verdict.outcomes)
    asks = model.tells_how_far and not parts.governs(target)
    away = parts.distance(percept, index, target.property) if asks else None
    valued = np.where(np.isfinite(verdict.values), VALUED, 0)
    far = np.where(verdict.modes != 0, 0 if away is None else far_bins(away), valued)
    for key, part in keys_of(outcomes, winners, verdict.margins, far):
        for rows, told in model.assess_many(key, said[part]):
            some = part[rows]
            values[some] = said[some, told.speaker]
            probability[some], interval[some] = told.probability, told.interval
            if told.speaker == OWN and key.winner > 0:
                probability[some] = told.probability * rests[some]
            if told.speaker == LATEST and key.winner:
                verdict.modes[some] = model.latest
            before = verdict.outcomes[some]
            if told.speaker >= len(EXPERTS):  # its word has nothing to do with modes
                verdict.modes[some], verdict.margins[some] = 0, 0.0
                before = np.where(model.claims(key, told), np.int8(_PREDICTED), before)
                verdict.outcomes[some] = before
            if not model.claims(key, told):
                verdict.outcomes[some[before == _PREDICTED]] = _UNSURE
            elif model.calibration.trials and key.winner:
                verdict.outcomes[some[before == _UNEXPLAINED]] = _PREDICTED
    return values, probability, interval


def _stacked(
    layout: SceneLayout,
    following: NDArray[np.float64],
    keys: tuple[tuple[str, str], ...],
    verdicts: Sequence[Verdict],
    frames: tuple[str, ...],
    calibrated: tuple[Sequence[NDArray[np.float64]], Sequence[NDArray[np.float64]]],
) -> BatchPrediction:
    n = len(following)
    if not verdicts:
        modes, outcomes = np.zeros((n, 0), dtype=np.int64), np.zeros((n, 0), dtype=np.int8)
        return BatchPrediction(layout, following, keys, modes, outcomes, np.zeros((n, 0)), frames)
    modes = np.stack([v.modes for v in verdicts], axis=1)
    outcomes = np.stack([v.outcomes for v in verdicts], axis=1)
    margins = np.stack([v.margins for v in verdicts], axis=1)
    probabilities, intervals = (np.stack(each, axis=1) for each in calibrated)
    return BatchPrediction(
        layout, following, keys, modes, outcomes, margins, frames, probabilities, intervals
    )


def _frame(parts: Parts, target: Target) -> str:
    """Axes in which a target's contacts are described."""
    pair = None if parts.laws is None else parts.laws.learner.book.pair
    return pair.frame if pair is not None and parts.governs(target) else "world"


def derive(
    schema: SceneSchema, layout: SceneLayout, now: NDArray[np.float64], following: NDArray[np.float64]
) -> None:
    """Declared kinematics, in place: simulate, then derive (§4.8)."""
    for law in schema.derivations:
        for index in layout.of_type(law.type):
            place, rate = layout.column(index, law.property), layout.column(index, law.rate)
            source = following if law.uses_next else now
            following[:, place] = now[:, place] + law.step * source[:, rate]
