from __future__ import annotations

import pytest

from relgym.experiments.chapter4 import claims
from relgym.experiments.chapter4.claims import CLAIMS, NOT_MEASURED, Claim, plan, verdict_of
from relgym.experiments.chapter4.protocol import Protocol


def test_there_are_at_least_forty_and_each_can_be_evaluated() -> None:
    assert len(CLAIMS) >= 40
    assert len({(c.section, c.text) for c in CLAIMS}) == len(CLAIMS)
    for claim in CLAIMS:
        assert claim.printed and claim.section.startswith(("3.", "4."))
        if claim.measure is not None:  # the wider band holds the narrower
            assert claim.near[0] <= claim.same[0] <= claim.same[1] <= claim.near[1], claim


@pytest.mark.parametrize(
    ("ours", "verdict"),
    [(1.0, "replicates"), (1.6, "partly"), (3.0, "doesn't"), (float("nan"), "doesn't"), (None, NOT_MEASURED)],
)
def test_verdicts(ours: float | None, verdict: str) -> None:
    claim = Claim("4.3", "a rate", "1", lambda _: 1.0, (0.7, 1.3), (0.5, 2.0))
    assert verdict_of(claim, ours) == verdict


def test_what_it_rests_on_is_the_thesis_alone() -> None:
    learners = {t.arguments.get("learner") for tasks in plan(Protocol.fast(1)).values() for t in tasks}
    assert learners == {"original", "thesis", None}


@pytest.mark.parametrize(
    ("positive", "clauses", "shares"),
    [
        (1, ["¬intersect(A, *)", "¬ramp(*)"], (100, 100)),
        (3, ["ramp(B) ∧ intersect(A, B)", "ramp(B)"], (0, 100)),
        (3, ["ramp(B) ∧ intersect(A, B)", "wall(B)"], (0, 0)),
        (3, [], (0, 0)),
        (1, ["ramp(B)"], (0, 0)),
    ],
)
def test_a_test_counts_in_either_place_of_the_two_modes(
    positive: int, clauses: list[str], shares: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(claims, "row_of", lambda mode, _: mode["id"])
    rows = [{"clause": clause} for clause in [*clauses, "else"]]
    pair = {"mode": positive, "other": 4 - positive, "rows": rows}
    run = {
        "modes": {"ball.vx": [{"id": 1}, {"id": 3}]},
        "report": {"targets": [{"target": "ball.vx", "pairs": [pair]}]},
    }
    for negated, share in zip((None, "ramp(B)"), shares, strict=True):
        measure = claims._clause("some", "4.2", "x", (1, 3), "¬ramp(*)", negated=negated)
        assert measure({"some": [run]}) == share
