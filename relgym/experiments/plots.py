"""Pictures of what a model learned: imagined trajectories drawn over the real ones, and learning curves.

matplotlib and pygame belong to the extra ``viz``; both are imported when a picture is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, cycle
from pathlib import Path
from textwrap import fill
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.envs.rendering import View, render_scene, scene_view
from relgym.envs.tasks import Region
from relgym.errors import ConfigError
from relgym.experiments.rollouts import STRAY
from relgym.scene.objects import POSE, Float2D, Scene

__all__ = ["Curve", "Imagined", "Trajectory", "draw_curves", "draw_trajectories", "require_matplotlib"]

_DOTS: Final = 90
"""Dots per inch of all pictures."""

_COLOURS: Final = ("#1f4e79", "#c44e52", "#6aa879", "#8e6eb0")
_TIME: Final = "plasma"
_ASPECT: Final = 2.15
"""Width of a panel with a scene in it over its height."""

_PIXELS: Final = 520
"""Height of a rendered scene."""

_LINE: Final = 44
"""Characters in a line of a legend, which a panel is wide enough for."""

_SNAPSHOTS: Final = 5
"""Scenes that are drawn of what leaves the place where it began."""

_FAR: Final = 5.0
"""One picture shows a whole episode that needs a view at most so many times as wide as its first scene's."""

_Styles: TypeAlias = Mapping[str, Mapping[str, Any]]
"""Style of lines by model."""


@dataclass(frozen=True, slots=True)
class Imagined:
    """A roll-out of one model from an episode's first scene alone.

    Attributes
    ----------
    by
        Which model, for people.
    vectors
        State vectors, shape ``(steps + 1, width)``.
    predicted
        How many steps the model predicted before it stopped.
    """

    by: str
    vectors: Float2D
    predicted: int


@dataclass(frozen=True, slots=True)
class Trajectory:
    """One episode as it was, and as models imagined it from its first scene alone.

    Attributes
    ----------
    title
        What is shown.
    scene
        The first scene.
    mover
        Name of the object whose path is drawn.
    real
        State vectors, shape ``(steps + 1, width)``.
    imagined
        What models make of the first scene.
    marks
        Regions to mark, such as a goal.
    events
        Steps to mark on the path, each with a word about it.
    """

    title: str
    scene: Scene
    mover: str
    real: Float2D
    imagined: tuple[Imagined, ...]
    marks: tuple[Region, ...] = ()
    events: tuple[tuple[int, str], ...] = ()

    def path(self, vectors: Float2D) -> Float2D:
        """The mover's position along the first axis and the up axis, shape ``(steps + 1, 2)``."""
        layout = self.scene.layout
        start, up = layout.slice(layout.index(self.mover)).start, "xyz".index(self.scene.schema.up)
        columns = layout.types[layout.index(self.mover)].pose_columns()
        return vectors[:, [start + columns[POSE.index("px")], start + columns[up]]]

    def error(self, imagined: Imagined) -> NDArray[np.float64]:
        """Distance of an imagined mover from the real one at each predicted step, in units, shape ``(n + 1,)``."""
        off: NDArray[np.float64] = np.linalg.norm(self.path(self.real) - self.path(imagined.vectors), axis=1)
        return off[: imagined.predicted + 1]

    def scene_at(self, vectors: Float2D, step: int) -> Scene:
        """The scene at a step."""
        return Scene(self.scene.schema, self.scene.layout, vectors[step])


@dataclass(frozen=True, slots=True)
class Curve:
    """How one target was learned.

    Attributes
    ----------
    target
        Such as ``ball.vx``.
    steps
        Steps seen by the end of each episode, shape ``(n,)``.
    wrong
        Share of the episode's predictions that were wrong, each made before learning from its outcome, shape ``(n,)``.
    """

    target: str
    steps: Sequence[int]
    wrong: Sequence[float]


