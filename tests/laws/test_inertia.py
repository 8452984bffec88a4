"""Masses and moments from what single contacts did, by hand."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relgym.laws.inertia import (
    AREA,
    NOTHING,
    SQUARE,
    Gyration,
    Inertia,
    Mass,
    Pushes,
    find_gyrations,
    find_mass,
    ratios,
)
from relgym.laws.records import ONE, Piece

TOLERANCE = 1e-9


def pushes(
    change: np.ndarray,
    features: dict[str, np.ndarray],
    types: list[str],
    objects: list[str] | None = None,
    *,
    turn: np.ndarray | None = None,
    torque: np.ndarray | None = None,
    reach: np.ndarray | None = None,
) -> Pushes:
    n = change.shape[1]
    numbers = [np.zeros(n) if each is None else each for each in (turn, torque)]
    return Pushes(
        change,
        *numbers,
        np.ones(n) if reach is None else reach,
        features,
        np.array(types),
        np.array(types if objects is None else objects),
    )


def met(
    masses_a: np.ndarray, masses_b: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """What equal and opposite impulses change the velocities of two bodies by."""
    impulse = rng.normal(size=(2, len(masses_a)))
    return impulse / masses_a, -impulse / masses_b


def seen(rng: np.random.Generator, n: int, **more: np.ndarray) -> dict[str, np.ndarray]:
    return {AREA: rng.uniform(0.5, 2.0, n), SQUARE: rng.uniform(0.1, 0.4, n)} | more


# ---------------------------------------------------------------------- masses
def test_a_mass_is_a_product_of_powers_times_a_constant() -> None:
    features = {"sx": np.array([1.0, 2.0, 3.0]), "rho": np.array([5.0, 7.0, 9.0])}
    names = ["ball", "box", "ball"]
    assert Mass((("sx", 2), ("rho", 1))).values(features, names).tolist() == [5.0, 28.0, 81.0]
    by_type = Mass((("sx", 1),), "type", (("ball", 1.0), ("box", 0.25)))
    assert by_type.values(features, names).tolist() == [1.0, 0.5, 3.0]
    assert np.isnan(by_type.values(features, ["ball", "wedge", "ball"])).tolist() == [False, True, False]
    assert np.isnan(Mass((("weight", 1),)).values(features, names)).all()
    assert Mass(()).values({}, ["x", "y"]).tolist() == [1.0, 1.0]


@pytest.mark.parametrize(
    ("stated", "law"),
    [
        ((), lambda f: np.ones(len(f["sx"]))),
        (((AREA, 1),), lambda f: 3.0 * f[AREA]),
        ((("sx", 3),), lambda f: f["sx"] ** 3),
        ((("sx", 1), ("sy", 1)), lambda f: 0.1 * f["sx"] * f["sy"]),
    ],
)
def test_masses_that_follow_from_what_is_seen(
    stated: tuple[tuple[str, int], ...], law: object, rng: np.random.Generator
) -> None:
    one, two = (seen(rng, 40, sx=rng.uniform(1, 2, 40), sy=rng.uniform(1, 2, 40)) for _ in "ab")
    a, b = met(law(one), law(two), rng)  # type: ignore[operator]
    found = find_mass(pushes(a, one, ["box"] * 40), pushes(b, two, ["box"] * 40), TOLERANCE)
    assert found == Mass(stated, examples=40)


def test_masses_by_type_of_those_that_met(rng: np.random.Generator) -> None:
    """Boxes are three times as heavy as balls; no feature says so, and one constant for each type is shorter."""
    one, two = seen(rng, 30), seen(rng, 30)
    types_a, types_b = (["ball"] * 15 + ["box"] * 15, ["box"] * 20 + ["ball"] * 10)
    mass = {"ball": 2.0, "box": 6.0}
    a, b = met(np.array([mass[t] for t in types_a]), np.array([mass[t] for t in types_b]), rng)
    found = find_mass(pushes(a, one, types_a), pushes(b, two, types_b), TOLERANCE)
    assert found is not None
    assert (found.factors, found.by, found.examples, found.unexplained) == ((), "type", 30, 0)
    assert dict(found.constants) == pytest.approx({"ball": 1.0, "box": 3.0})


def test_masses_by_object_are_found_along_chains(rng: np.random.Generator) -> None:
    """x met y, and y met z: that tells the mass of all three."""
    mass = {"x": 1.0, "y": 2.5, "z": 0.5}
    first, second = ["x", "y"] * 10, ["y", "z"] * 10
    a, b = met(np.array([mass[n] for n in first]), np.array([mass[n] for n in second]), rng)
    kinds = ["box"] * 20
    found = find_mass(
        pushes(a, seen(rng, 20), kinds, first), pushes(b, seen(rng, 20), kinds, second), TOLERANCE
    )
    assert found is not None
    assert (found.factors, found.by) == ((), "object")
    assert dict(found.constants) == pytest.approx(mass)


def test_few_contacts_and_those_that_fit_nothing_tell_no_mass(rng: np.random.Generator) -> None:
    for n, told in ((3, False), (4, True)):
        a, b = met(np.ones(n), np.ones(n), rng)
        found = find_mass(
            pushes(a, seen(rng, n), ["ball"] * n), pushes(b, seen(rng, n), ["ball"] * n), TOLERANCE
        )
        assert (found is not None) is told
    anyhow = rng.uniform(1.0, 9.0, 40)
    a, b = met(anyhow, np.ones(40), rng)
    assert (
        find_mass(pushes(a, seen(rng, 40), ["ball"] * 40), pushes(b, seen(rng, 40), ["box"] * 40), TOLERANCE)
        is None
    )


def test_gentle_touches_are_no_evidence(rng: np.random.Generator) -> None:
    """Of a change of less than a hundred tolerances rounding makes too much."""
    a, b = met(np.ones(20), np.full(20, 2.0), rng)
    a[:, 5:] *= 1e-8
    b[:, 5:] = 3.0 * a[:, 5:]  # with the sign of a pull, too
    kinds = (["ball"] * 20, ["box"] * 20)
    found = find_mass(pushes(a, seen(rng, 20), kinds[0]), pushes(b, seen(rng, 20), kinds[1]), TOLERANCE)
    assert found is not None
    assert found.examples == 5
    assert dict(found.constants) == pytest.approx({"ball": 1.0, "box": 2.0})


def test_one_contact_in_fifty_may_be_another_matter(rng: np.random.Generator) -> None:
    for wrong, told in ((2, True), (3, False)):
        one, two = seen(rng, 100), seen(rng, 100)
        a, b = met(one[AREA], two[AREA], rng)
        a[:, :wrong] *= 1.5
        found = find_mass(pushes(a, one, ["box"] * 100), pushes(b, two, ["box"] * 100), TOLERANCE)
        assert (found is not None) is told
        assert found is None or (found.factors, found.unexplained) == (((AREA, 1),), wrong)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 10.0))
def test_which_body_comes_first_is_no_matter(seed: int, heavier: float) -> None:
    rng = np.random.default_rng(seed)
    one, two = seen(rng, 20), seen(rng, 20)
    a, b = met(np.ones(20), np.full(20, heavier), rng)
    sides = pushes(a, one, ["ball"] * 20), pushes(b, two, ["box"] * 20)
    found, back = find_mass(*sides, TOLERANCE), find_mass(*reversed(sides), TOLERANCE)
    assert found is not None and back is not None
    assert (found.factors, found.by) == (back.factors, back.by)
    assert dict(found.constants) == pytest.approx(dict(back.constants))
    values = dict(found.constants) or {"ball": 1.0, "box": 1.0}
    assert values["box"] / values["ball"] == pytest.approx(heavier, rel=1e-6)


# ---------------------------------------------------------------------- moments
def turned(
    gyration: np.ndarray, features: dict[str, np.ndarray], types: list[str], rng: np.random.Generator
) -> Pushes:
    """Bodies pushed at an arm: the torque over the mass is the moment over the mass times the change of the spin."""
    n = len(types)
    arm, change = rng.normal(size=(2, n)), rng.normal(size=(2, n))
    torque = arm[0] * change[1] - arm[1] * change[0]
    return pushes(change, features, types, turn=torque / gyration, torque=torque, reach=np.hypot(*arm))


def test_a_body_of_even_density_turns_as_its_shape_says(rng: np.random.Generator) -> None:
    features = seen(rng, 30)
    (found,) = find_gyrations(turned(features[SQUARE], features, ["box"] * 30, rng), TOLERANCE, rng=rng)
    assert found == Gyration(("box",), Piece(((SQUARE, 1.0),)), whole=True, examples=30)


def test_a_hollow_one_is_harder_to_turn(rng: np.random.Generator) -> None:
    features = seen(rng, 30)
    (found,) = find_gyrations(turned(2.0 * features[SQUARE], features, ["box"] * 30, rng), TOLERANCE, rng=rng)
    assert found.piece is not None and found.whole
    ((name, weight),) = found.piece.terms
    assert (name, weight) == (SQUARE, pytest.approx(2.0))


def test_a_number_for_each_type_and_what_never_turns(rng: np.random.Generator) -> None:
    types = ["box"] * 20 + ["rod"] * 20 + ["sledge"] * 20 + ["rare"] * 3
    gyration = np.array([0.5] * 20 + [2.0] * 20 + [np.inf] * 20 + [1.0] * 3)
    found = {
        g.types: g for g in find_gyrations(turned(gyration, seen(rng, 63), types, rng), TOLERANCE, rng=rng)
    }
    assert set(found) == {("rod",), ("box",), ("sledge",)}  # three contacts found nothing
    assert found["sledge",].piece is None
    for name, expected in (("box", 0.5), ("rod", 2.0)):
        piece = found[name,].piece
        assert piece is not None
        assert piece.terms == ((ONE, pytest.approx(expected)),)
        assert not found[name,].whole  # a constant is a matter of the type


def test_a_sum_of_two_terms_is_found(rng: np.random.Generator) -> None:
    """A bob of its own moment beside the shape's: 0.75 of the shape's mean square and 0.125 of what is seen."""
    features = seen(rng, 40, load=rng.uniform(1.0, 3.0, 40))
    truth = 0.75 * features[SQUARE] + 0.125 * features["load"]
    (found,) = find_gyrations(turned(truth, features, ["box"] * 40, rng), TOLERANCE, rng=rng)
    assert found.piece is not None and found.unexplained == 0
    assert dict(found.piece.terms) == pytest.approx({SQUARE: 0.75, "load": 0.125})


def test_lengths_count_by_their_squares(rng: np.random.Generator) -> None:
    """Of a rod of length s, however wide it is drawn, s^2 / 12."""
    features = seen(rng, 40, sx=rng.uniform(1.0, 3.0, 40))
    (found,) = find_gyrations(
        turned(features["sx"] ** 2 / 12.0, features, ["rod"] * 40, rng), TOLERANCE, rng=rng
    )
    assert found.piece is not None
    assert found.piece.terms == (("sx^2", pytest.approx(1 / 12)),)


def test_ratios_of_what_is_seen_but_of_no_shapes() -> None:
    features = {"m": np.array([2.0, 0.0]), "I": np.array([6.0, 1.0]), AREA: np.ones(2), "sx": np.ones(2)}
    found = ratios(features)
    assert set(found) == {*features, "m/I", "I/m"}
    assert found["m/I"].tolist() == [1 / 3, 0.0]
    assert found["I/m"][0] == 3.0 and np.isnan(found["I/m"][1])


# ---------------------------------------------------------------------- what is known
KNOWN = Inertia(
    Mass((("sx", 2), ("rho", 1)), "type", (("ball", 1.0), ("box", 0.25)), 30, 1),
    (
        Gyration(("box", "rod"), Piece(((SQUARE, 2.0), (ONE, 0.5))), False, 12, 0),
        Gyration(("sledge",), None, False, 9, 1),
    ),
)


def test_saved_and_told() -> None:
    assert Inertia.from_json(json.loads(json.dumps(KNOWN.to_json()))) == KNOWN
    assert Inertia.from_json(NOTHING.to_json()) == NOTHING
    assert KNOWN.sentences() == (
        "masses go as sx^2 rho; by type, times ball: 1, box: 0.25",
        "moment over mass of box, rod: 2 shape.r2 + 0.5",
        "moment over mass of sledge: infinite",
    )
    assert Inertia(Mass(()), (Gyration(("a",), Piece(((SQUARE, 1.0),)), True),)).sentences() == (
        "masses go as 1",
        "moment over mass: shape.r2",
    )


def test_whose_moment_is_known() -> None:
    assert KNOWN.gyration("box") == KNOWN.gyrations[0]
    assert KNOWN.gyration("sledge") == KNOWN.gyrations[1]
    assert KNOWN.gyration("wheel") is None
    general = Inertia(None, (Gyration(("box",), Piece(((SQUARE, 1.0),)), True),))
    assert general.gyration("wheel") == general.gyrations[0]


def test_rounding_and_examples_change_nothing_that_is_said() -> None:
    more = Inertia(
        Mass((("sx", 2), ("rho", 1)), "type", (("ball", 1.0), ("box", 0.25 * (1 + 1e-9))), 99, 2),
        KNOWN.gyrations,
    )
    assert more.says() == KNOWN.says()
    assert Inertia(KNOWN.mass, KNOWN.gyrations[:1]).says() != KNOWN.says()
    assert NOTHING.says() != KNOWN.says()
