"""Laws at points of bodies that turn, learned from streams, and what they say of scenes unlike those."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.experiments.bodies.trials import learned, rolled, tally
from relgym.experiments.bodies.worlds import Setting, body_rooms
from relgym.laws.account import accounts
from relgym.laws.book import LawBook
from relgym.laws.columns import Sources
from relgym.laws.inertia import Gyration, Inertia, Mass
from relgym.laws.learner import LawLearner
from relgym.laws.records import ONE, AxisLaw, FreeLaw, PairLaw, Piece
from relgym.laws.text import law_rows
from relgym.laws.touching import Contacts
from relgym.laws.turning import _running, _Seen
from relgym.reporting.motion import MotionRules, parse_motion
from relgym.scene.objects import POSE, Kinematics, ObjectType, Target
from relgym.scene.relations import Extractor
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere

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


def test_scenes_of_a_batch_are_those_alone(rough: LawLearner) -> None:
    """Learning from a room at once gives what learning from each scene on its own gives, to the last bit."""
    room = body_rooms(TWO, 1, seed=1004, steps=80)[0]
    book, now = rough.book, room.vectors[:-1]
    whole = Contacts.of(book.cast(room.layout), Extractor(room.schema).extract(room.layout, now), now)
    motion = book.motion(whole, now)
    assert whole.points is not None and len(whole.points)
    for k in range(len(now)):
        relations = Extractor(room.schema).extract(room.layout, now[k : k + 1])
        alone = Contacts.of(whole.cast, relations, now[k : k + 1])
        points = whole.scene(k).points
        assert points is not None and alone.points is not None
        for name in ("scene", "pair", "normal", "arms"):
            assert np.array_equal(getattr(points, name), getattr(alone.points, name))
        told, part = book.motion(alone, now[k : k + 1]), motion.scene(k)
        assert told.velocity.tobytes() == part.velocity.tobytes()
        assert np.array_equal(told.known, part.known) and np.array_equal(told.touched, part.touched)


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


# ---------------------------------------------------------------------- conveyors
DISC, FLAT = (
    ObjectType(name, (*POSE, "vx", "vy", "spin"), shape, velocity=("vx", "vy", None))
    for name, shape in (("disc", Sphere()), ("flat", Box()))
)
YARD = SceneSchema(
    (DISC, FLAT, ObjectType("belt", POSE, Box()), ObjectType("floor", POSE, Box())),
    (("a", "disc"), ("b", "flat"), ("belt", "belt"), ("floor", "floor")),
    planar=True,
    kinematics=tuple(
        Kinematics(t, place, rate)
        for t in ("disc", "flat")
        for place, rate in (("px", "vx"), ("py", "vy"), ("rz", "spin"))
    ),
    targets=tuple(Target(t, rate) for t in ("disc", "flat") for rate in ("vx", "vy", "spin")),
)


def yard_laws(speed: float) -> LawBook:
    """Discs fall, stop where they land, and slip with friction on a floor and on a belt that runs."""
    targets = YARD.targets or ()
    book = LawBook(YARD, {t.name: Sources.of(YARD, t, targets) for t in (DISC, FLAT)})
    free = (Piece((("vx", 1.0),)), Piece((("vy", 1.0), (ONE, -0.01))), Piece((("spin", 1.0),)))
    book.free = {name: FreeLaw(name, free) for name in ("disc", "flat")}
    kinds, zero = (("disc", "belt"), ("disc", "floor")), Piece(())
    normal = AxisLaw((Piece((("u_n", 1.0),)), zero), "max", kinds, examples=9)
    slip = AxisLaw((Piece((("u_t", 1.0), ("J_n", -0.5))), zero), "max", kinds, examples=9)
    book.pair = PairLaw("point", ((normal,), (slip,)), 1.0, surfaces=((kinds[0], speed),))
    book.inertia = Inertia(Mass(()), (Gyration(("disc", "flat"), Piece((("shape.r2", 1.0),)), whole=True),))
    book.tolerance = 1e-12
    return book


def yard_step(book: LawBook, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, Contacts]:
    """A disc on the belt, on the floor or in the air, what comes next, and who touches whom."""
    layout, x = YARD.layout(), float(rng.choice([-5.0, 5.0, 100.0]))
    moving = (0.1 * rng.normal(), -0.05 * abs(rng.normal()), 0.2 * rng.normal())
    parts = {
        "a": [x, 0.5 if x < 50.0 else 30.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, *moving],
        "b": [50.0, 20.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, *0.1 * rng.normal(size=3)],
        "belt": [-5.0, -0.5, 0.0, 0.0, 0.0, 0.0, 6.0, 1.0, 1.0],
        "floor": [5.0, -0.5, 0.0, 0.0, 0.0, 0.0, 6.0, 1.0, 1.0],
    }
    now = np.concatenate([parts[name] for name in layout.names])
    cast = book.cast(layout)
    contacts = Contacts.of(cast, Extractor(YARD).extract(layout, now[None]), now[None])
    motion, after = book.motion(contacts, now[None]), now.copy()
    for name in ("a", "b"):
        at = layout.places[name, "vx"]
        after[at : at + 3] = motion.velocity[:, 0, cast.bodies[name]]
    return now, after, contacts


@pytest.mark.parametrize("speed", [0.1, -0.08, 0.0])
def test_a_belts_speed_is_found_from_what_it_takes_along(speed: float, rng: np.random.Generator) -> None:
    book, learner = yard_laws(speed), LawLearner(YARD, YARD.targets or (), seed=0)
    stays = dict.fromkeys(range(len(YARD.objects)), True)
    for _ in range(80):
        now, after, contacts = yard_step(book, rng)
        cast = learner.book.cast(YARD.layout())
        learner.learn_one(Contacts.of(cast, contacts.relations, now[None]), now, after, stays)
    found = learner.book.pair
    assert found is not None
    assert [law.formula(6) for axis in found.axes for law in axis] == ["max(u_n, 0)", "max(0, u_t - 0.5 J_n)"]
    assert dict(found.surfaces) == ({("disc", "belt"): pytest.approx(speed, abs=1e-9)} if speed else {})
    for _ in range(20):  # and it says of others what comes next
        now, after, contacts = yard_step(book, rng)
        cast = learner.book.cast(YARD.layout())
        motion = learner.book.motion(Contacts.of(cast, contacts.relations, now[None]), now[None])
        at = YARD.layout().places["a", "vx"]
        assert motion.known[0, 0]
        np.testing.assert_allclose(motion.velocity[:, 0, 0], after[at : at + 3], atol=1e-9)


def test_speeds_of_surfaces_by_hand() -> None:
    """Most of what ends on the second kind's belt ends at 0.3; on the first kind's floor all is explained."""
    names = (("disc", "floor"), ("disc", "belt"), ("block", "belt"))
    kinds = np.array([0] * 6 + [1] * 8 + [2] * 3)
    ends = np.array([0.0] * 6 + [0.3] * 5 + [0.7, -0.2, 0.1] + [0.3, 0.5, 0.6])
    after, n = np.stack([np.zeros(17), ends]), np.zeros((2, 17))
    explained = kinds == 0

    def found(push: float = 0.01, tolerance: float = 1e-6, ends: np.ndarray = after) -> dict[int, float]:
        return _running(_Seen(n, n, ends, np.full(17, push), kinds, tolerance), explained, names)

    assert found() == {1: 0.3, 2: 0.3}  # all that touch it are taken along
    assert found(push=0.0) == {}  # nothing holds them
    assert found(tolerance=0.0031) == {}  # it hardly moves: less than a hundred tolerances
    apart = after.copy()
    apart[1, 8:11] = [0.31, 0.32, 0.33]
    assert found(ends=apart) == {}  # three alike are a coincidence
    assert _running(_Seen(n, n, after, np.full(17, 0.01), kinds, 1e-6), np.ones(17, dtype=bool), names) == {}


@pytest.mark.slow
@pytest.mark.parametrize("elasticity", [0.0, 0.8])
@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("seed", [410, 411, 412, 413, 414])
def test_pushing(friction: float, elasticity: float, seed: int) -> None:
    setting = Setting(("box",) * (2 + seed % 3), friction, elasticity)
    found = tally(learned(body_rooms(setting, 100, seed=seed)).book, body_rooms(setting, 20, seed=510))
    assert found.right_share >= 99.9
    assert found.wrong_share <= 0.05
