"""Every example in a docstring gives what it says, under the module's installed name."""

from __future__ import annotations

import doctest
import importlib

import pytest
from source_tree import modules

WITH_EXAMPLES = [
    pytest.param(m.name, marks=[pytest.mark.sb3] if m.name.startswith("relgym.wrappers.sb3") else [])
    for m in modules()
    if ">>>" in m.path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_docstring_examples(name: str) -> None:
    # Not --doctest-modules: it would import envs/ and wrappers/ under their names in the checkout.
    found = doctest.DocTestFinder().find(importlib.import_module(name))
    assert any(test.examples for test in found)
    result = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS)
    assert result.failed == 0, "the difference stands in the captured output"
