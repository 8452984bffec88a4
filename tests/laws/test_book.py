"""What laws written by hand say of contacts that are worked out by hand: resting, sliding, belts, hits and winds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relgym.laws.book import LawBook, Motion
from relgym.laws.columns import Sources, vector_types
from relgym.laws.inertia import AREA, NOTHING, SQUARE, Gyration, Inertia, Mass
from relgym.laws.records import ONE, ZERO, AxisLaw, Bound, FreeLaw, PairLaw, Piece, Region
from relgym.laws.touching import Contacts
from relgym.scene.objects import POSE, Kinematics, ObjectType, Target
from relgym.scene.relations import Extractor
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere

MOVING = (*POSE, "vx", "vy", "spin")
BLOCK = ObjectType("block", MOVING, Box(), velocity=("vx", "vy", None))
DISC = ObjectType("disc", MOVING, Sphere(), velocity=("vx", "vy", None))
BELT = ObjectType("belt", POSE, Box())
TARGETS = tuple(Target(t, v) for t in ("block", "disc") for v in ("vx", "vy", "spin"))
RATES = tuple(
    Kinematics(t, p, v) for t in ("block", "disc") for p, v in (("px", "vx"), ("py", "vy"), ("rz", "spin"))
)
KINDS = (("block", "belt"), ("disc", "belt"), ("block", "block"), ("block", "disc"))
FALL = 0.01


def schema_of(**objects: str) -> SceneSchema:
    return SceneSchema(
        (BLOCK, DISC, BELT), tuple(objects.items()), planar=True, kinematics=RATES, targets=TARGETS
    )


def law_of(*pieces: Piece, **more: object) -> tuple[AxisLaw]:
    return (AxisLaw(pieces, "max", KINDS, examples=100, **more),)  # type: ignore[arg-type]


REST = law_of(Piece((("u_n", 1.0),)), ZERO)
BOUNCE = law_of(Piece((("u_n", 1.0),)), Piece((("v_n", -0.5),)))
SMOOTH = law_of(Piece((("u_t", 1.0),)))
ROUGH = law_of(Piece((("u_t", 1.0), ("J_n", -0.5))), ZERO)


def book_of(
    schema: SceneSchema,
    normal: tuple[AxisLaw],
    slip: tuple[AxisLaw],
    *,
    fall: float = 0.0,
    belt: float = 0.0,
    inertia: Inertia | None = None,
) -> LawBook:
    """Bodies of even density, whose mass goes with their area."""
    book = LawBook(schema, {t.name: Sources.of(schema, t, TARGETS) for t in vector_types(schema, TARGETS)})
    down = Piece((("vy", 1.0), *([(ONE, -fall)] if fall else [])))
    free = (Piece((("vx", 1.0),)), down, Piece((("spin", 1.0),)))
    book.free = {name: FreeLaw(name, free) for name in ("block", "disc")}
    surfaces = ((("block", "belt"), belt),) if belt else ()
    book.pair = PairLaw("point", (normal, slip), 1.0, surfaces=surfaces)
    even = Inertia(Mass(((AREA, 1),)), (Gyration(("block", "disc"), Piece(((SQUARE, 1.0),)), whole=True),))
    book.inertia = even if inertia is None else inertia
    book.tolerance = 1e-12
    return book


def placed(x: float, y: float, width: float, height: float, motion: tuple[float, ...] = ()) -> list[float]:
    """A body's numbers: where it is, how large, and how it moves."""
    return [x, y, 0.0, 0.0, 0.0, 0.0, width, height, 1.0, *motion]


def moved(book: LawBook, **objects: list[float]) -> Motion:
    """What the laws say of one scene."""
    scene = book.schema.scene(objects)
    vectors = scene.vector[None]
    relations = Extractor(book.schema).extract(scene.layout, vectors)
    return book.motion(Contacts.of(book.cast(scene.layout), relations, vectors), vectors)


