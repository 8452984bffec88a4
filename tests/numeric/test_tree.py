"""Decision trees: cuts worked out by hand, pruning, and that single and batch evaluation agree."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relgym.errors import ConfigError
from relgym.numeric.tree import DecisionTree, learn_tree

NAN = float("nan")


def test_threshold_lies_midway_in_the_gap() -> None:
    x = np.array([[0.0], [0.1], [0.2], [1.0], [1.1], [1.2]])
    tree = learn_tree(x, x[:, 0] < 0.5, columns=["v"])
    assert tree.rules() == ("v <= 0.6 -> yes (3 : 0)", "v > 0.6 -> no (0 : 3)")


def test_cut_beside_a_run_of_identical_values_is_found() -> None:
    # The original sorted by (value, class) and looked only between neighbours of different class; a run of
    # zeros of both classes could hide the cut at its end.
    x = np.array([[0.0]] * 10 + [[0.4]] * 5 + [[0.5]] * 5)
    positive = np.array([True] * 8 + [False] * 2 + [False] * 10)
    tree = learn_tree(x, positive)
    assert tree.threshold[0] == 0.2


def test_equal_entropies_prefer_the_wider_relative_gap() -> None:
    x = np.array([[0.0, 0.0], [0.4, 1.0], [0.5, 9.0], [1.0, 10.0]])
    tree = learn_tree(x, np.array([True, True, False, False]), min_leaf=1, prune=False)
    assert (tree.column[0], tree.threshold[0]) == (1, 5.0)


def test_weights_stand_for_repeated_rows() -> None:
    rng = np.random.default_rng(3)
    x = rng.normal(size=(60, 2))
    positive = x[:, 0] + 0.3 * x[:, 1] > 0.2
    counts = rng.integers(1, 4, size=60)
    repeated = learn_tree(np.repeat(x, counts, axis=0), np.repeat(positive, counts), min_leaf=1)
    weighted = learn_tree(x, positive, weights=counts.astype(float), min_leaf=1)
    assert weighted.column == repeated.column
    np.testing.assert_allclose(weighted.threshold, repeated.threshold, rtol=1e-12)
    np.testing.assert_allclose(weighted.positive, repeated.positive, rtol=1e-12)


def test_pruning_removes_a_split_on_noise_and_keeps_a_real_one() -> None:
    rng = np.random.default_rng(0)
    x = rng.normal(size=(400, 3))
    positive = (x[:, 1] > 0.5) ^ (rng.random(400) < 0.05)
    assert learn_tree(x, positive).column == (1, -1, -1)
    assert len(learn_tree(x, positive, prune=False).leaves) > 5
    assert learn_tree(x, rng.random(400) < 0.3).leaves == (0,)


def test_undefined_values_go_above_and_can_be_split_off() -> None:
    x = np.array([[1.0], [2.0], [3.0], [NAN], [NAN], [NAN]])
    tree = learn_tree(x, np.isnan(x[:, 0]))
    assert tree.leaf_one([3.0]) == tree.below[0]
    assert tree.leaf_one([NAN]) == tree.above[0]


def test_rare_class_is_separated() -> None:
    x = np.linspace(0.0, 1.0, 1000)[:, None]
    tree = learn_tree(x, x[:, 0] > 0.995)
    assert tree.predict_batch(x).sum() == 5


def test_one_class_gives_a_leaf() -> None:
    tree = learn_tree(np.zeros((5, 1)), np.ones(5, dtype=bool))
    assert tree.rules() == ("always -> yes (5 : 0)",)


def test_unequal_lengths_are_refused() -> None:
    with pytest.raises(ConfigError, match="as many classes and weights as rows"):
        learn_tree(np.zeros((5, 1)), np.ones(4, dtype=bool))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 80), st.integers(1, 4))
def test_single_batch_and_json_agree(seed: int, n: int, d: int) -> None:
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(n, d)).round(1)  # rounded: many equal values
    x[rng.random(x.shape) < 0.1] = NAN
    positive = np.nan_to_num(x[:, 0]) + 0.3 * rng.normal(size=n) > 0
    tree = learn_tree(x, positive, min_leaf=1, prune=False)
    again = DecisionTree.from_dict(json.loads(json.dumps(tree.to_dict())))
    assert again == tree
    queries = np.concatenate([x, rng.normal(size=(20, d))])
    assert [tree.leaf_one(row) for row in queries.tolist()] == tree.leaf_batch(queries).tolist()
    assert [tree.predict_one(row) for row in queries.tolist()] == tree.predict_batch(queries).tolist()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_order_of_examples_is_irrelevant(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = rng.integers(0, 6, size=(40, 3)).astype(float)
    positive = (x[:, 0] > 2) & (x[:, 1] > 1)
    order = rng.permutation(40)
    assert learn_tree(x[order], positive[order]) == learn_tree(x, positive)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_tree_never_errs_more_than_the_majority(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, positive = rng.normal(size=(50, 2)), rng.random(50) < 0.4
    wrong = np.sum(learn_tree(x, positive).predict_batch(x) != positive)
    assert wrong <= min(positive.sum(), (~positive).sum())


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_whole_weights_part_as_the_same_ones_in_another_unit(seed: int) -> None:
    """Entropies of whole numbers are looked up, those of others worked out: both say the same of every cut."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(50, 3)).round(1)
    x[rng.random(x.shape) < 0.1] = NAN
    positive = (np.nan_to_num(x[:, 0]) > 0.2) ^ (rng.random(50) < 0.1)
    whole = rng.integers(1, 4, size=50).astype(float)
    one, other = (
        learn_tree(x, positive, weights=unit * whole, min_leaf=1, prune=False) for unit in (1.0, 0.3)
    )
    assert (one.column, one.threshold) == (other.column, other.threshold)
    np.testing.assert_allclose(other.positive, 0.3 * np.array(one.positive), rtol=1e-12)


def test_infinite_values_are_cut_off_as_undefined_ones_are() -> None:
    x = np.array([[0.0], [0.0], [1.0], [np.inf], [np.inf], [NAN]])
    tree = learn_tree(x, ~np.isfinite(x[:, 0]), min_leaf=1, prune=False)
    assert tree.predict_batch(x).tolist() == [False, False, False, True, True, True]


def test_a_tie_is_one_however_large_weights_are() -> None:
    rng = np.random.default_rng(0)
    positive = np.arange(300) < 100
    near, far = (np.where(positive, 0.0, gap) + rng.uniform(0.0, 1.0, 300) for gap in (1.1, 3.0))
    for weights in (None, rng.uniform(1e7, 1e9, 300)):
        tree = learn_tree(np.column_stack([near, far]), positive, weights=weights)
        assert tree.column[0] == 1 and 1.0 < tree.threshold[0] < 3.0
