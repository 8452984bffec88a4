"""Why a dream is truncated: the model makes no prediction, or the next scene lies outside the observation space."""

from __future__ import annotations

import enum
from collections.abc import Collection, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from relgym.model.predicting.prediction import OUTCOMES, BatchPrediction, Outcome, ScenePrediction

__all__ = ["CAUSES", "Cause", "causes", "explained", "horizon_reached", "parts_of", "parts_of_row"]


class Cause(enum.Enum):
    """What ended a dream; the value is the sentence for people, the name is ``info["cause"]`` in lower case.

    With all but `HORIZON` the prediction was not followed: the dream stays in the last scene that is known. `NO_REWARD`
    comes from a `LearnedRewardModel`.
    """

    NO_MODE = Outcome.NO_MODE.value
    UNEXPLAINED = Outcome.UNEXPLAINED.value
    NO_ROLES = Outcome.NO_ROLES.value
    OUTSIDE = Outcome.OUTSIDE.value
    DEPENDS = Outcome.DEPENDS.value
    UNSURE = Outcome.UNSURE.value
    LOW_MARGIN = "the winning mode leads its runner-up by too little"
    LEFT = "left the observation space"
    HORIZON = "the horizon is reached"
    NO_REWARD = "nothing that was learned of the task says what this step is worth"


CAUSES = tuple(Cause)
"""Order in which batches number causes; -1 stands for a step that can be followed."""

_LEFT = np.int8(CAUSES.index(Cause.LEFT))
_FOLLOWED = OUTCOMES.index(Outcome.PREDICTED)
_OF_OUTCOME = np.array(
    [-1 if o is Outcome.PREDICTED else CAUSES.index(Cause[o.name]) for o in OUTCOMES], dtype=np.int8
)


def causes(
    prediction: BatchPrediction,
    inside: NDArray[np.bool_],
    min_margin: float,
    overruled: Collection[tuple[str, str]] = (),
) -> NDArray[np.int8]:
    """Why each of n predictions can't be followed, as a position in `CAUSES`; -1 where it can.

    Parameters
    ----------
    prediction
        The model's prediction.
    inside
        Whether each next scene lies in the observation space, shape ``(n,)``.
    min_margin
        Least margin, in log-odds, of a prediction that is followed.
    overruled
        (object, property) pairs that don't matter.

    Notes
    -----
    Of several causes the first in this order counts: a property that no mode predicts (the first one in causal
    order), a margin too small, a property out of its bounds.
    """
    n = len(inside)
    found = np.where(inside, np.int8(-1), _LEFT)
    margins, outcomes = prediction.margins, prediction.outcomes
    if overruled:
        heeded = np.array([part not in overruled for part in prediction.parts], dtype=bool)
        margins, outcomes = margins[:, heeded], outcomes[:, heeded]
    if margins.shape[1] and min_margin > 0.0:
        found[(margins < min_margin).any(axis=1)] = CAUSES.index(Cause.LOW_MARGIN)
    abstained = outcomes != _FOLLOWED
    if abstained.any():
        some = abstained.any(axis=1)
        first = outcomes[np.arange(n), abstained.argmax(axis=1)]
        found[some] = _OF_OUTCOME[first[some]]
    return found


def explained(
    parts: Iterable[tuple[str, str, Outcome, float]],
    min_margin: float,
    overruled: Collection[tuple[str, str]] = (),
) -> tuple[Cause, str] | None:
    """Why one prediction can't be followed, and the sentence that names objects and properties; None if it can.

    Whether the next scene lies in the observation space is not asked here.

    Parameters
    ----------
    parts
        Object, property, outcome and margin of every part of the prediction, in causal order.
    min_margin, overruled
        As for `causes`.
    """
    parts = tuple(part for part in parts if part[:2] not in overruled)
    abstained = [
        (name, prop, outcome) for name, prop, outcome, _ in parts if outcome is not Outcome.PREDICTED
    ]
    if abstained:
        told = "; ".join(f"{name}.{prop}: {outcome.value}" for name, prop, outcome in abstained)
        return Cause[abstained[0][2].name], told
    unsure = [(name, prop, margin) for name, prop, _, margin in parts if margin < min_margin]
    if unsure:
        told = "; ".join(
            f"{name}.{prop}: {Cause.LOW_MARGIN.value} ({margin:.3g}, expected at least {min_margin:.3g})"
            for name, prop, margin in unsure
        )
        return Cause.LOW_MARGIN, told
    return None


def parts_of(prediction: ScenePrediction) -> Iterator[tuple[str, str, Outcome, float]]:
    """What `explained` asks of a single prediction."""
    return ((p.object, p.property, p.outcome, p.margin) for p in prediction.parts)


def parts_of_row(prediction: BatchPrediction, row: int) -> Iterator[tuple[str, str, Outcome, float]]:
    """What `explained` asks of one scene of a batch."""
    told = zip(
        prediction.parts, prediction.outcomes[row].tolist(), prediction.margins[row].tolist(), strict=True
    )
    return ((name, prop, OUTCOMES[outcome], margin) for (name, prop), outcome, margin in told)


def horizon_reached(horizon: int | None) -> str:
    """The sentence for `Cause.HORIZON`."""
    return f"the horizon of {horizon} steps is reached"
