"""Pictures of what a model learned: real and imagined trajectories side by side, and learning curves.

matplotlib and pygame belong to the extra ``viz``; both are imported when a picture is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError
from relgym.scene.objects import POSE, Float2D, Scene

__all__ = ["Trajectory", "draw_curves", "draw_trajectories", "require_matplotlib"]

_DOTS = 90
"""Dots per inch of all pictures."""

_COLOURS = ("#c44e52", "#4878a8", "#6aa879", "#8e6eb0")


@dataclass(frozen=True, slots=True)
class Trajectory:
    """One episode as it was, and as the model imagined it from its first scene alone.

    Attributes
    ----------
    title
        What is shown.
    scene
        The first scene.
    mover
        Name of the object whose path is drawn.
    real, imagined
        State vectors, shape ``(steps + 1, width)``.
    predicted
        How many steps the model predicted before it stopped.
    """

    title: str
    scene: Scene
    mover: str
    real: Float2D
    imagined: Float2D
    predicted: int

    def path(self, vectors: Float2D) -> Float2D:
        """The mover's position along the first axis and the up axis, shape ``(steps + 1, 2)``."""
        layout = self.scene.layout
        start, up = layout.slice(layout.index(self.mover)).start, "xyz".index(self.scene.schema.up)
        columns = layout.types[layout.index(self.mover)].pose_columns()
        return vectors[:, [start + columns[POSE.index("px")], start + columns[up]]]

    @property
    def error(self) -> NDArray[np.float64]:
        """Distance of the imagined mover from the real one at each step, in units, shape ``(steps + 1,)``."""
        off: NDArray[np.float64] = np.linalg.norm(self.path(self.real) - self.path(self.imagined), axis=1)
        return off


def require_matplotlib() -> None:
    """Raise `ConfigError`, which says what to install, if matplotlib is missing."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise ConfigError(
            "pictures need matplotlib and pygame-ce, which are not installed: pip install 'relgym[viz]'"
        ) from None


def draw_trajectories(path: Path, trajectories: Sequence[Trajectory]) -> Path:
    """Draw every trajectory in a row of its own: real, imagined, and the distance between the two.

    Parameters
    ----------
    path
        Where to write the picture (PNG).
    trajectories
        At least one.

    Raises
    ------
    ConfigError
        matplotlib or pygame isn't installed.
    """
    figure = _figure(12.0, 3.1 * len(trajectories))
    axes = figure.subplots(len(trajectories), 3, width_ratios=(3, 3, 2), squeeze=False)
    for row, shown in zip(axes, trajectories, strict=True):
        _draw_path(row[0], shown, shown.real, f"{shown.title}: real")
        steps = len(shown.real) - 1
        stop = "" if shown.predicted == steps else f", stops after {shown.predicted}"
        _draw_path(row[1], shown, shown.imagined, f"imagined from the first scene alone{stop}")
        _draw_error(row[2], shown)
    figure.suptitle(
        "Paths are coloured by time. On the right: how far the imagined one is off (dashed: 0.01)",
        fontsize=10,
    )
    figure.savefig(path, dpi=_DOTS)
    return path


def draw_curves(path: Path, curves: Mapping[str, Mapping[str, Sequence[float]]]) -> Path:
    """Draw learning curves, one panel per world.

    Parameters
    ----------
    path
        Where to write the picture (PNG).
    curves
        Per world and target: share of wrong predictions in each episode, made before learning from it.

    Raises
    ------
    ConfigError
        matplotlib isn't installed.
    """
    figure = _figure(12.0, 4.2)
    panels = figure.subplots(1, len(curves), squeeze=False)[0]
    for panel, (title, targets) in zip(panels, curves.items(), strict=True):
        for k, (target, shares) in enumerate(targets.items()):
            episodes, percent = np.arange(1, len(shares) + 1), 100.0 * np.array(shares)
            # Later curves are thinner: where two agree, both can be seen.
            style = {
                "color": _COLOURS[k % len(_COLOURS)],
                "lw": max(1.0, 3.5 - 2.3 * k),
                "ms": max(3, 9 - 5 * k),
            }
            panel.plot(episodes, percent, ".-", label=target, **style)
        panel.set_yscale("symlog", linthresh=1.0)
        panel.set_ylim(-0.08, 140.0)
        panel.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
        panel.set_title(title, fontsize=11)
        panel.set_xlabel("episode")
        panel.set_ylabel("wrong before learning from it, %")
        panel.grid(alpha=0.3)
        panel.legend(frameon=False)
    figure.savefig(path, dpi=_DOTS)
    return path


def _figure(width: float, height: float) -> Any:
    require_matplotlib()
    from matplotlib.figure import Figure

    # No pyplot: it would choose a window system and keep global state.
    return Figure(figsize=(width, height), layout="constrained")


def _draw_path(panel: Any, shown: Trajectory, vectors: Float2D, title: str) -> None:
    from relgym.envs.rendering import scene_view

    path, view = shown.path(vectors), scene_view(shown.scene)
    low, high = shown.path(shown.real).min(axis=0), shown.path(shown.real).max(axis=0)
    stays = view.left <= low[0] and high[0] <= view.left + view.width
    if stays:
        _draw_in_scene(panel, shown.scene, view, path)
    else:
        _draw_in_time(panel, path, low, high)
    panel.set_title(title, fontsize=10)


def _draw_in_scene(panel: Any, scene: Scene, view: Any, path: Float2D) -> None:
    """The scene, and over it the path, coloured by time."""
    from relgym.envs.rendering import render_scene

    height = 600
    picture = render_scene(scene, size=(max(1, round(height * view.width / view.height)), height), view=view)
    right, top = view.left + view.width, view.bottom + view.height
    panel.imshow(picture, extent=(view.left, right, view.bottom, top), interpolation="bilinear")
    panel.scatter(path[:, 0], path[:, 1], c=np.arange(len(path)), cmap="plasma", s=5, linewidths=0)
    panel.set(xlim=(view.left, right), ylim=(view.bottom, top), xticks=[], yticks=[])


def _draw_in_time(panel: Any, path: Float2D, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
    """Position by step, for what leaves the place where it began."""
    panel.scatter(np.arange(len(path)), path[:, 0], c=np.arange(len(path)), cmap="plasma", s=9, linewidths=0)
    pad = 0.05 * float(high[0] - low[0])
    panel.set(ylim=(low[0] - pad, high[0] + pad), xlabel="step", ylabel="px")
    panel.grid(alpha=0.3)


def _draw_error(panel: Any, shown: Trajectory) -> None:
    error = shown.error[: shown.predicted + 1]
    panel.semilogy(np.arange(len(error)), np.maximum(error, 1e-17), color=_COLOURS[1], lw=1.2)
    panel.axhline(1e-2, color=_COLOURS[0], lw=0.8, ls="--")
    panel.set_ylim(1e-17, 1e1)
    panel.set_title(f"distance, at most {error.max():.0e}", fontsize=10)
    panel.set_xlabel("step")
    panel.grid(alpha=0.3)
