"""The trust acceptance: opens on small prequential errors, shuts on large ones, and doesn't flutter between."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.wrappers.sb3.acceptance import ModelAcceptance, Verdict

KEY = ("cart", "v")


def acceptance(**changes: float) -> ModelAcceptance:
    settings = {"accept_at": 0.1, "reject_at": 0.5, "window": 10, "least": 5} | changes
    return ModelAcceptance(**settings)  # type: ignore[arg-type]


def step(off: float, change: float = 1.0) -> Verdict:
    return Verdict({KEY: off}, {KEY: change})


def test_opens_after_enough_good_steps() -> None:
    g = acceptance()
    for k in range(5):
        assert not g.accepted, k
        g.count(step(0.0))
    assert g.accepted
    assert (g.error, g.known, g.switches) == (0.0, 1.0, 1)


def test_hysteresis() -> None:
    g = acceptance(window=5)
    for off in (0, 0, 0, 0, 0):
        g.count(step(off))
    for off in (1, 1):  # 0.4: above what opens, below what shuts
        g.count(step(off))
    assert g.accepted
    assert g.error == pytest.approx(0.4)
    g.count(step(1.0))
    assert not g.accepted
    for off in (0, 0, 0, 0):  # 0.2: below what shuts, above what opens
        g.count(step(off))
    assert g.error == pytest.approx(0.2)
    assert not g.accepted
    g.count(step(0.0))
    assert g.accepted
    assert g.switches == 3


def test_errors_are_measured_in_what_the_property_moves() -> None:
    small, large = acceptance(least=1), acceptance(least=1)
    for _ in range(5):
        small.count(step(0.5, change=10.0))
        large.count(step(0.5, change=1.0))
    assert small.error == pytest.approx(0.05)
    assert large.error == pytest.approx(0.5)


def test_the_worst_property_decides_and_one_step_counts_once() -> None:
    g = acceptance(least=1)
    g.count(Verdict({KEY: 0.0, ("task", "reward"): -70.0}, {KEY: 1.0, ("task", "reward"): 1.0}))
    assert g.error == 1.0


def test_silence_neither_opens_nor_counts() -> None:
    g = acceptance()
    for _ in range(20):
        g.count(Verdict({}, {KEY: 1.0}))
    assert not g.accepted
    assert (g.error, g.known) == (1.0, 0.0)


def test_what_never_moves_allows_no_error() -> None:
    g = acceptance(least=1)
    g.count(step(0.0, change=0.0))
    assert g.error == 0.0
    g.count(step(1e-3, change=0.0))
    assert g.error == 0.5


@given(st.lists(st.floats(-3, 3), min_size=1, max_size=40))
def test_open_only_below_shut_at(offs: list[float]) -> None:
    g = acceptance(window=7, least=3)
    for off in offs:
        g.count(step(off))
        assert 0.0 <= g.error <= 1.0
        assert not g.accepted or g.error < g.reject_at
