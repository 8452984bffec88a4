"""Every regressor keeps the interface, and learns what it can."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.baselines.base import Memory
from relgym.baselines.catalogue import (
    BUDGET,
    CLASSIFIERS,
    REGRESSORS,
    Columns,
    installed,
    make_classifier,
    make_regressor,
)
from relgym.baselines.lwr import LocallyWeightedRegression
from relgym.baselines.model_tree import LinearModelTree
from relgym.baselines.motion import ConstantVelocity, Persistence
from relgym.baselines.rls import RecursiveLeastSquares
from relgym.baselines.tuned import TUNED, setting_of
from relgym.errors import ConfigError, ObservationError, QueryError

RNG = np.random.default_rng(7)
X = RNG.normal(size=(240, 4))
LINEAR = np.column_stack([X[:, 0] - 2.0 * X[:, 1] + 0.5, X[:, 2]])
COLUMNS = Columns((0, 1), own=2, objects=2)


def _taught(model: object, x: np.ndarray, y: np.ndarray) -> None:
    for row, values in zip(x, y, strict=True):
        model.learn_one(row, values)  # type: ignore[attr-defined]


LIGHT = sorted(name for name, known in REGRESSORS.items() if known.package != "torch")


@pytest.mark.parametrize(
    "name", [*LIGHT, *(pytest.param(n, marks=pytest.mark.sb3) for n in ("ensemble", "interactions"))]
)
def test_one_by_one_and_in_a_batch(name: str) -> None:
    model = make_regressor(name, columns=COLUMNS, rng=np.random.default_rng(0))
    kept = X.copy()
    _taught(model, X[:200], LINEAR[:200])
    batch = model.predict_batch(X[200:])
    assert name in installed(REGRESSORS)
    assert batch.shape == (40, 2) and np.isfinite(batch).all()
    one = np.stack([model.predict_one(row) for row in X[200:210]])
    single = name in ("ensemble", "interactions")  # precision of the nets
    np.testing.assert_allclose(one, batch[:10], rtol=1e-5 if single else 1e-6, atol=1e-9)
    np.testing.assert_array_equal(X, kept)


@pytest.mark.parametrize(
    "name", sorted(set(LIGHT) - {"persistence", "constant-velocity", "amrules", "hoeffding"})
)
def test_better_than_the_mean(name: str) -> None:
    model = make_regressor(name, columns=COLUMNS, rng=np.random.default_rng(0))
    _taught(model, X[:200], LINEAR[:200])
    off = np.abs(model.predict_batch(X[200:]) - LINEAR[200:]).mean()
    assert off < 0.8 * np.abs(LINEAR[:200].mean(axis=0) - LINEAR[200:]).mean()


@pytest.mark.parametrize("name", ["forest", "gp", "mlp"])
def test_same_seed_same_predictions(name: str) -> None:
    answers = []
    for _ in range(2):
        model = make_regressor(name, columns=COLUMNS, rng=np.random.default_rng(3))
        _taught(model, X[:100], LINEAR[:100])
        answers.append(model.predict_batch(X[100:]))
    np.testing.assert_array_equal(*answers)


def test_guesses_by_hand() -> None:
    x = np.array([[1.0, 2.0, 3.0]])
    assert Persistence((2, 0)).predict_one(x[0]).tolist() == [0.0, 0.0]
    assert ConstantVelocity((2, 0)).predict_batch(x).tolist() == [[3.0, 1.0]]


def test_recursive_least_squares_is_least_squares() -> None:
    model = RecursiveLeastSquares(prior=1e12)
    _taught(model, X, LINEAR)
    np.testing.assert_allclose(model.predict_batch(X), LINEAR, atol=1e-6)
    with pytest.raises(ConfigError, match="forgetting in \\(0, 1\\]"):
        RecursiveLeastSquares(forgetting=1.1)


def test_recursive_least_squares_forgets() -> None:
    keeps, forgets = RecursiveLeastSquares(1.0), RecursiveLeastSquares(0.9)
    for model in (keeps, forgets):
        _taught(model, X[:120], LINEAR[:120])
        _taught(model, X[120:], -LINEAR[120:])
    off = [np.abs(m.predict_batch(X) + LINEAR).mean() for m in (keeps, forgets)]
    assert off[1] < 1e-3 < off[0]


def test_lwr_is_exact_on_what_is_linear_and_averages_what_it_has_seen() -> None:
    model = LocallyWeightedRegression(30)
    _taught(model, X[:200], LINEAR[:200])
    np.testing.assert_allclose(model.predict_batch(X[200:]), LINEAR[200:], atol=1e-5)
    twice = LocallyWeightedRegression(5)
    _taught(twice, np.repeat(X[:20], 2, axis=0), np.tile([[1.0], [3.0]], (20, 1)))
    np.testing.assert_array_equal(twice.predict_batch(X[:5]), np.full((5, 1), 2.0))


def test_lwr_ignores_what_never_varied() -> None:
    x = np.column_stack([X, np.full(len(X), 7.0)])
    model = LocallyWeightedRegression(30)
    _taught(model, x[:200], LINEAR[:200])
    moved = x[200:].copy()
    moved[:, -1] = 1e6
    np.testing.assert_array_equal(model.predict_batch(moved), model.predict_batch(x[200:]))


def test_lwr_fits_stepwise_what_depends_on_few() -> None:
    """Fewer neighbours than features: a ridge regression shares the weight out, Algorithm 1 finds the one."""
    rng = np.random.default_rng(0)
    x = rng.normal(size=(400, 40))
    off = []
    for stepwise in (False, True):
        model = LocallyWeightedRegression(20, stepwise=stepwise)
        _taught(model, x[:300], 2.0 * x[:300, 3:4] + 1.0)
        off.append(np.abs(model.predict_batch(x[300:]) - 2.0 * x[300:, 3:4] - 1.0).max())
    assert off[1] < 1e-9 < 1e-2 < off[0]


def test_lwr_measures_as_it_is_told() -> None:
    """One neighbour: the first column differs by 2 of 1,000, the second by 1 of 1."""
    x, y = np.array([[0.0, 0.0], [1000.0, 1.0]]), np.array([[1.0], [2.0]])
    query = np.array([[499.0, 0.9]])
    for scale, value in ((True, 2.0), (False, 1.0)):
        model = LocallyWeightedRegression(1, scale=scale)
        _taught(model, x, y)
        assert model.predict_batch(query).tolist() == [[value]]


def test_a_model_tree_finds_two_planes() -> None:
    x = np.random.default_rng(0).normal(size=(2000, 4))
    y = np.where(x[:, :1] > 0.0, 3.0 * x[:, 1:2] + 10.0, -x[:, 2:3])
    off = np.abs(LinearModelTree(leaf=10, depth=8).fit(x, y).predict(x) - y)
    assert np.quantile(off, 0.9) < 1e-5
    with pytest.raises(ConfigError, match="leaf >= 2"):
        LinearModelTree(leaf=1)


def test_memory_refuses_what_does_not_fit_and_stays_as_it_was() -> None:
    memory = Memory()
    with pytest.raises(QueryError, match="call learn_one first"):
        _ = memory.x
    for k in range(70):  # more than it begins with room for
        memory.add([float(k), 0.0], [1.0])
    for x, y in (([1.0], [1.0]), ([1.0, 2.0], [1.0, 2.0])):
        with pytest.raises(ObservationError, match="expected 2 features and 1 values as before"):
            memory.add(x, y)
    with pytest.raises(ObservationError, match="NaN or infinity"):
        memory.add([np.nan, 0.0], [1.0])
    assert len(memory) == 70 and memory.x[:, 0].tolist() == [float(k) for k in range(70)]


@pytest.mark.parametrize("name", sorted(CLASSIFIERS))
def test_classifiers(name: str) -> None:
    model = make_classifier(name, rng=np.random.default_rng(0))
    labels = (X[:, 0] > 0.0).astype(np.int64) + 4
    for row, label in zip(X[:1], [4], strict=True):
        model.learn_one(row, label)
    assert model.predict_batch(X[:3]).tolist() == [4, 4, 4]  # one class is all it knows
    for row, label in zip(X[:200], labels[:200].tolist(), strict=True):
        model.learn_one(row, label)
    found = model.predict_batch(X[200:])
    assert (found == labels[200:]).mean() > 0.7
    assert [model.predict_one(row) for row in X[200:205]] == found[:5].tolist()


def test_the_budget_is_the_same_for_all() -> None:
    assert {len(b.settings) for b in REGRESSORS.values()} <= {1, BUDGET}
    assert all(len(b.settings) <= BUDGET for b in CLASSIFIERS.values())


def test_what_was_tuned_exists() -> None:
    known = {"regress": REGRESSORS, "classify": CLASSIFIERS}
    for (task, name, seen), number in TUNED.items():
        assert seen in ("thesis", "contact") and 0 <= number < len(known[task][name].settings)
    wanted = {
        (t, n, s) for t in known for n, b in known[t].items() for s in ("thesis", "contact") if b.settings[1:]
    }
    assert TUNED.keys() == wanted
    assert setting_of("regress", "lwr-50", "thesis-uncentred") == setting_of("regress", "lwr-50", "thesis")


@pytest.mark.parametrize(
    "make", [make_classifier, lambda n, rng: make_regressor(n, columns=COLUMNS, rng=rng)]
)
def test_unknown_baseline(make: object) -> None:
    with pytest.raises(ConfigError, match="baseline 'oracle': expected one of"):
        make("oracle", rng=np.random.default_rng(0))  # type: ignore[operator]


@pytest.mark.sb3
def test_an_interaction_network_does_not_care_who_comes_first() -> None:
    from relgym.baselines.interaction import InteractionNetwork

    model = InteractionNetwork(2, 2, train_steps=20)
    _taught(model, X[:200], LINEAR[:200])
    np.testing.assert_allclose(
        model.predict_batch(X[200:]), model.predict_batch(X[200:][:, [0, 1, 3, 2]]), rtol=1e-4, atol=1e-5
    )
    with pytest.raises(ConfigError, match="2 columns can't be shared out among 3 objects"):
        InteractionNetwork(2, 3).learn_one(X[0], LINEAR[0])
    with pytest.raises(ConfigError, match="objects=0: expected at least 1"):
        InteractionNetwork(2, 0)


@pytest.mark.parametrize("name", LIGHT)
def test_few_examples_equal_ones_none_to_ask_and_gaps(name: str) -> None:
    def made() -> object:
        return make_regressor(name, columns=COLUMNS, rng=np.random.default_rng(0))

    for x in (X[:1], X[:3], np.ones((20, 4))):
        model = made()
        _taught(model, x, LINEAR[: len(x)])
        assert np.isfinite(model.predict_batch(X[:5])).all()  # type: ignore[attr-defined]
        assert model.predict_batch(np.empty((0, 4))).shape == (0, 2)  # type: ignore[attr-defined]
    model = made()
    _taught(model, X[:60], LINEAR[:60])
    before = model.predict_one(X[70])  # type: ignore[attr-defined]
    try:
        model.learn_one(np.array([np.nan, 0.0, 0.0, 0.0]), LINEAR[0])  # type: ignore[attr-defined]
    except ObservationError:
        np.testing.assert_array_equal(model.predict_one(X[70]), before)  # type: ignore[attr-defined]
    assert np.isfinite(model.predict_one(X[70])).all()  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", sorted(CLASSIFIERS))
def test_classifiers_of_few_examples(name: str) -> None:
    for count in (1, 3):
        model = make_classifier(name, rng=np.random.default_rng(0))
        for k in range(count):
            model.learn_one(X[k], k)
        assert model.predict_one(X[0]) in range(count)
        assert model.predict_batch(np.empty((0, 4))).shape == (0,)
