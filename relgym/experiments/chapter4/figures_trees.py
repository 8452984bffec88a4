"""Decision trees behind clauses (figures 4.2, 4.10 and 4.11), drawn."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from relgym.experiments.chapter4.canvas import TITLES, canvas, save
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.published import MODES
from relgym.experiments.chapter4.tables_modes import best_run, row_of
from relgym.model.reports.text import Cell
from relgym.numeric.tree import DecisionTree

__all__ = ["trees_shown"]

_FIGURES: Final[Mapping[str, tuple[str, str, int, int]]] = {
    "4.2": ("4.2", "y", 1, 4),
    "4.10": ("4.9", "x", 1, 2),
    "4.11": ("4.9", "y", 4, 5),
}
"""Per figure: table of its modes, axis, and the two modes."""


def trees_shown(_: Protocol, values: Values, number: str) -> Shown:
    """The trees by which each learner tells the figure's two modes apart."""
    modes, axis, first, second = _FIGURES[number]
    target, published = f"ball.v{axis}", MODES[modes, axis]
    trees: dict[str, dict[str, Any]] = {}
    texts: list[str] = []
    data: list[list[Cell]] = [["learner", "stage", "test", "answer"]]
    for learner, runs in values.items():
        run = best_run(runs)
        rows = {mode["id"]: row_of(mode, published) for mode in run["modes"].get(target, ())}
        found = [
            t
            for t in run["trees"]
            if t["target"] == target and {rows.get(t["mode"]), rows.get(t["other"])} == {first, second}
        ]
        if not found:
            texts.append(f"{TITLES[learner]}: {_without(rows, first, second)}")
            continue
        chosen = max(found, key=lambda t: sum(t["tree"]["positive"][:1]) + sum(t["tree"]["negative"][:1]))
        trees[learner] = chosen | {"yes": rows[chosen["mode"]], "no": rows[chosen["other"]]}
        tree = DecisionTree.from_dict(chosen["tree"])
        texts.append(
            f'{TITLES[learner]}, behind "{chosen["stage"]}"; yes: mode {trees[learner]["yes"]}\n{tree}'
        )
        data += [[learner, chosen["stage"], *rule.split(" -> ")] for rule in tree.rules()]
    note = f"Modes {first} and {second} of Table {modes}, {axis} velocity."
    text = "\n\n".join([note, *texts])
    if not trees:  # an empty picture would say less than the text does
        return Shown(text, data)
    return Shown(text, data, lambda path: _draw(path, trees))


def _without(rows: Mapping[int, int], first: int, second: int) -> str:
    if not rows:
        return "laws of contacts, no modes"
    if {first, second} <= set(rows.values()):
        return "tells the two modes apart without a tree"
    return "has not learned both modes"


def _draw(path: Path, trees: Mapping[str, Mapping[str, Any]]) -> None:
    sizes = [_size(DecisionTree.from_dict(about["tree"])) for about in trees.values()]
    width, depth = (max(each) for each in zip(*sizes, strict=True))
    figure, panels = canvas((1.0 + 1.2 * width) * len(sizes), 0.8 + 0.9 * depth, 1, len(sizes))
    for panel in panels[0]:
        panel.set_axis_off()
    for panel, (learner, about) in zip(panels[0], trees.items(), strict=False):
        tree = DecisionTree.from_dict(about["tree"])
        names = {True: f"mode {about['yes']}", False: f"mode {about['no']}"}
        places = _places(tree)
        for node, (x, y) in places.items():
            _node(panel, tree, node, (x, y), places, names)
        panel.set_title(TITLES.get(learner, learner), fontsize=10)
        width = max(x for x, _ in places.values())
        panel.set(xlim=(-0.6, width + 0.6), ylim=(min(y for _, y in places.values()) - 0.5, 0.5))
    save(figure, path)


def _size(tree: DecisionTree) -> tuple[float, float]:
    """Leaves side by side, and tests from root to leaf."""
    places = _places(tree).values()
    return max(x for x, _ in places) + 1.0, -min(y for _, y in places)


def _places(tree: DecisionTree) -> dict[int, tuple[float, float]]:
    """Leaves side by side, every other node above the middle of what lies below it."""
    places: dict[int, tuple[float, float]] = {}

    def put(node: int, depth: int) -> float:
        if tree.column[node] < 0:
            x = float(sum(1 for n in places if tree.column[n] < 0))
        else:
            x = 0.5 * (put(tree.below[node], depth + 1) + put(tree.above[node], depth + 1))
        places[node] = (x, -float(depth))
        return x

    put(0, 0)
    return places


def _node(
    panel: Any,
    tree: DecisionTree,
    node: int,
    at: tuple[float, float],
    places: Mapping[int, tuple[float, float]],
    names: Mapping[bool, str],
) -> None:
    if tree.column[node] < 0:
        right, wrong = tree.negative[node], tree.positive[node]
        if tree.says_yes(node):
            right, wrong = wrong, right
        text = f"{names[tree.says_yes(node)]}\n{right:,.0f} of {right + wrong:,.0f}"
        style = {"boxstyle": "round", "facecolor": "#dde8f3"}
    else:
        text = f"{tree.columns[tree.column[node]]} <= {tree.threshold[node]:.3g}"
        style = {"boxstyle": "square", "facecolor": "white"}
        for child, word in ((tree.below[node], "yes"), (tree.above[node], "no")):
            (x, y), (u, v) = at, places[child]
            panel.plot([x, u], [y, v], color="black", lw=0.7, zorder=0)
            panel.text(0.5 * (x + u), 0.5 * (y + v), word, fontsize=7, ha="center", backgroundcolor="white")
    panel.text(*at, text, ha="center", va="center", fontsize=7, bbox=style)
