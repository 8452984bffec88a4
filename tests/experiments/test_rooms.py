from __future__ import annotations

import numpy as np
import pytest

from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes
from relgym.experiments.laws.score import score, taught
from relgym.experiments.rooms import Room, room_schema, rooms


def drawn(count: int, objects: int, friction: float = 0.0, *, seed: int = 0, steps: int = 200) -> list[Room]:
    rng = np.random.default_rng(seed)
    return rooms(count, objects=objects, elasticity=0.9, friction=friction, rng=rng, steps=steps)


def test_rooms_hold_what_they_promise() -> None:
    (room,) = drawn(1, 12)
    kinds = [t.name for t in room.layout.types]
    assert [kinds.count(k) for k in ("ball", "box", "ramp", "counterramp", "wall")] == [1, 6, 3, 3, 2]
    assert room.vectors.shape == (201, room.layout.width)
    assert room.schema == room_schema(12)


def test_velocity_is_the_last_displacement() -> None:
    (room,) = drawn(1, 4)
    at = room.layout.offsets[room.layout.index("ball")]
    steps = np.diff(room.vectors[:, at : at + 2], axis=0)
    assert np.array_equal(steps, room.vectors[1:, at + 9 : at + 11])


def test_the_same_generator_gives_the_same_rooms() -> None:
    one, two = drawn(2, 4, seed=3), drawn(2, 4, seed=3)
    assert all(a.vectors.tobytes() == b.vectors.tobytes() for a, b in zip(one, two, strict=True))


@pytest.mark.parametrize("experiment", [1, 2])
def test_laws_of_small_rooms_hold_in_large_ones(experiment: int) -> None:
    setting = BALL_EXPERIMENTS[experiment]
    model = taught(ball_episodes(experiment, seed=0, episodes=8))
    large = rooms(
        4,
        objects=12,
        elasticity=setting.elasticity,
        friction=setting.frictions[0],
        rng=np.random.default_rng(0),
        steps=300,
    )
    found = score(model, large)
    assert (found.transitions, found.wrong, found.abstained) == (1200, 0, 0)
