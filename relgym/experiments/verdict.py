"""A model in one line: on how many fresh steps it is right, and how many whole episodes it foresees exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import TOLERANCE, chunks
from relgym.experiments.rollouts import largest_errors
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.world_model import WorldModel

__all__ = ["EXACT", "Missed", "Verdict", "verdict"]

EXACT: Final = 1e-9
"""A roll-out is exact when no position is ever off by more, in units: what rounding adds up to is far less."""

_SPOKE: Final = OUTCOMES.index(Outcome.PREDICTED)


@dataclass(frozen=True, slots=True)
class Missed:
    """Wrong predictions of steps at which the same thing happened.

    Attributes
    ----------
    what
        What happened, by the engine's own log of contacts.
    wrong, steps
        How many such steps were predicted wrongly, and how many there were.
    """

    what: str
    wrong: int
    steps: int


@dataclass(frozen=True, slots=True)
class Verdict:
    """How good a model is on episodes that it hasn't seen.

    Attributes
    ----------
    right, steps
        At how many steps every target was predicted to `TOLERANCE`, and of how many. All steps count.
    exact, trials
        How many roll-outs from a first scene alone were never off by more than `EXACT`, and of how many.
    length
        Steps of a roll-out.
    largest
        Largest position error of the exact ones, in units; NaN if there are none.
    missed
        Where the wrong steps lie, as far as such steps occurred.
    """

    right: int
    steps: int
    exact: int
    trials: int
    length: int
    largest: float
    missed: tuple[Missed, ...]

    def __str__(self) -> str:
        within = f" (within {self.largest:.0e})" if self.exact else ""
        line = (
            f"Right on {self.right:,} of {self.steps:,} fresh steps; {self.exact:,} of {self.trials:,} roll-outs of "
            f"{self.length} steps exact{within}."
        )
        wrong = [f"\n  {m.wrong:,} of {m.steps:,} {m.what}" for m in self.missed if m.wrong]
        return line + (f"\nIt misses{''.join(wrong)}" if wrong and len(self.missed) > 1 else "")


def verdict(model: WorldModel, episodes: Sequence[Episode], *, trials: int = 80) -> Verdict:
    """Predict every step of some episodes, and the first of them whole.

    Parameters
    ----------
    model
        The model; unchanged.
    episodes
        Of equal length; the model hasn't learned from them.
    trials
        How many roll-outs, at most.

    Notes
    -----
    Cost: some 40 µs per step and as much per step of a roll-out.
    """
    right: list[NDArray[np.bool_]] = []
    corner: list[NDArray[np.bool_]] = []
    several: list[NDArray[np.bool_]] = []
    for part in chunks(episodes):
        right.append(_right(model, part))
        corner += [e.truth.corner for e in part]
        several += [(e.truth.active > 1) & ~e.truth.corner for e in part]
    good, at_corner, at_several = np.concatenate(right), np.concatenate(corner), np.concatenate(several)
    happened = {
        "steps that hit a corner": at_corner,
        "steps with several contacts at once": at_several,
        "steps with one contact or none": ~(at_corner | at_several),
    }
    off = largest_errors(model, episodes[:trials])
    exact = off <= EXACT
    return Verdict(
        right=int(good.sum()),
        steps=len(good),
        exact=int(exact.sum()),
        trials=len(off),
        length=len(episodes[0]),
        largest=float(off[exact].max()) if exact.any() else float("nan"),
        missed=tuple(
            Missed(what, int((~good & at).sum()), int(at.sum())) for what, at in happened.items() if at.any()
        ),
    )


def _right(model: WorldModel, part: Sequence[Episode]) -> NDArray[np.bool_]:
    """At which steps of episodes with the same objects every target was predicted rightly, shape ``(n,)``."""
    layout = part[0].layout
    prediction = model.predict_batch(layout, np.concatenate([e.vectors[:-1] for e in part]))
    after = np.concatenate([e.vectors[1:] for e in part])
    columns = [layout.column(layout.index(name), prop) for name, prop in prediction.parts]
    close = np.abs(prediction.vectors[:, columns] - after[:, columns]) <= TOLERANCE
    right: NDArray[np.bool_] = (close & (prediction.outcomes == _SPOKE)).all(axis=1)
    return right
