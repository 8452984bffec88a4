"""Roll-outs: errors over time (figures 4.22 and 4.23), and failures step by step (figures 4.24-4.26)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.chapter4.canvas import FLOOR, TITLES, canvas, save
from relgym.experiments.chapter4.job import Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.rolled import trial_episodes
from relgym.experiments.seeds import TEST_SEEDS
from relgym.model.reports.text import Cell, table
from relgym.scene.objects import Scene

__all__ = ["failure_shown", "rollout_errors_shown"]

_SHOWN: Final = (0, 50, 100, 150, 200)


def rollout_errors_shown(_: Protocol, values: Values, axis: int) -> Shown:
    """Position error along one axis over time, a line per trial."""
    name = "xy"[axis]
    heading = ["learner", "step", "median", "p90", "largest", "failed so far"]
    lines: list[list[Cell]] = []
    for learner, runs in values.items():
        errors = _errors(runs[0]["trials"], axis)
        for step in _SHOWN:
            at = errors[:, : step + 1].max(axis=1)
            quantiles = [f"{np.quantile(at, q, method='lower'):.1e}" for q in (0.5, 0.9, 1.0)]
            lines.append([TITLES[learner], step, *quantiles, int((at > 1e-2).sum())])

    def draw(path: Path) -> None:
        figure, panels = canvas(4.6 * len(values), 3.8, 1, len(values), sharey=True)
        for panel, (learner, runs) in zip(panels[0], values.items(), strict=True):
            for trial, errors in zip(runs[0]["trials"], _errors(runs[0]["trials"], axis), strict=True):
                colour = "#c44e52" if trial["corner"] else "#4878a8"
                panel.semilogy(np.clip(errors, FLOOR, 1e2), color=colour, lw=0.6, alpha=0.7)
            failed = sum(trial["failed"] for trial in runs[0]["trials"])
            title = f"{TITLES[learner]}: {failed} of {len(runs[0]['trials'])} fail"
            panel.set(title=title, xlabel="time step", ylim=(FLOOR, 1e2))
            panel.grid(alpha=0.3)
        panels[0][0].set_ylabel(f"error of the ball's {name} position (red: a corner is hit)", fontsize=8)
        save(figure, path)

    return Shown(table(heading, lines), [heading, *lines], draw)


def _errors(trials: Sequence[Mapping[str, Any]], axis: int) -> Any:
    """Errors, shape ``(trials, steps + 1)``; infinite after a roll-out has stopped."""
    return np.array([[np.inf if v is None else v for v in trial["errors"][axis]] for trial in trials])


def failure_shown(_: Protocol, values: Values, causes: Sequence[str], severe: bool | None = None) -> Shown:
    """One failed roll-out, step by step: what happened (black) and what was imagined (grey).

    Parameters
    ----------
    values
        Roll-outs by learner.
    causes
        Of what it failed.
    severe
        The trial with the greatest (true) or the least (false) final error; none: the one that fails first.
    """
    found = _example(values, causes, severe)
    if found is None:
        return Shown(f"No roll-out of any learner failed of: {', '.join(causes)}.", [["learner", "trial"]])
    learner, number = found
    trial = values[learner][0]["trials"][number]
    error = float(np.hypot(*(np.subtract(trial["real"][-1], trial["imagined"][-1]))))
    text = (
        f"Learner {TITLES[learner]}, trial {number}: {trial['cause']}, wrong from step {trial['begins']} on, "
        f"final distance {error:.2g}."
    )
    rows: list[list[Cell]] = [["step", "x", "y", "x imagined", "y imagined"]]
    rows += [
        [k, *real, *imagined]
        for k, (real, imagined) in enumerate(zip(trial["real"], trial["imagined"], strict=True))
    ]
    return Shown(text, rows, lambda path: _draw_failure(path, trial, number, text))


def _example(values: Values, causes: Sequence[str], severe: bool | None) -> tuple[str, int] | None:
    for learner, runs in values.items():
        trials = runs[0]["trials"]
        numbers = [k for k, t in enumerate(trials) if t["cause"] in causes and not t["stopped"]]
        if numbers:
            if severe is None:
                return learner, min(numbers, key=lambda k: int(trials[k]["begins"]))
            by_error = sorted(numbers, key=lambda k: _distance(trials[k]))
            return learner, by_error[-1 if severe else 0]
    return None


def _distance(trial: Mapping[str, Any]) -> float:
    return float(np.hypot(*np.subtract(trial["real"][-1], trial["imagined"][-1])))


def _draw_failure(path: Path, trial: Mapping[str, Any], number: int, text: str) -> None:
    from relgym.envs.rendering import render_scene, scene_view

    episode = trial_episodes(1, TEST_SEEDS[:2], number + 1)[number]
    begins, last = trial["begins"], len(trial["real"]) - 1
    steps = sorted({max(0, begins - 8), begins, min(last, begins + 6), (begins + last) // 2, last})
    figure, panels = canvas(3.4 * len(steps), 2.9, 1, len(steps))
    radius = 0.5 * float(episode.columns("ball", "sx")[0, 0])
    for panel, step in zip(panels[0], steps, strict=True):
        scene = Scene(episode.schema, episode.layout, episode.vectors[step].copy())
        view = scene_view(scene)
        picture = render_scene(scene, size=(800, max(1, round(800 * view.height / view.width))), view=view)
        right, top = view.left + view.width, view.bottom + view.height
        panel.imshow(picture, extent=(view.left, right, view.bottom, top), alpha=0.55)
        recent = [np.array(trial[which])[max(0, step - 20) : step + 1] for which in ("imagined", "real")]
        for points, colour in zip(recent, ("#8c8c8c", "black"), strict=True):
            panel.plot(*points.T, color=colour, lw=0.8)
            _circle(panel, points[-1], radius, colour)
        panel.set(xticks=[], yticks=[], **_near(recent, radius))
        panel.set_title(f"step {step}", fontsize=9)
    figure.suptitle(text, fontsize=9)
    save(figure, path)


def _near(recent: Sequence[NDArray[np.float64]], radius: float) -> dict[str, tuple[float, float]]:
    """Limits of a square that shows the balls and where they came from, in units."""
    points = np.concatenate(recent)
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * (low + high)
    half = max(0.5 * float((high - low).max()) + 2.0 * radius, 5.0 * radius)
    (x, y) = ((float(m - half), float(m + half)) for m in middle)
    return {"xlim": x, "ylim": y}


def _circle(panel: Any, at: Sequence[float], radius: float, colour: str) -> None:
    from matplotlib.patches import Circle

    panel.add_patch(Circle((at[0], at[1]), radius, fill=False, color=colour, lw=1.4))
