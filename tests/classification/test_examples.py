"""The records that classifiers are shown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_situations import BALL_VOCABULARY, ball_stream

from relgym.classification.examples import ExampleBatch, Vocabulary, check_example
from relgym.errors import ConfigError, ObservationError


def test_names_must_differ_from_one_another_and_from_mode_functions() -> None:
    with pytest.raises(ConfigError, match=r"rename \['ball'\]"):
        Vocabulary(relations=("intersect",), unary=("ball",), own=("ball",))
    with pytest.raises(ConfigError, match=r"rename \['F2 - F10'\]"):
        Vocabulary(relations=(), unary=(), own=("F2 - F10",))


def test_vocabulary_survives_json() -> None:
    assert Vocabulary.from_dict(BALL_VOCABULARY.to_dict()) == BALL_VOCABULARY


def test_batch_gives_back_what_was_stacked() -> None:
    examples = [item.example for item in ball_stream(5, rng=np.random.default_rng(0))]
    batch = ExampleBatch.stack(examples)
    assert len(batch) == 5
    for name in ("table", "unary", "close", "pair", "own"):
        np.testing.assert_array_equal(getattr(batch[3], name), getattr(examples[3], name))


def test_wrong_shapes_are_named() -> None:
    example = next(ball_stream(1, rng=np.random.default_rng(0))).example
    check_example(BALL_VOCABULARY, example)
    with pytest.raises(ObservationError, match=r"expected own of shape \(2,\) for 6 objects, got \(3,\)"):
        check_example(BALL_VOCABULARY, replace(example, own=np.zeros(3)))
    with pytest.raises(ObservationError, match="target 6 is none of its 6 objects"):
        check_example(BALL_VOCABULARY, replace(example, target=6))
