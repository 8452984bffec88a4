"""Names for conditions, from what happens where they hold: ``bouncing``, ``resting on floor``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from relgym.errors import ConfigError
from relgym.reporting.functions import Sum
from relgym.reporting.rules import Branch, RuleList

__all__ = ["named", "named_text", "word_for"]

SHORT: Final = 24
"""Conditions of fewer characters tell themselves."""


def named(branches: Iterable[Branch], prop: str) -> tuple[Branch, ...]:
    """The branches with names for the conditions that are too long to be told in place.

    Parameters
    ----------
    branches
        In order.
    prop
        The property that they predict.
    """
    found: list[Branch] = []
    used: dict[str, int] = {}
    for branch in branches:
        if not branch.cases or branch.function is None or len(branch.text) < SHORT:
            found.append(branch)
            continue
        name = word_for(branch.function, prop)
        used[name] = used.get(name, 0) + 1
        found.append(replace(branch, name=name if used[name] == 1 else f"{name} {_letter(used[name])}"))
    return tuple(found)


def word_for(function: Sum, prop: str) -> str:
    """What a property does where a function holds, in a word."""
    weights = {name: float(f"{weight:.9g}") for weight, name in function.terms}
    own = weights.get(prop, 0.0)
    if not weights:
        return "at rest" if function.constant == 0.0 else "held"
    if set(weights) == {prop}:
        if own == 1.0:
            return "steady" if function.constant == 0.0 else "drifting"
        return "bouncing" if own < 0.0 else "changing"
    if own == 1.0:
        return "driven"
    return "deflected" if own else "led"


def named_text(rules: RuleList, condition: str) -> str:
    """The text of a condition, given that or its name; with ``target: name`` that of one property only.

    Raises
    ------
    ConfigError
        There is no such condition, or there are several.
    """
    target, _, bare = condition.rpartition(": ")
    found = {
        branch.text
        for part in rules.properties
        for branch in part.branches
        if branch.cases and (not target or part.target == target) and bare in (branch.name, branch.text)
    }
    if len(found) != 1:
        known = [f"{p.target}: {name}" for p in rules.properties for name in p.names]
        problem = "several conditions are" if found else "no condition is"
        raise ConfigError(f"{problem} called {condition!r}; there are {known}, or give a condition's text")
    return found.pop()


def _letter(number: int) -> str:
    return chr(ord("a") + number - 1) if number <= 26 else f"a{number}"
