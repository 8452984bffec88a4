"""A ratchet: the numbers that the learner was tuned with may become fewer, never more.

A constant belongs in `relgym.config`, with its unit, what it means and what it follows from; best of all, it follows
from others and isn't needed. Those elsewhere are counted here by package: named ones (in capitals, at module level),
and numbers in the code besides, but for 0, 1, 2, their halves and places in arrays. Who removes some lowers the bound
in the same change; who needs a new one finds another that can go. `python tests/support/constants.py` lists them all.
"""

from __future__ import annotations

import ast

import pytest
from constants import PACKAGES, _constants, counted
from source_tree import ROOT, Module

MOST = {
    "classification": (3, 1),
    "clustering": (2, 7),
    "hypotheses": (0, 0),
    "laws": (0, 0),
    "logic": (0, 0),
    "model": (10, 2),
    "numeric": (0, 5),
    "scheduling": (0, 0),
}
"""Most constants of each package: named ones, and others."""


@pytest.mark.parametrize("package", PACKAGES)
def test_constants_become_fewer(package: str) -> None:
    found, most = counted()[package], MOST[package]
    for kind, count, bound in zip(("named constants", "numbers in the code"), found, most, strict=True):
        assert count <= bound, (
            f"relgym.{package} has {count} {kind}, at most {bound} are allowed: put a new one into relgym.config, "
            "with unit, meaning and derivation, or derive it (python tests/support/constants.py lists them)"
        )


def test_what_counts() -> None:
    code = '''
FIRST, SECOND = 3, 0.5
NAMES = ("a", "b")
plain = 7

def f(x, most=12):
    """3 apples."""
    return x[:, 3] + 2 * x[0] - 1 + 0.25 if x > -4 else True
'''
    module = Module("relgym.example", ROOT / "example.py")
    module.__dict__["tree"] = ast.parse(code)
    found = [(c.text, c.named) for c in _constants(module)]
    assert sorted(found) == sorted(
        [("FIRST", True), ("SECOND", True), ("7", False), ("12", False), ("0.25", False), ("4", False)]
    )
