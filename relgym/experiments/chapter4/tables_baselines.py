"""All baselines beside our learners at equal features, and how their settings were chosen (§4.7, and beyond it)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import mean
from typing import Any, Final

from relgym.baselines.catalogue import REGRESSORS
from relgym.baselines.tuned import setting_of
from relgym.experiments.chapter4.canvas import TITLES, first_case
from relgym.experiments.chapter4.figures_accuracy import pooled_as_told
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.scores import quantile
from relgym.model.reports.text import Cell, table

__all__ = ["headline_shown", "tuning_shown"]

_OURS: Final[Mapping[str, str]] = {"thesis": "thesis", "contact": "default"}
"""Which of our learners was shown what: chapter III's relations are the thesis' features, contact laws ours."""

_LEVEL: Final = 1e-12
"""Errors below are as good as none."""

_MEASURES: Final = ("p50", "p95", "p99.9", "mean", "modes")


def headline_shown(_: Protocol, values: Values) -> Shown:
    """Every baseline against our learner that saw the same: who errs less, by training size and measure."""
    heading = ["baseline", "features", "target", "episodes", *_MEASURES, "lost"]
    lines: list[list[Cell]] = []
    counts = {seen: Counter[str]() for seen in _OURS}
    losses: list[list[Cell]] = []
    for target in ("ball.vx", "ball.vy"):
        known = {seen: _measures(values[name], target) for seen, name in _OURS.items()}
        for seen, name in _OURS.items():
            lines += [[TITLES[name], seen, target, b, *_texts(m), ""] for b, m in known[seen].items()]
        for group in (group for group in values if "/" in group):
            baseline, seen = group.split("/")
            for episodes, found in _measures(values[group], target).items():
                cells = list(zip(_MEASURES, found, known[seen][episodes], strict=True))
                counts[seen].update(_result(theirs, ours) for _, theirs, ours in cells)
                lost = [(m, theirs, ours) for m, theirs, ours in cells if _result(theirs, ours) == "behind"]
                about = [REGRESSORS[baseline].title, seen, target, episodes]
                lines.append([*about, *_texts(found), " ".join(m for m, *_ in lost)])
                losses += [
                    [*about, m, *_texts([ours, theirs]), _cause(values[_OURS[seen]], target, episodes, m)]
                    for m, theirs, ours in lost
                ]
    parts = [_score(counts), table(heading, lines), _NOTE, _losses(losses), _cost(values)]
    return Shown("\n\n".join(parts), [heading, *lines])


def _result(theirs: float, ours: float) -> str:
    """Of one cell, from our side; errors below 1e-12 are level."""
    theirs, ours = max(theirs, _LEVEL), max(ours, _LEVEL)
    return "level" if theirs == ours else "ahead" if ours < theirs else "behind"


def _score(counts: Mapping[str, Counter[str]]) -> str:
    return "\n".join(
        f"{TITLES[_OURS[seen]]} against all that saw the {seen} features, {c.total()} cells: ahead in {c['ahead']}, "
        f"level in {c['level']}, behind in {c['behind']} (ahead or level: {1 - c['behind'] / max(c.total(), 1):.1%})"
        for seen, c in counts.items()
    )


def _losses(losses: Sequence[Sequence[Cell]]) -> str:
    if not losses:
        return "No cell is lost."
    heading = [
        "lost to",
        "features",
        "target",
        "episodes",
        "measure",
        "ours",
        "theirs",
        "what errs most of ours",
    ]
    return f"{table(heading, losses)}\n\nnot learned: no learned mode explains the example; others are misclassified."


def _cause(runs: Sequence[Any], target: str, episodes: int, measure: str) -> str:
    """The true mode that our learner's error is mostly of, and whether it was learned."""
    parts = [s["targets"][target] for run in runs for s in run["scores"] if s["episodes"] == episodes]
    modes = _pooled_modes(parts)
    worth = {m["name"]: quantile(m["errors"], 0.5) if measure == "modes" else m["sum"] for m in modes}
    corners = sum(p["all"]["sum"] - p["counted"]["sum"] for p in parts)
    if measure != "modes" and corners > max(worth.values()):
        return "corners and contacts that no linear law explains"
    worst = max(modes, key=lambda m: worth[m["name"]])
    learned = f", {worst['unlearned']} not learned" if "unlearned" in worst else ""
    return f"{first_case(worst['name'])}: {worst['wrong']} of {worst['examples']:,} wrong{learned}"


def _pooled_modes(parts: Sequence[Any]) -> list[dict[str, Any]]:
    """Scores of every true mode over several batches."""
    modes: dict[str, list[Any]] = {}
    for part in parts:
        for score in part["modes"]:
            modes.setdefault(score["name"], []).append(score)
    return [pooled_as_told(scores) for scores in modes.values()]


_NOTE: Final = (
    "Quantiles and mean of the absolute error over all test examples, corners included; modes: the median error of "
    "each true mode,\naveraged, so that rare ones count. lost: measures in which the baseline errs less. Errors below "
    "1e-12 are level."
)


def _cost(values: Values) -> str:
    """Seconds of learning a batch and of answering its tests' questions, and memory kept; means over the batches."""
    lines: list[list[Cell]] = []
    for group, runs in values.items():
        name, _, seen = group.partition("/")
        title = TITLES[name] if name in TITLES else REGRESSORS[name].title
        learning = mean(run.get("learning", run.get("seconds", 0.0)) for run in runs)
        asking = [f"{mean(run['asking'] for run in runs):.2g}"] if "asking" in runs[0] else ["-"]
        kept = f"{mean(run['bytes'] for run in runs) / 1e6:.2g}" if "bytes" in runs[0] else "-"
        lines.append([title, seen or "-", f"{learning:.2g}", *asking, kept])
    heading = ["learner", "features", "learning, s", "asking, s", "kept, MB"]
    return f"{table(heading, lines)}\n\nLibraries that fit in one go learn when they are asked first."


def _measures(runs: Sequence[Any], target: str) -> dict[int, list[float]]:
    found = {}
    for k, each in enumerate(runs[0]["scores"]):
        parts = [run["scores"][k]["targets"][target] for run in runs]
        every = pooled_as_told([part["all"] for part in parts])
        medians = [quantile(mode["errors"], 0.5) for mode in _pooled_modes(parts)]
        quantiles = [quantile(every["errors"], q) for q in (0.5, 0.95, 0.999)]
        found[each["episodes"]] = [*quantiles, every["sum"] / every["examples"], mean(medians)]
    return found


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
