"""Tables of modes (3.1, 4.2, 4.9, 4.17): every row of the thesis, and what each learner has for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from relgym.experiments.chapter4.canvas import PRINTED, TITLES
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.published import MODES, PublishedMode
from relgym.experiments.data import BALL_EXPERIMENTS
from relgym.model.reports.text import Cell, amount, table

__all__ = ["best_run", "modes_shown", "pushing_modes_shown", "row_of", "wrong_rate"]

_TABLES: Final[Mapping[int, str]] = {1: "4.2", 2: "4.9", 3: "4.17"}

_CLOSE: Final = 6e-3
"""Relative difference up to which a coefficient is the printed one: three digits were printed."""


def wrong_rate(value: Mapping[str, Any]) -> float:
    """Share of wrong predictions of a lesson's last test, both coordinates."""
    parts = [target["counted"] for target in value["scores"][-1]["targets"].values()]
    wrong: int = sum(p["wrong"] for p in parts)
    return wrong / max(1, int(sum(p["examples"] for p in parts)))


def best_run(values: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Of the batches that learned most rows of a table of modes the one that errs least.

    The thesis shows the "most correct" one, too, some of whose modes others miss (§4.3.1).
    """
    return min(values, key=lambda run: (-_rows_learned(run), wrong_rate(run)))


def _rows_learned(run: Mapping[str, Any]) -> int:
    """How many rows of both axes, in the table that has most of them."""
    found: dict[str, int] = {}
    for (number, axis), published in MODES.items():
        rows = {row_of(mode, published) for mode in run["modes"].get(f"ball.v{axis}", ())}
        found[number] = found.get(number, 0) + len(rows - {0})
    return max(found.values())


def row_of(mode: Mapping[str, Any], published: Sequence[PublishedMode]) -> int:
    """Number of the published mode with this function; 0 if there is none."""
    if mode["others"] or not mode["weights"].keys() <= {"vx", "vy"}:
        return 0
    found = (mode["weights"].get("vx", 0.0), mode["weights"].get("vy", 0.0), mode["intercept"])
    for row in published:
        if row.weights is not None and all(map(_same, found, (*row.weights, row.intercept))):
            return row.number
    return 0


def _same(found: float, printed: float) -> bool:
    return abs(found - printed) <= max(_CLOSE * abs(printed), 1e-8)


def modes_shown(_: Protocol, values: Values, experiment: int) -> Shown:
    """Tables 4.2, 4.9 and 4.17."""
    number = _TABLES[experiment]
    axes = ("x",) if experiment == 3 else ("x", "y")
    texts: list[str] = []
    rows: list[list[Cell]] = [["axis", "number", "behaviour", "function", PRINTED, *_titles(values)]]
    runs = {learner: best_run(each) for learner, each in values.items()}
    for axis in axes:
        published = MODES[number, axis]
        counts = {learner: _counts(run, f"ball.v{axis}", published) for learner, run in runs.items()}
        lines = _mode_lines(axis, published, counts)
        heading = ["#", "behaviour (printed)", "function", PRINTED, *_titles(values)]
        texts.append(f"{axis} velocity: training examples of each mode\n\n{table(heading, lines)}")
        rows += [[axis, *line] for line in lines]
    note = (
        "A dash: no learned mode states this function. Each column is, of the batches that learned most of them,\n"
        f"the one that errs least; printed: of {amount(BALL_EXPERIMENTS[experiment].episodes * 200, 'example')}.\n"
        "The default learner has laws of contacts instead of these modes; the functions that follow from them:"
    )
    law_text = next((run["text"] for name, run in runs.items() if name == "default"), "")
    return Shown("\n\n".join([*texts, note, law_text]), rows)


def _titles(values: Values) -> list[str]:
    return [TITLES[learner] for learner in values]


def _mode_lines(
    axis: str, published: Sequence[PublishedMode], counts: Mapping[str, Mapping[int, int | str]]
) -> list[list[Cell]]:
    lines: list[list[Cell]] = []
    for row in published:
        known = (each.get(row.number, "-") for each in counts.values())
        lines.append([row.number, row.behaviour, _function(axis, row), row.examples, *known])
    lines.append(["", "modes that are no row", "", "", *(each.get(-1, "") for each in counts.values())])
    return lines


def _counts(run: Mapping[str, Any], target: str, published: Sequence[PublishedMode]) -> dict[int, int | str]:
    """Examples by row of the table; -1: how many modes are no row of it."""
    if target not in run["modes"]:
        laws: dict[int, int | str] = {row.number: "law" for row in published if row.number}
        return {**laws, -1: "", 0: ""}
    found: dict[int, int | str] = {}
    others = 0
    for mode in run["modes"][target]:
        row = row_of(mode, published)
        if row and row not in found:
            found[row] = mode["examples"]
        else:
            others += 1
    noise = next(t["noise"] for t in run["report"]["targets"] if t["target"] == target)
    return found | {0: noise, -1: others}


def _function(axis: str, row: PublishedMode) -> str:
    if row.weights is None:
        return "-"
    terms = [
        ("" if abs(w) == 1.0 else f"{abs(w):g} ") + f"v{n}"
        for w, n in zip(row.weights, "xy", strict=True)
        if w
    ]
    signs = [w for w in (*row.weights, row.intercept) if w]
    terms += [f"{abs(row.intercept):g}"] if row.intercept else []
    text = " ".join(f"{'-' if w < 0 else '+'} {term}" for w, term in zip(signs, terms, strict=True))
    return f"v{axis}' = " + (text.removeprefix("+ ").replace("- ", "-", text.startswith("- ")) or "0")


# ------------------------------------------------------------------ box pushing
_PUSHING: Final = (
    (1, "1", 480, "v' = v + 0.025 F - 7.5 Ca"),
    (2, "2 and 3", 960, "v' = v + 0.025 F - 5 Ca - 2.5 Cb"),
    (3, "4", 480, "v' = v + 0.025 F - 2.5 Ca - 2.5 Cb - 2.5 Cc"),
)
"""Table 3.1; noise: none."""


def pushing_modes_shown(_: Protocol, values: Values) -> Shown:
    """Table 3.1."""
    counts = {learner: _pushing_counts(runs[0]) for learner, runs in values.items()}
    lines: list[list[Cell]] = [
        [number, configuration, function, examples, *(c.get(number, "-") for c in counts.values())]
        for number, configuration, examples, function in _PUSHING
    ]
    noise: list[Cell] = [0, "noise", "-", 0, *(runs[0]["noise"] for runs in values.values())]
    extra: list[Cell] = ["", "modes that are no row", "", "", *(c[-1] for c in counts.values())]
    heading = ["#", "configuration", "function", PRINTED, *_titles(values)]
    lines = [noise, *lines, extra]
    return Shown(f"Training examples of each mode\n\n{table(heading, lines)}", [heading, *lines])


def _pushing_counts(run: Mapping[str, Any]) -> dict[int, int]:
    target = next(t for t in run["report"]["targets"] if t["target"] == "truck.vx")
    examples = {mode["mode"]: mode["examples"] for mode in target["modes"]}
    found: dict[int, int] = {-1: 0}
    for mode, row in run["stated"].items():
        if row < 0 or row + 1 in found:
            found[-1] += 1
        else:
            found[row + 1] = examples[int(mode)]
    return found
