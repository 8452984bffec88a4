"""Predictions of the next step: values, and how they came about."""

from __future__ import annotations

import builtins
import enum
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from relgym.html import html_table
from relgym.model.predicting.calibration import Audit, Key
from relgym.scene.objects import Scene, SceneLayout

__all__ = ["BatchPrediction", "LateAudit", "Outcome", "Prediction", "ScenePrediction"]


class Outcome(enum.Enum):
    """How a prediction came about; the value is the sentence for people.

    Only `PREDICTED` is the prediction of a mode or a law. With every other outcome the value is a fallback, not a
    claim: what is unexplained is guessed (`relgym.model.target.guess`) as soon as a guess is better than that
    nothing changes, and so it is where an approximation isn't good (`relgym.model.target.scope`); or, where modes
    cover the examples but nothing tells which of them holds when, it is what the vote's winner says; outside
    experience it is what the mode says that would win the vote; what depends on such a fallback value follows from
    it; else the property keeps its value. So it is for a model that nobody told how its predictions came out. Of
    one that was told, the value is that of whoever codes such predictions best, and a mode's or a law's prediction
    that isn't right often enough for a claim is `UNSURE` (`relgym.model.predicting.calibration`).
    """

    PREDICTED = "predicted by a mode"
    NO_MODE = "no mode learned yet: learn from more transitions"
    UNEXPLAINED = (
        "unexplained: no law of the form that is looked for describes it; the report says what might"
    )
    NO_ROLES = "no mode's roles could be filled by the objects in the scene"
    OUTSIDE = "outside experience: nothing like this situation was seen in training"
    DEPENDS = "depends on another property that could not be predicted"
    UNSURE = "unsure: predictions like this one were wrong too often"


OUTCOMES = tuple(Outcome)
"""Order in which batches number outcomes."""


class LateAudit:
    """An audit that is worked out when somebody looks back: what every expert said takes longer than predicting.

    Who had no say in the prediction is asked of the model as it then is.

    Parameters
    ----------
    work
        Works it out.
    key, speaker
        What kind of prediction it is of, and who spoke.
    present
        What it would be if nothing changed.
    """

    __slots__ = ("_found", "_work", "key", "present", "speaker")

    def __init__(self, work: Callable[[], Audit | None], key: Key, speaker: int, present: float) -> None:
        self._work: Callable[[], Audit | None] | None = work
        self._found: Audit | None = None
        self.key, self.speaker, self.present = key, speaker, present

    def __call__(self) -> Audit | None:
        """The audit; worked out once."""
        if self._work is not None:
            self._found, self._work = self._work(), None
        return self._found

    def __reduce__(self) -> tuple[Callable[..., LateAudit], tuple[Audit | None, Key, int, float]]:
        return _audited, (self(), self.key, self.speaker, self.present)


def _audited(audit: Audit | None, key: Key, speaker: int, present: float) -> LateAudit:
    return LateAudit(lambda: audit, key, speaker, present)


