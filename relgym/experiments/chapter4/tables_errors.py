"""Tables of errors: which modes are taken for which (4.7, 4.8, 4.15, 4.16), roll-outs (4.18), and rates.

Rates are those of all learners, and of the thesis' program with single causes of its errors taken away (§4.3.4,
§4.4.4).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from relgym.experiments.chapter4.canvas import PRINTED, TITLES, first_case
from relgym.experiments.chapter4.figures_accuracy import pooled_as_told
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import ABLATIONS, Protocol
from relgym.experiments.chapter4.published import CONFUSIONS, MODES, RATES, ROLLOUT_FAILURES, Confusion
from relgym.experiments.chapter4.rolled import CAUSES, STRAYS, occurrences
from relgym.experiments.chapter4.scores import pooled_scores, quantile
from relgym.experiments.chapter4.tables_modes import best_run, row_of
from relgym.experiments.rollouts import STRAY
from relgym.model.reports.text import Cell, table

__all__ = ["ablation_shown", "confusion_shown", "rates_shown", "rollouts_shown", "wrong_of_modes"]

_TARGETS: Final[Mapping[str, tuple[str, str]]] = {
    "4.7": ("4.2", "x"),
    "4.8": ("4.2", "y"),
    "4.15": ("4.9", "x"),
    "4.16": ("4.9", "y"),
}


def wrong_of_modes(scores: Sequence[Mapping[str, Any]], *names: str) -> float:
    """Share of wrong predictions, in percent, among the examples of true modes whose names begin so; NaN of none.

    Parameters
    ----------
    scores
        Of one target, from any number of trainings.
    names
        Such as ``"floor"``.
    """
    modes = [mode for score in scores for mode in score["modes"] if mode["name"].startswith(names)]
    examples = sum(mode["examples"] for mode in modes)
    return 100.0 * float(sum(mode["wrong"] for mode in modes)) / examples if examples else math.nan


def confusion_shown(_: Protocol, values: Values, number: str) -> Shown:
    """Which mode was taken for which, a single model of each learner."""
    modes, axis = _TARGETS[number]
    target, published = f"ball.v{axis}", MODES[modes, axis]
    texts = [f"{PRINTED}: rate of errors {CONFUSIONS[number].rate:.4f}\n\n{_published(CONFUSIONS[number])}"]
    data: list[list[Cell]] = [["learner", "predicted", "correct", "count"]]
    for learner, runs in values.items():
        run = best_run(runs)
        found = run["confusions"].get(target)
        if found is None:
            score = run["scores"][-1]["targets"][target]["counted"]
            texts.append(
                f"{TITLES[learner]}: laws, no modes; wrong {score['wrong']} of {score['examples']:,}"
            )
            continue
        named = [_name(mode, run["modes"][target], published) for mode in found["modes"]]
        order = sorted(range(len(named)), key=lambda k: (len(named[k]), named[k]))  # rows of the table first
        names = [named[k] for k in order]
        counts = [[found["table"][i][j] for j in order] for i in (*order, len(order))]
        texts.append(f"{TITLES[learner]}: {_confusion(counts, names)}")
        data += [
            [learner, row, column, counts[i][j]]
            for i, row in enumerate([*names, "none"])
            for j, column in enumerate(names)
        ]
    note = (
        "Rows: predicted mode, columns: correct mode (the one with the least error; equally good ones are as correct). "
        "Modes that the\nthesis' table lacks are named by their functions; there are other rare modes than it shows."
    )
    return Shown("\n\n".join([*texts, note]), data)


def _published(confusion: Confusion) -> str:
    columns = [str(k + 1) for k in range(len(confusion.examples))]
    lines: list[list[Cell]] = [[k + 1, *row, sum(row)] for k, row in enumerate(confusion.errors)]
    totals = [sum(column) for column in zip(*confusion.errors, strict=True)]
    lines.append(["errors", *totals, sum(totals)])
    lines.append(["examples", *confusion.examples, sum(confusion.examples)])
    return table(["predicted", *columns, "total"], lines)


def _name(mode: int, known: Sequence[Mapping[str, Any]], published: Sequence[Any]) -> str:
    found = next(m for m in known if m["id"] == mode)
    row = row_of(found, published)
    return str(row) if row else str(found["function"])


def _confusion(counts: Sequence[Sequence[int]], names: Sequence[str]) -> str:
    size = len(names)
    off = [[0 if i == j else counts[i][j] for j in range(size)] for i in range(size)] + [list(counts[size])]
    lines: list[list[Cell]] = [
        [name, *row, sum(row)] for name, row in zip([*names, "none"], off, strict=True)
    ]
    totals = [sum(row[j] for row in off) for j in range(size)]
    examples = [sum(row[j] for row in counts) for j in range(size)]
    lines.append(["errors", *totals, sum(totals)])
    lines.append(["examples", *examples, sum(examples)])
    rate = sum(totals) / max(sum(examples), 1)
    short = [name if len(name) < 4 else f"({chr(ord('a') + k)})" for k, name in enumerate(names)]
    keys = "".join(f"\n  {s} {n}" for s, n in zip(short, names, strict=True) if s != n)
    for line, name in zip(lines, [*short, "none"], strict=False):
        line[0] = name
    return f"rate of errors {rate:.4f}{keys}\n\n{table(['predicted', *short, 'total'], lines)}"


def rollouts_shown(_: Protocol, values: Values) -> Shown:
    """Table 4.18: what roll-outs failed of, and how many failed."""
    trials = {learner: runs[0]["trials"] for learner, runs in values.items()}
    counts = [occurrences(each) for each in trials.values()]
    heading = ["error", PRINTED, *(TITLES[learner] for learner in values)]
    lines: list[list[Cell]] = [
        [cause, ROLLOUT_FAILURES.get(cause, "-"), *(each[cause] for each in counts)] for cause in CAUSES
    ]
    lines.append(
        ["corrected by hand", 22, *(sum(len(t["mended"]) for t in each) for each in trials.values())]
    )
    for name, key in (("failed", None), ("failed, nothing corrected", "unmended")):
        for stray in STRAYS:
            shares = [_failed(each, key, stray) for each in trials.values()]
            printed = "26 of 80" if key is None and stray == STRAY else "-"
            lines.append([f"{name}: off by more than {stray:g}", printed, *shares])
    some = next(iter(values.values()))[0]
    bounces = ", ".join(f"{n} {name}" for name, n in some["bounces"].items())
    note = (
        "Occurrences: bad resolutions that were corrected, and of each failed roll-out the step that went wrong first; "
        f"its cause is what\nreally happened there. Failed: a position is off by more than so much, {STRAY:g} where "
        "nothing else is said; the thesis speaks of\n26 trials with a significant error, and its axes are not "
        "readable. Corrected, as in the thesis: the second push of an upright or\nslanted surface that a ball still "
        f"overlaps. Bounces in the {len(some['trials'])} trials: {bounces} (printed: 205 vertical, 108 slant)."
    )
    return Shown(f"{table(heading, lines)}\n\n{note}", [heading, *lines])


def _failed(trials: Sequence[Mapping[str, Any]], key: str | None, stray: float) -> str:
    largest = [(t if key is None else t[key])["largest"] for t in trials]
    return f"{sum(v is None or v > stray for v in largest)} of {len(trials)}"


# ------------------------------------------------------------------ rates at the end of experiments 1 and 2
def _at_the_end(values: Values) -> Iterator[tuple[str, str, str, list[Any]]]:
    """Experiment, target, learner and its scores in the last test, in this order; groups are ``experiment/learner``."""
    for experiment in dict.fromkeys(group.partition("/")[0] for group in values):
        for target in ("ball.vx", "ball.vy"):
            for group in (group for group in values if group.startswith(f"{experiment}/")):
                scores = [run["scores"][-1]["targets"][target] for run in values[group]]
                yield experiment, target, group.partition("/")[2], scores


def _range(experiment: str, target: str) -> str:
    """What counts as the thesis' rate, in per cent."""
    low, high = RATES[int(experiment), target]
    return f"{100 * low:g}-{100 * high:g}"


