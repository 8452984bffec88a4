from __future__ import annotations

import json
import math

import numpy as np
import pytest

from relgym.laws.records import ONE, ZERO, AxisLaw, FreeLaw, PairLaw, Piece, Share, combined

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
