from __future__ import annotations

from typing import Any

import pytest

from relgym.config.logic import FoilConfig
from relgym.errors import ConfigError


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("choice", "random", "one of .*gain.*negatives"),
        ("max_literals", 0, "at least 1"),
        ("max_clauses", 0, "at least 1"),
        ("max_new_variables", -1, "at least 0"),
        ("beam", 0, "at least 1"),
        ("lookahead", -1, "at least 0"),
        ("min_precision", 1.1, r"in \[0, 1\]"),
        ("min_precision", float("nan"), r"in \[0, 1\]"),
    ],
)
def test_values_outside_their_range_are_refused(field: str, value: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=f"{field} must .*{message}"):
        FoilConfig(**{field: value})
