"""How often a target's own predictions were wrong on steps not learned yet: whether its clauses choose well.

Modes that together cover all examples explain nothing if no condition tells which of them holds: of an env whose
state is the number of a cell, a few constants and offsets cover every step. What gives them away is that the mode that
wins the vote was the wrong one. So a learner that predicts before each step reports the outcome afterwards
(`WorldModel.look_back`); of a model that only learns nothing is counted.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from functools import lru_cache
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, NamedTuple

from relgym.clustering.mode import NOISE
from relgym.config.constants import FIRST, NEARLY_ALL, RECENT, ROUNDED, STDS
from relgym.mixing import GOLDEN, MOST, mixed_one
from relgym.model.predicting.calibration import OWN, PERSISTENCE, Audit, Calibration, Rough, missed
from relgym.model.predicting.prediction import LateAudit, Outcome, Prediction, ScenePrediction

if TYPE_CHECKING:
    from relgym.model.parts import Answer, Parts
    from relgym.scene.objects import Target

__all__ = [
    "WRONG",
    "Confirmed",
    "Hindsight",
    "Retrospect",
    "Standing",
    "calibration_to_json",
    "look_back",
    "restore_calibration",
]

WRONG = ROUNDED
"""A prediction off by more than this, in units of the property, counts as wrong; more where numbers are rounded, and to
those who learn from it less where a property never reaches 1."""


class Standing(Enum):
    """How much a prediction teaches that came out as such ones do.

    Attributes
    ----------
    SETTLED
        Nothing: modes are laws. Little if they read what is known only roughly.
    COARSE
        Little: it is known only roughly what comes, and nothing tells more.
    OPEN
        As much as any: nothing tells yet which of some laws holds.
    """

    SETTLED = 0
    COARSE = 1
    OPEN = 2


class Confirmed(NamedTuple):
    """A prediction that came out as such ones do.

    Attributes
    ----------
    mode
        Which mode made it, and came true; `NOISE` of what is only roughly right.
    weight
        How many such examples it stands for when it is learned from; 0: others stand for it (`Calibration.confirm`,
        `Calibration.thin`).
    """

    mode: int
    weight: int


class Retrospect(NamedTuple):
    """How the predictions of one step came out.

    Attributes
    ----------
    confirmed
        What came out as such predictions do, by (object, property).
    counted
        Whether all were counted and no more: how right such predictions are is known as it was.
    """

    confirmed: Mapping[tuple[str, str], Confirmed]
    counted: bool


@lru_cache
def _step(spoken: int, wrong: int) -> tuple[int, int]:
    """A step of `Hindsight`: one object for all that are alike, which is serialised once."""
    return spoken, wrong


class Hindsight:
    """The latest predictions of one target: how many there were in each step, and how many of them were wrong.

    Parameters
    ----------
    steps
        (predictions, wrong ones) by step, oldest first; of more than `RECENT` the newest.
    undecided
        What was the case before, where they leave it open.

    Attributes
    ----------
    spoken, wrong : int
        Predictions in these steps, and how many of them were wrong.
    undecided : bool
        Whether so many were wrong that nothing tells which mode holds when.

    Examples
    --------
    >>> known = Hindsight([(1, 0)] * 50)
    >>> for _ in range(20):
    ...     known.add(1, 1)
    >>> known.wrong, known.spoken, known.undecided
    (20, 70, True)
    """

    def __init__(self, steps: Iterable[tuple[int, int]] = (), *, undecided: bool = False) -> None:
        self._steps = deque((_step(int(n), int(k)) for n, k in steps), maxlen=RECENT)
        self.spoken = sum(n for n, _ in self._steps)
        self.wrong = sum(k for _, k in self._steps)
        self.undecided = undecided
        self._settle()

    def __len__(self) -> int:
        return len(self._steps)

    def add(self, spoken: int, wrong: int) -> None:
        """Take in one step. Cost O(1)."""
        if len(self._steps) == RECENT:
            n, k = self._steps[0]
            self.spoken, self.wrong = self.spoken - n, self.wrong - k
        self._steps.append(_step(spoken, wrong))
        self.spoken, self.wrong = self.spoken + spoken, self.wrong + wrong
        self._settle()

    def _settle(self) -> None:
        """Clauses tell which mode holds where nearly all predictions are right, and again at half as many wrong ones.

        In between it stays as it was: within one of Taxi's episodes a tenth is wrong, from one to the next a quarter.
        """
        if len(self._steps) >= FIRST:
            most = (1.0 - NEARLY_ALL) * self.spoken
            self.undecided = self.wrong > (0.5 * most if self.undecided else most)

    def united(self, other: Hindsight) -> Hindsight:
        """What two models know together: the latest of both, in turns."""
        pairs = zip_longest(reversed(self._steps), reversed(other._steps))
        newest = [step for pair in pairs for step in pair if step is not None]
        return Hindsight(newest[:RECENT][::-1], undecided=self.undecided or other.undecided)

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back: [predictions, wrong ones] by step, and what they are taken for."""
        return {"steps": [list(step) for step in self._steps], "undecided": self.undecided}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Hindsight:
        """Read what `to_json` wrote."""
        return cls(((n, k) for n, k in data["steps"]), undecided=bool(data["undecided"]))


