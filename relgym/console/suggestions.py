"""What a misspelt word may have meant."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

__all__ = ["did_you_mean", "nearest"]


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word that comes nearest to a misspelt one, whatever their case; None if all are far.

    Examples
    --------
    >>> nearest("cartpole-v1", ["CartPole-v1", "Pendulum-v1"])
    'CartPole-v1'
    >>> nearest("draws", ["clustering.draws", "seed"])
    'clustering.draws'
    """
    words = sorted(known)
    lower = {each.lower(): each for each in reversed(words)}
    if found := get_close_matches(word.lower(), lower, n=1, cutoff=0.65):
        return lower[found[0]]
    # Of names with a prefix (clustering.draws, relgym/TruckPush-v0) people remember what stands behind it.
    ends = {each.replace("/", ".").rpartition(".")[2].lower(): each for each in reversed(words)}
    found = get_close_matches(word.lower(), ends, n=1, cutoff=0.65)
    return ends[found[0]] if found else None


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """``; did you mean 'x'?``, or nothing, to stand behind a message."""
    found = nearest(word, known)
    return f"; did you mean {found!r}?" if found else ""