# One is made for every target in every step, and thousands are kept for a while: Python's collector of cycles took
# twice as long while it looked through them. They hold no reference to whoever holds them.
class Prediction(msgspec.Struct, frozen=True, gc=False, eq=False):
    """The next value of one property of one object. Two are equal if all is but `record`.

    Attributes
    ----------
    object, property
        What is predicted.
    value
        Its next value, in units of the property.
    outcome
        Whether a mode predicted it, or why none did.
    mode
        Id of the mode; 0 if none. With `Outcome.UNEXPLAINED` the one that won the vote: its value is no claim, since
        the winner was too often the wrong one (`relgym.model.target.hindsight`).
    roles
        Names of the objects bound to the mode's roles, the target first.
    margin
        Lead of the mode over its runner-up, in log-odds; infinite with a single mode, 0 with none.
    frame
        Axes in which what predicted it is stated: ``"world"`` for modes; laws of touching pairs name their own
        (`relgym.laws.frames`), and then the roles are the target and all that it touches.
    spread
        Standard deviation of what training examples of the same mode (after the same action, where the agent chooses
        among a few, or else on the same side of a threshold that tells) left, in units of the property; of a fallback
        what it left there; NaN where the property keeps its value.
    probability
        That the value is right: off by at most `ModelConfig.claim_error` of what the property mostly changes by.
        Learned from how such predictions came out (`relgym.model.predicting.calibration`); NaN as long as nobody looked
        back.
    interval
        Half width of the interval about the value that holds what comes in 95 % of such predictions, in units of the
        property; NaN where too few came out for that.
    record
        What `WorldModel.look_back` needs to learn that, or what works it out; see `audit`.
    """

    object: str
    property: str
    value: float
    outcome: Outcome
    mode: int = 0
    roles: tuple[str, ...] = ()
    margin: float = 0.0
    frame: str = "world"
    spread: float = math.nan
    probability: float = math.nan
    interval: float = math.nan
    record: Audit | LateAudit | None = None

    def __repr__(self) -> str:
        return f"Prediction({', '.join(f'{name}={said!r}' for name, said in self._said().items())})"

    def __eq__(self, other: Any) -> bool:
        if not isinstance(other, Prediction):
            return NotImplemented
        pairs = zip(self._said().values(), other._said().values(), strict=True)
        return all(a == b or (a != a and b != b) for a, b in pairs)  # what neither knows is the same

    __hash__ = None  # type: ignore[assignment]

    def replace(self, **changes: Any) -> Prediction:
        """The same with some other attributes."""
        return msgspec.structs.replace(self, **changes)

    def _said(self) -> dict[str, Any]:
        """All attributes but the record."""
        return {name: getattr(self, name) for name in self.__struct_fields__[:-1]}

    @builtins.property
    def audit(self) -> Audit | None:
        """What `WorldModel.look_back` needs; None where nobody asked who else would have had a value."""
        return self.record() if isinstance(self.record, LateAudit) else self.record

    @builtins.property  # `property` is a field here
    def ok(self) -> bool:
        """Whether a mode predicted it."""
        return self.outcome is Outcome.PREDICTED

    @builtins.property
    def informed(self) -> bool:
        """Whether a mode predicted it, or the fallback value is more than that nothing changes."""
        return self.ok or self.mode != 0 or not math.isnan(self.spread)


@dataclass(slots=True)  # as predictions are
class ScenePrediction:
    """The next scene, and the predictions it was made of; not to be changed.

    Attributes
    ----------
    scene
        The next scene; properties that no target and no kinematics cover keep their values.
    parts
        One `Prediction` per target of every object, in causal order.
    """

    scene: Scene
    parts: tuple[Prediction, ...]

    @property
    def ok(self) -> bool:
        """Whether every part was predicted by a mode."""
        return all(p.ok for p in self.parts)

    def _repr_html_(self) -> str:
        head = (
            *("target", "value", "how it came about", "mode", "roles", "margin", "spread"),
            *("probability", "95 % interval"),
        )
        rows = [
            (
                *(f"{p.object}.{p.property}", f"{p.value:.7g}", p.outcome.value, p.mode or "–"),
                *(", ".join(p.roles), f"{p.margin:.3g}", f"{p.spread:.2g}"),
                *(f"{p.probability:.2g}", f"± {p.interval:.2g}"),
            )
            for p in self.parts
        ]
        return html_table("The next scene", head, rows)

    def __getitem__(self, key: tuple[str, str]) -> Prediction:
        """Return the part of an (object, property)."""
        for part in self.parts:
            if (part.object, part.property) == key:
                return part
        raise KeyError(f"no prediction of {key}; there are {[(p.object, p.property) for p in self.parts]}")


@dataclass(frozen=True, slots=True)
class BatchPrediction:
    """Predictions for n scenes with the same objects.

    Attributes
    ----------
    layout
        The scenes' layout.
    vectors
        Next state vectors, shape ``(n, layout.width)``.
    parts
        The (object, property) of each target, in causal order.
    modes
        Ids of the modes, shape ``(n, len(parts))``; 0 where none predicted.
    outcomes
        Position in `OUTCOMES`, shape ``(n, len(parts))``.
    margins
        Shape ``(n, len(parts))``.
    frames
        Per part the axes in which its laws of contacts are stated; ``"world"`` where modes predict.
    probabilities, intervals
        As of `Prediction`, shape ``(n, len(parts))``.
    """

    layout: SceneLayout
    vectors: NDArray[np.float64]
    parts: tuple[tuple[str, str], ...]
    modes: NDArray[np.int64]
    outcomes: NDArray[np.int8]
    margins: NDArray[np.float64]
    frames: tuple[str, ...] = ()
    probabilities: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    intervals: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        for name in ("probabilities", "intervals"):  # of who knows none
            if getattr(self, name).shape != self.outcomes.shape:
                object.__setattr__(self, name, np.full(self.outcomes.shape, np.nan))

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Scenes all of whose parts a mode predicted, shape ``(n,)``."""
        predicted: NDArray[np.bool_] = (self.outcomes == OUTCOMES.index(Outcome.PREDICTED)).all(axis=1)
        return predicted
