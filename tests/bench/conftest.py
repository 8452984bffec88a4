"""Marks every test of this folder as a benchmark, so that plain `pytest` leaves it out."""

from __future__ import annotations

from pathlib import Path

import pytest

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    # The hook is called with the items of the whole session, not of this folder alone.
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.bench)
