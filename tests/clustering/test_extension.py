"""Modes whose first examples could not show one of their terms."""

from __future__ import annotations

import numpy as np
import pytest
from streams import BALL, Stream

from relgym.clustering.columns import SlotSignature
from relgym.config import ClusteringConfig
from relgym.scene.objects import ObjectType

SLOPE = "v' = 0.5 v - 0.7 w"


def grounded(stream: Stream, rng: np.random.Generator) -> None:
    """Twenty hits without w: they found a mode that knows nothing of it."""
    v = rng.normal(size=20)
    stream.feed(np.column_stack([v, np.zeros(20)]), 0.5 * v)
    assert stream.counts() == {"v' = 0.5 v": 20}


def test_two_examples_that_agree_extend_a_mode(rng: np.random.Generator) -> None:
    stream = Stream()
    grounded(stream, rng)
    stream.feed([(0.3, 0.4)], [0.5 * 0.3 - 0.7 * 0.4])
    assert stream.formulas == ["v' = 0.5 v"]  # one alone would fit with any weight
    stream.feed([(-0.2, 0.9)], [0.5 * -0.2 - 0.7 * 0.9])
    assert stream.counts() == {SLOPE: 22}


def test_other_unexplained_examples_in_between_do_no_harm(rng: np.random.Generator) -> None:
    stream = Stream()
    grounded(stream, rng)
    stream.feed([(0.3, 0.4)], [0.5 * 0.3 - 0.7 * 0.4])
    stream.feed(rng.normal(size=(5, 2)), rng.normal(size=5))
    stream.feed([(-0.2, 0.9)], [0.5 * -0.2 - 0.7 * 0.9])
    assert stream.counts() == {SLOPE: 22, "noise": 5}


@pytest.mark.parametrize("second", [(0.3, 0.4), (-0.2, 0.4)])
def test_an_example_with_the_same_value_confirms_nothing(
    second: tuple[float, float], rng: np.random.Generator
) -> None:
    # Any jump by a constant where w = 0.4 would do as well.
    stream = Stream()
    grounded(stream, rng)
    for v, w in ((0.3, 0.4), second):
        stream.feed([(v, w)], [0.5 * v - 0.7 * w])
    assert stream.formulas == ["v' = 0.5 v"]


def test_examples_that_disagree_extend_nothing(rng: np.random.Generator) -> None:
    stream = Stream()
    grounded(stream, rng)
    stream.feed([(0.3, 0.4), (-0.2, 0.9)], [0.5 * 0.3 - 0.7 * 0.4, 0.5 * -0.2 - 0.6999 * 0.9])
    assert stream.formulas == ["v' = 0.5 v"]


def test_a_column_that_varied_before_is_not_what_was_missing(rng: np.random.Generator) -> None:
    # Had w had a say, the mode's own examples would have shown it.
    stream = Stream()
    x = rng.normal(size=(20, 2))
    stream.feed(x, 0.5 * x[:, 0])
    stream.feed([(0.3, 5.0), (-0.2, 7.0)], [0.5 * 0.3 - 0.7 * 5.0, 0.5 * -0.2 - 0.7 * 7.0])
    assert stream.formulas == ["v' = 0.5 v"]


def test_noisy_data_need_more_than_two(rng: np.random.Generator) -> None:
    stream = Stream(config=ClusteringConfig(noise_std=1e-4))
    v = rng.normal(size=200)
    stream.feed(np.column_stack([v, np.zeros(200)]), 0.5 * v + 1e-4 * rng.normal(size=200))
    (mode,) = stream.clusterer.modes
    assert [name for name, _ in mode.roles[0].terms] == ["v"]
    stream.feed([(0.3, 4.0), (-0.2, 9.0)], [0.5 * 0.3 - 0.7 * 4.0, 0.5 * -0.2 - 0.7 * 9.0])
    (mode,) = stream.clusterer.modes
    assert [name for name, _ in mode.roles[0].terms] == ["v"]


