from __future__ import annotations

import pytest

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
