"""Draws any scene, real or dreamed, as seen from the side: along the depth axis."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing
from relgym.config.checks import checked_count
from relgym.envs.tasks import Region
from relgym.errors import ConfigError
from relgym.scene.axes import Axes
from relgym.scene.geometry.vectors import rotation
from relgym.scene.hull import outline_of
from relgym.scene.objects import POSE, Float1D, Float2D, Scene, SceneObject
from relgym.scene.shapes import ConvexPolyhedron, Sphere, outline, outlines

__all__ = ["Camera", "SceneViewer", "View", "render_scene", "scene_view"]

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]

_BACKGROUND: Colour = (250, 250, 247)
_GRID: Colour = (230, 231, 228)
_INK: Colour = (45, 52, 60)
_GOAL: Colour = (255, 214, 92)
_COLOURS: dict[str, Colour] = {
    "ball": (230, 126, 34),
    "pusher": (230, 126, 34),
    "rail": (188, 190, 193),
    "box": (93, 142, 190),
    "ramp": (106, 168, 121),
    "truck": (196, 84, 77),
    "floor": (172, 174, 178),
    "wall": (188, 190, 193),
    "ceiling": (203, 204, 207),
}
_GLASS: Colour = (214, 232, 240)
_WHEELED = frozenset({"truck"})
_PALETTE: tuple[Colour, ...] = (
    (142, 110, 176),
    (205, 164, 67),
    (77, 160, 166),
    (199, 120, 158),
    (139, 148, 83),
    (154, 116, 94),
)
_OVERSAMPLING = 2  # drawn twice as large and scaled down, which smooths all edges
_OBLIQUE = 0.3  # how far up a unit of depth is drawn, so that what stands behind can be seen
_ARROW = 12.0  # steps of motion that a velocity arrow shows
_ARROW_LONGEST = 0.15  # of the view's width


@dataclass(frozen=True, slots=True)
class View:
    """The part of the world that a picture shows, in world units along the first and the up axis."""

    left: float
    bottom: float
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class _Drawn:
    """What one body looks like: corners of its outline, or a disc, in world units; with wheels or without."""

    body: SceneObject
    colour: Colour
    centre: Float1D
    depth: float
    corners: Float2D | None
    radius: float
    wheeled: bool = False


@refusing(ConfigError)
def render_scene(
    scene: Scene,
    *,
    size: tuple[int, int] = (800, 500),
    view: View | None = None,
    labels: bool = False,
    velocities: bool = False,
    marks: Sequence[Region] = (),
) -> Image:
    """Draw a scene.

    Parameters
    ----------
    scene
        Any scene: planar or not, observed or predicted.
    size
        Width and height of the picture in pixels.
    view
        The part of the world to show; default: all bodies.
    labels
        Whether to write the objects' names on them.
    velocities
        Whether to draw how far each object would move in 12 steps.
    marks
        Regions to mark behind the bodies, such as a goal (`Task.regions`).

    Returns
    -------
    RGB picture, uint8, shape ``(height, width, 3)``.

    Raises
    ------
    ConfigError
        pygame isn't installed.
    """
    width, height = (checked_count("size", length, 1, 10**5) for length in size)
    pygame = _pygame()
    surface = _draw(
        pygame, scene, (width, height), view or scene_view(scene), marks, labels=labels, velocities=velocities
    )
    return np.ascontiguousarray(np.transpose(pygame.surfarray.array3d(surface), (1, 0, 2)), dtype=np.uint8)


def scene_view(scene: Scene, names: Iterable[str] | None = None, margin: float = 0.04) -> View:
    """The view that shows these bodies (default: all), with a margin relative to their extent."""
    wanted = None if names is None else set(names)
    extents = [_extent(d) for d in _bodies(scene) if wanted is None or d.body.name in wanted]
    if not extents:
        return View(-1.0, -1.0, 2.0, 2.0)
    low, high = np.min([e[0] for e in extents], axis=0), np.max([e[1] for e in extents], axis=0)
    pad = margin * max(float((high - low).max()), 1e-6)
    width, height = high - low + 2 * pad
    return View(float(low[0] - pad), float(low[1] - pad), float(width), float(height))


class Camera:
    """Chooses the view of one scene after the other: it stands still as long as nothing leaves the picture.

    So that what moves is seen to move. At first bodies and marks fill the picture; where one leaves it, the next view
    has room around them.
    """

    def __init__(self) -> None:
        self._view: View | None = None

    def view(self, scene: Scene, marks: Sequence[Region] = ()) -> View:
        """The view to take of this scene."""
        if self._view is None:
            self._view = _with_marks(scene_view(scene), marks)
        elif not _inside(_with_marks(scene_view(scene, margin=0.0), marks), self._view):
            self._view = _with_marks(scene_view(scene, margin=1.0), marks)
        return self._view


def _with_marks(view: View, marks: Sequence[Region]) -> View:
    parts: list[View | Region] = [view, *marks]
    left, bottom = min(p.left for p in parts), min(p.bottom for p in parts)
    right, top = max(p.left + p.width for p in parts), max(p.bottom + p.height for p in parts)
    return View(left, bottom, right - left, top - bottom)


def _inside(part: View, whole: View) -> bool:
    slack = 1e-9 * max(whole.width, whole.height)
    return (
        part.left >= whole.left - slack
        and part.bottom >= whole.bottom - slack
        and part.left + part.width <= whole.left + whole.width + slack
        and part.bottom + part.height <= whole.bottom + whole.height + slack
    )


class SceneViewer:
    """Shows one scene after the other, in a window (``"human"``) or as arrays (``"rgb_array"``)."""

    def __init__(self, mode: str, *, fps: int = 50, size: tuple[int, int] = (800, 500)) -> None:
        self._mode, self._fps, self._size = mode, fps, size
        self._window: Any = None
        self._clock: Any = None

    def show(self, scene: Scene, view: View | None = None, marks: Sequence[Region] = ()) -> Image | None:
        """Draw a scene; the picture for ``"rgb_array"``, ``None`` when it went to the window."""
        if self._mode == "rgb_array":
            return render_scene(scene, size=self._size, view=view, marks=marks)
        pygame = _pygame()
        if self._window is None:
            pygame.display.init()
            self._window = pygame.display.set_mode(self._size)
            pygame.display.set_caption("relgym")
            self._clock = pygame.time.Clock()
        self._window.blit(_draw(pygame, scene, self._size, view or scene_view(scene), marks), (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(self._fps)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            _pygame().display.quit()
            self._window = None


def _pygame() -> ModuleType:
    try:
        import pygame
    except ImportError:
        raise ConfigError("drawing needs pygame-ce: pip install 'relgym[viz]'") from None
    module: ModuleType = pygame
    return module


def _draw(
    pygame: ModuleType,
    scene: Scene,
    size: tuple[int, int],
    view: View,
    marks: Sequence[Region] = (),
    *,
    labels: bool = False,
    velocities: bool = False,
) -> Any:
    """A pygame surface with the scene on it."""
    large = (size[0] * _OVERSAMPLING, size[1] * _OVERSAMPLING)
    canvas = pygame.Surface(large)
    canvas.fill(_BACKGROUND)
    pen = _Pen(pygame, canvas, view, large)
    pen.grid(view)
    for mark in marks:
        pen.mark(mark)
    drawn = sorted(_bodies(scene), key=lambda d: d.depth)  # what is behind comes first
    for body in drawn:
        pen.body(body)
    if velocities:
        for body in drawn:
            pen.arrow(body.centre, _step(scene, body.body), _ARROW_LONGEST * view.width)
    surface = pygame.transform.smoothscale(canvas, size)
    if labels:
        for body in drawn:
            pen.label(surface, body)
    return surface


class _Pen:
    """Draws world coordinates on a canvas: the view centred, equal scales, up is up."""

    def __init__(self, pygame: ModuleType, canvas: Any, view: View, size: tuple[int, int]) -> None:
        self._pygame, self._canvas, self._size = pygame, canvas, size
        self._scale = min(size[0] / view.width, size[1] / view.height)
        self._left = size[0] / 2 - self._scale * (view.left + view.width / 2)
        self._base = size[1] / 2 + self._scale * (view.bottom + view.height / 2)
        self._line = max(2, size[1] // 350)

    def _pixel(self, point: Float1D) -> tuple[float, float]:
        x, y = self._left + self._scale * point[0], self._base - self._scale * point[1]
        # Far outside pixels overflow the library's short integers.
        return float(np.clip(x, -1e4, 1e4)), float(np.clip(y, -1e4, 1e4))

    def grid(self, view: View) -> None:
        """Upright lines at round distances: they show the scale, and motion when the view follows it."""
        step = 10.0 ** math.floor(math.log10(view.width))
        step /= 5.0 if view.width / step < 2.0 else 2.0 if view.width / step < 5.0 else 1.0
        first = math.ceil((0 - self._left) / self._scale / step)
        last = math.floor((self._size[0] - self._left) / self._scale / step)
        for k in range(first, last + 1):
            x = self._pixel(np.array([k * step, 0.0]))[0]
            self._pygame.draw.line(self._canvas, _GRID, (x, 0), (x, self._size[1]), self._line)

    def mark(self, region: Region) -> None:
        """Fill a rectangle of the world."""
        low = self._pixel(np.array([region.left, region.bottom]))
        high = self._pixel(np.array([region.left + region.width, region.bottom + region.height]))
        corners = [low, (low[0], high[1]), high, (high[0], low[1])]
        self._pygame.draw.polygon(self._canvas, _GOAL, corners)
        self._pygame.draw.polygon(self._canvas, _INK, corners, self._line)

    def body(self, drawn: _Drawn) -> None:
        """Fill and outline a body."""
        if drawn.corners is None:
            centre, radius = self._pixel(drawn.centre), self._scale * drawn.radius
            self._pygame.draw.circle(self._canvas, drawn.colour, centre, radius)
            self._pygame.draw.circle(self._canvas, _INK, centre, radius, self._line)
            return
        corners = [self._pixel(corner) for corner in drawn.corners]
        self._pygame.draw.polygon(self._canvas, drawn.colour, corners)
        self._pygame.draw.polygon(self._canvas, _INK, corners, self._line)
        if drawn.wheeled:
            self._truck(drawn.corners.min(axis=0), drawn.corners.max(axis=0))

    def _truck(self, low: Float1D, high: Float1D) -> None:
        """A windscreen and two wheels inside a body's box: its outline stays what touches other bodies."""
        width, height = high - low
        across, up = np.array([width, 0.0]), np.array([0.0, height])
        screen = [
            low + a * across + b * up for a, b in ((0.62, 0.55), (0.93, 0.55), (0.86, 0.88), (0.62, 0.88))
        ]
        pane = [self._pixel(corner) for corner in screen]
        self._pygame.draw.polygon(self._canvas, _GLASS, pane)
        self._pygame.draw.polygon(self._canvas, _INK, pane, self._line)
        radius = 0.19 * min(height, 0.6 * width)
        for a in (0.2, 0.8):
            hub = self._pixel(low + a * across + np.array([0.0, radius]))
            self._pygame.draw.circle(self._canvas, _INK, hub, self._scale * radius)
            self._pygame.draw.circle(self._canvas, _GRID, hub, 0.45 * self._scale * radius)

    def arrow(self, start: Float1D, step: Float1D, longest: float) -> None:
        """Draw the way of some steps from `start`."""
        length = _ARROW * float(np.hypot(*step))
        if length < 0.02 * longest:
            return
        shown = min(length, longest)
        way = step / np.hypot(*step) * shown
        along = way * min(0.12 * longest / shown, 0.5)
        across = np.array([-along[1], along[0]]) * 0.6
        tip = start + way
        self._pygame.draw.line(
            self._canvas, _INK, self._pixel(start), self._pixel(tip - along), 2 * self._line
        )
        head = [self._pixel(p) for p in (tip, tip - along + across, tip - along - across)]
        self._pygame.draw.polygon(self._canvas, _INK, head)

    def label(self, surface: Any, drawn: _Drawn) -> None:
        """Write a body's name on it, or above it where it is too small; on the scaled-down picture."""
        self._pygame.font.init()
        text = self._pygame.font.Font(None, max(14, self._size[1] // 50)).render(drawn.body.name, True, _INK)
        low, high = _extent(drawn)
        middle = drawn.centre if drawn.corners is None else drawn.corners.mean(axis=0)
        x, y = (value / _OVERSAMPLING for value in self._pixel(middle))
        box = text.get_rect(center=(x, y))
        room = self._scale / _OVERSAMPLING * (high - low)
        if text.get_width() > room[0] and 3 * text.get_height() > room[1]:
            box.bottom = int(self._pixel(high)[1] / _OVERSAMPLING) - 2
        surface.blit(text, box.clamp(surface.get_rect()))


def _bodies(scene: Scene) -> list[_Drawn]:
    poses = scene.pose()
    names = [scene.layout.names[i] for i in scene.layout.bodies]
    return [
        part for name, pose in zip(names, poses, strict=True) for part in _drawn(scene, scene[name], pose)
    ]


def _drawn(scene: Scene, body: SceneObject, pose: Float1D) -> list[_Drawn]:
    """What a body looks like, part by part."""
    axes = Axes.of(scene.schema)
    first, up, depth = axes.canonical
    z = 0.0 if axes.planar else float(pose[depth])
    centre = np.array([pose[first], pose[up] - _OBLIQUE * z])
    kind = scene.schema.ancestry(body.type.name)[-1]
    colour = _colour(kind)
    if isinstance(body.type.shape, Sphere):
        return [_Drawn(body, colour, centre, z, None, float(pose[POSE.index("sx")]) / 2)]
    parts = [centre + corners for corners in _outlines(axes, body, pose)]
    wheeled = kind in _WHEELED
    return [_Drawn(body, colour, centre, z, part, 0.0, wheeled=wheeled and _upright(part)) for part in parts]


def _upright(corners: Float2D) -> bool:
    """Whether an outline is a rectangle along the picture's edges."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    return len(corners) == 4 and bool((np.isclose(corners, low) | np.isclose(corners, high)).all())


def _outlines(axes: Axes, body: SceneObject, pose: Float1D) -> list[Float2D]:
    """Corners of the outlines of a body's parts around its centre, as seen along the depth axis."""
    shape, scale, angles = body.type.shape, pose[6:], pose[3:6]
    assert shape is not None, "only bodies are drawn"
    first, up, depth = axes.canonical
    if axes.planar:
        angle = axes.turn * angles[depth]
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        return [(flat * scale[[first, up]]) @ turn for flat in outlines(shape, (first, up))]
    flat = outline(shape, (first, up))
    if isinstance(shape, ConvexPolyhedron):
        corners = np.array(shape.vertices)
    else:
        corners = np.empty((2 * len(flat), 3))
        corners[:, [first, up]] = np.concatenate([flat, flat])
        corners[:, depth] = np.repeat([-0.5, 0.5], len(flat))
    turned = (corners * scale) @ np.array(rotation(angles)).T
    return [outline_of(turned[:, [first, up]])]


def _extent(drawn: _Drawn) -> tuple[Float1D, Float1D]:
    if drawn.corners is None:
        return drawn.centre - drawn.radius, drawn.centre + drawn.radius
    return drawn.corners.min(axis=0), drawn.corners.max(axis=0)


def _step(scene: Scene, body: SceneObject) -> Float1D:
    """Displacement of one step in the picture's plane."""
    columns = body.type.velocity_columns()
    velocity = [float(body.values[c]) if c >= 0 else 0.0 for c in columns]
    first, up, _ = Axes.of(scene.schema).canonical
    return np.array([velocity[first], velocity[up]])


def _colour(root_type: str) -> Colour:
    """The same colour for a type in every scene and every run."""
    return _COLOURS.get(root_type, _PALETTE[zlib.crc32(root_type.encode()) % len(_PALETTE)])