def test_a_flag_has_no_third_value_to_differ_in(rng: np.random.Generator) -> None:
    stream = Stream()
    grounded(stream, rng)
    stream.feed([(0.3, 1.0)], [0.5 * 0.3 + 2.0])
    assert stream.formulas == ["v' = 0.5 v"]
    stream.feed([(-0.2, 1.0)], [0.5 * -0.2 + 2.0])
    assert stream.counts() == {"v' = 0.5 v + 2 w": 22}


def test_what_a_flag_adds_in_one_mode_an_example_of_another_confirms(rng: np.random.Generator) -> None:
    stream = Stream()
    v = rng.normal(size=40)
    stream.feed(np.column_stack([v, np.zeros(40)]), np.where(v > 0, 0.5, -0.3) * v)
    stream.feed([(0.3, 1.0), (0.7, 1.0)], [0.5 * 0.3 + 2.0, 0.5 * 0.7 + 2.0])
    assert stream.formulas == ["v' = -0.3 v", "v' = 0.5 v + 2 w"]
    stream.feed([(-0.9, 1.0)], [-0.3 * -0.9 + 2.0])
    assert stream.formulas == ["v' = -0.3 v + 2 w", "v' = 0.5 v + 2 w"]


def test_another_mode_confirms_nothing_but_the_same_weight(rng: np.random.Generator) -> None:
    stream = Stream()
    v = rng.normal(size=40)
    stream.feed(np.column_stack([v, np.zeros(40)]), np.where(v > 0, 0.5, -0.3) * v)
    stream.feed([(0.3, 1.0), (0.7, 1.0)], [0.5 * 0.3 + 2.0, 0.5 * 0.7 + 2.0])
    stream.feed([(-0.9, 1.0)], [-0.3 * -0.9 + 2.5])
    assert stream.formulas == ["v' = -0.3 v", "v' = 0.5 v + 2 w"]


def test_where_numbers_are_coarser_only_flags_extend(rng: np.random.Generator) -> None:
    stream = Stream(config=ClusteringConfig(noise_std=1e-7))
    grounded(stream, rng)
    stream.feed([(0.3, 0.4), (-0.2, 0.9)], [0.5 * 0.3 - 0.7 * 0.4, 0.5 * -0.2 - 0.7 * 0.9])
    assert stream.formulas == ["v' = 0.5 v"]
    coarse = Stream(config=ClusteringConfig(noise_std=1e-7))
    grounded(coarse, rng)
    coarse.feed([(0.3, 1.0), (-0.2, 1.0)], [0.5 * 0.3 + 2.0, 0.5 * -0.2 + 2.0])
    assert coarse.counts() == {"v' = 0.5 v + 2 w": 22}


def test_half_as_many_examples_show_the_other_value_of_a_target_that_is_a_flag(
    rng: np.random.Generator,
) -> None:
    stream = Stream(config=ClusteringConfig(min_examples=4))
    stream.feed(rng.normal(size=(60, 2)), np.zeros(60))
    assert stream.formulas == ["v' = 0"]
    stream.feed([(0.3, 0.4)], [1.0])
    assert stream.counts() == {"v' = 0": 60, "noise": 1}
    stream.feed([(0.9, -0.4)], [1.0])
    assert stream.counts() == {"v' = 0": 60, "v' = 1": 2}


def test_a_flag_extends_a_mode_of_what_another_object_does(rng: np.random.Generator) -> None:
    signature = SlotSignature((BALL, ObjectType("action", ("a",))))
    stream = Stream(signature)
    rows = np.column_stack([rng.normal(size=20), np.zeros(20), rng.normal(size=20)])
    stream.feed(rows, 0.5 * rows[:, 2])
    assert stream.formulas == ["v' = 0.5 action.a"]
    stream.feed([(0.1, 1.0, 0.3), (0.4, 1.0, -0.2)], [0.15 + 2.0, -0.1 + 2.0])
    assert stream.formulas == ["v' = 2 w + 0.5 action.a"]


def test_where_a_target_counts_flags_that_agree_say_nothing(rng: np.random.Generator) -> None:
    stream = Stream()
    v = rng.integers(-9, 10, size=60).astype(float)
    stream.feed(np.column_stack([v, np.zeros(60)]), v)
    stream.feed([(3.0, 1.0), (-2.0, 1.0)], [5.0, 0.0])
    assert stream.counts() == {"v' = v": 60, "noise": 2}
