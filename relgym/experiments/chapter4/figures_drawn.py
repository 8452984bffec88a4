"""What is drawn rather than measured: worlds, configurations, cases of collision (figures 1.3, 3.1, 4.1, 4.8, 4.9)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from relgym.envs.ball_box_ramp import configurations
from relgym.experiments.analytic import contact_law
from relgym.experiments.chapter4.canvas import canvas, save
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.tables_modes import best_run
from relgym.experiments.data import THESIS_EXPERIMENTS, ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.seeds import TRAINING_SEEDS
from relgym.model.reports.text import Cell, table

__all__ = [
    "ball_modes_shown",
    "collisions_shown",
    "configurations_shown",
    "layouts_shown",
    "parameters_shown",
]


def _picture(panel: Any, episode: Episode, row: int, title: str, *, path: bool = False) -> None:
    from relgym.envs.rendering import render_scene, scene_view

    scene = episode.scene(row)
    view = scene_view(scene)
    size = (480, max(1, round(480 * view.height / view.width)))
    right, top = view.left + view.width, view.bottom + view.height
    panel.imshow(render_scene(scene, size=size, view=view), extent=(view.left, right, view.bottom, top))
    if path:
        places = episode.columns("ball", "px", "py")
        panel.scatter(*places.T, c=np.arange(len(places)), cmap="plasma", s=4, linewidths=0)
    panel.set(xlim=(view.left, right), ylim=(view.bottom, top), xticks=[], yticks=[])
    panel.set_title(title, fontsize=8)


# ------------------------------------------------------------------ figure 3.1
def layouts_shown(_: Protocol, __: Values) -> Shown:
    """The box pushing domain's four configurations."""
    episodes = {
        b.configuration["layout"]: b for b in truck_episodes(seed=TRAINING_SEEDS[0], repeats=1, order=None)
    }
    names = sorted(episodes)
    heading = ["configuration", "stacks, from the truck on"]
    truths = [episodes[name].truth for name in names]
    stacks = [truth.mode_names["truck.vx"][int(truth.mode["truck.vx"][0])] for truth in truths]
    lines: list[list[Cell]] = [[name, told] for name, told in zip(names, stacks, strict=True)]

    def draw(path: Path) -> None:
        figure, panels = canvas(3.2 * len(names), 2.6, 1, len(names))
        for panel, name in zip(panels[0], names, strict=True):
            _picture(panel, episodes[name], 0, f"configuration {name}")
        save(figure, path)

    return Shown(table(heading, lines), [heading, *lines], draw)


# ------------------------------------------------------------------ table and figure 4.1
_VALUES: Final = (
    ("ramp placement", "ramp", "left of box, right of box"),
    ("ramp and box touching", "touching", "yes, no"),
    ("ball position", "ball", "leftmost, above left object, between objects, above right object, rightmost"),
    ("ball's initial direction", "direction", "left, right"),
)
"""Table 4.1; the second column is the env's reset option."""


def parameters_shown(_: Protocol, __: Values) -> Shown:
    """Table 4.1 and the env's reset options."""
    every = configurations()
    heading = ["parameter", "printed", "values of the env"]
    lines: list[list[Cell]] = [
        [name, printed, ", ".join(dict.fromkeys(str(c[option]) for c in every))]
        for name, option, printed in _VALUES
    ]
    text = f"{table(heading, lines)}\n\n{len(every)} configurations (thesis: 40)"
    return Shown(text, [heading, *lines])


def configurations_shown(_: Protocol, __: Values) -> Shown:
    """Some initial configurations, with the paths that follow."""
    episodes = list(ball_episodes(THESIS_EXPERIMENTS[1], seed=TRAINING_SEEDS[0], episodes=40, order=None))[
        ::7
    ]
    heading = ["ramp", "touching", "ball", "direction"]
    lines: list[list[Cell]] = [[str(b.configuration[name]) for name in heading] for b in episodes]

    def draw(path: Path) -> None:
        figure, panels = canvas(12.0, 5.6, 2, 3)
        for panel, episode in zip(panels.flat, episodes, strict=True):
            c = episode.configuration
            near = "touching" if c["touching"] else "apart"
            title = f"ramp {c['ramp']}, {near}, ball {c['ball']}, {c['direction']}"
            _picture(panel, episode, 0, title, path=True)
        save(figure, path)

    return Shown(table(heading, lines), [heading, *lines], draw)


# ------------------------------------------------------------------ figure 1.3
_PUBLISHED: Final = (
    ("Flying", "¬intersect(A, *)", "vy' = vy - k1"),
    ("Bounce (flat)", "intersect(A, B) & vy > 1e-8", "vy' = -k2 vy"),
    ("Roll (flat)", "intersect(A, B) & vy <= 1e-8", "vy' = 0"),
    ("Roll (ramp)", "intersect(A, C)", "vy' = k3 vx + k4 vy + k5"),
)


