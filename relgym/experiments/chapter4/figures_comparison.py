"""Our learners beside the alternatives, and under noise (figures 4.18 to 4.21)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import mean
from typing import Any, Final

from relgym.baselines.catalogue import CLASSIFIERS, REGRESSORS
from relgym.experiments.chapter4.canvas import (
    COLOURS,
    TITLES,
    above,
    canvas,
    error_axis,
    legend,
    mean_change,
    save,
)
from relgym.experiments.chapter4.figures_accuracy import scores_by_episodes
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.published import CLASSIFIER_ERRORS
from relgym.experiments.chapter4.scores import quantile
from relgym.model.reports.text import Cell, table

__all__ = ["classifiers_shown", "lwr_shown", "noise_shown"]

_STYLES: Final = ((0.95, "-"), (0.75, "--"), (0.5, ":"))


# ------------------------------------------------------------------ figures 4.19 and 4.20
def lwr_shown(_: Protocol, values: Values) -> Shown:
    """Quantiles of LWR's errors in the x velocity of experiment 2, and our 95th percentile."""
    target = "ball.vx"
    found = {group: scores_by_episodes(runs, target) for group, runs in values.items()}
    heading = ["learner", "episodes", "p50", "p75", "p95"]
    lines: list[list[Cell]] = [
        [
            _title(group),
            episodes,
            *(f"{quantile(score['errors'], q):.1e}" for q in (0.5, 0.75, 0.95)),
        ]
        for group, scores in found.items()
        for episodes, score in scores.items()
    ]

    return Shown(table(heading, lines), [heading, *lines], lambda path: _draw_lwr(path, found))


def _draw_lwr(path: Path, found: Mapping[str, Mapping[int, Any]]) -> None:
    figure, panels = canvas(10.0, 4.4)
    panel, shades = panels[0][0], iter(("#8e6eb0", "#cda443", "#5aa469"))
    for group, scores in found.items():
        ours = group in COLOURS
        colour = COLOURS[group] if ours else next(shades)
        for q, style in _STYLES[:1] if ours else _STYLES:
            line = [above(quantile(s["errors"], q)) for s in scores.values()]
            label = f"{_title(group)}, {100 * q:g} %"
            width = {"thesis": 6.0, "default": 2.0}.get(group, 1.2)  # where they agree, both can be seen
            panel.plot(list(scores), line, style, marker="o", ms=3, lw=width, color=colour, label=label)
    last = list(next(iter(found.values())).values())[-1]
    mean_change(panel, last["change"] / last["examples"])
    error_axis(panel)
    panel.set_xlabel("training episodes")
    legend(figure, panel, "right center", fontsize=8)
    save(figure, path)


def _title(group: str) -> str:
    """Of one of our learners, or of a baseline with what it was shown."""
    name, _, seen = group.partition("/")
    return (
        TITLES[name]
        if name in TITLES
        else REGRESSORS[name].title + (", uncentred" * seen.endswith("uncentred"))
    )


# ------------------------------------------------------------------ figure 4.21
def classifiers_shown(protocol: Protocol, values: Values) -> Shown:
    """Shares of misclassified examples of experiment 2; our learners' are those of wrong predictions."""
    heading = ["target", "classifier", "features", "episodes", "wrong %", "printed %"]
    rates = {group: _rates(runs) for group, runs in values.items()}
    lines: list[list[Cell]] = []
    for target in ("ball.vx", "ball.vy"):
        for group, found in rates.items():
            name, _, seen = group.partition("/")
            printed = CLASSIFIER_ERRORS.get("FOIL" if name == "thesis" else name, {})
            for episodes, rate in found[target].items():
                shown = printed.get(episodes) if target == "ball.vx" and seen != "contact" else None
                percent = "" if shown is None else f"{100 * shown:g}"
                lines.append(
                    [target, TITLES.get(name, name), seen or "-", episodes, round(100 * rate, 3), percent]
                )

    def draw(path: Path) -> None:
        figure, panels = canvas(13.0, 4.6, 1, 2, sharey=True)
        for panel, target in zip(panels[0], ("ball.vx", "ball.vy"), strict=True):
            _lines(panel, {group: found[target] for group, found in rates.items()})
            panel.set(title=f"{target[-1]} velocity", xlabel="training episodes")
        panels[0][0].set_ylabel("wrong, %")
        legend(figure, panels[0][0], "right center", fontsize=7)
        save(figure, path)

    return Shown(table(heading, lines), [heading, *lines], draw)


