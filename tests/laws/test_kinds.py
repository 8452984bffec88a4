"""One law for all kinds of contacts, and what it doesn't hold for."""

from __future__ import annotations

import numpy as np

from relgym.laws.kinds import fit_apart, fit_together
from relgym.laws.pieces import AxisExamples
from relgym.laws.records import AxisLaw, PairLaw


def test_a_rare_kind_that_a_law_has_wrong_is_doubted(rng: np.random.Generator) -> None:
    x = np.concatenate([rng.uniform(0.5, 1.0, (203, 1)), np.ones((203, 1))], axis=1)
    y = x[:, 0].copy()
    y[200:] += np.array([0.1, 0.23, 0.31])
    examples = AxisExamples(("u_t", "1"), x, y, "u_t", 1e-9)
    kinds = np.repeat([0, 1], [200, 3])
    (law,) = fit_together(examples, kinds, [("box", "wall"), ("box", "belt")], rng=rng).laws
    assert law.trusted() and law.trusted(("box", "wall")) and not law.trusted(("box", "belt"))
    assert law.doubted == (("box", "belt"),)
    assert AxisLaw.from_json(law.to_json()) == law
    y[201:] = x[201:, 0]  # those that let go tell nothing of what a contact does where it acts
    (law,) = fit_together(examples, kinds, [("box", "wall"), ("box", "belt")], rng=rng).laws
    assert law.doubted == (("box", "belt"),)
    y[200] = x[200, 0]
    (law,) = fit_together(examples, kinds, [("box", "wall"), ("box", "belt")], rng=rng).laws
    assert law.doubted == ()


def test_an_exception_among_many_contacts_that_act_is_none_of_the_kind(rng: np.random.Generator) -> None:
    u = np.concatenate([rng.uniform(-1.0, 1.0, 200), rng.uniform(-1.0, -0.5, 8)])
    y = np.maximum(u, 0.0)
    y[200] = 0.3
    examples = AxisExamples(("u_n", "1"), np.stack([u, np.ones(208)], axis=1), y, "u_n", 1e-9)
    names = [("box", "wall"), ("box", "shelf")]
    for count, doubted in ((7, (("box", "shelf"),)), (8, ())):
        some = examples.rows(np.arange(208) < 200 + count)
        (law,) = fit_together(some, np.repeat([0, 1], [200, count]), names, rng=rng).laws
        assert law.doubted == doubted and law.excused == len(doubted)


def test_what_others_do_is_not_held_against_a_kind_that_obeys(rng: np.random.Generator) -> None:
    v = rng.uniform(-1.0, -0.5, 9)
    u = v - 0.01
    bounce = np.repeat([0.5, 0.9, 0.3], [6, 2, 1])
    x = np.stack([u, v, np.ones(9)], axis=1)
    examples = AxisExamples(("u_n", "v_n", "1"), x, np.maximum(u, -bounce * v), "u_n", 1e-9)
    names = [("ball", "box"), ("ball", "floor"), ("ball", "wall")]
    (law,) = fit_together(examples, np.repeat([0, 1, 2], [6, 2, 1]), names, rng=rng).laws
    assert law.unexplained == law.excused == 3 and set(law.doubted) == set(names[1:])
    assert law.trusted(names[0])
    assert not any(law.trusted(kind) for kind in (*names[1:], ("ball", "ramp")))


def test_where_materials_differ_a_kind_shows_its_number_before_it_is_claimed(
    rng: np.random.Generator,
) -> None:
    """Whether who only ever stuck slips at a rough or a smooth body's bound, or at another, is not known."""
    n, names = 120, [("box", "ice"), ("box", "sand"), ("box", "glue")]
    kinds = np.repeat([0, 1, 2], n)
    push = rng.uniform(0.5, 1.0, 3 * n)
    slip = push * rng.uniform(0.0, 0.1, 3 * n)  # sticks everywhere
    fast = (rng.random(3 * n) < 0.5) & (kinds < 2)
    slip[fast] += rng.uniform(1.0, 2.0, int(fast.sum()))
    after = np.maximum(0.0, slip - np.repeat([0.1, 0.6, 0.9], n) * push)
    x = np.stack([slip, push, np.ones(3 * n)], axis=1)
    examples = AxisExamples(("u_t", "J_n", "1"), x, after, "u_t", 1e-9)

    def doubted(some: int) -> set[tuple[str, str]]:
        part = examples.rows(kinds < some)
        together = fit_together(part, kinds[kinds < some], names, rng=rng)
        found = fit_apart(part, kinds[kinds < some], names, together, np.inf, rng=rng)
        assert found.explained.all()
        return {kind for law in found.laws for kind in law.doubted}

    assert doubted(2) == set()
    assert doubted(3) == {("box", "glue")}
    slip[-9:] = push[-9:] + rng.uniform(0.3, 0.5, 9)
    x[:, 0], after[-9:] = slip, slip[-9:] - 0.9 * push[-9:]
    assert doubted(3) == set()


def test_a_law_that_says_nothing_of_a_kind() -> None:
    law = AxisLaw((), "max", (("box", "wall"), ("box", "belt")), examples=100)
    pair = PairLaw("point", ((law,), (law,)), 0.0).doubting({("box", "belt"), ("disc", "belt")})
    for axis in (0, 1):
        found = pair.law_of(axis, ("box", "belt"))
        assert found is not None and found.trusted() and not found.trusted(("box", "belt"))
    assert pair.doubting({("box", "belt")}) == pair


def test_surfaces_run_alike_for_whoever_touches_them() -> None:
    belt = PairLaw("point", (), 0.0, surfaces=((("box", "belt"), 0.25), (("disc", "belt"), 0.25)))
    kinds = [("box", "belt"), ("tee", "belt"), ("box", "wall")]
    assert belt.running(kinds).tolist() == [0.25, 0.25, 0.0]
    other = PairLaw("point", (), 0.0, surfaces=((("box", "belt"), 0.25), (("disc", "belt"), 0.5)))
    assert np.isnan(other.running(kinds)[1])
    assert PairLaw.from_json(belt.to_json()) == belt
