"""Why are the thesis' rates of errors what they are? Its program with single causes taken away (§4.3.4, §4.4.4)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from relgym.experiments.chapter4.canvas import first_case
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import ABLATIONS, Protocol
from relgym.experiments.chapter4.published import RATES
from relgym.experiments.chapter4.scores import pooled_scores
from relgym.experiments.chapter4.tables_errors import wrong_of_modes
from relgym.model.reports.text import Cell, table

__all__ = ["ablation_shown"]


def ablation_shown(_: Protocol, values: Values) -> Shown:
    """Rates of wrong predictions at the end of experiments 1 and 2; groups are ``experiment/learner``."""
    heading = (
        "experiment, target, learner, wrong %, strict %, "
        "ties too %, printed range %, inside, upright %, most of it"
    ).split(", ")
    lines: list[list[Cell]] = []
    for group, runs in values.items():
        experiment, learner = group.split("/")
        for target in ("ball.vx", "ball.vy"):
            parts = [run["scores"][-1]["targets"][target] for run in runs]
            score = pooled_scores(part["counted"] for part in parts)
            shares = [score[key] / score["examples"] for key in ("wrong", "strict", "literal")]
            low, high = RATES[int(experiment), target]
            inside = "yes" if low <= shares[0] <= high else "no"
            percents = [f"{100 * share:.3f}" for share in shares]
            bounds = f"{100 * low:g}-{100 * high:g}"
            share = wrong_of_modes(parts, "left face", "right face")
            upright = "-" if math.isnan(share) else f"{share:.1f}"
            lines.append([experiment, target, learner, *percents, bounds, inside, upright, _worst(parts)])
    lines.sort(key=lambda line: (line[0], line[1]))
    return Shown(f"{table(heading, lines)}\n\n{_NOTE}\n{_causes()}", [heading, *lines])


def _worst(parts: Sequence[Mapping[str, Any]]) -> str:
    """The true mode with most wrong predictions."""
    wrong: dict[str, list[int]] = {}
    for part in parts:
        for mode in part["modes"]:
            counts = wrong.setdefault(mode["name"], [0, 0])
            counts[0] += mode["wrong"]
            counts[1] += mode["examples"]
    name, (errors, examples) = max(wrong.items(), key=lambda item: item[1][0])
    return f"{first_case(name)}: {errors} of {examples:,}" if errors else "-"


_NOTE: Final = (
    "On all 24,000 test examples, whatever the protocol. wrong: off by more than 1e-9, or no prediction. strict: the "
    "chosen mode isn't\nthe best one, ties forgiven; ties too: not forgiven, as the thesis counted. upright: wrong "
    "of the bounces off\nupright surfaces."
)


def _causes() -> str:
    return "\n".join(f"{name}: {words}." for name, words in ABLATIONS.items())
