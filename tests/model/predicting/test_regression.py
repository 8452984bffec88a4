"""Regressions on everything: which columns, how far they go, and what of them is kept."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from points import schema_of, transitions

from relgym.config.constants import FIRST, ROUNDS
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.predicting.regression import Regression, _says, _unpacked
from relgym.model.world_model import WorldModel
from relgym.program.records import RATES
from relgym.scene.objects import Transition

SCHEMA = schema_of(("x", "y"), ("a",))
SIGNATURE = WorldModel(SCHEMA)._parts.signature_of(("self", "action"))


def taught(n: int, most: int = 320, seed: int = 0) -> Regression:
    """Of a change by a product, and of one by a sum."""
    rng = np.random.default_rng(seed)
    found = Regression(most)
    for row in rng.normal(size=(n, len(SIGNATURE.columns))):
        x, y, a = (row[SIGNATURE.column(*key)] for key in ((0, "x"), (0, "y"), (1, "a")))
        found.learn_one(SIGNATURE, row, {"x": x * a, "y": y + 2.0 * a})
    return found


def said_of(found: Regression, rows: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Changes that regressions predict of some rows."""
    told = found.values(SIGNATURE, rows)
    return None if told is None else told.changes


def test_distances_are_about_one_of_what_was_learned_and_grow_with_the_square() -> None:
    found = taught(400)
    told = found.values(SIGNATURE, np.random.default_rng(0).normal(size=(400, len(SIGNATURE.columns))))
    assert told is not None
    assert told.distances.mean() == pytest.approx(
        1.0 + 1.0 / 3.0, rel=0.1
    )  # of three columns, and their constant
    far = found.values(SIGNATURE, np.outer([0.0, 10.0, 100.0, 1e200], np.ones(len(SIGNATURE.columns))))
    assert far is not None
    midst, near, further, out = far.distances
    assert midst == pytest.approx(1.0 / 3.0, rel=0.1)
    assert further / near == pytest.approx(100.0, rel=0.05)
    assert np.isposinf(out)


def test_products_are_told_where_there_is_room_for_them() -> None:
    rows = np.random.default_rng(9).normal(size=(50, len(SIGNATURE.columns)))
    x, y, a = (rows[:, SIGNATURE.column(*key)] for key in ((0, "x"), (0, "y"), (1, "a")))
    for most in (320, 3):
        found = taught(400, most)
        said = said_of(found, rows)
        assert said is not None
        assert found.targets == ["x", "y"]
        np.testing.assert_allclose(said[:, 1], y + 2.0 * a, atol=0.05)
        error = np.abs(said[:, 0] - x * a).max()
        assert error < 0.1 if most == 320 else error > 0.5


def test_nothing_is_said_before_there_are_enough_examples_and_of_too_many_columns() -> None:
    rows = np.zeros((1, len(SIGNATURE.columns)))
    assert said_of(taught(FIRST - 1), rows) is None
    assert said_of(taught(FIRST), rows) is not None
    assert said_of(taught(FIRST, most=2), rows) is None
    linear = said_of(taught(FIRST, most=3), rows)
    assert linear is not None
    assert np.isfinite(linear[0]).all()
    assert len(taught(FIRST, most=3)._ridges) == 1


def test_words_count_as_far_as_their_leverage_allows() -> None:
    """Each for the sum of what its rates have to say, on top of what those before it say."""
    found = taught(400)
    found._say[0, :, 0] = [
        0.25,
        0.0,
        0.0,
        0.0,
        0.5,
        0.0,
        0.0,
        0.0,
    ]  # a quarter of it always, half by the rate 1
    found._say[1, :, 0] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]  # by the rate 64
    here = np.random.default_rng(9).normal(size=(4, len(SIGNATURE.columns)))
    rows = np.concatenate([here, 30.0 * here])
    own, leverage = found._said(rows[:, found._columns(SIGNATURE)])
    said = said_of(found, rows)
    assert said is not None
    assert (leverage[:4] < 0.3).all() and (leverage[4:, 1] > 10.0).all()
    for k in range(8):
        first, second = (leverage[k, i] * found._ridges[i].rows / found._ridges[i].columns for i in range(2))
        linear = own[k, 0, 0] * (0.25 + 0.5 / (1.0 + first))
        assert said[k, 0] == pytest.approx(linear + (own[k, 1, 0] - linear) / (1.0 + 64.0 * second))