def require_matplotlib() -> None:
    """Raise `ConfigError`, which says what to install, if matplotlib is missing."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise ConfigError(
            "pictures need matplotlib and pygame-ce, which are not installed: pip install 'relgym[viz]'"
        ) from None


def draw_trajectories(path: Path, trajectories: Sequence[Trajectory]) -> Path:
    """Draw every trajectory in a row of its own: what was imagined over what happened, and how far apart they are.

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
    figure = _figure(12.0, 0.7 + 3.35 * len(trajectories))
    styles = _styles(trajectories)
    rows = figure.add_gridspec(len(trajectories), 2, width_ratios=(2, 1))
    for k, shown in enumerate(trajectories):
        _draw_episode(figure, rows[k, 0], shown, styles)
        _draw_errors(figure.add_subplot(rows[k, 1]), shown, styles)
    _draw_key(figure, styles)
    figure.savefig(path, dpi=_DOTS)
    return path


def draw_curves(path: Path, curves: Mapping[str, Sequence[Curve]]) -> Path:
    """Draw learning curves, one panel per model.

    Parameters
    ----------
    path
        Where to write the picture (PNG).
    curves
        By title, a curve per target.

    Raises
    ------
    ConfigError
        matplotlib isn't installed.
    """
    figure = _figure(12.0, 4.2)
    panels = figure.subplots(1, len(curves), squeeze=False, sharey=True)[0]
    for panel, (title, targets) in zip(panels, curves.items(), strict=True):
        for k, curve in enumerate(targets):
            # Later curves are thinner: where two agree, both can be seen.
            style = {"lw": max(1.0, 3.5 - 2.3 * k), "ms": max(3, 9 - 5 * k)}
            panel.plot(
                curve.steps,
                100.0 * np.array(curve.wrong),
                ".-",
                label=curve.target,
                color=_COLOURS[k % len(_COLOURS)],
                **style,
            )
        panel.set_yscale("symlog", linthresh=1.0)
        panel.set_ylim(-0.08, 140.0)
        panel.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
        panel.set_yticks([*range(2, 10), *range(20, 100, 10)], minor=True)
        panel.set_title(title, fontsize=10)
        panel.set_xlabel("steps seen")
        panel.set_xlim(left=0)
        panel.locator_params(axis="x", nbins=5)
        panel.xaxis.set_major_formatter("{x:,.0f}")
        panel.axhspan(-0.08, 1.0, color="0.94", zorder=0)
        panel.grid(alpha=0.3)
        panel.legend(frameon=False)
    panels[0].set_ylabel("wrong predictions, % of an episode's\n(log scale; grey, below 1 %: linear)")
    figure.savefig(path, dpi=_DOTS)
    return path


def _figure(width: float, height: float) -> Any:
    require_matplotlib()
    from matplotlib.figure import Figure

    # No pyplot: it would choose a window system and keep global state.
    return Figure(figsize=(width, height), layout="constrained")


def _draw_key(figure: Any, styles: _Styles) -> None:
    """What the lines mean, once for all rows."""
    from matplotlib.lines import Line2D

    purple, orange = "#6a00a8", "#fca636"  # of the colours of time
    handles = [
        (Line2D([], [], color=purple, lw=5), Line2D([], [], color=orange, lw=5)),
        *(Line2D([], [], **style) for style in styles.values()),
    ]
    from matplotlib.legend_handler import HandlerTuple

    names = ["what really happened", *(f"imagined from the first scene alone, {name}" for name in styles)]
    figure.legend(
        handles,
        names,
        loc="outside upper center",
        ncols=len(names),
        frameon=False,
        fontsize=9,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.0)},
        handlelength=3.0,
    )


def _styles(trajectories: Sequence[Trajectory]) -> _Styles:
    """Style of each model's lines."""
    models = dict.fromkeys(dream.by for shown in trajectories for dream in shown.imagined)
    first = {"color": "black", "lw": 1.1, "ls": "-"}
    others = ({"color": colour, "lw": 1.6, "ls": ":"} for colour in cycle(_COLOURS[1:]))
    return dict(zip(models, chain([first], others), strict=False))


# ------------------------------------------------------------------ an episode
def _draw_episode(figure: Any, slot: Any, shown: Trajectory, styles: _Styles) -> None:
    first, whole = scene_view(shown.scene), _whole(shown)
    if whole.width <= _FAR * first.width:
        panel = figure.add_subplot(slot)
        _draw_in_scene(panel, shown, _around(shown, whole), styles)
    else:
        strip = slot.subgridspec(2, _SNAPSHOTS, height_ratios=(5, 4))
        _draw_snapshots([figure.add_subplot(strip[0, k]) for k in range(_SNAPSHOTS)], shown)
        panel = figure.add_subplot(strip[1, :])
        _draw_in_time(panel, shown, styles)
    bar = figure.colorbar(_time(len(shown.real) - 1), ax=panel, pad=0.01, aspect=18)
    bar.set_label("step", fontsize=9)


