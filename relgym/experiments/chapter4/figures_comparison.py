"""Our learners beside the alternatives (figures 4.18-4.21), the headline at equal features, and the tuning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import mean
from typing import Any, Final

from relgym.baselines.catalogue import CLASSIFIERS, REGRESSORS
from relgym.baselines.tuned import setting_of
from relgym.experiments.chapter4.canvas import COLOURS, TITLES, above, canvas, error_axis, save
from relgym.experiments.chapter4.figures_accuracy import scores_by_blocks
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.published import CLASSIFIER_ERRORS, LWR
from relgym.experiments.chapter4.scores import pooled_scores, quantile
from relgym.model.text import Cell, table

__all__ = ["classifiers_shown", "headline_shown", "lwr_shown", "noise_shown", "tuning_shown"]

_STYLES: Final = ((0.95, "-"), (0.75, "--"), (0.5, ":"))


# ------------------------------------------------------------------ figures 4.19 and 4.20
def lwr_shown(_: Protocol, values: Values, number: str) -> Shown:
    """Quantiles of LWR's errors in the x velocity of experiment 2, and our 95th percentile."""
    target = "ball.vx"
    found = {group: scores_by_blocks(runs, target) for group, runs in values.items()}
    heading = ["learner", "blocks", "p50", "p75", "p95"]
    lines: list[list[Cell]] = [
        [
            TITLES.get(group, group),
            blocks,
            *(f"{quantile(score['errors'], q):.1e}" for q in (0.5, 0.75, 0.95)),
        ]
        for group, scores in found.items()
        for blocks, score in scores.items()
    ]

    def draw(path: Path) -> None:
        figure, panels = canvas(8.0, 4.6)
        panel = panels[0][0]
        shades = iter(("#8e6eb0", "#cda443"))
        for group, scores in found.items():
            ours = group in COLOURS
            colour = COLOURS[group] if ours else next(shades)
            for q, style in _STYLES[:1] if ours else _STYLES:
                line = [above(quantile(s["errors"], q)) for s in scores.values()]
                label = f"{TITLES.get(group, group)}, {100 * q:g} %"
                panel.plot(
                    list(scores),
                    line,
                    style,
                    marker="o",
                    ms=3,
                    lw=3 if ours else 1.2,
                    color=colour,
                    label=label,
                )
        last = list(next(iter(found.values())).values())[-1]
        panel.axhline(last["change"] / last["examples"], color="black", lw=0.8, ls="--")
        error_axis(panel)
        panel.set_xlabel("training blocks")
        panel.legend(fontsize=7, ncols=2)
        save(figure, path)

    return Shown(f"{table(heading, lines)}\n\nprinted: {LWR[number]}", [heading, *lines], draw)


