"""One law for all kinds of contacts, and what it doesn't hold for."""

from __future__ import annotations

import numpy as np

from relgym.laws.kinds import fit_together
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
    y[201:] = x[201:, 0]  # one exception alone tells nothing of its kind
    (law,) = fit_together(examples, kinds, [("box", "wall"), ("box", "belt")], rng=rng).laws
    assert law.doubted == ()


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
