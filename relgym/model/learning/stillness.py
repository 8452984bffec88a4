"""What a property was before it first changed: the same, in all that others of its type remember.

A property becomes a target when it first changes, for most never do. What it did until then is known, too: nothing.
Who learned from its changes alone would take a flag that has been 0 in two thousand steps, and 1 in the nine after its
first change, for one that is always 1. What was still for a shorter while will be seen to be so again.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from relgym.config.constants import EVIDENCE, MEMORY
from relgym.model.parts import Parts
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.scene.objects import TASK, Target
from relgym.scheduling.agenda import Budget

__all__ = ["recall"]

_NO_MODE: Final = OUTCOMES.index(Outcome.NO_MODE)

RECALLED: Final = round(EVIDENCE)
"""So many examples stand for all: each tells one bit, as a coin's side does, and so many of them a mode."""


def recall(parts: Parts, target: Target, rows: int, budget: Budget) -> None:
    """Let a new target learn from some of its type's examples, which stand for all: it stayed as it was.

    Nothing is recalled of fewer than records remember (`MEMORY`). Cost: as of so many transitions.

    Parameters
    ----------
    parts
        Who learns.
    target
        The new target.
    rows
        How many of its type's rows came before it first changed.
    budget
        What may be spent on searches.
    """
    table = parts.tables[target.type]
    others = [model for t, model in parts.by_type[target.type] if t != target]
    source = max(others, key=lambda other: len(other.classifier.exemplars), default=None)
    if target.type == TASK or source is None:
        return
    kept = source.classifier.exemplars
    before = np.flatnonzero(source.clusterer.rows[kept.rows.astype(np.intp)] < rows)
    model, weights = parts.models[target], kept.weights()
    if weights[before].sum() < MEMORY:
        return
    slots = before[np.unique(np.linspace(0, len(before) - 1, RECALLED).astype(np.intp))]
    shares = weights[slots] * (weights[before].sum() / weights[slots].sum())
    for slot, share in zip(slots.tolist(), shares.tolist(), strict=True):
        example, row = source.remembered(slot)
        signature = table.signatures[table.signature_ids[row]]
        own = next(
            k for k, c in enumerate(signature.columns) if c.slot == 0 and c.property == target.property
        )
        weight = max(1, round(share))
        model.clusterer.pass_over(weight - 1)
        model.learn_one(table, row, float(table.x[row, own]), signature, example, budget, weight)
    # Also for those before a mode was found.
    model.clusterer.stand_for(int(model.clusterer.labels[-1]), round(shares.sum()))
    if source.calibration.trials:  # somebody looks back
        model.calibration.stood_still(_NO_MODE, round(shares.sum()))
