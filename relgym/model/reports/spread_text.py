"""Spreads in words: one for all actions, or action by action where they differ much."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relgym.model.target.spread import Spread

__all__ = ["spread_text"]

SINGLE, ALIKE = 8, 2.0
"""More actions than `SINGLE` are told in groups, whose spreads differ by at most the factor `ALIKE`."""

_Action = tuple[float, ...]


def spread_text(spread: Spread, names: Sequence[str]) -> str:
    """A mode's spread, such as ``± 0.05 after left; ± 0.001 after others``.

    Parameters
    ----------
    spread
        The spread.
    names
        Names of the action's properties.

    Examples
    --------
    >>> spread_text(Spread(0.4, {(0.0, 1.0, 0.0): 0.1, (1.0, 0.0, 1.0): 0.5}), ("a", "left", "right"))
    '± 0.1 after left; ± 0.5 after right'
    """
    if spread.split is not None:
        return str(spread.split)
    if spread.pooled:
        return f"± {spread.whole:.2g} over all actions: more than are told apart"
    if not spread.uneven():
        return f"± {spread.whole:.2g}"
    known = spread.by_action
    told = labels(list(known), names)
    if len(known) <= SINGLE:
        return "; ".join(f"± {s:.2g} after {told[a]}" for a, s in known.items())
    groups = _alike(known)
    most = max(groups, key=len)
    texts = [
        f"± {_size([known[a] for a in group]):.2g} after {' or '.join(told[a] for a in group)}"
        for group in groups
        if group is not most
    ]
    return "; ".join([*texts, f"± {_size([known[a] for a in most]):.2g} after any other"])


def labels(actions: Sequence[_Action], names: Sequence[str]) -> dict[_Action, str]:
    """Actions for people: a choice's name or number rather than its indicators.

    Examples
    --------
    >>> labels([(0.0, 1.0, 0.0), (1.0, 0.0, 1.0)], ("a", "a_is_0", "a_is_1"))
    {(0.0, 1.0, 0.0): '0', (1.0, 0.0, 1.0): '1'}
    >>> labels([(0.0, 1.0, 0.0), (1.0, 0.0, 1.0)], ("a", "left", "right"))
    {(0.0, 1.0, 0.0): 'left', (1.0, 0.0, 1.0): 'right'}
    >>> labels([(0.5, -1.0)], ("a0", "a1"))
    {(0.5, -1.0): '0.5, -1'}
    """
    shown = list(range(len(actions[0]))) if actions else []
    if len(names) == len(shown):
        shown = [k for k in shown if not _indicates(names[k], names)]
        if len(shown) == len(names) > 2 and _choices(actions):
            return {a: names[1 + a[1:].index(1.0)] for a in actions}
    return {a: ", ".join(f"{a[k]:g}" for k in shown) for a in actions}


def _indicates(name: str, names: Sequence[str]) -> bool:
    """Whether a property is that another one has a certain value."""
    number, found, _ = name.rpartition("_is_")
    return bool(found) and number in names


def _choices(actions: Sequence[_Action]) -> bool:
    """Whether every action is a number, counted from somewhere, and a 1 among zeros at that place."""
    starts = {
        number - places.index(1.0) if sorted(places) == [0.0] * (len(places) - 1) + [1.0] else np.nan
        for number, *places in actions
    }
    return len(starts) == 1 and np.isfinite(starts.pop())


def _alike(known: dict[_Action, float]) -> list[list[_Action]]:
    """Actions in groups of similar spreads, from the smallest on; in each in their order."""
    groups: list[list[_Action]] = []
    for action, spread in sorted(known.items(), key=lambda pair: pair[1]):
        if groups and spread <= ALIKE * known[groups[-1][0]]:
            groups[-1].append(action)
        else:
            groups.append([action])
    return [sorted(group) for group in groups]


def _size(spreads: Sequence[float]) -> float:
    return float(np.sqrt(np.square(spreads).mean()))