def look_back(
    parts: Parts, prediction: ScenePrediction, residuals: Mapping[tuple[str, str], float], precision: float
) -> Retrospect:
    """Report to each target how its predictions of a step came out; arguments as of `WorldModel.look_back`.

    Only predictions of modes count: neither fallback values nor laws of motion, which abstain where they don't hold.
    What rests on another property's next value that was off isn't evaluated, since the fault is that one's. Returned is
    what came true, and whether that was all.
    """
    answers, look = parts.answers(prediction.scene.layout), _Look(parts, precision)
    for part in prediction.parts:
        key = part.object, part.property
        residual, answer = residuals.get(key), answers.get(key)
        if residual is not None and answer is not None and not look.repeats(part, residual, answer):
            look.compare(part, residual, answer)
    counted = look.counted
    for target, (spoken, wrong) in look.counts.items():
        known = parts.models[target].hindsight
        before = known.undecided
        known.add(spoken, wrong)
        counted = counted and known.undecided == before
    return Retrospect(look.confirmed, counted)


class _Look:
    """What is found out as one looks back at the predictions of a step, in their order."""

    def __init__(self, parts: Parts, precision: float) -> None:
        self._parts, self._precision, self._laws = parts, precision, parts.laws
        config = parts.config
        self._share = config.downsampling
        noise = config.clustering.noise_std
        # Who says how large the noise is takes it for granted.
        self._least = 0.0 if isinstance(noise, str) else config.clustering.inlier_stds * noise
        self._off: set[tuple[str, str]] = set()
        # A number from 0 to 1 for this step; a model that is loaded again draws the same.
        trials = sum([model.calibration.trials for model in parts.models.values()])
        self._draw = mixed_one(trials * GOLDEN) / MOST
        # How many predictions that came true, or that came out as such ones do, the present one counts for.
        self._times = self._stands = 0
        self.counts: dict[Target, list[int]] = {}
        self.confirmed: dict[tuple[str, str], Confirmed] = {}
        self.counted = True

    def _rounding(self, came: float, most: float) -> float:
        """What is rounding where a target is at most so large: `WRONG`, or as small a share of what is smaller."""
        most = min(most, 1.0)
        return max(WRONG * most, self._precision * max(most, abs(came)))

    def repeats(self, part: Prediction, residual: float, answer: Answer) -> bool:
        """Whether a prediction came out as such ones do and another one stands for it: it is counted, no more."""
        self._times = self._stands = 0
        record, (target, model, _, _, _) = part.record, answer
        if record is None:
            return False
        lawful = self._laws is not None and self._laws.governs(target)
        if not lawful:
            standing = model.standing
            if standing is Standing.OPEN:
                return False
            if standing is Standing.COARSE or part.outcome is Outcome.DEPENDS:
                return self._passed(part, residual, answer)
            if self._misled(answer):
                return False
        if part.outcome is not Outcome.PREDICTED or not part.mode or record.speaker != OWN:
            return False
        within = (
            self._rounding(part.value + residual, 1.0)
            if lawful
            else model.clusterer.population.scale.tolerance
        )
        if not abs(residual) <= within:
            return False
        self._times = model.calibration.confirm(record.key, self._share, self._draw)
        if lawful:
            return not self._times
        self.confirmed[part.object, part.property] = Confirmed(part.mode, self._times)
        if self._times:
            return False
        self.counts.setdefault(target, [0, 0])[0] += 1
        return True

    def _passed(self, part: Prediction, residual: float, answer: Answer) -> bool:
        """`repeats` of what is only roughly right.

        What lies far outside of its interval is news, which modes are taught in any case; how right such predictions
        are is counted of all.
        """
        record, model = part.record, answer.model
        if not self._share or record is None or (model.cast and model.follows_latest):
            return False
        if math.isnan(part.interval):  # too few came out to tell
            self._stands = 1
            return False
        came = part.value + residual
        rounding = max(self._rounding(came, model.clusterer.reach), self._least)
        if argued := isinstance(record, Audit):
            values: Sequence[float] = record.values
        else:  # to ask the others would take longer than predicting
            values = [math.nan] * model.calibration.experts
            values[OWN], values[PERSISTENCE] = part.value, record.present
        errors = missed(values, came, rounding, answer.turn)
        weight = self._stands = model.calibration.thin(
            Rough(record.key, record.speaker, argued, errors),
            self._draw,
            held=abs(residual) <= part.interval,
            misled=self._deceived(answer, record),
        )
        if abs(residual) <= STDS * part.interval:
            self.confirmed[part.object, part.property] = Confirmed(NOISE, weight)
        elif not weight:
            self.counted = False
        if not weight:
            self._note(answer, residual, rounding)
        return weight == 0

    def _note(self, answer: Answer, residual: float, rounding: float) -> None:
        """Take note of what was off: predictions that rest on it aren't to blame."""
        if not abs(residual) <= rounding:
            self._off.add((answer.target.type, answer.target.property))

    def compare(self, part: Prediction, residual: float, answer: Answer) -> None:
        """Take in how far a prediction was off, and who would have known better."""
        self.counted = False
        target, model, _, _, turn = answer
        came, audit = part.value + residual, part.audit
        rounding = self._rounding(came, 1.0 if self._parts.governs(target) else model.clusterer.reach)
        misled = self._misled(answer)
        if audit is not None:
            rounding = max(rounding, self._least)
            model.calibration.look_back(
                audit,
                came,
                claimed=part.ok,
                rounding=rounding,
                error=self._parts.config.claim_error,
                turn=turn,
                times=self._times,
                stands=self._stands,
                misled=self._deceived(answer, audit),
            )
        self._note(answer, residual, rounding)
        if not part.mode or self._parts.governs(target) or misled:
            return
        spread = STDS * part.spread if part.spread == part.spread else 0.0
        if audit is not None and audit.speaker != OWN:  # another one gave the value, and the spread
            residual, spread = came - audit.values[OWN], 0.0
            residual = math.remainder(residual, turn) if turn else residual
        count = self.counts.setdefault(target, [0, 0])
        count[0] += 1
        count[1] += not abs(residual) <= max(rounding, model.clusterer.scale.tolerance, spread)

    def _deceived(self, answer: Answer, record: Audit | LateAudit) -> bool:
        """Whether a mode's word rests on another prediction that was off."""
        if record.speaker != OWN or record.key.winner <= 0 or not self._misled(answer):
            return False
        return not self._off.isdisjoint(self._parts.relied_on(answer.model))

    def _misled(self, answer: Answer) -> bool:
        """Whether a prediction rests on another one that was off."""
        off = self._off
        return (
            bool(off) and not off.isdisjoint(answer.target.given) and not off.isdisjoint(answer.model.needs)
        )


