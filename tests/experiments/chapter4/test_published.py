"""The transcription against what the thesis says about it elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.experiments.analytic import analytic_modes
from relgym.experiments.chapter4.published import (
    CONFUSIONS,
    MODES,
    ROLLOUT_FAILURES,
    published_pairs,
)
from relgym.experiments.chapter4.tables_modes import row_of
from relgym.experiments.data import BALL_EXPERIMENTS


@pytest.mark.parametrize(
    ("table", "experiment", "examples"), [("4.2", 1, 16_000), ("4.9", 2, 32_000), ("4.17", 3, 96_000)]
)
def test_examples_add_up(table: str, experiment: int, examples: int) -> None:
    for (name, _), rows in MODES.items():
        if name == table:
            assert sum(row.examples for row in rows) == pytest.approx(examples, rel=5e-3)


@pytest.mark.parametrize(("table", "experiment"), [("4.2", 1), ("4.9", 2), ("4.17", 3)])
def test_every_printed_function_follows_from_physics(table: str, experiment: int) -> None:
    setting = BALL_EXPERIMENTS[experiment]
    laws = analytic_modes(setting.incline, setting.elasticity, setting.frictions)
    for (name, axis), rows in MODES.items():
        if name != table:
            continue
        known = [(*law.weights, law.intercept) for law in (laws.x if axis == "x" else laws.y)]
        for row in rows:
            if row.weights is not None:
                off = [np.abs(np.subtract(k, (*row.weights, row.intercept))).max() for k in known]
                assert min(off) < 5e-4, (axis, row)


@pytest.mark.parametrize(
    ("table", "rate"), [("4.7", 0.005), ("4.8", 0.011), ("4.15", 0.033), ("4.16", 0.010)]
)
def test_confusions_have_the_printed_rates(table: str, rate: float) -> None:
    found = CONFUSIONS[table]
    assert round(found.rate, 3) == rate
    assert all(row[k] == 0 for k, row in enumerate(found.errors))
    assert len(found.errors) == len(found.errors[0]) == len(found.examples)


@pytest.mark.parametrize(
    ("table", "columns"), [("4.15", [37, 43, 626, 11, 63, 0]), ("4.16", [15, 69, 138, 7, 5, 0])]
)
def test_columns_have_the_printed_totals(table: str, columns: list[int]) -> None:
    assert [sum(column) for column in zip(*CONFUSIONS[table].errors, strict=True)] == columns


def test_clauses() -> None:
    every = {t: published_pairs(t) for t in ("3.2", "4.3", "4.4", "4.5", "4.6")}
    every |= {t: published_pairs(t) for t in ("4.10", "4.11", "4.12", "4.13", "4.14")}
    assert [len(pairs) for pairs in every.values()] == [3, 3, 1, 6, 1, 7, 8, 5, 8, 2]
    # 6 modes have 15 pairs (§3.4.3), in x as in y.
    for tables in (("4.10", "4.11"), ("4.12", "4.13", "4.14")):
        assert len({frozenset((p.mode, p.other)) for t in tables for p in every[t]}) == 15
    assert every["3.2"][0].clauses[0].clause == "y-greater-than(B, A) ∧ on-top(C, B)"
    assert [p.negated for p in every["4.3"]] == [False, False, True]
    assert every["4.5"][1].clauses[-1].tree


@pytest.mark.parametrize("table", ["3.2", "4.4", "4.6"])
def test_training_performance_follows_from_the_counts(table: str) -> None:
    for pair in published_pairs(table):
        right, wrong = sum(c.correct for c in pair.clauses), sum(c.incorrect for c in pair.clauses)
        assert right / (right + wrong) == pytest.approx(pair.performance, abs=0.03)


def test_failures_of_roll_outs() -> None:
    assert sum(ROLLOUT_FAILURES.values()) == 34


def test_learned_modes_find_their_rows() -> None:
    rows = MODES["4.2", "x"]
    mode = {"others": 0, "weights": {"vx": 0.525, "vy": -0.8227241}, "intercept": 4.24352e-4}
    assert row_of(mode, rows) == 3
    assert row_of(mode | {"weights": {"vx": 1.0}, "intercept": 0.0}, rows) == 1
    assert row_of(mode | {"weights": {"vx": 1.0}, "intercept": 1e-4}, rows) == 0
    assert row_of(mode | {"weights": {"vx": 0.525, "sx": 1.0}}, rows) == 0
    assert row_of(mode | {"others": 1}, rows) == 0
