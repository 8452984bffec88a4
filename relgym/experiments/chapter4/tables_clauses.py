"""Tables of clauses (3.2, 4.3-4.6, 4.10-4.14) and of roles (Figure 3.8), ours beside the thesis'."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from relgym.experiments.chapter4.canvas import PRINTED, TITLES, text_figure
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.published import MODES, published_pairs, rows_of_pair
from relgym.experiments.chapter4.tables_modes import best_run, row_of
from relgym.model.reports.text import Cell, table

__all__ = ["clauses_shown", "pushing_clauses_shown", "roles_shown"]

_HEADING: Final = ["clause", "correct", "incorrect", "tree"]

_TARGETS: Final[Mapping[str, tuple[str, str, str]]] = {
    "4.3": ("4.2", "x", "ball.vx"),
    "4.4": ("4.2", "x", "ball.vx"),
    "4.5": ("4.2", "y", "ball.vy"),
    "4.6": ("4.2", "y", "ball.vy"),
    "4.10": ("4.9", "x", "ball.vx"),
    "4.11": ("4.9", "x", "ball.vx"),
    "4.12": ("4.9", "y", "ball.vy"),
    "4.13": ("4.9", "y", "ball.vy"),
    "4.14": ("4.9", "y", "ball.vy"),
}
"""Per table: where its modes are listed, and of which target they are."""


def clauses_shown(_: Protocol, values: Values, number: str) -> Shown:
    """Each section of a table of clauses, and the same pair of modes as our learners tell it."""
    modes, axis, target = _TARGETS[number]
    published = MODES[modes, axis]
    named = {
        learner: _by_row(best_run(runs), target, published)
        for learner, runs in values.items()
        if target in best_run(runs)["modes"]
    }
    return _pairs_shown(number, named)


def pushing_clauses_shown(_: Protocol, values: Values) -> Shown:
    """Table 3.2."""
    named = {}
    for learner, runs in values.items():
        rows = {int(mode): row + 1 for mode, row in runs[0]["stated"].items()}
        named[learner] = _renamed(runs[0], "truck.vx", rows)
    return _pairs_shown("3.2", named)


_Pairs = Mapping[frozenset[int], Mapping[str, Any]]


def _by_row(run: Mapping[str, Any], target: str, published: Sequence[Any]) -> _Pairs:
    return _renamed(run, target, {mode["id"]: row_of(mode, published) for mode in run["modes"][target]})


def _renamed(run: Mapping[str, Any], target: str, rows: Mapping[int, int]) -> _Pairs:
    """Learned pairs by the published numbers of their modes."""
    found = next(t for t in run["report"]["targets"] if t["target"] == target)
    pairs = {}
    for pair in found["pairs"]:
        mode, other = rows.get(pair["mode"], 0), rows.get(pair["other"], 0)
        if mode and other:
            pairs[frozenset((mode, other))] = pair | {"mode": mode, "other": other}
    return pairs


def _pairs_shown(number: str, named: Mapping[str, _Pairs]) -> Shown:
    texts: list[str] = []
    data: list[list[Cell]] = [["learner", "mode", "other", *_HEADING]]
    for section in published_pairs(number):
        lines: list[list[Cell]] = [
            [c.clause, c.correct, c.incorrect, "yes" if c.tree else "no"] for c in section.clauses
        ]
        parts = [
            (
                f"{PRINTED}: mode {section.mode} vs. {section.other} (train perf. {section.performance:.4f})",
                lines,
            )
        ]
        data += [[PRINTED, section.mode, section.other, *line] for line in lines]
        for learner, pairs in named.items():
            pair = pairs.get(rows_of_pair(number, section))
            if pair is None:
                parts.append((f"{TITLES[learner]}: has not both modes", []))
                continue
            own = [_line(row) for row in pair["rows"]]
            right, wrong = sum(r["correct"] for r in pair["rows"]), sum(r["incorrect"] for r in pair["rows"])
            share = right / max(right + wrong, 1)
            parts.append(
                (f"{TITLES[learner]}: mode {pair['mode']} rather than {pair['other']} ({share:.4f})", own)
            )
            data += [[learner, pair["mode"], pair["other"], *line] for line in own]
        texts.append(_section(parts))
    note = (
        "Modes of ours are numbered as in the thesis' table of modes. The default learner needs no clauses where laws "
        "of contacts govern."
    )
    return Shown("\n\n".join([*texts, note]), data)


def _section(parts: Sequence[tuple[str, list[list[Cell]]]]) -> str:
    rows: list[list[Cell] | str] = []
    for head, lines in parts:
        rows.append(head)
        rows += [[f"  {line[0]}", *line[1:]] for line in lines]
    return table(_HEADING, rows)


def _line(row: Mapping[str, Any]) -> list[Cell]:
    return [row["clause"], round(row["correct"]), round(row["incorrect"]), "yes" if row["tests"] else "no"]


# ------------------------------------------------------------------ roles
_ROLES: Final = (
    (1, "a", "y-aligned(A, B)"),
    (2, "a", "on-top(C, B)"),
    (2, "b", "¬on-top(*, B) ∧ y-aligned(A, B)"),
    (3, "a, b, c", "(any box)"),
)
"""Figure 3.8, as its text describes it (§3.5.1); A is the truck, B the box in question."""


def roles_shown(_: Protocol, values: Values) -> Shown:
    """Figure 3.8; its boxes as rows."""
    rows: list[list[Cell]] = [["learner", "mode", "role", "bound to"]]
    rows += [[PRINTED, *row] for row in _ROLES]
    for learner, runs in values.items():
        target = next(t for t in runs[0]["report"]["targets"] if t["target"] == "truck.vx")
        for role in target["roles"]:
            mode = runs[0]["stated"][str(role["mode"])] + 1
            rule = role["rule"] or f"(any {role['type']})"
            rows.append([TITLES[learner], mode, ", ".join(role["roles"]), rule])
    heading, *lines = rows
    text = table([str(h) for h in heading], lines)
    return Shown(text, rows, lambda path: text_figure(path, text))
