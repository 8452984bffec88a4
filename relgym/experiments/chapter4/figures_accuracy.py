"""Accuracy by number of training episodes, whole and by mode (figures 4.3-4.7, 4.12-4.17, 4.27-4.29)."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any, Final, TypeAlias

from relgym.experiments.chapter4.canvas import (
    COLOURS,
    ERROR,
    TITLES,
    above,
    canvas,
    error_axis,
    legend,
    mean_change,
    save,
)
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.scores import pooled_scores, quantile
from relgym.model.reports.text import Cell, table

__all__ = [
    "accuracy_shown",
    "by_mode_shown",
    "perfect_shown",
    "pooled_as_told",
    "rates_shown",
    "scores_by_episodes",
]

_QUANTILES: Final = (0.05, 0.25, 0.5, 0.75, 0.95)
_Score: TypeAlias = Mapping[str, Any]
_Scores: TypeAlias = Mapping[str, Mapping[str, Mapping[int, _Score]]]
"""By target, learner and number of training episodes."""


def scores_by_episodes(runs: Sequence[Any], target: str, part: str = "all") -> dict[int, _Score]:
    """Pooled scores of all batches by number of training episodes; `part` is ``"all"`` or ``"counted"``."""
    numbers = [each["episodes"] for each in runs[0]["scores"]]
    return {
        episodes: pooled_as_told([run["scores"][k]["targets"][target][part] for run in runs])
        for k, episodes in enumerate(numbers)
    }


def pooled_as_told(scores: Sequence[_Score]) -> dict[str, Any]:
    """Pooled scores, as far as all batches tell: after few episodes some have modes, where others' laws have none."""
    told = set.intersection(*map(set, scores))
    return pooled_scores([{key: each[key] for key in scores[0] if key in told} for each in scores])


# ------------------------------------------------------------------ figures 4.3, 4.12, 4.16
def accuracy_shown(_: Protocol, values: Values, targets: Sequence[str]) -> Shown:
    """95th percentile of the error over all test examples, and 99.9th: the former hides rare modes."""
    heading = ["target", "learner", "episodes", "p50", "p95", "p99.9", "mean change", "wrong %"]
    found = _found(values, targets)

    def draw(path: Path) -> None:
        figure, panels = canvas(5.5 * len(targets), 4.2, 1, len(targets), sharey=True)
        for panel, (target, learners) in zip(panels[0], found.items(), strict=True):
            for k, (learner, scores) in enumerate(learners.items()):
                colour = COLOURS[learner]
                at = list(scores)
                thick = max(1.2, 6.0 - 1.6 * k)  # later lines are thinner: where two agree, both can be seen
                p95 = [above(quantile(s["errors"], 0.95)) for s in scores.values()]
                p999 = [above(quantile(s["errors"], 0.999)) for s in scores.values()]
                panel.plot(at, p95, "o-", color=colour, lw=thick, ms=4, label=f"{TITLES[learner]}, 95 %")
                panel.plot(
                    at, p999, "o:", color=colour, lw=0.4 * thick, ms=3, label=f"{TITLES[learner]}, 99.9 %"
                )
            _dash(panel, next(iter(learners.values())))
            error_axis(panel, label=panel is panels[0][0])
            panel.set(title=f"{target[-1]} velocity", xlabel="training episodes")
        legend(figure, panels[0][0], "lower center", ncols=3 + 2 * (len(targets) > 1), fontsize=7)
        save(figure, path)

    return _listed(heading, found, _figures, draw)


def _found(values: Values, targets: Sequence[str], part: str = "all") -> _Scores:
    return {t: {name: scores_by_episodes(runs, t, part) for name, runs in values.items()} for t in targets}


def _listed(
    heading: list[str], found: _Scores, cells: Callable[[_Score], list[Cell]], draw: Callable[[Path], None]
) -> Shown:
    """A line for each target, learner and number of episodes."""
    lines: list[list[Cell]] = [
        [target, TITLES[learner], episodes, *cells(score)]
        for target, learners in found.items()
        for learner, scores in learners.items()
        for episodes, score in scores.items()
    ]
    return Shown(table(heading, lines), [heading, *lines], draw)