def test_what_each_would_have_left_of_what_came_by_hand() -> None:
    found = taught(FIRST + 3)
    x, y = np.array([3.0, 1.0, 2.0]), np.array([1.5, 0.5])
    before = found._left.copy()
    words, leverage = found._said(x[None])
    found._compare(x, y)
    near, far = leverage[0] * found._growth()
    shares = np.array([[*(1.0 / (1.0 + rate * q) for rate in RATES), 0.0] for q in (near, far)])
    missed = shares[0][:, None] * words[0, 0] - y
    np.testing.assert_allclose(found._left[0], before[0] + 0.5 * (missed**2 - before[0]))  # twice one in four
    linear = words[0, 0] * (found._say[0] * shares[0][:-1, None]).sum(axis=0)
    missed = linear + shares[1][:, None] * (words[0, 1] - linear) - y
    np.testing.assert_allclose(found._left[1], before[1] + 0.5 * (missed**2 - before[1]))


def test_what_the_linear_one_leaves_is_told_by_leaving_rows_out() -> None:
    """Of all rows that the weights come from, by the time that there are to be new weights."""
    found, rng, n = Regression(3), np.random.default_rng(3), FIRST + 5
    rows = rng.normal(size=(n, len(SIGNATURE.columns)))
    moved = np.array([rows[:, SIGNATURE.column(0, "x")] ** 2, rows[:, SIGNATURE.column(1, "a")] ** 3]).T
    for row, (x, y) in zip(rows, moved.tolist(), strict=True):
        found.learn_one(SIGNATURE, row, {"x": x, "y": y})
    ridge = found._ridges[0]
    assert (ridge.rows, ridge.due, found._gone_over) == (n, n + 1, FIRST)
    found.settle()
    said, leverage = ridge.without(found._scaled(rows[:, found._columns(SIGNATURE)]), moved)
    said, q = np.clip(said, *found._bounds()), leverage[:, None] * n / 3
    left = [np.square(said / (1.0 + rate * q) - moved).mean(axis=0) for rate in RATES]
    left.append(np.square(moved).mean(axis=0))
    np.testing.assert_allclose(found._left_out / n, left)
    np.testing.assert_allclose(found._say[0], _says(found._left[0] + left, n))  # each row is tried twice


def test_who_leaves_least_has_most_to_say_and_more_where_others_agree_by_hand() -> None:
    """Over n rows with weights that fall by the square root of n: of 4 rows as the mean square."""
    left = np.full((len(RATES) + 1, 3), 4.0)
    left[0, 0], left[1, 0] = 1.0, 2.0
    left[:, 2] = 0.0  # what never changed has no say in what others do
    own = (1.0 / left[:, :1]) / (1.0 / left[:, :1]).sum()
    level = np.full((len(RATES) + 1, 1), 1.0 / (len(RATES) + 1))
    first, second = own, level
    for _ in range(ROUNDS):
        first, second = own * (1.0 + second), level * (1.0 + first)
        first, second = first / first.sum(), second / second.sum()
    np.testing.assert_allclose(_says(left, 4)[:, :2], np.concatenate([first, second], axis=1)[:-1])


