"""Laws at points of bodies that turn, learned from streams, and what they say of scenes unlike those."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.experiments.bodies import learned, rolled, tally
from relgym.experiments.body_worlds import Setting, body_rooms
from relgym.laws.account import accounts
from relgym.laws.inertia import Gyration, Inertia, Mass
from relgym.laws.learner import LawLearner
from relgym.laws.records import Piece
from relgym.laws.text import law_rows
from relgym.laws.touching import Contacts
from relgym.reporting.motion import MotionRules, parse_motion
from relgym.scene.relations import Extractor

TWO = Setting(("box", "box"), friction=0.5)


@pytest.fixture(scope="module")
def rough() -> LawLearner:
    """What four episodes with friction teach."""
    return learned(body_rooms(TWO, 4, seed=1))


def test_pushing_is_a_handful_of_sentences(rough: LawLearner) -> None:
    assert [str(row) for row in law_rows(rough.book, ["box"], 6)] == [
        "box touching nothing: vx' = vx, vy' = vy, spin' = spin",
        "touching, along the normal n (of the points that touch): v'_n = max(u_n, 0)",
        "touching, along the slip direction t (of the points that touch): v'_t = max(0, u_t - 0.5 J_n)",
        "masses: mass",
        "moment over mass: shape.r2",
    ]


def test_every_contact_of_fresh_scenes_is_right(rough: LawLearner) -> None:
    found = tally(rough.book, body_rooms(TWO, 3, seed=1001))
    assert found.contacts > 200
    assert (found.right, found.wrong, found.free_wrong) == (found.contacts, 0, 0)


def test_other_shapes_and_more_bodies_need_no_learning(rough: LawLearner) -> None:
    strange = Setting(("box", "hexagon", "triangle", "tee", "box", "puck"), friction=0.5)
    rooms = body_rooms(strange, 2, seed=1002)
    found = tally(rough.book.on(rooms[0].schema, rooms[0].schema.targets or ()), rooms)
    assert found.contacts > 200
    assert found.right >= 0.999 * found.contacts
    assert found.wrong + found.free_wrong == 0


def test_roll_outs_stay_right(rough: LawLearner) -> None:
    errors = [rolled(rough.book, room, (0, 99), 100) for room in body_rooms(TWO, 3, seed=1003)]
    assert np.median(errors) <= 1e-9


def test_masses_that_are_not_seen_follow_from_areas() -> None:
    setting = Setting(("box", "box"), friction=0.5, masses="uniform")
    learner = learned(body_rooms(setting, 4, seed=3))
    assert learner.book.inertia.sentences() == ("masses go as shape.area", "moment over mass: shape.r2")
    found = tally(learner.book, body_rooms(setting, 2, seed=1004))
    assert (found.right, found.wrong) == (found.contacts, 0)


def test_masses_may_be_constants_of_objects() -> None:
    setting = Setting(("box", "box"), friction=0.5, masses="own")
    mass = learned(body_rooms(setting, 10, seed=1)).book.inertia.mass
    assert mass is not None
    assert (mass.by, mass.factors) == ("object", ())
    densities = np.random.default_rng(30).uniform(2.0, 8.0, 3)  # those that `body_rooms` takes
    truth = dict(zip(("disc", "body1", "body2"), densities / densities[1], strict=True))
    assert dict(mass.constants) == pytest.approx(truth, rel=1e-6)


def test_damping_is_part_of_the_free_law() -> None:
    learner = learned(body_rooms(Setting(("box", "box"), damping=0.5), 3, seed=5))
    law = learner.book.free["box"]
    assert [dict(piece.terms) for piece in law.components] == [
        pytest.approx({name: 0.5**0.01}) for name in ("vx", "vy", "spin")
    ]


@pytest.mark.parametrize("setting", [Setting(magnet=0.3), Setting(drag=0.3)], ids=["magnet", "drag"])
def test_forces_that_nothing_accounts_for_are_left_unsaid(setting: Setting) -> None:
    learner = learned(body_rooms(setting, 3, seed=6))
    found = tally(learner.book, body_rooms(setting, 2, seed=1006))
    assert found.wrong + found.free_wrong <= 0.001 * (found.contacts + found.free)


def test_without_a_law_of_contacts_nothing_is_claimed_there(rough: LawLearner) -> None:
    rooms = body_rooms(TWO, 1, seed=1007)
    book = rough.book.on(rooms[0].schema, rooms[0].schema.targets or ())
    book.pair = None
    found = tally(book, rooms)
    assert (found.right, found.wrong) == (0, 0)
    book.pair, book.inertia = rough.book.pair, Inertia()
    assert tally(book, rooms).wrong == 0


def test_company_changes_no_bit(rough: LawLearner) -> None:
    room = body_rooms(TWO, 1, seed=1008)[0]
    cast = rough.book.cast(room.layout)

    def moved(rows: slice) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[type-arg]
        vectors = room.vectors[rows]
        contacts = Contacts.of(cast, Extractor(room.schema).extract(room.layout, vectors), vectors)
        motion = rough.book.motion(contacts, vectors)
        return motion.velocity, motion.known

    velocity, known = moved(slice(None, -1))
    for k in range(0, len(room), 9):
        alone = moved(slice(k, k + 1))
        assert np.array_equal(alone[0][:, 0], velocity[:, k])
        assert np.array_equal(alone[1][0], known[k])


def test_every_point_is_explained(rough: LawLearner) -> None:
    room = body_rooms(TWO, 1, seed=1008)[0]
    cast = rough.book.cast(room.layout)
    told = 0
    for k in range(0, len(room), 4):
        vectors = room.vectors[k : k + 1]
        contacts = Contacts.of(cast, Extractor(room.schema).extract(room.layout, vectors), vectors)
        found = accounts(rough.book, contacts, vectors)
        assert contacts.points is not None
        assert len(found) == len(contacts.points)
        told += len(found)
        for account in found:
            normal, tangent = account.axes
            assert normal.value >= -1e-12
            assert tangent.value >= -1e-12
    assert told > 0


def test_it_goes_on_as_if_never_saved() -> None:
    rooms = body_rooms(TWO, 3, seed=9)
    whole, first = learned(rooms), learned(rooms[:2])
    again = LawLearner(first.schema, first.schema.targets or (), seed=7)
    again.restore(first.to_json(history=True), first.to_arrays())
    one = learned(rooms[2:], learner=again)
    assert one.to_json(history=True) == whole.to_json(history=True)


def test_what_is_printed_is_read_back(rough: LawLearner) -> None:
    book = rough.book
    names = sorted(book.free)
    rules = MotionRules(
        tuple(book.free[name] for name in names),
        tuple((name, book.components(name)) for name in names),
        book.pair,
        "nt",
        (),
        book.tolerance,
        Inertia(
            Mass((("sx", 1), ("sy", 2)), "object", (("body1", 1.0), ("disc", 0.25))),
            (Gyration(("box",), Piece((("sx^2", 0.0625), ("1", 0.5)))), Gyration(("disc",), None)),
        ),
    )
    text = rules.text()
    assert "masses go as sx sy^2; by object, times body1: 1, disc: 0.25" in text
    assert "moment over mass of disc: infinite" in text
    lines = [line for line in text.split("\n") if not line.strip().startswith("#")]
    assert parse_motion(lines).text() == text


@pytest.mark.slow
@pytest.mark.parametrize("elasticity", [0.0, 0.8])
@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("seed", [410, 411, 412, 413, 414])
def test_pushing(friction: float, elasticity: float, seed: int) -> None:
    setting = Setting(("box",) * (2 + seed % 3), friction, elasticity)
    found = tally(learned(body_rooms(setting, 100, seed=seed)).book, body_rooms(setting, 20, seed=510))
    assert found.right_share >= 99.9
    assert found.wrong_share <= 0.05
