from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.experiments.chapter4.scores import (
    histogram,
    mode_score,
    pooled,
    pooled_scores,
    quantile,
    target_score,
)

ERRORS = st.lists(st.floats(1e-17, 1e5), min_size=1, max_size=60)


@given(ERRORS, st.sampled_from([0.05, 0.25, 0.5, 0.75, 0.95, 0.999, 1.0]))
def test_quantiles_are_right_to_six_percent(errors: list[float], share: float) -> None:
    exact = sorted(errors)[max(0, math.ceil(share * len(errors) - 1e-9) - 1)]
    assert quantile(histogram(np.array(errors)), share) == pytest.approx(exact, rel=0.0605)


@given(ERRORS, ERRORS)
def test_pooling_is_one_histogram_of_all(first: list[float], second: list[float]) -> None:
    parts = [histogram(np.array(each)) for each in (first, second)]
    assert pooled(parts) == histogram(np.array([*first, *second]))


def test_ends_of_the_scale() -> None:
    assert quantile(histogram(np.array([0.0, 1e-30])), 1.0) == 0.0
    assert quantile(histogram(np.array([np.inf, np.nan])), 0.5) > 1e6
    assert math.isnan(quantile([], 0.5))


def test_what_went_wrong_by_hand() -> None:
    #          right  abstained  other mode known  none known  tied
    residual = np.array([0.0, 0.5, 0.5, 0.5, 1e-10])
    abstained = np.array([False, True, False, False, False])
    best = np.array([0.0, 0.0, 0.0, 0.4, 0.0])
    score = mode_score("floor", residual, abstained, best, np.full(5, -2.0))
    assert (score["examples"], score["wrong"], score["abstained"]) == (5, 3, 1)
    assert (score["unlearned"], score["misclassified"], score["strict"]) == (1, 2, 3)
    assert score["literal"] == 4  # the tie counts, too
    assert score["change"] == 10.0 and score["sum"] == pytest.approx(1.5)
    twice = pooled_scores([score, score])
    assert twice["wrong"] == 6 and twice["name"] == "floor" and quantile(twice["errors"], 1.0) > 0.4


def test_only_what_a_law_explains_is_counted_by_mode() -> None:
    truth = np.array([0, 0, 1, -1, -1])
    counted = np.array([True, True, True, True, False])
    residual, abstained = np.array([0.0, 1.0, 0.0, 1.0, 1.0]), np.zeros(5, dtype=bool)
    score = target_score(("fly", "floor"), truth, counted, residual, abstained, None, np.ones(5))
    assert [(m["name"], m["examples"], m["wrong"]) for m in score["modes"]] == [
        ("fly", 2, 1),
        ("floor", 1, 0),
        ("several contacts", 1, 1),
    ]
    assert score["all"]["wrong"] == 3 and score["counted"]["wrong"] == 2
    assert "unlearned" not in score["all"]  # laws have no modes to choose from