def _draw_in_scene(panel: Any, shown: Trajectory, view: View, styles: _Styles) -> None:
    """The first scene, the last one shining through, and over them the paths."""
    size = (max(1, round(_PIXELS * view.width / view.height)), _PIXELS)
    first, last = (
        render_scene(shown.scene_at(shown.real, k), size=size, view=view, marks=shown.marks) for k in (0, -1)
    )
    moved = (first != last).any(axis=2, keepdims=True)
    picture = np.where(moved, 0.7 * first + 0.3 * last, first).astype(np.uint8)
    right, top = view.left + view.width, view.bottom + view.height
    panel.imshow(picture, extent=(view.left, right, view.bottom, top), interpolation="bilinear")
    real = shown.path(shown.real)
    _draw_real(panel, real)
    for k, dream in reversed(list(enumerate(shown.imagined))):
        # Where a model other than the first agrees with what happened, its line would only hide the others.
        error = shown.error(dream)
        astray = np.flatnonzero(error > STRAY)
        start = 0 if k == 0 else max(0, int(astray[0]) - 1) if len(astray) else len(error)
        panel.plot(*shown.path(dream.vectors)[start : dream.predicted + 1].T, zorder=4, **styles[dream.by])
    panel.plot(*real[0], "o", ms=9, mfc="white", mec="black", mew=1.6, zorder=6)
    _say(panel, real[0], "start", view)
    for step, word in shown.events:
        panel.plot(*real[step], "o", ms=17, mfc="none", mec="#c44e52", mew=2.2, zorder=6)
        _say(panel, real[step], word, view)
    panel.set_title(shown.title, fontsize=10)
    panel.set(xlim=(view.left, right), ylim=(view.bottom, top), xticks=[], yticks=[])


def _draw_real(panel: Any, real: Float2D) -> None:
    """A broad line, coloured by time."""
    from matplotlib.collections import LineCollection

    pieces = np.stack([real[:-1], real[1:]], axis=1)
    line = LineCollection(list(pieces), cmap=_TIME, linewidths=5, capstyle="round", zorder=3)
    line.set_array(np.arange(len(pieces)))
    panel.add_collection(line)


def _say(panel: Any, point: NDArray[np.float64], word: str, view: View) -> None:
    """A word beside a point, on the side where there is room."""
    left = point[0] > view.left + 0.6 * view.width
    panel.annotate(
        word,
        point,
        xytext=(-13 if left else 13, 13),
        textcoords="offset points",
        ha="right" if left else "left",
        fontsize=10,
        bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.75},
        zorder=7,
    )


