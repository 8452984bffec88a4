"""Scenes whose modes are as frequent as the thesis', in a small form of the count on ten seeds (`scenes`)."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.experiments.chapter4.frequencies import count
from relgym.experiments.chapter4.published import MODES
from relgym.experiments.data import BALL_EXPERIMENTS, THESIS_EXPERIMENTS, ball_episodes
from relgym.experiments.scenes import SCENES, TOLD_APART
from relgym.experiments.seeds import FREQUENCY_SEEDS


@pytest.mark.parametrize(("experiment", "number"), [(1, "4.2"), (2, "4.9")])
def test_the_frequent_modes_are_as_frequent_as_printed(experiment: int, number: int) -> None:
    found = count(experiment=experiment, seed=FREQUENCY_SEEDS[0], scenes="thesis")
    for axis, column in found.items():
        assert sum(column) == THESIS_EXPERIMENTS[experiment].episodes * 200
        told = TOLD_APART.get((experiment, axis), {})
        for row in MODES[str(number), axis][1:]:
            wanted = told.get(row.number - 1, row.examples)
            if wanted > 1000:
                assert column[row.number] == pytest.approx(wanted, rel=0.25), row
            elif wanted >= 90:
                assert column[row.number] == pytest.approx(wanted, rel=0.5), row


def test_the_env_has_its_own_scenes_as_before() -> None:
    plain = next(ball_episodes(BALL_EXPERIMENTS[1], seed=3))
    again = next(ball_episodes(1, seed=3))
    np.testing.assert_array_equal(plain.vectors, again.vectors)
    assert not np.array_equal(next(ball_episodes(THESIS_EXPERIMENTS[1], seed=3)).vectors, plain.vectors)


def test_every_configuration_begins_inside_the_room_and_in_no_body() -> None:
    for episode in ball_episodes(THESIS_EXPERIMENTS[2], seed=901, episodes=80, order=None):
        drawn, options = episode.configuration, SCENES[2]
        assert options.room_width[0] <= drawn["room_width"] <= options.room_width[1]
        assert drawn["ramp_highest"] == options.ramp_highest
        assert np.abs(episode.columns("ball", "vx", "vy")).max() < 0.2  # nothing was thrown out of a body


def test_rooms_with_one_object_only() -> None:
    from dataclasses import replace

    for kind in ("box", "ramp"):
        setting = replace(THESIS_EXPERIMENTS[1], objects=(kind,))
        rooms = list(ball_episodes(setting, seed=901, episodes=8, order=None))
        assert {kind in room.layout.names for room in rooms} == {True}


@pytest.mark.parametrize("experiment", [1, 2])
def test_most_balls_that_fly_into_a_wall_are_hardly_in_it(experiment: int) -> None:
    """Table 4.5, Table 4.14: they aren't x-aligned yet, so less than a twentieth of their width overlaps."""
    shallow = counted = 0
    for episode in ball_episodes(THESIS_EXPERIMENTS[experiment], seed=901, order=None):
        x, width = episode.columns("ball", "px", "sx").T
        for name, side in (("left_wall", 1.0), ("right_wall", -1.0)):
            wall, thick = episode.columns(name, "px", "sx").T
            depth = 0.5 * (width + thick) - side * (x - wall)
            contacts = zip(episode.truth.touched, episode.truth.pushing, strict=True)
            hit = [touched == {name} == pushing for touched, pushing in contacts]
            shallow += int((depth[:-1][hit] < 0.05 * width[:-1][hit]).sum())
            counted += sum(hit)
    assert counted >= 10 and shallow > 0.6 * counted
