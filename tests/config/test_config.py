"""Parameters: what they refuse, and files that give them back."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.config import ClassificationConfig, ClusteringConfig, ModelConfig
from relgym.errors import ConfigError


@pytest.mark.parametrize(
    ("record", "wrong", "message"),
    [
        (ClassificationConfig, {"context": "near"}, "context must be one of .*'approached'.*, got 'near'"),
        (ClassificationConfig, {"beam": 0}, "beam must be at least 1, got 0"),
        (ClassificationConfig, {"exemplars_alone": 0}, "exemplars_alone must be at least 1, got 0"),
        (ClassificationConfig, {"max_new_variables": -1}, "max_new_variables must be at least 0, got -1"),
        (ClassificationConfig, {"max_exemplars": 99}, "max_exemplars must be at least 100, got 99"),
        (
            ClassificationConfig,
            {"clause_tree_threshold": 1.5},
            r"clause_tree_threshold must lie in \[0, 1\], got 1.5",
        ),
        (
            ClassificationConfig,
            {"fall_through_tree_threshold": float("nan")},
            "fall_through_tree_threshold must be finite, got nan",
        ),
        (ClassificationConfig, {"relearn_growth": 1.0}, "relearn_growth must be greater than 1, got 1.0"),
        (ClusteringConfig, {"noise_std": 0.0}, "noise_std must be 'auto' or a positive float, got 0.0"),
        (
            ClusteringConfig,
            {"noise_std": "small"},
            "noise_std must be 'auto' or a positive float, got 'small'",
        ),
        (ClusteringConfig, {"min_examples": 3}, "min_examples must be 'auto' or an int >= 4, got 3"),
        (ClusteringConfig, {"draws": 0}, "draws must be at least 1, got 0"),
        (ClusteringConfig, {"unify_ratio": 0.4}, r"unify_ratio must lie in \[0.5, 1\], got 0.4"),
        (ClusteringConfig, {"refit_growth": 1.0}, "refit_growth must be greater than 1, got 1.0"),
        (ModelConfig, {"geometry": "bullet"}, "geometry must be one of"),
        (ModelConfig, {"frames": "own"}, "frames must be one of"),
        (ClusteringConfig, {"inlier_stds": 0}, "inlier_stds must be at least 1e-06, got 0"),
        (ClusteringConfig, {"tail_stds": 1e7}, "tail_stds must be at most 1,000,000.0, got 10000000.0"),
        (ClusteringConfig, {"noise_std": 1e-160}, "noise_std must be at least 1e-100, got 1e-160"),
        (ClusteringConfig, {"noise_std": 1e160}, r"noise_std must be at most 1e\+100, got 1e\+160"),
        (ClusteringConfig, {"min_examples": 10**7}, "min_examples must be at most 1,000,000, got 10000000"),
        (ClusteringConfig, {"draws": 10**6}, "draws must be at most 100,000, got 1000000"),
        (ClassificationConfig, {"beam": 257}, "beam must be at most 256, got 257"),
        (ClassificationConfig, {"max_exemplars": 10**8}, "max_exemplars must be at most 10,000,000"),
        (ModelConfig, {"history": 10**10}, "history must be at most 1,000,000,000, got 10000000000"),
        (ClusteringConfig, {"inlier_stds": "two"}, "inlier_stds must be a number, got 'two'"),
        (ClusteringConfig, {"draws": 2.5}, "draws must be a whole number, got 2.5"),
        (ClassificationConfig, {"beam": None}, "beam must be a whole number, got None"),
        (ClassificationConfig, {"beam": True}, "beam must be a whole number, got True"),
        (ModelConfig, {"clustering": {}}, "clustering must be a ClusteringConfig, got {}"),
        (ModelConfig, {"classification": None}, "classification must be a ClassificationConfig, got None"),
        (ModelConfig, {"abstain": 1}, "abstain must be True or False, got 1"),
        (ModelConfig, {"seed": -1}, "seed must be at least 0, got -1"),
        (ModelConfig, {"history": 99}, "history must be at least 100, got 99"),
        (
            ModelConfig,
            {"features": "trig"},
            r"features must be a tuple of names, such as \('trig',\), got 'trig'",
        ),
    ],
)
def test_what_cannot_be_is_refused(record: Any, wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        record(**wrong)
    with pytest.raises(ConfigError, match=message):
        replace(record(), **wrong)


def test_numpys_numbers_become_plain_ones_so_that_files_can_hold_them() -> None:
    numbers: dict[str, Any] = {"inlier_stds": np.float32(3.0), "draws": np.int32(7)}
    config = ModelConfig(seed=np.int64(3), clustering=ClusteringConfig(**numbers))  # type: ignore[arg-type]
    found = (config.seed, config.clustering.inlier_stds, config.clustering.draws)
    assert [type(n) for n in found] == [int, float, int]
    assert json.loads(json.dumps(config.to_json()))["seed"] == 3


def test_nobody_changes_them_under_a_model() -> None:
    config: Any = ModelConfig()
    with pytest.raises(FrozenInstanceError):
        config.seed = 1


@pytest.mark.parametrize(("history", "examples"), [(200_000, 3_000), (60_000, 3_000), (1_000, 50), (100, 10)])
def test_a_short_history_bounds_what_is_remembered(history: int, examples: int) -> None:
    assert ModelConfig(history=history).classifying.exemplars_alone == examples


@given(
    st.sampled_from([ModelConfig(), ModelConfig(frames="world", abstain=False)]),
    st.integers(0, 2**31),
    st.lists(st.sampled_from(["trig", "cart:products", "squares"]), unique=True).map(tuple),
)
def test_written_and_read_they_are_the_same(
    config: ModelConfig, seed: int, features: tuple[str, ...]
) -> None:
    config = replace(config, seed=seed, features=features)
    assert ModelConfig.from_json(json.loads(json.dumps(config.to_json()))) == config
