"""A ratchet: the numbers that the learner was tuned with may become fewer, never more.

A constant belongs in `relgym.config`, with its unit, what it means and what it follows from; best of all, it is written
as what it follows from, and isn't free. Free ones are counted here by package: named ones (in capitals, at module
level), and numbers in the code besides, but for 0, 1, 2, their halves and places in arrays. Who removes some lowers the
bound in the same change; who needs a new one finds another that can go. `python tests/support/constants.py` lists them.
"""

from __future__ import annotations

import ast

import pytest
from constants import _constants, counted
from source_tree import ROOT, Module

MOST = {
    "classification": (0, 0),
    "clustering": (0, 0),
    "config": (30, 0),
    "hypotheses": (0, 0),
    "laws": (0, 0),
    "logic": (0, 0),
    "model": (0, 0),
    "numeric": (0, 0),
    "scheduling": (0, 0),
}
"""Most constants of each package: named ones, and others."""


@pytest.mark.parametrize("package", sorted(MOST))
def test_constants_become_fewer(package: str) -> None:
    found, most = counted()[package], MOST[package]
    for kind, count, bound in zip(("named constants", "numbers in the code"), found, most, strict=True):
        assert count <= bound, (
            f"relgym.{package} has {count} {kind}, at most {bound} are allowed: put a new one into relgym.config, "
            "with unit, meaning and derivation, or write it as what it follows from "
            "(python tests/support/constants.py lists them)"
        )


def test_what_counts() -> None:
    code = '''
FIRST, SECOND = 3, 0.5
NAMES = ("a", "b")
HALF_OF_IT, NONE = 0.5 * FIRST, -1
MORE = 3 * FIRST
plain = 7

def f(x, most=12):
    """3 apples."""
    return x[:, 3] + 2 * x[0] - 1 + 0.25 if x > -4 else True
'''
    module = Module("relgym.example", ROOT / "example.py")
    module.__dict__["tree"] = ast.parse(code)
    found = [(c.text, c.named) for c in _constants(module)]
    assert sorted(found) == sorted(
        [
            ("FIRST", True),
            ("SECOND", True),
            ("MORE", True),
            ("7", False),
            ("12", False),
            ("0.25", False),
            ("4", False),
        ]
    )
