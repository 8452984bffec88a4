"""The benchmarks of bodies: what is counted, and what a roll-out is that laws decline."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from relgym.experiments.benchmark import Known, main
from relgym.experiments.bodies.deliveries import ARMS, delivered
from relgym.experiments.bodies.suite import FEW_PARCELS, FORCES, STRANGE, SUITE
from relgym.experiments.bodies.trials import EXACT, Tally, asked, rolled, setting_of, tally, watched
from relgym.experiments.bodies.worlds import ROOM, Setting, body_masses, body_rooms, checked_rooms
from relgym.laws.book import LawBook
from relgym.laws.learner import LawLearner
from relgym.scene.relations import Extractor

SETTING = Setting(("box", "tee"), friction=0.5)


def empty_book() -> LawBook:
    room = body_rooms(SETTING, 1, seed=1, steps=1)[0]
    return LawLearner(room.schema, room.schema.targets or (), seed=0).book


def test_shares() -> None:
    found = Tally(contacts=200, right=150, wrong=1, free=800, free_wrong=1)
    assert (found.right_share, found.wrong_share) == (75.0, 0.2)


def test_what_the_engine_leaves_unsettled_is_counted_apart() -> None:
    rooms = body_rooms(SETTING, 1, seed=1)
    whole = tally(empty_book(), rooms)
    residual = np.zeros((len(rooms[0]), 3))
    residual[:, 1] = 1.0
    found = tally(empty_book(), rooms, residuals=[residual])
    assert found.unsettled > 0
    assert found.contacts + found.unsettled == whole.contacts
    assert found.free == whole.free
    assert tally(empty_book(), rooms, 2.0, [residual]).unsettled == 0


def test_the_engines_residual_tells_nothing_of_the_rooms() -> None:
    falling = Setting(("box",), 0.5, 0.3, gravity=9.8, driven=False)
    ((room, residual),) = checked_rooms(falling, 1, seed=3, steps=30)
    assert np.array_equal(room.vectors, body_rooms(falling, 1, seed=3, steps=30)[0].vectors)
    assert residual.shape == (30, 2)
    assert (residual >= 0.0).all() and residual.max() < 1e-4


def test_settings_vary_what_their_names_say() -> None:
    plain, heavy = (body_masses(Setting(("box",), heavy=h), seed=4) for h in (1.0, 10.0))
    assert heavy[0].mass == pytest.approx(10.0 * plain[0].mass)
    assert heavy[1] == plain[1]
    rough = body_masses(Setting(("box",) * 2, 0.25, materials=(0.9, 0.2)), seed=4)
    assert [body.friction for body in rough] == [0.9, 0.2, 0.9]
    room = body_rooms(Setting(("box",), tilt=0.25), 1, seed=4, steps=1)[0]
    walls = [room.layout.slice(room.layout.index(f"wall{k}")).start + 5 for k in (1, 2, 3, 4)]
    assert room.vectors[0, walls] == pytest.approx([0.25, -0.25, np.pi / 2 - 0.25, np.pi / 2 + 0.25])


def test_settings_are_plain_data() -> None:
    for setting in (*STRANGE.values(), *FORCES.values()):
        assert setting_of(json.loads(json.dumps(asdict(setting)))) == setting


def test_results_are_kept_and_a_page_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["masses", "--seeds", "1", "--episodes", "1", "--tests", "1", "--out", str(tmp_path)]
    target = tmp_path / "bodies.md"
    main(SUITE, [*options, "--page", str(target)])
    first = capsys.readouterr()
    assert "2 of 2 runs" in first.err
    text = target.read_text(encoding="utf-8")
    assert "## masses: Masses that aren't seen" in text
    assert "`relgym benchmark bodies masses --seeds 1 --episodes 1 --tests 1`" in text
    target.write_text(text.replace("## masses", "## pushing\n\nkept\n\n## masses"), encoding="utf-8")
    main(SUITE, [*options, "--page", str(target)])
    again = capsys.readouterr()
    assert "1 of" not in again.err  # nothing was left to run
    assert again.out == first.out
    assert "## pushing\n\nkept\n\n## masses:" in target.read_text(encoding="utf-8")


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


def test_a_models_claims_at_once_are_those_one_by_one() -> None:
    model, told = watched(body_rooms(SETTING, 1, seed=1, steps=60))
    assert told.contacts + told.free == 3 * 60
    (room,) = body_rooms(SETTING, 1, seed=2, steps=60)
    relations = Extractor(room.schema).extract(room.layout, room.vectors[:-1])
    touched = np.asarray(relations.relation("intersect").any(axis=2))
    right, wrong = [0, 0], [0, 0]  # flying, touching
    for step, transition in enumerate(room.transitions()):
        said = model.predict_one(transition.before)
        for body, name in enumerate(("disc", "body1", "body2")):
            own = [part for part in said.parts if part.object == name]
            off = [abs(part.value - transition.after[name][part.property]) > EXACT for part in own]
            claimed = [part.ok for part in own]
            right[int(touched[step, body])] += all(claimed) and not any(off)
            wrong[int(touched[step, body])] += any(c and o for c, o in zip(claimed, off, strict=True))
    contacts = int(touched[:, :3].sum())
    assert right[0] > 0
    assert asked(model, [room]) == Tally(contacts, right[1], wrong[1], 3 * 60 - contacts, wrong[0])


def test_parcels_of_all_seeds_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty episodes of each seed make a hundred; of the ensemble's, which takes long, those that begin them."""
    deliveries = SUITE.benchmarks["deliveries"]
    wanted = Known()
    deliveries.measure(SUITE.extent(seeds=2), wanted)
    told = [task.arguments for task in wanted.missing]
    assert [(each["arm"], each["first"], each["episodes"]) for each in told] == [
        (arm, first, FEW_PARCELS if arm == "ensemble" else 20) for arm in ARMS for first in (0, 20)
    ]
    result = {"good": 1, "episodes": 2, "learning": 3.0, "testing": 8.0}
    monkeypatch.setattr(Known, "__call__", lambda self, function, arguments: [result, {**result, "good": 2}])
    shown = deliveries.measure(SUITE.extent(seeds=2, parcels=2), Known())
    assert [(m.values, m.ok) for m in shown.measures] == [((50.0, 100.0), False)]
    assert f"{ARMS['sac']}: 3 of 4 episodes (1, 2 of 2)" in shown.notes
    assert f"{ARMS['sac']}: 3 s of processor time to learn, 4 s for an episode (median)" in shown.notes


@pytest.mark.slow
def test_parcels_are_delivered_by_plans_in_what_was_learned() -> None:
    assert delivered(arm="relgym", seed=7, episodes=2, first=1_000)["good"] == 2
