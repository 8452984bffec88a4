"""Box pushing: the modes, clauses and roles of tables 3.1 and 3.2 and Figure 3.8."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from relgym.config import ModelConfig
from relgym.experiments.analytic import truck_modes
from relgym.experiments.chapter4.learners import modes_of, noise_of, report_of, settings_of, taught
from relgym.experiments.data import truck_episodes
from relgym.experiments.truck_check import truck_mode_of
from relgym.model.reports.text import plain
from relgym.thesis.settings import ThesisSettings

__all__ = ["lesson"]


def lesson(*, learner: str, seed: int, repeats: int = 2) -> dict[str, Any]:
    """Learn the box pushing domain: every layout x permutation x repeats, 40 steps each (§3.1).

    Parameters
    ----------
    learner
        Name of a configuration (`relgym.experiments.chapter4.protocol.LEARNERS`).
    seed
        Of the training episodes.
    repeats
        How often each permutation is shown; 2 in the thesis (1,920 examples).

    Returns
    -------
    Plain data: the model's report, and which row of Table 3.1 each mode states (-1: none).
    """
    model = taught(truck_episodes(seed=seed, repeats=repeats), _settings(learner))
    laws = truck_modes(3)
    known = {law: row for row, law in enumerate(laws)}
    stated = {}
    for mode in modes_of(model, "truck.vx"):
        law = truck_mode_of(mode, laws)
        stated[str(mode.id)] = -1 if law is None else known[law]
    return {
        "report": plain(report_of(model)),
        "text": str(report_of(model)),
        "stated": stated,
        "laws": [law.name for law in laws],
        "noise": noise_of(model, "truck.vx"),
    }


def _settings(learner: str) -> ThesisSettings | ModelConfig:
    """The learner's, but clauses may mention every object.

    Table 3.2 tells stacks of three by a box on one that the truck doesn't touch: no clause about what it touches can.
    """
    settings = settings_of(learner)
    return replace(settings, context="all") if isinstance(settings, ThesisSettings) else settings