@pytest.mark.parametrize("after", [FIRST + 10, 700, 701, 702, 703])
@pytest.mark.parametrize("wild", [False, True])
def test_a_target_that_comes_late_is_known_of_all_rows_that_are_left_out(
    after: int, wild: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether or not its first row is one that is kept, and even if it is none that can be learned."""
    monkeypatch.setattr("relgym.model.predicting.regression.MEMORY", 50)  # so every eighth row is kept
    found, rng = taught(after), np.random.default_rng(1)
    for k in range(20):
        row = rng.normal(size=len(SIGNATURE.columns))
        found.learn_one(SIGNATURE, row, {"x": 1.0, "y": 0.5, "late": 1e200 if wild and k == 0 else 2.0})
        if k in (0, 5):
            found.settle()
        arrays = found.to_arrays()
        assert arrays["responses"].shape == (len(found._rows), 3)
        assert len(arrays["left0"]) == len(found._ridges[0].weights) == 3


def test_settled_predictions_are_others_than_before() -> None:
    """Though no weight is another one: how far they count is known better."""
    found = taught(FIRST + 6)  # solved with the latest row
    before, reach, solved = found.revision, found.reach, found.solved
    found.settle()
    assert all(a is b for a, b in zip(solved[0], found.solved[0], strict=True))
    assert found.revision != before and reach.tobytes() != found.reach.tobytes()


def test_gross_errors_among_the_first_are_survived() -> None:
    found, rng = Regression(320), np.random.default_rng(2)
    for k in range(FIRST + 20):
        row = rng.normal(size=len(SIGNATURE.columns))
        found.learn_one(SIGNATURE, row, {"x": 1e200 if k < 5 else row[0], "y": 0.0})
        if k == FIRST:
            found.settle()
    assert found._ridges[0].rows == FIRST + 15
    assert (found._left >= 0.0).all() and np.isfinite(found._say).all()


def test_settled_all_rows_are_gone_over_once() -> None:
    found = taught(FIRST + 30)
    assert found._gone_over < len(found._rows)
    found.settle()
    assert found._gone_over == found._rows_before == len(found._rows) == FIRST + 30
    left, say = found._left_out.copy(), found._say.copy()
    found.settle()
    assert left.tobytes() == found._left_out.tobytes() and say.tobytes() == found._say.tobytes()


def test_all_of_a_word_counts_before_it_was_held_against_anything() -> None:
    found = taught(FIRST)
    rows = np.random.default_rng(9).normal(size=(4, len(SIGNATURE.columns)))
    own, _ = found._said(rows[:, found._columns(SIGNATURE)])
    said = said_of(found, rows)
    assert said is not None
    np.testing.assert_allclose(said, own[:, 1])


def test_nothing_is_said_of_what_nothing_tells() -> None:
    rng = np.random.default_rng(3)
    found = Regression(320)
    for row in rng.normal(size=(400, len(SIGNATURE.columns))):
        found.learn_one(SIGNATURE, row, {"x": float(rng.normal())})
    rows = rng.normal(size=(50, len(SIGNATURE.columns)))
    said, (own, _) = said_of(found, rows), found._said(rows[:, found._columns(SIGNATURE)])
    assert said is not None
    assert np.square(said).mean() < 0.5 * np.square(own[:, 0]).mean()


def test_what_a_line_says_everywhere_counts_everywhere() -> None:
    """Of a change that is linear far out, too, and of one that is so in the midst alone."""
    rng, found = np.random.default_rng(1), Regression(3)
    for row in rng.normal(size=(600, len(SIGNATURE.columns))) * rng.choice([1.0, 6.0], size=(600, 1)):
        x, y = row[SIGNATURE.column(0, "x")], row[SIGNATURE.column(0, "y")]
        found.learn_one(SIGNATURE, row, {"x": 2.0 * x, "y": float(y if abs(y) < 2.0 else rng.normal())})
    far = np.zeros((1, len(SIGNATURE.columns)))
    far[0, SIGNATURE.column(0, "x")] = far[0, SIGNATURE.column(0, "y")] = 15.0
    said, (own, _) = said_of(found, far), found._said(far[:, found._columns(SIGNATURE)])
    assert said is not None
    assert said[0, 0] > 0.99 * own[0, 0, 0]
    assert said[0, 1] < 0.7 * own[0, 0, 1]


def test_what_came_last_is_known_once_learning_is_finished() -> None:
    """A change that came for the first time since weights were solved."""

    def step(s: np.ndarray, u: np.ndarray) -> list[float]:
        return [float(s[0] + (s[1] > 3.0)), float(np.tanh(s[1]) + u[0])]

    rng = np.random.default_rng(3)
    before = np.append(rng.uniform(-1.0, 1.0, size=(106, 2)), [[0.5, 9.0], [-0.5, 9.0]], axis=0)
    model = WorldModel(SCHEMA)
    for transition in transitions(SCHEMA, step, before, rng.normal(size=(108, 1))):
        compare_and_learn(model, transition, model.predict_one(transition.before))
    regression = model._parts.regressions["self"]
    row = np.zeros((1, len(SIGNATURE.columns)))
    row[0, SIGNATURE.column(0, "y")] = 9.0
    k = regression.targets.index("x")
    assert regression._said(row[:, regression._columns(SIGNATURE)])[0][0, 0, k] == 0.0
    model.finish()
    assert regression._said(row[:, regression._columns(SIGNATURE)])[0][0, 0, k] > 0.5


def test_changes_never_go_far_beyond_those_that_were_seen() -> None:
    found = taught(200)
    said = said_of(found, np.full((1, len(SIGNATURE.columns)), 1e6))
    assert said is not None
    assert np.nanmax(np.abs(said)) < 20.0


def test_what_was_saved_says_and_learns_the_same() -> None:
    for n in (10, 150):
        found, again = taught(n), Regression(320)
        data = json.loads(json.dumps(found.to_json(history=True)))
        again.restore(data, found.to_arrays())
        more = np.random.default_rng(5).normal(size=(80, len(SIGNATURE.columns)))
        for row in more:
            for each in (found, again):
                each.learn_one(SIGNATURE, row, {"x": row[0], "y": row[1]})
        one, other = said_of(found, more), said_of(again, more)
        assert one is not None
        assert other is not None
        assert one.tobytes() == other.tobytes()


def test_what_no_law_explains_is_predicted_by_them_and_not_claimed() -> None:
    def step(s: np.ndarray, u: np.ndarray) -> list[float]:
        return [float(np.tanh(s[0] * u[0]) + 0.3 * s[1]), float(s[1])]

    rng = np.random.default_rng(3)

    def some(n: int) -> list[Transition]:
        return transitions(SCHEMA, step, rng.normal(size=(n, 2)), rng.normal(size=(n, 1)))

    model = WorldModel(SCHEMA)
    for transition in some(500):
        compare_and_learn(model, transition, model.predict_one(transition.before))
    fresh = some(100)
    parts = [model.predict_one(t.before)["self", "x"] for t in fresh]
    came = np.array([t.after["self"]["x"] for t in fresh])
    now = np.array([t.before["self"]["x"] for t in fresh])
    error = np.sqrt(np.square([p.value for p in parts] - came).mean())
    assert not any(p.ok for p in parts)
    assert error < 0.5 * np.sqrt(np.square(now - came).mean())
    inside = np.mean([abs(p.value - y) <= p.interval for p, y in zip(parts, came, strict=True)])
    assert inside > 0.85


@pytest.mark.parametrize("wild", [1e30, 1e140, 1e155, 1e200, 1.7e308, -1.7e308])
def test_of_a_gross_error_nothing_is_said_or_what_was_seen(wild: float) -> None:
    """No number beyond what changes were, no overflow, and no other row's values change for it."""
    found, rng = taught(150), np.random.default_rng(7)
    calm = rng.normal(size=(12, len(SIGNATURE.columns)))
    before = said_of(found, calm)
    least, most = found._range
    slack = 0.5 * (most - least)
    for column in range(len(SIGNATURE.columns)):
        rows = calm.copy()
        rows[5, column] = wild
        said = said_of(found, rows)
        assert before is not None and said is not None
        told = said[5][~np.isnan(said[5])]
        assert ((told >= np.min(least - slack)) & (told <= np.max(most + slack))).all()
        others = np.arange(12) != 5
        assert said[others].tobytes() == before[others].tobytes()


@pytest.mark.parametrize("wild", [1e155, 1e300])
def test_a_gross_error_that_is_learned_leaves_what_is_known_as_it_is(wild: float) -> None:
    """Its squares would be infinite, and so would be what is summed from then on."""
    hit, calm = taught(150), taught(150)
    rows = np.random.default_rng(7).normal(size=(100, len(SIGNATURE.columns)))
    for k, row in enumerate(rows):
        if k == 3:
            hit.learn_one(SIGNATURE, np.full(len(row), wild), {"x": 0.0, "y": 0.0})
        for each in (hit, calm):
            each.learn_one(SIGNATURE, row, {"x": row[0], "y": row[1]})
    said = [said_of(each, rows) for each in (hit, calm)]
    assert said[0] is not None and said[1] is not None
    assert said[0].tobytes() == said[1].tobytes()
    assert all(np.isfinite(array).all() for array in hit.to_arrays().values())


@given(st.integers(FIRST, 130), st.integers(0, 2**32 - 1))
def test_sums_say_what_values_say(n: int, seed: int) -> None:
    """Columns, centres, scales, weights and bounds are all that kernels read."""
    found = taught(n, seed=seed % 7)
    rows = 3.0 * np.random.default_rng(seed).normal(size=(4, len(SIGNATURE.columns)))
    said, _ = found._said(rows[:, found._columns(SIGNATURE)])
    looked = found.fit(SIGNATURE)
    assert looked is not None
    places, centre, scale, reach = looked
    for ridge, (mean, spread) in zip(found._ridges, reach, strict=True):
        assert list(mean) == ridge.mean.tolist()
        assert _unpacked(spread, len(mean)).tobytes() == ridge.spread.tobytes()
    for k, target in enumerate(found.targets):
        told = found.sums(target)
        assert told is not None
        weights, (least, most) = told
        for kind, (growth, few, *say) in enumerate(found.trusted[k].tolist()):
            ridge = found._ridges[kind]
            assert (growth, few) == (max(1.0, ridge.rows / ridge.columns), 1.0 / ridge.rows)
            assert say == found._say[kind, :, k].tolist()
        for row, expected in zip(rows, said, strict=True):
            z = [(row[p] - c) / s for p, c, s in zip(places, centre, scale, strict=True)]
            products = [a * b for i, a in enumerate(z) for b in z[i:]]
            for kind, columns in enumerate(([1.0, *z], [1.0, *z, *products])):
                value = sum(w * c for w, c in zip(weights[kind], columns, strict=True))
                assert min(max(value, least), most) == pytest.approx(expected[kind, k], rel=1e-9, abs=1e-9)


def test_bounds_are_half_a_range_beyond_what_was_seen() -> None:
    found = taught(100)
    least, most = found._range[:, 1]
    told = found.sums("y")
    assert told is not None
    assert told[1] == pytest.approx((1.5 * least - 0.5 * most, 1.5 * most - 0.5 * least))
    far = np.zeros((2, len(SIGNATURE.columns)))
    far[:, SIGNATURE.column(0, "y")] = -1e3, 1e3
    said, _ = found._said(far[:, found._columns(SIGNATURE)])
    assert said[:, 0, 1].tolist() == list(told[1])


def test_of_other_columns_nothing_is_said() -> None:
    other = WorldModel(schema_of(("x",), ("a",)))._parts.signature_of(("self", "action"))
    found = taught(100)
    assert found.values(other, np.zeros((1, len(other.columns)))) is None
    assert found.fit(other) is None and found.sums("z") is None
    seen = found.seen
    found.learn_one(other, np.zeros(len(other.columns)), {"x": 1.0})
    assert found.seen == seen
