from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from relgym.laws.ledger import Ledger, doubtful

SETTLED = 344
"""If one in fifty were wrong, none of so many would be once in a thousand times: 0.98^344 < 2^-10 < 0.98^343."""


def test_laws_settle_while_hardly_ever_wrong() -> None:
    ledger = Ledger(["thing"])
    for _ in range(SETTLED - 1):
        ledger.count("thing", right=True, learned=True)
    assert not ledger.settled("thing")
    ledger.count("thing", right=True, learned=False)
    assert ledger.settled("thing")
    for _ in range(SETTLED // 49):
        ledger.count("thing", right=False, learned=True)
        assert ledger.settled("thing")
    ledger.count("thing", right=False, learned=True)
    assert not ledger.settled("thing")
    assert (ledger.seen("thing"), ledger.unlearned("thing")) == (SETTLED + SETTLED // 49 + 1, 0)


def test_what_no_law_learns_from_is_counted_until_laws_change() -> None:
    ledger = Ledger(["one", "two"])
    ledger.count("one", right=False, learned=False)
    ledger.count("one", right=True, learned=False)
    ledger.count("two", right=False, learned=True)
    assert [ledger.unlearned(name) for name in ("one", "two")] == [1, 0]
    ledger.start_again()
    assert (ledger.unlearned("one"), ledger.seen("one")) == (0, 2)


def test_saved_and_restored() -> None:
    ledger, other = Ledger(["thing"]), Ledger(["thing"])
    ledger.count("thing", right=False, learned=False)
    other.restore(ledger.to_json())
    assert other.to_json() == ledger.to_json() == [["thing", 1, 1, 1, 1]]


def test_doubt_goes_by_what_is_likelier() -> None:
    assert not doubtful(0, 0, 0.02)
    assert not doubtful(0, 1_000, 0.02)
    # 1 / (8 * 7) of all shares alike, 0.02 * 0.98^6 of 2 %.
    assert doubtful(1, 7, 0.02)
    assert not doubtful(1, 8, 0.02)
    assert doubtful(2, 19, 0.02)
    assert not doubtful(2, 20, 0.02)
    assert not doubtful(34, 1_000, 0.02)
    assert doubtful(35, 1_000, 0.02)
    assert doubtful(300, 1_000, 0.1)


@given(st.integers(0, 2_000), st.integers(0, 2_000), st.floats(0.01, 0.5))
def test_more_right_ones_never_make_doubtful(wrong: int, right: int, share: float) -> None:
    count = wrong + right
    assert doubtful(wrong + 1, count + 1, share) or not doubtful(wrong, count, share)
    assert doubtful(wrong, count, share) or not doubtful(wrong, count + 1, share)
