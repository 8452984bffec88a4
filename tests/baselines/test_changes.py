"""What other learners say of a stream: each of a row before it is shown what came."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.baselines.catalogue import installed
from relgym.baselines.changes import (
    CHANGES,
    ONLINE,
    LastChange,
    NoChange,
    along,
    fitted_once,
    predicted_changes,
    titles,
)
from relgym.baselines.kinds import Columns
from relgym.errors import ConfigError, QueryError

RNG = np.random.default_rng(3)
X = RNG.normal(size=(200, 3))
CHANGE = np.column_stack([0.5 * X[:, 0] - X[:, 2], np.full(200, 0.25)])
LIGHT = sorted(name for name, known in CHANGES.items() if known.package != "torch")


@pytest.mark.parametrize("name", [*LIGHT, pytest.param("ensemble", marks=pytest.mark.sb3)])
def test_all_keep_the_interface_and_their_inputs(name: str) -> None:
    known, x, y = CHANGES[name], X.copy(), CHANGE.copy()
    setting = {**known.settings[0], **({"train_every": 100, "train_steps": 5} if name == "ensemble" else {})}
    learner = known.make(setting, Columns(()), np.random.default_rng(0))
    told = fitted_once(learner, x, y)
    assert told.shape == CHANGE.shape
    assert np.isnan(told[:100]).all() and np.isfinite(told[100:]).all()
    np.testing.assert_allclose(learner.predict_one(x[150]), told[150], rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(x, X)
    np.testing.assert_array_equal(y, CHANGE)
    assert known.change


def test_guesses_by_hand() -> None:
    for guess, said in ((NoChange(), [0.0, 0.0]), (LastChange(), [1.0, -2.0])):
        guess.learn_one(np.zeros(3), np.array([1.0, -2.0]))
        assert guess.predict_one(np.zeros(3)).tolist() == said
        assert guess.predict_batch(np.zeros((2, 3))).tolist() == [said, said]


def test_the_last_change_is_a_copy() -> None:
    guess, change = LastChange(), np.array([1.0])
    guess.learn_one(np.zeros(1), change)
    change[0] = 7.0
    assert guess.predict_one(np.zeros(1)).tolist() == [1.0]


def test_nobody_is_shown_what_comes_before_having_said_it() -> None:
    told = along(LastChange(), X, CHANGE)
    assert not told[0].any()
    np.testing.assert_array_equal(told[1:], CHANGE[:-1])
    # The same beginning, another end: what is said of the beginning doesn't change.
    other = CHANGE.copy()
    other[120:] += 100.0
    mine, theirs = (predicted_changes(X, change, once=False) for change in (CHANGE, other))
    assert set(mine) == set(ONLINE) & set(installed(CHANGES))
    for name in mine:
        np.testing.assert_array_equal(mine[name][:121], theirs[name][:121])


def test_a_linear_change_is_learned_along_the_way() -> None:
    off = {
        name: np.abs(told[100:] - CHANGE[100:]).mean()
        for name, told in predicted_changes(X, CHANGE, once=False).items()
    }
    assert off["rls"] < 1e-3 < off["persistence"]


@pytest.mark.sb3
def test_those_that_are_fitted_once_come_on_request() -> None:
    few = predicted_changes(X[:40], CHANGE[:40], once=True)
    assert list(few) == list(CHANGES)
    assert np.isnan(few["forest"][:20]).all() and np.isfinite(few["ensemble"][20:]).all()


def test_the_last_change_may_be_given_where_rows_are_of_several_objects() -> None:
    last = RNG.normal(size=CHANGE.shape)
    assert predicted_changes(X, CHANGE, once=False, last=last)["constant-velocity"] is last


def test_tables_call_them_by_title() -> None:
    assert titles(["relgym", "constant-velocity"]) == ["relgym", "constant velocity"]


def test_a_tree_that_saw_nothing_says_so() -> None:
    tree = CHANGES["tree"].make(CHANGES["tree"].settings[0], Columns(()), np.random.default_rng(0))
    with pytest.raises(QueryError, match="nothing learned yet"):
        tree.predict_one(X[0])


@pytest.mark.parametrize("once", [False, True])
def test_a_stream_of_one_row_is_refused(once: bool) -> None:
    for rows in (0, 1):
        with pytest.raises(ConfigError, match=f"a stream of {rows} rows: expected at least two"):
            predicted_changes(X[:rows], CHANGE[:rows], once=once)


def test_whole_numbers_may_change_by_fractions() -> None:
    x = np.array([[0], [1], [2], [3], [4]])
    change = np.array([[0], [1], [1], [2], [3]])
    told = predicted_changes(x, change, once=False)["rls"]
    assert (told != np.round(told)).any()
