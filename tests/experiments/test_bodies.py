"""The benchmarks of bodies: what is counted, and what a roll-out is that laws decline."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.experiments.bodies import main
from relgym.experiments.body_trials import Tally, rolled, tally
from relgym.experiments.body_worlds import ROOM, Setting, body_rooms
from relgym.laws.book import LawBook
from relgym.laws.learner import LawLearner

SETTING = Setting(("box", "tee"), friction=0.5)


def empty_book() -> LawBook:
    room = body_rooms(SETTING, 1, seed=1, steps=1)[0]
    return LawLearner(room.schema, room.schema.targets or (), seed=0).book


def test_shares() -> None:
    found = Tally(contacts=200, right=150, wrong=1, free=800, free_wrong=1)
    assert (found.right_share, found.wrong_share) == (75.0, 0.2)


def test_who_knows_nothing_claims_nothing() -> None:
    rooms = body_rooms(SETTING, 1, seed=1, steps=40)
    found = tally(empty_book(), rooms)
    assert found.contacts + found.free == 3 * 40
    assert (found.right, found.wrong, found.free_wrong) == (0, 0, 0)
    assert np.isinf(rolled(empty_book(), rooms[0], (0,), 3)).all()


def test_rooms_keep_their_bodies_and_their_seed() -> None:
    one, same, other = (body_rooms(SETTING, 2, seed=seed, steps=60) for seed in (5, 5, 6))
    assert np.array_equal(one[1].vectors, same[1].vectors)
    assert not np.array_equal(one[0].vectors, other[0].vectors)
    for room in one:
        for name in ("disc", "body1", "body2"):
            start = room.layout.slice(room.layout.index(name)).start
            assert np.abs(room.vectors[:, start : start + 2]).max() < ROOM
            # Velocity is the last displacement.
            moved = np.diff(room.vectors[:, start : start + 2], axis=0)
            assert moved == pytest.approx(room.vectors[1:, start + 9 : start + 11], abs=1e-12)


def test_unknown_benchmarks_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["pushings"])
    assert "expected one of pushing" in capsys.readouterr().err