def _figures(score: _Score) -> list[Cell]:
    quantiles = [f"{quantile(score['errors'], q):.1e}" for q in (0.5, 0.95, 0.999)]
    change = f"{score['change'] / score['examples']:.1e}"
    return [*quantiles, change, round(100 * score["wrong"] / score["examples"], 3)]


def _dash(panel: Any, scores: Mapping[int, _Score]) -> None:
    """The average magnitude of change."""
    last = list(scores.values())[-1]
    mean_change(panel, last["change"] / last["examples"])


# ------------------------------------------------------------------ figures 4.4, 4.5, 4.13, 4.14, 4.27-4.29
def by_mode_shown(_: Protocol, values: Values, target: str) -> Shown:
    """Errors within each true mode: boxes from quartile to quartile, whiskers from 5 to 95 %."""
    found = {learner: _by_mode(runs, target) for learner, runs in values.items()}
    names = list(dict.fromkeys(name for modes in found.values() for name in modes))
    heading = ["mode", "learner", "episodes", "examples", "p5", "p25", "p50", "p75", "p95", "wrong %"]
    lines: list[list[Cell]] = []
    for name in names:
        for learner, modes in found.items():
            for episodes, score in modes.get(name, {}).items():
                boxes = [f"{quantile(score['errors'], q):.0e}" for q in _QUANTILES]
                wrong = round(100 * score["wrong"] / max(score["examples"], 1), 2)
                lines.append([name, TITLES[learner], episodes, score["examples"], *boxes, wrong])

    def draw(path: Path) -> None:
        columns = 4 if len(names) in (4, 7, 8) else min(3, len(names))
        rows = -(-len(names) // columns)
        figure, panels = canvas(13.8, 3.1 * rows, rows, columns, sharey=True)
        for panel, name in zip(panels.flat, names, strict=False):
            _boxes(panel, {learner: modes.get(name, {}) for learner, modes in found.items()})
            panel.set_title(_short(name, names), fontsize=8)
        for panel in list(panels.flat)[len(names) :]:
            panel.set_axis_off()
        figure.supxlabel("training episodes", fontsize=9)
        figure.supylabel(ERROR, fontsize=9)
        legend(figure, panels.flat[0], "upper center", ncols=5, fontsize=8)
        save(figure, path)

    return Shown(table(heading, lines), [heading, *lines], draw)


def _short(name: str, names: Sequence[str]) -> str:
    """A mode's name in at most two lines; without the friction where all have the same."""
    if len(set(re.findall(r"mu [0-9.]+", " ".join(names)))) == 1:
        name = re.sub(r", mu [0-9.]+", "", name)
    lines = wrap(name, 46, max_lines=2, placeholder=" …")
    return "\n".join(lines)


def _by_mode(runs: Sequence[Any], target: str) -> dict[str, dict[int, _Score]]:
    """Pooled scores by true mode and number of training episodes."""
    found: dict[str, dict[int, list[_Score]]] = {}
    for each in (each for run in runs for each in run["scores"]):
        for score in each["targets"][target]["modes"]:
            found.setdefault(score["name"], {}).setdefault(each["episodes"], []).append(score)
    return {
        name: {episodes: pooled_as_told(scores) for episodes, scores in by_episodes.items()}
        for name, by_episodes in found.items()
    }


def _boxes(panel: Any, learners: Mapping[str, Mapping[int, _Score]], part: str = "errors") -> None:
    """Boxes of several learners side by side, one group per number of episodes."""
    numbers = sorted({episodes for scores in learners.values() for episodes in scores})
    width = 0.8 / max(len(learners), 1)
    for k, (learner, scores) in enumerate(learners.items()):
        kept = [(numbers.index(b) + width * (k + 0.5) - 0.4, s) for b, s in scores.items() if part in s]
        if kept:
            panel.bxp(
                [_box(score[part]) for _, score in kept],
                positions=[place for place, _ in kept],
                widths=0.85 * width,
                showfliers=False,
                patch_artist=True,
                boxprops={"facecolor": COLOURS[learner], "alpha": 0.55, "lw": 0.6},
                medianprops={"color": "black", "lw": 1.6},
            )
            panel.fill_between([], [], color=COLOURS[learner], alpha=0.55, label=TITLES[learner])
    for score in [s for scores in learners.values() for s in scores.values()][:1]:
        mean_change(panel, score["change"] / max(score["examples"], 1))
    error_axis(panel, label=False)
    panel.set_xticks(range(len(numbers)), [str(n) for n in numbers])


def _box(errors: Any) -> dict[str, Any]:
    low, first, median, third, high = (above(quantile(errors, q)) for q in _QUANTILES)
    return {"whislo": low, "q1": first, "med": median, "q3": third, "whishi": high}


# ------------------------------------------------------------------ figures 4.6, 4.15, 4.17
def rates_shown(_: Protocol, values: Values, targets: Sequence[str]) -> Shown:
    """Shares of wrong predictions, split: the mode wasn't learned, or it was and another one was chosen."""
    heading = ["target", "learner", "episodes", "wrong %", "not learned %", "misclassified %"]
    found = _found(values, targets, "counted")

    def draw(path: Path) -> None:
        figure, panels = canvas(5.5 * len(targets), 4.0, 1, len(targets))
        for panel, (target, learners) in zip(panels[0], found.items(), strict=True):
            _rates_drawn(panel, learners)
            panel.set(title=f"{target[-1]} velocity", xlabel="training episodes", ylabel="wrong, %")
        panels[0][-1].legend(fontsize=7)
        save(figure, path)

    return _listed(heading, found, _split, draw)


def _split(score: _Score) -> list[Cell]:
    rate = 100.0 / max(score["examples"], 1)
    return [
        round(rate * score[key], 3) if key in score else "-"
        for key in ("wrong", "unlearned", "misclassified")
    ]


def _rates_drawn(panel: Any, learners: Mapping[str, Mapping[int, _Score]]) -> None:
    width = 0.8 / len(learners)
    numbers = list(next(iter(learners.values())))
    for k, (learner, scores) in enumerate(learners.items()):
        rates = [
            [100.0 * s.get(key, 0) / s["examples"] for s in scores.values()] for key in ("unlearned", "wrong")
        ]
        at = [n + width * (k + 0.5) - 0.4 for n in range(len(scores))]
        panel.bar(at, rates[1], 0.9 * width, color=COLOURS[learner], label=TITLES[learner])
        panel.bar(at, rates[0], 0.9 * width, color="none", edgecolor="black", hatch="////", lw=0.3)
    panel.bar([0], [0], color="none", edgecolor="black", hatch="////", label="of these: mode not learned")
    panel.set_xticks(range(len(numbers)), [str(n) for n in numbers])
    panel.set_yscale("symlog", linthresh=0.1)
    panel.set_ylim(0, 110)
    panel.set_yticks([0, 0.1, 1, 10, 100], ["0", "0.1", "1", "10", "100"])
    panel.grid(alpha=0.3, axis="y")


# ------------------------------------------------------------------ figure 4.7
def perfect_shown(_: Protocol, values: Values, target: str, mode: str) -> Shown:
    """Errors within one mode if the classifier were perfect: what remains is not learned (Figure 4.7)."""
    found = {}
    for learner, runs in values.items():
        modes = _by_mode(runs, target)
        known = (s for name, s in modes.items() if name.split(", ")[0] == mode)
        found[learner] = next((s for s in known if all("best" in x for x in s.values())), {})
    heading = ["learner", "episodes", "chosen p50", "chosen p75", "best p50", "best p75", "best p95"]
    lines: list[list[Cell]] = []
    for learner, scores in found.items():
        for episodes, score in scores.items():
            chosen = [f"{quantile(score['errors'], q):.0e}" for q in (0.5, 0.75)]
            best = [f"{quantile(score['best'], q):.0e}" for q in (0.5, 0.75, 0.95)]
            lines.append([TITLES[learner], episodes, *chosen, *best])

    def draw(path: Path) -> None:
        figure, panels = canvas(9.0, 3.8, 1, 2, sharey=True)
        for panel, part, title in zip(
            panels[0], ("errors", "best"), ("as classified", "with a perfect classifier"), strict=True
        ):
            _boxes(panel, {learner: scores for learner, scores in found.items() if scores}, part)
            panel.set(title=title, xlabel="training episodes")
        error_axis(panels[0][0])
        panels[0][1].legend(fontsize=8)
        save(figure, path)

    return Shown(table(heading, lines), [heading, *lines], draw)