def told(motion: Motion, body: int = 0) -> list[float]:
    """Velocity and spin of a body, of which the laws are sure."""
    assert motion.known[0, body]
    return motion.velocity[:, 0, body].tolist()


FLOOR = placed(0.0, -0.5, 20.0, 1.0)


def on_floor(book: LawBook, vx: float, vy: float = 0.0) -> Motion:
    return moved(book, a=placed(0.0, 0.5, 1.0, 1.0, (vx, vy, 0.0)), floor=FLOOR)


# ---------------------------------------------------------------------- on the ground
GROUND = schema_of(a="block", floor="belt")


def test_a_block_rests_slides_and_stops() -> None:
    # Falling by 0.01 a step the floor pushes it by as much, and friction takes half of that.
    book = book_of(GROUND, REST, ROUGH, fall=FALL)
    for before, after in ((0.0, 0.0), (0.3, 0.295), (-0.3, -0.295), (0.004, 0.0)):
        assert told(on_floor(book, before)) == pytest.approx([after, 0.0, 0.0], abs=1e-14)
    assert told(on_floor(book, 0.3, vy=0.2)) == pytest.approx([0.3, 0.19, 0.0])  # it leaves
    assert told(on_floor(book, 0.3, vy=-0.2)) == pytest.approx([0.3 - 0.5 * 0.21, 0.0, 0.0])


def test_a_belt_takes_along_what_lies_on_it() -> None:
    """It runs along the turned normal, which points to the left where the normal points up."""
    book = book_of(GROUND, REST, ROUGH, fall=FALL, belt=0.1)
    for before, after in (
        (0.0, -0.005),
        (-0.098, -0.1),
        (-0.1, -0.1),
        (-0.102, -0.1),
        (-0.2, -0.195),
        (0.3, 0.295),
    ):
        assert told(on_floor(book, before)) == pytest.approx([after, 0.0, 0.0], abs=1e-14)
    smooth = book_of(GROUND, REST, SMOOTH, fall=FALL, belt=0.1)
    assert told(on_floor(smooth, 0.3)) == pytest.approx([0.3, 0.0, 0.0])


def test_a_disc_rolls_off_what_it_slides() -> None:
    # Of even density g = r^2 / 2, so that at its rim a disc is three times as easy to move as at its centre. Without
    # slip in the end it has two thirds of its speed and rolls backwards, clockwise, at v / r.
    schema = schema_of(a="disc", floor="belt")
    book = book_of(schema, REST, law_of(ZERO), fall=FALL)
    found = moved(book, a=placed(0.0, 0.5, 1.0, 1.0, (0.3, 0.0, 0.0)), floor=FLOOR)
    assert told(found) == pytest.approx([0.2, 0.0, -0.4])
    # Friction that is not enough: 0.005 of speed, and 0.005 r / g = 0.02 of spin.
    found = moved(replaced(book, ROUGH), a=placed(0.0, 0.5, 1.0, 1.0, (0.3, 0.0, 0.0)), floor=FLOOR)
    assert told(found) == pytest.approx([0.295, 0.0, -0.02])


def replaced(book: LawBook, slip: tuple[AxisLaw]) -> LawBook:
    assert book.pair is not None
    other = book.on(book.schema, TARGETS)
    other.pair = replace(book.pair, axes=(book.pair.axes[0], slip))
    return other


# ---------------------------------------------------------------------- one body hits another
PAIR = schema_of(a="block", b="block")


