from __future__ import annotations

from relgym.laws.ledger import SETTLED, Ledger, doubtful


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


def test_doubt_takes_evidence() -> None:
    assert not doubtful(0, 0, 0.02)
    assert not doubtful(1, 1, 0.02)  # 5.6 bits
    assert doubtful(2, 2, 0.02)  # 11.3 bits
    assert not doubtful(2, 4, 0.02)
    assert not doubtful(2, 100, 0.02)
    assert doubtful(300, 1_000, 0.1)
