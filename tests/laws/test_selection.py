"""Pieces and how they combine, on contacts made by hand: one axis at a time."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.laws.pieces import AxisExamples, find_pieces, fitted
from relgym.laws.records import ONE, ZERO, Piece
from relgym.laws.selection import fit_axis

NAMES = ("u", "v", "w", "J_n", ONE)
FREE = Piece((("u", 1.0),))


def examples(
    rng: np.random.Generator, n: int, law: str, *, pull: float = 0.01, noise: float = 0.0
) -> AxisExamples:
    """Contacts that obey a law of u, v, w and J; the free motion u is v + pull + a little of w."""
    v, w, push = rng.normal(size=n), rng.normal(size=n), np.abs(rng.normal(size=n))
    u = v + pull * (1.0 + np.abs(w))
    known = {"u": u, "v": v, "w": w, "J": push, "max": np.maximum, "min": np.minimum}
    y = np.asarray(eval(law, {}, known), dtype=np.float64)
    y = y + noise * rng.normal(size=n)
    x = np.stack([u, v, w, push, np.ones(n)], axis=1)
    return AxisExamples(NAMES, x, np.broadcast_to(y, n).copy(), "u", max(1e-12, 6.0 * noise))


@pytest.mark.parametrize(
    ("law", "formula"),
    [
        ("u", "u"),
        ("max(u, -0.9 * v)", "max(u, -0.9 v)"),
        ("max(u, 0 * u)", "max(u, 0)"),
        ("min(u, -0.5 * v)", "min(u, -0.5 v)"),
        ("max(u - 0.2 * J, 0)", "max(0, u - 0.2 J_n)"),
        ("max(u, 0.3 * v - 0.7 * w)", "max(u, 0.3 v - 0.7 w)"),
        ("max(u, v * 0 + 0.25)", "max(u, 0.25)"),
    ],
)
def test_laws_of_one_axis(law: str, formula: str, rng: np.random.Generator) -> None:
    found = fit_axis(examples(rng, 200, law), rng=rng)
    texts = sorted(p.formula(6) for p in found.pieces)
    inside = formula[4:-1].split(", ") if "(" in formula else [formula]
    assert texts == sorted(inside)
    assert found.explained.all()
    assert len(found.pieces) == 1 or found.operator == formula[:3]


@pytest.mark.parametrize("n", [20, 60, 600])
def test_a_rare_piece_is_found_among_many_slides(n: int, rng: np.random.Generator) -> None:
    whole = examples(rng, n, "max(u, -0.9 * v)")
    x = whole.x.copy()
    x[8:, 0], x[8:, 1] = -0.01, 0.0  # slides: at rest along the normal, pulled down
    y = np.maximum(x[:, 0], -0.9 * x[:, 1])
    x[:4, 1] = -np.abs(x[:4, 1])
    x[:4, 0] = x[:4, 1] - 0.01
    y[:4] = -0.9 * x[:4, 1]
    found = fit_axis(AxisExamples(NAMES, x, y, "u", 1e-12), rng=rng)
    assert sorted(p.formula(6) for p in found.pieces) == ["-0.9 v", "u"]


@pytest.mark.parametrize(
    ("law", "piece", "n"), [("-0.9 * v", "-0.9 v", 2), ("0.3 * v - 0.7 * w", "0.3 v - 0.7 w", 3)]
)
def test_an_example_more_than_it_has_numbers_verifies_a_piece(
    law: str, piece: str, n: int, rng: np.random.Generator
) -> None:
    whole = examples(rng, n, law)
    assert piece in [each.formula(6) for each in find_pieces(whole, [FREE, ZERO], rng=rng)]
    assert not find_pieces(whole.rows(np.arange(n - 1)), [FREE, ZERO], rng=rng)
    whole.y[-1] += 1e-6
    assert piece not in [each.formula(6) for each in find_pieces(whole, [FREE, ZERO], rng=rng)]


@pytest.mark.parametrize(("noise", "n", "found"), [(1e-9, 2, True), (1e-2, 2, False), (1e-2, 4, True)])
def test_through_noise_it_takes_more_of_them(
    noise: float, n: int, found: bool, rng: np.random.Generator
) -> None:
    v = np.linspace(-1.0, -0.7, n)
    x = np.stack([v - 0.01, v, rng.normal(size=n), np.full(n, 0.7), np.ones(n)], axis=1)
    y = -0.9 * v + noise * rng.uniform(-1.0, 1.0, n)
    pieces = find_pieces(AxisExamples(NAMES, x, y, "u", 6.0 * noise), [FREE, ZERO], rng=rng)
    assert any(set(dict(piece.terms)) & {"u", "v"} for piece in pieces) == found


def test_ties_stay_open(rng: np.random.Generator) -> None:
    tied = examples(rng, 80, "max(u, -0.9 * v)", pull=0.0)  # nothing pulls: u = v
    found = fit_axis(tied, rng=rng)
    forms = {tuple(sorted(p.formula(4) for p in pieces)) for _, pieces in found.alternatives}
    forms.add(tuple(sorted(p.formula(4) for p in found.pieces)))
    assert {("-0.9 u", "u"), ("-0.9 v", "u")} <= forms


def test_slides_alone_say_nothing_of_bounces(rng: np.random.Generator) -> None:
    n = 50
    x = np.zeros((n, len(NAMES)))
    x[:, 0], x[:, 2], x[:, 4] = -0.01, rng.normal(size=n), 1.0
    found = fit_axis(AxisExamples(NAMES, x, np.zeros(n), "u", 1e-12), rng=rng)
    # The body is let go where it moves away, rather than held for ever.
    assert found.operator == "max"
    assert sorted(p.formula() for p in found.pieces) == ["0", "u"]


def test_rubbish_stays_unexplained(rng: np.random.Generator) -> None:
    rubbish = examples(rng, 120, "max(u, -v * v)")
    found = fit_axis(rubbish, rng=rng)
    assert 0.2 < (~found.explained).mean() < 0.8
    assert sum(p.free_parameters() for p in found.pieces) == 0


def test_noise_leaves_the_law_as_it_is(rng: np.random.Generator) -> None:
    found = fit_axis(examples(rng, 800, "max(u, -0.9 * v)", noise=1e-5), rng=rng)
    ((name, weight),) = next(p.terms for p in found.pieces if p != FREE)
    assert (name, found.operator) == ("v", "max")
    assert weight == pytest.approx(-0.9, abs=1e-4)


def test_what_two_examples_determine_is_no_law(rng: np.random.Generator) -> None:
    few = examples(rng, 40, "max(u, 0 * u)")
    y = few.y.copy()
    y[:2] = -3.0 * few.x[:2, 1] + 0.5 * few.x[:2, 2]
    found = find_pieces(AxisExamples(NAMES, few.x, y, "u", 1e-12), [FREE, ZERO], rng=rng)
    assert found == []


def test_fitting_keeps_the_free_motion_and_whole_weights(rng: np.random.Generator) -> None:
    data = examples(rng, 30, "u - 0.25 * J")
    assert fitted(Piece((("u", 1.0), ("J_n", -9.0))), data).formula(8) == "u - 0.25 J_n"
    still = examples(rng, 30, "-v")
    assert fitted(Piece((("v", -0.7),)), still).terms == (("v", -1.0),)
