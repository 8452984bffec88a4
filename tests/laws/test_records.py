from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from relgym.laws.records import ONE, ZERO, AxisLaw, Bound, FreeLaw, PairLaw, Piece, Region, Share, combined

FREE, BOUNCE = Piece((("u_n", 1.0),)), Piece((("v_n", -0.9),))
FRICTION = Piece((("u_t", 1.0), ("J_n", -0.2)))


def test_a_piece_is_a_weighted_sum() -> None:
    piece = Piece((("u", 2.0), (ONE, 0.5)))
    assert piece.values({"u": np.array([1.0, -1.0])}, np.zeros(2)).tolist() == [2.5, -1.5]
    assert ZERO.values({}, np.zeros(2)).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("piece", "text"),
    [(BOUNCE, "-0.9 v_n"), (FRICTION, "u_t - 0.2 J_n"), (ZERO, "0"), (Piece(((ONE, -2.0),)), "-2")],
)
def test_pieces_as_text(piece: Piece, text: str) -> None:
    assert piece.formula() == text


def test_weights_of_one_are_no_parameters() -> None:
    assert [p.free_parameters() for p in (FREE, BOUNCE, FRICTION, ZERO)] == [0, 1, 1, 0]


def test_letting_go_is_free_motion_plus_impulses() -> None:
    assert FREE.releases("u_n")
    assert FRICTION.releases("u_t")
    assert not BOUNCE.releases("u_n")
    assert not Piece((("u_t", 1.0), ("v_t", -0.2))).releases("u_t")


def test_maximum_and_minimum() -> None:
    one, two = np.array([1.0, -1.0]), np.array([0.0, 0.0])
    assert combined("max", [one, two]).tolist() == [1.0, 0.0]
    assert combined("min", [one, two]).tolist() == [0.0, -1.0]
    law = AxisLaw((FREE, BOUNCE), "max", (("ball", "box"),))
    assert law.formula() == "max(u_n, -0.9 v_n)"
    features = {"u_n": np.array([-1.0, 2.0]), "v_n": np.array([-1.0, 2.0])}
    assert law.values(features, np.zeros(2)).tolist() == [0.9, 2.0]


def test_what_fails_on_its_own_examples_is_not_trusted() -> None:
    assert AxisLaw((FREE,), "max", (), examples=100, unexplained=2).trusted()
    assert not AxisLaw((FREE,), "max", (), examples=100, unexplained=3).trusted()


def test_kinds_never_seen_obey_the_law_of_all_or_none() -> None:
    one, other = ("ball", "floor"), ("ball", "ice")
    floor, ice = (AxisLaw((FREE,), "max", (kind,)) for kind in (one, other))
    assert PairLaw("contact", ((floor,),), 0.0).law_of(0, ("ball", "wall")) is floor
    assert PairLaw("contact", ((floor, ice),), 0.0).law_of(0, other) is ice
    assert PairLaw("contact", ((floor, ice),), 0.0).law_of(0, ("ball", "wall")) is None


def test_grips_of_kinds_never_seen_are_those_of_all_or_none() -> None:
    floor, ice, wall = (("ball", name) for name in ("floor", "ice", "wall"))
    assert math.isnan(PairLaw("point", (), 0.0).grip(floor))
    alike = PairLaw("point", (), 0.0, ((floor, 1 / 3), (ice, 1 / 3 + 1e-9)))
    assert alike.grip(wall) == 1 / 3
    different = PairLaw("point", (), 0.0, ((floor, 0.5), (ice, 1 / 3)))
    assert [different.grip(kind) for kind in (floor, ice)] == [0.5, 1 / 3]
    assert math.isnan(different.grip(wall))