def rates_shown(_: Protocol, values: Values) -> Shown:
    """All learners at the end of experiments 1 and 2; groups are ``experiment/learner``."""
    heading = (
        "experiment, target, learner, wrong %, not learned %, "
        "misclassified %, strict %, p95, p99.9, printed range %"
    ).split(", ")
    lines = []
    for experiment, target, learner, parts in _at_the_end(values):
        shares = _shares(pooled_as_told([part["counted"] for part in parts]))
        lines.append([int(experiment), target, TITLES[learner], *shares, _range(experiment, target)])
    note = (
        "wrong: off by more than 1e-9, or no prediction. not learned: no learned mode is right. strict: the thesis' "
        "count, the chosen\nmode isn't the best one, ties forgiven. p95, p99.9: quantiles of the absolute error.\n"
        "Rates of the thesis' program on all 24,000 test examples, whatever the protocol: see *ablation*."
    )
    return Shown(f"{table(heading, lines)}\n\n{note}", [heading, *lines])


def _shares(score: Mapping[str, Any]) -> list[Cell]:
    shares: list[Cell] = []
    for key in ("wrong", "unlearned", "misclassified", "strict"):
        shares.append(round(100 * score[key] / score["examples"], 3) if key in score else "-")
    return [*shares, *(f"{quantile(score['errors'], q):.0e}" for q in (0.95, 0.999))]


def ablation_shown(_: Protocol, values: Values) -> Shown:
    """Rates of wrong predictions at the end of experiments 1 and 2; groups are ``experiment/learner``."""
    heading = (
        "experiment, target, learner, wrong %, strict %, "
        "ties too %, printed range %, inside, upright %, most of it"
    ).split(", ")
    lines: list[list[Cell]] = []
    for experiment, target, learner, parts in _at_the_end(values):
        score = pooled_scores(part["counted"] for part in parts)
        shares = [score[key] / score["examples"] for key in ("wrong", "strict", "literal")]
        low, high = RATES[int(experiment), target]
        inside = "yes" if low <= shares[0] <= high else "no"
        percents = [f"{100 * share:.3f}" for share in shares]
        share = wrong_of_modes(parts, "left face", "right face")
        upright = "-" if math.isnan(share) else f"{share:.1f}"
        about = [experiment, target, learner, *percents, _range(experiment, target)]
        lines.append([*about, inside, upright, _worst(parts)])
    note = (
        "On all 24,000 test examples, whatever the protocol. wrong: off by more than 1e-9, or no prediction. strict: "
        "the chosen mode isn't\nthe best one, ties forgiven; ties too: not forgiven, as the thesis counted. upright: "
        "wrong of the bounces off\nupright surfaces."
    )
    causes = "\n".join(f"{name}: {words}." for name, words in ABLATIONS.items())
    return Shown(f"{table(heading, lines)}\n\n{note}\n{causes}", [heading, *lines])


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