@pytest.mark.parametrize(
    ("normal", "width", "after"),
    [
        # Face to face at 0.2; masses 1 and w. Stuck together they have 0.2 / (1 + w); if half of the speed comes
        # back, the first one has 0.2 (1 - w / 2) / (1 + w), the second one 0.3 / (1 + w).
        (REST, 1.0, (0.1, 0.1)),
        (REST, 2.0, (0.2 / 3, 0.2 / 3)),
        (BOUNCE, 1.0, (0.05, 0.15)),
        (BOUNCE, 2.0, (0.0, 0.1)),
        (BOUNCE, 4.0, (-0.04, 0.06)),
    ],
)
def test_a_block_hits_a_block_in_the_middle(
    normal: tuple[AxisLaw], width: float, after: tuple[float, float]
) -> None:
    book = book_of(PAIR, normal, SMOOTH)
    found = moved(
        book,
        a=placed(0.0, 0.0, 1.0, 1.0, (0.2, 0.05, 0.0)),
        b=placed(0.5 + 0.5 * width, 0.0, width, 1.0, (0.0, 0.0, 0.0)),
    )
    assert told(found, 0) == pytest.approx([after[0], 0.05, 0.0], abs=1e-14)
    assert told(found, 1) == pytest.approx([after[1], 0.0, 0.0], abs=1e-14)
    assert found.touched.all()


@pytest.mark.parametrize("d", [0.0, 0.25, -0.4])
def test_a_disc_hits_a_block_beside_its_middle(d: float) -> None:
    # A disc of mass π/4 falls at 0.1 on the top of a block of mass 1 with g = 1/6, at a distance d from its middle.
    # What an impulse J changes there is J (4/π + 1 + 6 d^2).
    book = book_of(schema_of(a="block", b="disc"), REST, SMOOTH)
    found = moved(
        book,
        a=placed(0.0, 0.0, 1.0, 1.0, (0.0, 0.0, 0.0)),
        b=placed(d, 1.0, 1.0, 1.0, (0.0, -0.1, 0.3)),
    )
    push = 0.1 / (4.0 / np.pi + 1.0 + 6.0 * d * d)
    assert told(found, 0) == pytest.approx([0.0, -push, -6.0 * d * push], abs=1e-14)
    assert told(found, 1) == pytest.approx([0.0, -0.1 + 4.0 / np.pi * push, 0.3], abs=1e-14)


def test_what_passes_between_bodies_is_kept() -> None:
    """Momentum, and turning momentum about the origin, whatever the law is."""
    schema, rng = schema_of(a="block", b="disc"), np.random.default_rng(0)
    for slip in (SMOOTH, ROUGH, law_of(ZERO)):
        book = book_of(schema, BOUNCE, slip)
        for _ in range(10):
            d, width = rng.uniform(-0.4, 0.4), rng.uniform(0.9, 2.0)
            before = rng.normal(size=(2, 3))
            before[1, 1] = -abs(before[1, 1]) - 5.0
            a, b = placed(0.0, 0.0, width, 1.0, tuple(before[0])), placed(d, 1.0, 1.0, 1.0, tuple(before[1]))
            after = moved(book, a=a, b=b).velocity[:, 0].T
            masses = np.array([width, np.pi / 4])
            moments = masses * [(width**2 + 1.0) / 12.0, 1.0 / 8.0]
            arms = np.array([[0.0, 0.0], [d, 1.0]])

            assert kept(after, masses, moments, arms) == pytest.approx(
                kept(before, masses, moments, arms), abs=1e-12
            )
            assert not np.allclose(after, before)


def kept(v: np.ndarray, masses: np.ndarray, moments: np.ndarray, arms: np.ndarray) -> list[float]:
    """Momentum and turning momentum of bodies with rows (vx, vy, spin)."""
    turning = arms[:, 0] * v[:, 1] - arms[:, 1] * v[:, 0]
    return [*(masses @ v[:, :2]), float(masses @ turning + moments @ v[:, 2])]