def ball_modes_shown(_: Protocol, values: Values) -> Shown:
    """The modes of a ball's vertical velocity, sketched in the thesis and learned here."""
    run = best_run(values["world"])
    learned = next(t for t in run["report"]["targets"] if t["target"] == "ball.vy")
    heading = ["source", "mode", "relations", "function"]
    lines: list[list[Cell]] = [["printed", *row] for row in _PUBLISHED]
    clauses = {
        mode["mode"]: [p["rows"][0]["clause"] for p in learned["pairs"] if p["mode"] == mode["mode"]]
        for mode in learned["modes"]
    }
    for mode in learned["modes"]:
        said = " | ".join(dict.fromkeys(clauses[mode["mode"]])) or "else"
        lines.append(["learned", f"{mode['mode']}, {mode['examples']} examples", said, mode["function"]])

    def draw(path: Path) -> None:
        figure, panels = canvas(11.0, 4.0, 1, 2, width_ratios=(1, 1))
        *_, episode = ball_episodes(
            1, seed=TRAINING_SEEDS[0], episodes=8, order=None
        )  # the ball begins above an object
        _picture(panels[0][0], episode, 0, "path, coloured by time", path=True)
        panels[0][1].set_axis_off()
        said = (" | ".join(clauses[m["mode"]])[:80] or "else" for m in learned["modes"])
        text = "\n\n".join(
            f"{m['function']}\n    if {clause}" for m, clause in zip(learned["modes"], said, strict=True)
        )
        panels[0][1].text(0.0, 0.5, text, va="center", fontsize=11, family="monospace")
        save(figure, path)

    return Shown(table(heading, lines), [heading, *lines], draw)


# ------------------------------------------------------------------ figures 4.8 and 4.9
_LEVEL: Final = (("A", (0.6, -0.8)), ("B", (-0.6, -0.8)))
_UPRIGHT: Final = (("A", (0.8, -0.6)), ("B", (-0.8, 0.6)), ("C", (0.8, 0.6)), ("D", (-0.8, -0.6)))
"""Velocities before the collision. Upright: friction has the sign of vx in A and B (mode 4), not in C and D."""


def collisions_shown(_: Protocol, __: Values, *, level: bool) -> Shown:
    """How friction acts in a bounce, on a level or on an upright surface (experiment 2's coefficients)."""
    cases = _LEVEL if level else _UPRIGHT
    heading = ["case", "vx", "vy", "vx' - vx", "vy' - vy", "friction along the surface"]
    lines: list[list[Cell]] = []
    arrows = []
    for name, before in cases:
        normal = (0.0, 1.0) if level else (-float(np.sign(before[0])), 0.0)
        after, friction = _bounce(before, normal)
        arrows.append((name, before, after, friction, normal))
        change = [round(b - a, 3) for a, b in zip(before, after, strict=True)]
        lines.append([name, *before, *change, f"({friction[0]:+.2f}, {friction[1]:+.2f})"])
    return Shown(table(heading, lines), [heading, *lines], lambda path: _draw_collisions(path, arrows))


def _bounce(before: Sequence[float], normal: Sequence[float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Velocity after a bounce with elasticity 0.95 and friction 0.2, and the change that friction makes."""
    v, n = np.array(before), np.array(normal)
    sliding = float(np.array([-n[1], n[0]]) @ v)
    ends = []
    for slip in ("forward" if sliding > 0 else "backward", "none"):
        matrix, offset = contact_law(normal, 0.95, 0.2 if slip != "none" else 0.0, slip)
        ends.append(matrix @ v + offset)
    rub = ends[0] - ends[1]
    return tuple(map(float, ends[0])), tuple(map(float, rub))


def _draw_collisions(path: Path, arrows: Sequence[tuple[Any, ...]]) -> None:
    from matplotlib.patches import Circle

    figure, panels = canvas(3.0 * len(arrows), 3.2, 1, len(arrows))
    for panel, (name, before, after, friction, normal) in zip(panels[0], arrows, strict=True):
        level = normal[0] == 0.0
        panel.add_patch(Circle((0.0, 0.0), 0.25, color="#e67e22"))
        wall = -0.25 * np.array(normal)
        along = np.array([-normal[1], normal[0]])
        panel.plot(*np.stack([wall - 1.3 * along, wall + 1.3 * along]).T, color="#555555", lw=4)
        for vector, colour, tail, label in (
            (before, "black", -np.array(before), "v"),
            (after, "#4878a8", np.zeros(2), "v'"),
            (friction, "#c44e52", wall - 0.2 * np.array(normal), "friction"),
        ):
            tip = tail + np.array(vector)
            panel.annotate("", tip, tail, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.8})
            beside = np.array([-vector[1], vector[0]]) / float(np.hypot(*vector))
            side = -0.3 * np.array(normal) if label == "friction" else 0.15 * beside
            ha = "center" if label != "friction" or level else ("left" if normal[0] < 0 else "right")
            panel.text(*(0.5 * (tail + tip) + side), label, color=colour, fontsize=9, ha=ha, va="center")
        panel.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4), xticks=[], yticks=[], aspect="equal")
        panel.set_title(f"case {name}", fontsize=10)
    save(figure, path)
