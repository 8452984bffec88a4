"""How laws have fared, type by type: what decides whether they are settled, and what they leave to be paid for."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from relgym.config.constants import EVIDENCE, LEFT_OPEN

__all__ = ["Ledger", "doubtful"]


def doubtful(wrong: int, count: int, share: float) -> bool:
    """Whether so many wrong ones speak for any share of them whatever rather than for one of `share` at most.

    The likelier of the two: a single wrong one of seven makes the rest doubtful where 2 % may be, one of eight doesn't.
    """
    if wrong <= share * count:
        return False
    # Of all shares alike: the integral of p^wrong (1 - p)^right, which is wrong! right! / (count + 1)!.
    right = count - wrong
    anyhow = math.lgamma(wrong + 1) + math.lgamma(right + 1) - math.lgamma(count + 2)
    return anyhow > wrong * math.log(share) + right * math.log1p(-share)


@dataclass(slots=True)
class _Tally:
    """Transitions of one type.

    Attributes
    ----------
    seen
        All.
    wrong, since
        Since the laws last changed: those that they had wrong, and all.
    unlearned
        Of the wrong ones those from which no law is learned, since several contacts acted.
    """

    seen: int = 0
    wrong: int = 0
    since: int = 0
    unlearned: int = 0


class Ledger:
    """Counts of right and wrong transitions.

    Parameters
    ----------
    types
        Names of the types whose transitions are counted.
    """

    def __init__(self, types: Iterable[str]) -> None:
        self._tallies = {name: _Tally() for name in types}

    def count(self, type_name: str, *, right: bool, learned: bool) -> None:
        """Take up a transition: whether the laws had it right, and whether laws are learned from it."""
        tally = self._tallies[type_name]
        tally.seen += 1
        tally.since += 1
        tally.wrong += not right
        tally.unlearned += not (right or learned)

    def start_again(self) -> None:
        """The laws changed: what they had wrong before says nothing of them."""
        for tally in self._tallies.values():
            tally.wrong = tally.since = tally.unlearned = 0

    def seen(self, type_name: str) -> int:
        """Number of a type's transitions."""
        return self._tallies[type_name].seen

    def unlearned(self, type_name: str) -> int:
        """Wrong transitions from which nothing is learned, since the laws last changed."""
        return self._tallies[type_name].unlearned

    def settled(self, type_name: str) -> bool:
        """Whether the laws have long been as they are, and wrong no more often since than laws may be (`LEFT_OPEN`).

        So long that laws which are wrong more often would have shown it, but for a chance that evidence excludes.
        """
        tally = self._tallies[type_name]
        told = -tally.since * math.log2(1.0 - LEFT_OPEN)
        return told >= EVIDENCE and tally.wrong <= LEFT_OPEN * tally.since

    def to_json(self) -> list[list[str | int]]:
        """Plain data that `restore` reads back."""
        return [[name, t.seen, t.wrong, t.since, t.unlearned] for name, t in sorted(self._tallies.items())]

    def restore(self, data: Iterable[Iterable[str | int]]) -> None:
        """Take over what `to_json` wrote."""
        self._tallies = {str(name): _Tally(*map(int, counts)) for name, *counts in data}