# ---------------------------------------------------------------------- what is not known is not said
def test_nothing_is_said_of_contacts_without_a_law_or_a_mass() -> None:
    for book in (
        book_of(PAIR, REST, SMOOTH, inertia=NOTHING),
        book_of(
            PAIR, law_of(Piece((("u_n", 1.0),)), ZERO, unexplained=3), SMOOTH
        ),  # of more than two in a hundred
        book_of(PAIR, law_of(Piece((("u_n", 1.0),)), ZERO, doubted=(("block", "block"),)), SMOOTH),
    ):
        side_by_side = {
            "a": placed(0.0, 0.0, 1.0, 1.0, (0.2, 0.0, 0.0)),
            "b": placed(1.0, 0.0, 1.0, 1.0, (0.0, 0.0, 0.0)),
        }
        found = moved(book, **side_by_side)
        assert not found.known.any() and not found.stated.any()
        side_by_side["b"] = placed(3.0, 0.0, 1.0, 1.0, (0.0, 0.0, 0.0))
        assert told(moved(book, **side_by_side)) == [0.2, 0.0, 0.0]  # apart they are as free as ever


def test_where_laws_that_explain_all_examples_disagree_nothing_is_claimed() -> None:
    other = law_of(
        Piece((("u_n", 1.0),)),
        ZERO,
        alternatives=(("max", (Piece((("u_n", 1.0),)), Piece((("v_t", -0.5),)))),),
    )
    book = book_of(GROUND, other, SMOOTH, fall=FALL)
    assert told(on_floor(book, 0.0)) == pytest.approx([0.0, 0.0, 0.0], abs=1e-14)  # both say so
    found = on_floor(book, 0.3)
    assert found.stated[0, 0] and not found.known[0, 0]
    assert found.velocity[:, 0, 0].tolist() == pytest.approx([0.3, 0.0, 0.0])


# ---------------------------------------------------------------------- free motion
def free_book(*components: Piece, regions: tuple[Region, ...] = ()) -> LawBook:
    book = book_of(schema_of(a="block"), REST, SMOOTH)
    book.free["block"] = FreeLaw("block", components, regions=regions)
    return book


KEPT = tuple(Piece(((name, 1.0),)) for name in ("vx", "vy", "spin"))


def test_resistance_of_the_air_goes_with_the_square_of_the_speed() -> None:
    # |v| is 0.5: of 0.3 and 0.4 a tenth of it is lost.
    book = free_book(
        Piece((("vx", 1.0), ("|v|*vx", -0.2))),
        Piece((("vy", 1.0), ("|v|*vy", -0.2))),
        Piece((("spin", 0.5),)),
    )
    found = moved(book, a=placed(3.0, 7.0, 1.0, 1.0, (0.3, -0.4, 0.25)))
    assert told(found) == pytest.approx([0.27, -0.36, 0.125])


def test_wind_blows_where_it_blows() -> None:
    blown = (Piece((("vx", 1.0), (ONE, 0.125))), *KEPT[1:])
    book = free_book(*KEPT, regions=(Region((Bound("px", True, 1.0, 2.0),), blown),))
    for px, vx in ((0.5, 0.25), (1.0, 0.25), (2.0, 0.375), (9.0, 0.375)):
        assert told(moved(book, a=placed(px, 0.0, 1.0, 1.0, (0.25, 0.0, 0.0)))) == [vx, 0.0, 0.0]
    between = moved(book, a=placed(1.5, 0.0, 1.0, 1.0, (0.25, 0.0, 0.0)))
    assert not between.known[0, 0] and not between.stated[0, 0]


def test_of_a_type_never_seen_its_kin_tell() -> None:
    kin = [ObjectType(name, MOVING, Box(), "thing", velocity=("vx", "vy", None)) for name in ("rod", "crate")]
    targets = tuple(Target(t.name, v) for t in kin for v in MOVING[-3:])
    schema = SceneSchema(tuple(kin), (("a", "rod"), ("b", "crate")), planar=True, targets=targets)
    book = LawBook(schema, {t.name: Sources.of(schema, t, targets) for t in kin})
    assert book.free_law("crate") is None
    book.free["rod"] = FreeLaw("rod", KEPT)
    assert book.free_law("crate") == book.free["rod"]
    alone = book_of(schema_of(a="block"), REST, SMOOTH)
    del alone.free["block"]
    assert alone.free_law("block") is None  # discs are no kin