def _draw_snapshots(panels: Sequence[Any], shown: Trajectory) -> None:
    """Scenes from the start to the end: the imagined ones over the real ones, each framed in the colour of its step."""
    steps = np.linspace(0, len(shown.real) - 1, len(panels)).round().astype(int).tolist()
    colours = _time(len(shown.real) - 1)
    for panel, step in zip(panels, steps, strict=True):
        real = shown.scene_at(shown.real, step)
        views = scene_view(real, margin=0.08)
        size = (round(_PIXELS * views.width / views.height), _PIXELS)
        pictures = [render_scene(real, size=size, view=views, marks=shown.marks)]
        pictures += [
            render_scene(shown.scene_at(dream.vectors, step), size=size, view=views, marks=shown.marks)
            for dream in shown.imagined
        ]
        panel.imshow(np.mean(pictures, axis=0).astype(np.uint8), interpolation="bilinear")
        panel.set(xticks=[], yticks=[])
        panel.set_xlabel(f"step {step}", fontsize=9)
        for side in panel.spines.values():
            side.set(color=colours.to_rgba(step), linewidth=3)
    panels[len(panels) // 2].set_title(shown.title, fontsize=10)


def _draw_in_time(panel: Any, shown: Trajectory, styles: _Styles) -> None:
    """Position by step, for what leaves the place where it began."""

    def over_time(vectors: Float2D) -> Float2D:
        return np.column_stack([np.arange(len(vectors)), shown.path(vectors)[:, 0]])

    _draw_real(panel, over_time(shown.real))
    for dream in shown.imagined[::-1]:
        panel.plot(*over_time(dream.vectors)[: dream.predicted + 1].T, zorder=4, **styles[dream.by])
    panel.plot(*over_time(shown.real)[0], "o", ms=9, mfc="white", mec="black", mew=1.6, zorder=6)
    panel.set(xlabel="step", ylabel=f"{shown.mover}.px")
    panel.autoscale_view()
    panel.yaxis.set_major_formatter("{x:,.0f}")
    panel.grid(alpha=0.3)


def _draw_errors(panel: Any, shown: Trajectory, styles: _Styles) -> None:
    for dream in shown.imagined[::-1]:
        error = shown.error(dream)
        stop = "" if dream.predicted == len(shown.real) - 1 else f", stops after {dream.predicted}"
        label = f"{dream.by}: at most {error.max():.0e}{stop}"
        panel.semilogy(
            np.arange(len(error)),
            np.maximum(error, 1e-17),
            label=fill(label, _LINE),
            **(dict(styles[dream.by]) | {"ls": "-"}),
        )
    panel.axhline(STRAY, color="0.5", lw=0.8, ls="--")
    panel.set_ylim(1e-17, 1e6)  # with room for the legend
    panel.set_yticks([1e-16, 1e-12, 1e-8, 1e-4, 1e0])
    panel.set_title("distance between real and imagined (log scale)", fontsize=10)
    panel.set_xlabel("step")
    panel.grid(alpha=0.3)
    panel.legend(frameon=False, fontsize=9, loc="upper left")


def _time(steps: int) -> Any:
    """Colours of steps."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(0, steps), _TIME)


# ------------------------------------------------------------------ what to show
def _whole(shown: Trajectory) -> View:
    """A view that shows the first and the last scene, all marks, and the way between."""
    views = [
        scene_view(shown.scene),
        scene_view(shown.scene_at(shown.real, -1)),
        _box(shown.path(shown.real)),
    ]
    return _union([*views, *shown.marks])


def _around(shown: Trajectory, whole: View) -> View:
    """The part of the whole in which things happen: all paths, marks and whatever moved, with room around them."""
    paths = [shown.path(shown.real), *(shown.path(d.vectors)[: d.predicted + 1] for d in shown.imagined)]
    first, last = (shown.scene_at(shown.real, k) for k in (0, -1))
    moved = [o.name for o in first if o.name in last and (o.values != last[o.name].values).any()]
    bodies = [scene_view(scene, moved, margin=0.0) for scene in (first, last)]
    part = _union([_box(np.concatenate(paths)), *bodies, *shown.marks])
    low, high = (
        np.array([part.left, part.bottom]),
        np.array([part.left + part.width, part.bottom + part.height]),
    )
    pad = 0.1 * max(whole.width, whole.height)
    low, high = low - pad, high + pad
    height = max(float(high[1] - low[1]), float(high[0] - low[0]) / _ASPECT)
    width = height * _ASPECT
    left, bottom = (low + high - [width, height]) / 2.0
    # Nothing is beyond the whole: where the part would reach over an edge, it is moved inside.
    left = _within(float(left), width, whole.left, whole.width)
    bottom = _within(float(bottom), height, whole.bottom, whole.height)
    return View(left, bottom, width, height)


def _within(start: float, length: float, first: float, whole: float) -> float:
    """Where a stretch begins if it is to lie within another; centred on it if it is longer."""
    if length >= whole:
        return first + (whole - length) / 2.0
    return min(max(start, first), first + whole - length)


def _box(points: Float2D) -> View:
    """The smallest view of some points."""
    low, high = points.min(axis=0), points.max(axis=0)
    return View(float(low[0]), float(low[1]), float(high[0] - low[0]), float(high[1] - low[1]))


def _union(parts: Sequence[View | Region]) -> View:
    """The smallest view that shows all of these."""
    left, bottom = min(p.left for p in parts), min(p.bottom for p in parts)
    right, top = max(p.left + p.width for p in parts), max(p.bottom + p.height for p in parts)
    return View(left, bottom, right - left, top - bottom)