def test_laws_survive_json() -> None:
    law = AxisLaw(
        (FREE, BOUNCE), "max", (("ball", "box"),), (("min", (FRICTION, ZERO)),), (False, True), 7, 1, 50.5
    )
    pair = PairLaw("contact", ((law,), (law, law)), 3.0, ((("ball", "box"), 0.25),))
    assert (pair.examples, pair.unexplained) == (7, 3)
    assert PairLaw.from_json(json.loads(json.dumps(pair.to_json()))) == pair
    free = FreeLaw("ball", (FREE, ZERO), 3, 1, 2.0)
    assert FreeLaw.from_json(json.loads(json.dumps(free.to_json()))) == free


def test_shares_as_text() -> None:
    assert Share("mass").formula() == "mass_B / (mass_A + mass_B)"
    assert Share("extent", 2).formula() == "extent_B^2 / (extent_A^2 + extent_B^2)"
    assert Share(constant=0.25).formula() == "0.25"


# ---------------------------------------------------------------------- surfaces that run
BELT, SIDE = ("box", "belt"), ("box", "side")


def running(*surfaces: tuple[tuple[str, str], float]) -> PairLaw:
    law = AxisLaw((FREE, ZERO), "max", (BELT, SIDE))
    return PairLaw("point", ((law,), (law,)), 10.0, surfaces=surfaces)


def test_surfaces_run_by_kind_of_contact() -> None:
    law = running((BELT, 0.5))
    assert law.running([BELT, SIDE]).tolist() == [0.5, 0.0]
    assert law.running([]).tolist() == []
    assert running().running([BELT]).tolist() == [0.0]


def test_on_a_belt_that_runs_for_others_a_new_type_runs_too() -> None:
    ball, belt = ("ball", "belt"), ("rod", "belt")
    law = running((BELT, 0.5), (belt, 0.5 * (1 + 1e-9)))
    assert law.running([ball]).tolist() == [0.5]
    assert law.running([("belt", "ball")]).tolist() == [0.0]  # what runs is the second body
    apart = running((BELT, 0.5), (belt, 0.6))
    assert math.isnan(apart.running([ball])[0])  # who is right isn't known
    assert apart.running([BELT, belt]).tolist() == [0.5, 0.6]


def test_surfaces_are_saved_and_said() -> None:
    law = running((BELT, 0.5), (SIDE, -0.25))
    assert PairLaw.from_json(json.loads(json.dumps(law.to_json()))) == law
    assert "surfaces" not in running().to_json()
    assert law.says() != running((BELT, 0.5)).says() != running().says()
    assert law.says() == running((BELT, 0.5 * (1 + 1e-12)), (SIDE, -0.25)).says()


# ---------------------------------------------------------------------- what is trusted
def test_a_law_is_trusted_up_to_two_of_a_hundred_and_not_where_it_is_doubted() -> None:
    law = AxisLaw((FREE,), "max", (BELT, SIDE), examples=100, unexplained=2)
    assert law.trusted() and law.trusted(SIDE)
    assert not AxisLaw((FREE,), "max", (BELT,), examples=100, unexplained=3).trusted()
    pair = PairLaw("normal", ((law,), (law,)), 1.0)
    doubting = pair.doubting([SIDE, ("ball", "belt")])
    for axis in doubting.axes:
        assert axis[0].doubted == (SIDE,)  # of others it says nothing anyhow
        assert axis[0].trusted(BELT) and not axis[0].trusted(SIDE)
    assert doubting.doubting([SIDE]) == doubting
    assert doubting.says() != pair.says()