def _rates(runs: Sequence[Any]) -> dict[str, dict[int, float]]:
    """Share of errors by target and number of training episodes, over all batches."""
    found: dict[str, dict[int, float]] = {}
    for target in ("ball.vx", "ball.vy"):
        for k, each in enumerate(runs[0]["scores"]):
            parts = [run["scores"][k]["targets"][target] for run in runs]
            counts = [part.get("counted", part) for part in parts]
            rate = sum(c["wrong"] for c in counts) / sum(c["examples"] for c in counts)
            found.setdefault(target, {})[each["episodes"]] = rate
    return found


def _lines(panel: Any, rates: Mapping[str, Mapping[int, float]]) -> None:
    import matplotlib

    colours = matplotlib.colormaps["tab10"]
    baselines = list(dict.fromkeys(g.partition("/")[0] for g in rates if g not in COLOURS))
    for group, found in rates.items():
        name, _, seen = group.partition("/")
        ours = group in COLOURS
        colour = COLOURS[group] if ours else colours(baselines.index(name) % 10)
        title = TITLES[group] if ours else f"{CLASSIFIERS[name].title}, {seen}"
        style = "-" if ours else ("--" if seen == "contact" else ":")
        # A rate of 0 has no logarithm; the axis is linear below 0.01 %.
        panel.plot(
            list(found), [100 * r for r in found.values()], style, marker="o", ms=3, color=colour, label=title
        )
    panel.set_yscale("symlog", linthresh=0.01)
    panel.set_ylim(-0.002, 100)
    panel.set_yticks([0, 0.01, 0.1, 1, 10, 100], ["0", "0.01", "0.1", "1", "10", "100"])
    panel.grid(alpha=0.3)


# ------------------------------------------------------------------ figure 4.18
def noise_shown(protocol: Protocol, values: Values) -> Shown:
    """Mode-averaged median error against the true variance, a line per expected variance (y velocity)."""
    target, variances = "ball.vy", list(protocol.variances)
    found = {}
    for expected, runs in values.items():
        each = len(runs) // len(variances)
        found[expected] = [
            [run["errors"][target] for run in runs[k * each : (k + 1) * each]] for k in range(len(variances))
        ]
    heading = ["expected variance", *(f"true {v:g}" for v in variances)]
    lines: list[list[Cell]] = [
        [expected, *(f"{mean(errors):.1e}" for errors in by_true)] for expected, by_true in found.items()
    ]

    def draw(path: Path) -> None:
        figure, panels = canvas(7.5, 4.4)
        panel = panels[0][0]
        for expected, by_true in found.items():
            words = {"auto": "estimated, modes", "default": "default"}
            label = words.get(expected, f"σ² = {expected}")
            width = 2.5 if expected in words else 1.2
            panel.loglog(variances, [above(mean(e)) for e in by_true], "o-", lw=width, label=label)
        panel.loglog(
            variances, [v**0.5 for v in variances], color="black", lw=0.7, ls="--", label="one σ of the noise"
        )
        panel.set(xlabel="true variance of the noise", ylabel="mode-averaged median error")
        panel.grid(alpha=0.3)
        panel.legend(fontsize=7)
        save(figure, path)

    note = "y velocity, experiment 1. No error can be below the noise: the next state carries it, too."
    return Shown(f"{table(heading, lines)}\n\n{note}", [heading, *lines], draw)
