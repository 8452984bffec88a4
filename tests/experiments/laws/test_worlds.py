"""The simulator of other worlds, against mechanics by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from relgym.experiments.laws.motion import PULL, episode
from relgym.experiments.laws.worlds import Ball, Material, World, block_room
from relgym.scene.relations import Extractor

Array = NDArray[np.float64]


def played(world: World, steps: int = 150, *, seed: int = 0) -> Array:
    return episode(world, steps=steps, rng=np.random.default_rng(seed))


def columns(world: World, name: str, *properties: str) -> list[int]:
    layout = world.schema().layout()
    return [layout.column(layout.index(name), p) for p in properties]


@pytest.mark.parametrize("dimensions", [2, 3])
def test_it_falls_between_contacts_and_velocity_is_the_last_displacement(dimensions: int) -> None:
    world = World(dimensions)
    rows = played(world)
    place, speed = (
        columns(world, "ball1", *names[:dimensions]) for names in (("px", "py", "pz"), ("vx", "vy", "vz"))
    )
    assert np.array_equal(rows[:-1, place] + rows[1:, speed], rows[1:, place])
    layout = world.schema().layout()
    touch = Extractor(world.schema()).extract(layout, rows).relation("intersect")[:-1, 0].any(axis=1)
    assert 0 < touch.sum() < 100
    fall = np.zeros(dimensions)
    fall[1] = -PULL
    assert np.allclose(np.diff(rows[:, speed], axis=0)[~touch], fall, atol=1e-15)
    assert (np.abs(np.diff(rows[:, speed], axis=0)[touch] - fall) > 1e-6).any(axis=1).mean() > 0.5


def test_a_bounce_turns_the_normal_velocity_round() -> None:
    world = World(2, blocks=("block",) * 4, materials={"block": Material(0.5)})
    rows = played(world, 400)
    vy = rows[:, columns(world, "ball1", "vy")[0]]
    up = np.flatnonzero((vy[:-1] < -1e-3) & (vy[1:] > 0.0))
    assert len(up)
    assert np.allclose(vy[up + 1], -0.5 * vy[up], atol=1e-12)


def test_balls_pass_momentum_between_them() -> None:
    balls = (Ball(mass=3.0, radius=0.3), Ball(mass=1.0, radius=0.3))
    world = World(2, balls, blocks=("block",) * 4, weighed=True)
    rows = played(world, 600, seed=1)
    speeds = [rows[:, columns(world, name, "vx", "vy")] for name in ("ball1", "ball2")]
    layout = world.schema().layout()
    touch = Extractor(world.schema()).extract(layout, rows).relation("intersect")[:-1]
    met = touch[:, 0, 1] & (touch[:, :2].sum(axis=(1, 2)) == 2)
    assert met.any()
    total = 3.0 * speeds[0] + speeds[1]
    assert np.allclose(np.diff(total, axis=0)[met], [0.0, -4.0 * PULL], atol=1e-12)


def test_friction_makes_a_disc_roll() -> None:
    world = World(2, (Ball(spins=True),), blocks=("block",) * 4, materials={"block": Material(0.0, 0.9)})
    rows = played(world, 400)
    vx, spin = (rows[:, c] for c in columns(world, "ball1", "vx", "spin"))
    rolls = np.abs(vx + 0.1 * spin) < 1e-12
    assert rolls[150:].mean() > 0.8  # but for a while after a wall
    assert (np.abs(vx[rolls]) > 1e-4).mean() > 0.8


def test_soft_contacts_push_by_depth() -> None:
    world = World(2, blocks=("block",) * 4, materials={"block": Material(spring=1.0)})
    rows = played(world, 300)
    y, vy = (rows[:, c] for c in columns(world, "ball1", "py", "vy"))
    depth = 0.1 - (y + 1.5)  # the floor's top is at -1.5
    pressed = np.flatnonzero(depth[:-1] > 1e-6)
    assert len(pressed)
    assert np.allclose(vy[pressed + 1] - vy[pressed] + PULL, depth[pressed], atol=1e-12)


def test_rooms_are_closed_and_drawn_alike() -> None:
    one, two = (block_room(("block",) * 7, 2, rng=np.random.default_rng(3)) for _ in range(2))
    assert [b.centre.tolist() for b in one] == [b.centre.tolist() for b in two]
    assert [b.centre.tolist() for b in one[:4]] == [[-2.0, 0.0], [2.0, 0.0], [0.0, -2.0], [0.0, 2.0]]
    assert played(World(2)).tobytes() == played(World(2)).tobytes()