# ------------------------------------------------------------------ figure 4.21
def classifiers_shown(protocol: Protocol, values: Values) -> Shown:
    """Shares of misclassified examples of experiment 2; our learners' are those of wrong predictions."""
    heading = ["target", "classifier", "features", "blocks", "wrong %", "printed %"]
    rates = {group: _rates(runs) for group, runs in values.items()}
    lines: list[list[Cell]] = []
    for target in ("ball.vx", "ball.vy"):
        for group, found in rates.items():
            name, _, seen = group.partition("/")
            printed = CLASSIFIER_ERRORS.get("FOIL" if name == "thesis" else name, {})
            for blocks, rate in found[target].items():
                shown = printed.get(blocks) if target == "ball.vx" and seen != "contact" else None
                percent = "" if shown is None else f"{100 * shown:g}"
                lines.append(
                    [target, TITLES.get(name, name), seen or "-", blocks, round(100 * rate, 3), percent]
                )

    def draw(path: Path) -> None:
        figure, panels = canvas(13.0, 4.6, 1, 2, sharey=True)
        for panel, target in zip(panels[0], ("ball.vx", "ball.vy"), strict=True):
            _lines(panel, {group: found[target] for group, found in rates.items()})
            panel.set(title=f"{target[-1]} velocity", xlabel="training blocks")
        panels[0][0].set_ylabel("wrong, %")
        handles, labels = panels[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right center", fontsize=7)
        save(figure, path)

    return Shown(table(heading, lines), [heading, *lines], draw)


def _rates(runs: Sequence[Any]) -> dict[str, dict[int, float]]:
    """Share of errors by target and number of training blocks, over all batches."""
    found: dict[str, dict[int, float]] = {}
    for target in ("ball.vx", "ball.vy"):
        for k, each in enumerate(runs[0]["scores"]):
            parts = [run["scores"][k]["targets"][target] for run in runs]
            counts = [part.get("counted", part) for part in parts]
            rate = sum(c["wrong"] for c in counts) / sum(c["examples"] for c in counts)
            found.setdefault(target, {})[each["blocks"]] = rate
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


# ------------------------------------------------------------------ headline
_OURS: Final[Mapping[str, str]] = {"thesis": "thesis", "contact": "default"}
"""Which of our learners was shown what: chapter III's relations are the thesis' features, contact laws ours."""

_MEASURES: Final = ("p50", "p95", "p99.9", "mean", "modes")


def headline_shown(_: Protocol, values: Values) -> Shown:
    """Every baseline against our learner that saw the same: who errs less, by training size and measure."""
    heading = ["baseline", "features", "target", "blocks", *_MEASURES, "lost"]
    lines: list[list[Cell]] = []
    won = {seen: [0, 0] for seen in _OURS}
    losses: list[str] = []
    ours = {seen: values[name] for seen, name in _OURS.items()}
    for target in ("ball.vx", "ball.vy"):
        known = {seen: _measures(runs, target) for seen, runs in ours.items()}
        for seen, name in _OURS.items():
            lines += [[TITLES[name], seen, target, b, *_texts(m), ""] for b, m in known[seen].items()]
        for group, runs in values.items():
            if "/" not in group:
                continue
            baseline, seen = group.split("/")
            for blocks, found in _measures(runs, target).items():
                better = [
                    m for m, f, o in zip(_MEASURES, found, known[seen][blocks], strict=True) if _beats(f, o)
                ]
                won[seen][0] += len(_MEASURES) - len(better)
                won[seen][1] += len(_MEASURES)
                title = REGRESSORS[baseline].title
                lines.append([title, seen, target, blocks, *_texts(found), " ".join(better)])
                losses += (
                    [f"{title}, {seen}, {target}, {blocks} blocks: {', '.join(better)}"] if better else []
                )
    wins = "\n".join(
        f"{TITLES[_OURS[seen]]} against all that saw the {seen} features: ahead or level in {a} of {b} cells "
        f"({a / max(b, 1):.1%})"
        for seen, (a, b) in won.items()
    )
    note = (
        "Quantiles and mean of the absolute error over all test examples, corners included; modes: the median error "
        "of each true mode,\naveraged, so that rare ones count. lost: measures in which the baseline errs less. Errors "
        "below 1e-12 are level."
    )
    return Shown(f"{wins}\n\n{table(heading, lines)}\n\n{note}", [heading, *lines], None)


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
        _, name, seen = group.split("/")
        losses = [_loss(run) for run in runs]
        best = min(range(len(losses)), key=lambda k: losses[k])
        for k, run in enumerate(runs):
            setting = ", ".join(f"{key}={value}" for key, value in run["setting"].items()) or "-"
            error, wrong = losses[k]
            shown: list[Cell] = [f"{error:.3e}", round(100 * wrong, 3)]
            marks = ["*" if k == setting_of(name, seen) else "", "*" if k == best else ""]
            lines.append([name, seen, setting, *shown, *marks])
    return Shown(table(heading, lines), [heading, *lines])


def _loss(run: Mapping[str, Any]) -> tuple[float, float]:
    """What tuning minimises: the mean error where there is one, then the share of errors; both targets."""
    parts = [part.get("counted", part) for part in run["scores"][-1]["targets"].values()]
    wrong = mean(part["wrong"] / part["examples"] for part in parts)
    if "sum" not in parts[0]:
        return 0.0, wrong
    return mean(part["sum"] / part["change"] for part in parts), wrong