def hindsight_to_json(parts: Parts) -> dict[str, Any]:
    """Plain data that `restore_hindsight` reads back, by target; empty where nobody ever looked back."""
    known = {str(t): parts.models[t].hindsight for t in parts.targets}
    return {name: hindsight.to_json() for name, hindsight in known.items() if len(hindsight)}


def restore_hindsight(parts: Parts, data: Mapping[str, Any]) -> None:
    """Take over what `hindsight_to_json` wrote."""
    for target in parts.targets:
        if str(target) in data:
            parts.models[target].hindsight = Hindsight.from_json(data[str(target)])


def calibration_to_json(parts: Parts) -> dict[str, Any]:
    """Plain data that `restore_calibration` reads back, by target; empty where nobody ever looked back."""
    known = {str(t): parts.models[t].calibration for t in parts.targets}
    return {name: calibration.to_json() for name, calibration in known.items() if calibration.trials}


def restore_calibration(parts: Parts, data: Mapping[str, Any]) -> None:
    """Take over what `calibration_to_json` wrote."""
    for target in parts.targets:
        if str(target) in data:
            model = parts.models[target]
            model.calibration = Calibration.from_json(
                data[str(target)],
                parts.config.claim_probability,
                parts.config.claim_slips,
                len(parts.config.hypotheses),
            )
            model.calibration.reliable = model.reliable
