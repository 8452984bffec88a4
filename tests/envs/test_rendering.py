from __future__ import annotations

import sys

import numpy as np
import pytest

from relgym.envs import BallBoxRampEnv, BallGoalEnv, SceneEnv, TruckPushEnv, render_scene
from relgym.envs.rendering import Camera, View, scene_view
from relgym.envs.tasks import Region
from relgym.errors import ConfigError
from relgym.scene.objects import POSE, ObjectType, Scene
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, ConvexPolyhedron, Prism, Shape, Sphere, Wedge

pytest.importorskip("pygame")

SQUARE = View(-1.0, -1.0, 2.0, 2.0)


def shown(shape: Shape, *, planar: bool, up: str = "y", **pose: float) -> np.ndarray:
    """Where a single body of that shape is drawn: a mask of 100 x 100 pixels over [-1, 1]^2, row 0 on top."""
    thing = ObjectType("thing", POSE, shape)
    schema = SceneSchema((thing,), (("it", "thing"),), up=up, planar=planar)
    values = {"px": 0.0, "py": 0.0, "pz": 0.0, "sx": 1.0, "sy": 1.0, "sz": 1.0, **pose}
    scene = schema.scene({"it": [values.get(name, 0.0) for name in POSE]})
    image = render_scene(scene, size=(100, 100), view=SQUARE).astype(int)
    return np.asarray(image.max(axis=2) < 225)


def area(mask: np.ndarray) -> float:
    return float(mask.sum()) / 2500.0  # in world units


def test_picture_has_the_asked_size_and_type() -> None:
    env = BallBoxRampEnv(render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().shape == (500, 800, 3)
    small = render_scene(env.scene, size=(200, 100))
    assert small.shape == (100, 200, 3) and small.dtype == np.uint8


@pytest.mark.parametrize("planar", [True, False])
@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (Sphere(), np.pi / 4),
        (Box(), 1.0),
        (Wedge(), 0.5),
        (Prism(((-0.5, -0.5), (0.5, -0.5), (0.0, 0.5))), 0.5),
        (ConvexPolyhedron(((0, 0, 0), (0.5, 0, 0), (0, 0.5, 0), (0, 0, 0.5))), 0.125),
    ],
)
def test_shapes_have_their_area(shape: Shape, expected: float, planar: bool, up: str) -> None:
    # The outline, two pixels wide, lies half outside.
    assert area(shown(shape, planar=planar, up=up)) == pytest.approx(expected, abs=0.06)


@pytest.mark.parametrize("planar", [True, False])
def test_a_wedge_is_steep_on_the_left_and_upright(planar: bool) -> None:
    mask = shown(Wedge(), planar=planar)
    assert mask[30, 27] and not mask[30, 60]  # high on the left only
    assert mask[70, 27] and mask[70, 65]
    turned = shown(Wedge(), planar=planar, rz=np.pi / 2)  # a quarter turn to the left: steep side below
    assert turned[73, 70] and not turned[30, 30]


def test_positions_are_drawn_where_they_are() -> None:
    mask = shown(Box(), planar=True, px=0.5, py=0.5, sx=0.2, sy=0.2)
    rows, columns = np.nonzero(mask)
    assert (rows.mean(), columns.mean()) == pytest.approx((24.5, 74.5), abs=1.0)


def test_the_view_shows_all_bodies_or_the_named_ones() -> None:
    env = BallBoxRampEnv()
    env.reset(seed=0)
    scene = env.scene
    whole = scene_view(scene)
    assert whole.left < scene["left_wall"]["px"] < scene["right_wall"]["px"] < whole.left + whole.width
    ball = scene_view(scene, ["ball"])
    assert ball.width < 2 * scene["ball"]["sx"]
    assert scene_view(scene, []).width > 0


def test_the_trucks_view_follows_it() -> None:
    env = TruckPushEnv(task=None, render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    for _ in range(30):
        env.step(np.array([1.0]))
    truck = np.array([196, 84, 77])
    for image in (first, env.render()):
        assert (np.abs(image.astype(int) - truck).max(axis=2) < 3).mean() > 0.01
    assert not np.array_equal(first, env.render())  # the ground's lines pass by


def yellow_of(env: SceneEnv) -> np.ndarray:
    return np.asarray(np.abs(env.render().astype(int) - np.array([255, 214, 92])).max(axis=2) < 3)


@pytest.mark.parametrize("env", [TruckPushEnv(render_mode="rgb_array"), BallGoalEnv(render_mode="rgb_array")])
def test_goals_are_marked_where_they_are(env: SceneEnv) -> None:
    env.reset(seed=0)
    yellow = yellow_of(env)
    assert 0.0005 < yellow.mean() < 0.02
    rows, columns = np.nonzero(yellow)
    assert yellow[rows.min() : rows.max(), columns.min() : columns.max()].mean() > 0.7  # one rectangle
    action = np.full(env.action_space.shape or (), 1.0)
    for _ in range(3):
        env.step(action)
    np.testing.assert_array_equal(yellow_of(env), yellow)  # goal and camera stand still


def test_labels_and_arrows_are_off_by_default() -> None:
    env = BallBoxRampEnv()
    env.reset(seed=0)
    plain = render_scene(env.scene)
    assert not np.array_equal(render_scene(env.scene, labels=True), plain)
    assert not np.array_equal(render_scene(env.scene, velocities=True), plain)


def test_an_empty_scene_can_be_drawn() -> None:
    schema = SceneSchema((ObjectType("action", ("force",)),), (("action", "action"),))
    image = render_scene(schema.scene({"action": [1.0]}), size=(50, 50))
    assert isinstance(schema.scene({"action": [1.0]}), Scene) and image.shape == (50, 50, 3)


def test_a_window_can_be_opened_and_closed() -> None:
    env = BallBoxRampEnv(render_mode="human")
    env.reset(seed=0)
    env.step(0)
    assert env.render() is None
    env.close()
    env.close()


def test_missing_pygame_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    env = BallBoxRampEnv(render_mode="rgb_array")
    env.reset(seed=0)
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ConfigError, match=r"relgym\[viz\]"):
        env.render()


def test_the_camera_stands_still_until_something_leaves_the_picture() -> None:
    thing = ObjectType("thing", POSE, Box())
    schema = SceneSchema((thing,), (("it", "thing"), ("other", "thing")), planar=True)

    def at(x: float) -> Scene:
        values = {"px": x, "py": 0.0, "pz": 0.0, "sx": 1.0, "sy": 1.0, "sz": 1.0}
        still = [{**values, "px": 0.0}.get(name, 0.0) for name in POSE]
        return schema.scene({"it": [values.get(name, 0.0) for name in POSE], "other": still})

    goal = (Region(9.0, -0.5, 1.0, 1.0),)
    camera = Camera()
    first = camera.view(at(3.0), goal)
    assert first.left < -0.5 and first.left + first.width >= 10.0
    assert camera.view(at(4.0), goal) == camera.view(at(9.0), goal) == first
    later = camera.view(at(12.0), goal)
    assert later.left + later.width > 12.5 + 3.0  # with room to go on
    assert camera.view(at(14.0), goal) == later
    assert Camera().view(at(3.0)) == scene_view(at(3.0))
