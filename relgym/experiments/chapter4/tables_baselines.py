"""All baselines beside our learners at equal features, and how their settings were chosen (§4.7, and beyond it)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import mean
from typing import Any, Final

from relgym.baselines.catalogue import REGRESSORS
from relgym.baselines.tuned import setting_of
from relgym.experiments.chapter4.canvas import TITLES
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.scores import pooled_scores, quantile
from relgym.model.text import Cell, table

__all__ = ["headline_shown", "tuning_shown"]

_OURS: Final[Mapping[str, str]] = {"thesis": "thesis", "contact": "default"}
"""Which of our learners was shown what: chapter III's relations are the thesis' features, contact laws ours."""

_MEASURES: Final = ("p50", "p95", "p99.9", "mean", "modes")


def headline_shown(_: Protocol, values: Values) -> Shown:
    """Every baseline against our learner that saw the same: who errs less, by training size and measure."""
    heading = ["baseline", "features", "target", "blocks", *_MEASURES, "lost"]
    lines: list[list[Cell]] = []
    won = {seen: [0, 0] for seen in _OURS}
    for target in ("ball.vx", "ball.vy"):
        known = {seen: _measures(values[name], target) for seen, name in _OURS.items()}
        for seen, name in _OURS.items():
            lines += [[TITLES[name], seen, target, b, *_texts(m), ""] for b, m in known[seen].items()]
        for group in (group for group in values if "/" in group):
            baseline, seen = group.split("/")
            for blocks, found in _measures(values[group], target).items():
                better = [
                    m for m, f, o in zip(_MEASURES, found, known[seen][blocks], strict=True) if _beats(f, o)
                ]
                won[seen] = [won[seen][0] + len(_MEASURES) - len(better), won[seen][1] + len(_MEASURES)]
                lines.append(
                    [REGRESSORS[baseline].title, seen, target, blocks, *_texts(found), " ".join(better)]
                )
    text = "\n\n".join([_wins(won), table(heading, lines), _NOTE, _cost(values)])
    return Shown(text, [heading, *lines])


def _wins(won: Mapping[str, Sequence[int]]) -> str:
    return "\n".join(
        f"{TITLES[_OURS[seen]]} against all that saw the {seen} features: ahead or level in {a} of {b} cells "
        f"({a / max(b, 1):.1%})"
        for seen, (a, b) in won.items()
    )


_NOTE: Final = (
    "Quantiles and mean of the absolute error over all test examples, corners included; modes: the median error of "
    "each true mode,\naveraged, so that rare ones count. lost: measures in which the baseline errs less. Errors below "
    "1e-12 are level."
)


def _cost(values: Values) -> str:
    """Seconds of learning a batch, and of answering the questions of all its tests; means over the batches."""
    lines: list[list[Cell]] = []
    for group, runs in values.items():
        name, _, seen = group.partition("/")
        title = TITLES[name] if name in TITLES else REGRESSORS[name].title
        learning = mean(run.get("learning", run.get("seconds", 0.0)) for run in runs)
        asking = [f"{mean(run['asking'] for run in runs):.2g}"] if "asking" in runs[0] else ["-"]
        lines.append([title, seen or "-", f"{learning:.2g}", *asking])
    return table(["learner", "features", "learning, s", "asking, s"], lines)


def _measures(runs: Sequence[Any], target: str) -> dict[int, list[float]]:
    found = {}
    for k, each in enumerate(runs[0]["scores"]):
        parts = [run["scores"][k]["targets"][target] for run in runs]
        every = pooled_scores(part["all"] for part in parts)
        modes: dict[str, list[Any]] = {}
        for part in parts:
            for score in part["modes"]:
                modes.setdefault(score["name"], []).append(score)
        medians = [quantile(pooled_scores(scores)["errors"], 0.5) for scores in modes.values()]
        quantiles = [quantile(every["errors"], q) for q in (0.5, 0.95, 0.999)]
        found[each["blocks"]] = [*quantiles, every["sum"] / every["examples"], mean(medians)]
    return found


def _beats(theirs: float, ours: float) -> bool:
    return max(theirs, 1e-12) < max(ours, 1e-12)


def _texts(measures: Sequence[float]) -> list[Cell]:
    return [f"{m:.1e}" for m in measures]


# ------------------------------------------------------------------ tuning
def tuning_shown(protocol: Protocol, values: Values) -> Shown:
    """Every setting's error on tuning seeds; stars: what is reported, and what tuning would choose now."""
    heading = ["baseline", "features", "setting", "mean error", "wrong %", "reported", "best"]
    lines: list[list[Cell]] = []
    for group, runs in values.items():
        function, name, seen = group.split("/")
        reported = setting_of("classify" if function == "classify" else "regress", name, seen)
        losses = [_loss(run) for run in runs]
        best = min(range(len(losses)), key=lambda k: losses[k])
        for k, run in enumerate(runs):
            setting = ", ".join(f"{key}={value}" for key, value in run["setting"].items()) or "-"
            error, wrong = losses[k]
            shown: list[Cell] = [f"{error:.3e}", round(100 * wrong, 3)]
            marks = ["*" if k == reported else "", "*" if k == best else ""]
            lines.append([name, seen, setting, *shown, *marks])
    return Shown(table(heading, lines), [heading, *lines])


def _loss(run: Mapping[str, Any]) -> tuple[float, float]:
    """What tuning minimises: the mean error where there is one, then the share of errors; both targets."""
    parts = [part.get("counted", part) for part in run["scores"][-1]["targets"].values()]
    wrong = mean(part["wrong"] / part["examples"] for part in parts)
    if "sum" not in parts[0]:
        return 0.0, wrong
    return mean(part["sum"] / part["change"] for part in parts), wrong
