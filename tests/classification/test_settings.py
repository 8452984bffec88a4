"""The settings' presets and ranges."""

from __future__ import annotations

from typing import Any

import pytest

from relgym.classification.learning import foil_config
from relgym.config import ClassificationConfig
from relgym.errors import ConfigError


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"votes": "loud"}, r"votes must be one of \('soft', 'hard'\), got 'loud'"),
        ({"context": "near"}, "context must be one of"),
        ({"ambiguous": "guess"}, "ambiguous must be one of"),
        ({"literal_choice": "best"}, "literal_choice must be one of"),
        ({"beam": 0}, "beam must be at least 1, got 0"),
        ({"max_new_variables": -1}, "max_new_variables must be at least 0"),
        ({"min_precision": 0.4}, "min_precision must be at least 0.5"),
        ({"max_exemplars": 10}, "max_exemplars must be at least 100"),
        ({"clause_tree_threshold": 1.5}, r"clause_tree_threshold must lie in \[0, 1\], got 1.5"),
        ({"class_balance": float("nan")}, "class_balance must be finite, got nan"),
        ({"relearn_growth": 1.0}, "relearn_growth must be greater than 1"),
    ],
)
def test_values_outside_their_range_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ClassificationConfig(**change)


def test_presets_differ_from_the_default_as_described() -> None:
    thesis, original = ClassificationConfig.thesis(), ClassificationConfig.original()
    assert (thesis.votes, thesis.literal_choice, thesis.beam) == ("hard", "negatives", 1)
    assert (thesis.clause_tree_threshold, thesis.fall_through_tree_threshold) == (0.05, 0.2)
    assert (original.literal_choice, original.min_precision, original.mdl) == ("gain", 0.9, False)
    assert (thesis.tree_errors, original.tree_errors) == ("class", "stage")
    assert not (thesis.contact_facts or thesis.numeric_literals or thesis.mode_function_features)
    assert ClassificationConfig.thesis(context="all").context == "all"
    assert ClassificationConfig.original(beam=2).beam == 2


@pytest.mark.parametrize(
    "config", [ClassificationConfig(), ClassificationConfig.thesis(), ClassificationConfig.original()]
)
def test_every_preset_is_acceptable_to_foil(config: ClassificationConfig) -> None:
    foil = foil_config(config)
    assert (foil.choice, foil.beam, foil.numeric) == (
        config.literal_choice,
        config.beam,
        config.numeric_literals,
    )