def test_which_law_and_grip_hold_for_a_kind() -> None:
    one, other = AxisLaw((FREE,), "max", (BELT,)), AxisLaw((BOUNCE,), "max", (SIDE,))
    apart = PairLaw("normal", ((one, other), (one,)), 1.0, grips=((BELT, 0.5), (SIDE, 0.5 + 1e-9)))
    assert apart.law_of(0, SIDE) == other
    assert apart.law_of(0, ("ball", "belt")) is None
    assert apart.law_of(1, ("ball", "belt")) == one  # all obey it
    assert apart.grip(("ball", "belt")) == 0.5
    differ = PairLaw("normal", ((one,), (one,)), 1.0, grips=((BELT, 0.5), (SIDE, 0.6)))
    assert differ.grip(SIDE) == 0.6 and math.isnan(differ.grip(("ball", "belt")))
    assert math.isnan(running().grip(BELT))
    assert (apart.examples, apart.unexplained) == (0, 0)
    counted = PairLaw(
        "normal",
        (
            (AxisLaw((FREE,), "max", (BELT,), examples=7, unexplained=1),) * 2,
            (AxisLaw((FREE,), "max", (BELT,), examples=9, unexplained=2),),
        ),
        1.0,
    )
    assert (counted.examples, counted.unexplained) == (14, 4)


# ---------------------------------------------------------------------- regions
def test_between_the_bounds_of_a_region_nothing_is_known() -> None:
    region = Region((Bound("px", True, 1.0, 2.0), Bound("py", False, 3.0, 4.0)), (FREE,))
    px = np.array([2.0, 1.5, 1.0, 2.0, 2.0, 1.5])
    py = np.array([3.0, 3.0, 3.0, 3.5, 4.0, 4.0])
    inside, outside = region.where({"px": px, "py": py})
    assert inside.tolist() == [True, False, False, False, False, False]
    assert outside.tolist() == [False, False, True, False, True, True]
    assert region.text() == "px >= 2 (else px <= 1) and py <= 3 (else py >= 4)"


def test_the_first_region_that_surely_holds_counts() -> None:
    wind, gale = (Piece((("vx", 1.0), (ONE, x))) for x in (0.1, 0.7))
    regions = (
        Region((Bound("px", True, 0.0, 1.0),), (wind,)),
        Region((Bound("px", True, 4.0, 5.0),), (gale,)),
    )
    law = FreeLaw("ball", (Piece((("vx", 1.0),)),), regions=regions)
    for px, piece in ((-1.0, law.components[0]), (0.5, law.components[0]), (1.0, wind), (6.0, wind)):
        assert law.at({"px": np.array([px])}) == (piece,)
    assert law.reads() == {"vx", "px"}
    assert law.first(0).regions[1].components == ()
    moved = FreeLaw(
        "ball", law.components, 9, 1, 7.0, (Region((Bound("px", True, 0.5, 0.6),), (wind,)), regions[1])
    )
    assert moved.says() == law.says()  # where exactly it ends is no other statement
    below = FreeLaw(
        "ball", law.components, regions=(Region((Bound("px", False, 0.0, 1.0),), (wind,)), regions[1])
    )
    assert below.says() != law.says()


def test_who_is_known_from_doubted_kinds_alone_is_doubted_with_others_too() -> None:
    kinds = (("box", "wall"), ("box", "belt"))
    law = AxisLaw((FREE,), "max", kinds, examples=100, doubted=(("box", "belt"),))
    assert law.trusted(("box", "wall")) and not law.trusted(("box", "belt"))
    assert not law.trusted(("disc", "belt"))  # never seen: whatever the belt does to boxes
    assert law.trusted(("disc", "wall"))
    assert not law.trusted(("box", "disc"))  # to a box a disc may be like the wall or like the belt
    assert law.trusted(("disc", "tee"))  # of both nothing is known that would speak against it
    assert AxisLaw((FREE,), "max", kinds, examples=100).trusted(("disc", "belt"))


def test_what_is_doubted_says_nothing_against_the_rest() -> None:
    kinds = (("ball", "box"), ("ball", "floor"))
    law = AxisLaw((FREE,), "max", kinds, examples=7, unexplained=3, doubted=kinds[1:], excused=3)
    assert law.trusted(kinds[0]) and not law.trusted(kinds[1]) and not law.trusted(("ball", "ramp"))
    assert AxisLaw.from_json(law.to_json()) == law
    assert not replace(law, excused=2).trusted(kinds[0])
