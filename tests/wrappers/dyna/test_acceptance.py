"""Models are accepted on small prequential errors, rejected on large ones, and stay as they are in between."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.wrappers.dyna.acceptance import ModelAcceptance, Verdict

KEY = ("cart", "v")


def acceptance(**changes: float) -> ModelAcceptance:
    settings = {"accept_at": 0.1, "reject_at": 0.5, "window": 10, "least": 5} | changes
    return ModelAcceptance(**settings)  # type: ignore[arg-type]


def step(off: float, change: float = 1.0) -> Verdict:
    return Verdict({KEY: off}, {KEY: change})


def test_a_model_is_accepted_after_enough_good_steps() -> None:
    a = acceptance()
    for k in range(5):
        assert not a.accepted, k
        a.count(step(0.0))
    assert a.accepted
    assert (a.error, a.known, a.switches) == (0.0, 1.0, 1)


def test_hysteresis() -> None:
    a = acceptance(window=5)
    for off in (0, 0, 0, 0, 0):
        a.count(step(off))
    for off in (1, 1):  # 0.4: too much to be accepted, too little to be rejected
        a.count(step(off))
    assert a.accepted
    assert a.error == pytest.approx(0.4)
    a.count(step(1.0))
    assert not a.accepted
    for off in (0, 0, 0, 0):  # 0.2: too little to be rejected, too much to be accepted
        a.count(step(off))
    assert a.error == pytest.approx(0.2)
    assert not a.accepted
    a.count(step(0.0))
    assert a.accepted
    assert a.switches == 3


def test_errors_are_measured_in_what_the_property_moves() -> None:
    small, large = acceptance(least=1), acceptance(least=1)
    for _ in range(5):
        small.count(step(0.5, change=10.0))
        large.count(step(0.5, change=1.0))
    assert small.error == pytest.approx(0.05)
    assert large.error == pytest.approx(0.5)


def test_the_worst_property_decides_and_one_step_counts_once() -> None:
    a = acceptance(least=1)
    a.count(Verdict({KEY: 0.0, ("task", "reward"): -70.0}, {KEY: 1.0, ("task", "reward"): 1.0}))
    assert a.error == 1.0


def test_steps_without_a_prediction_neither_count_nor_accept() -> None:
    a = acceptance()
    for _ in range(20):
        a.count(Verdict({}, {KEY: 1.0}))
    assert not a.accepted
    assert (a.error, a.known) == (1.0, 0.0)


def test_what_never_moves_allows_no_error() -> None:
    a = acceptance(least=1)
    a.count(step(0.0, change=0.0))
    assert a.error == 0.0
    a.count(step(1e-3, change=0.0))
    assert a.error == 0.5


@given(st.lists(st.floats(-3, 3), min_size=1, max_size=40))
def test_accepted_only_below_reject_at(offs: list[float]) -> None:
    a = acceptance(window=7, least=3)
    for off in offs:
        a.count(step(off))
        assert 0.0 <= a.error <= 1.0
        assert not a.accepted or a.error < a.reject_at
