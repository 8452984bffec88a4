"""Declarations of types: what is refused, and that lists are as good as tuples."""

from __future__ import annotations

from typing import Any

import pytest

from relgym.errors import SchemaError
from relgym.scene.shapes import Box
from relgym.scene.types import ObjectType


def test_properties_may_be_a_list() -> None:
    listed = ObjectType("p", ["x", "v"])  # type: ignore[arg-type]
    assert listed == ObjectType("p", ("x", "v")) and hash(listed) == hash(ObjectType("p", ("x", "v")))


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"properties": "xv"}, "expected a tuple of property names, got 'xv'"),
        ({"properties": ("x", "x")}, "property names must differ"),
        ({"shape": Box}, r"expected a shape such as Box\(\), got <class"),
        ({"shape": "box"}, r"expected a shape such as Box\(\), got 'box'"),
        ({"pose": {"px": "y"}}, "'y' is named as a pose"),
        ({"pose": {"pw": "x"}}, "'pw' is no pose component"),
        ({"velocity": ("x",)}, "velocity needs three entries"),
        ({"angles": ("th",)}, "'th' is named as"),
    ],
)
def test_what_cannot_be_is_refused(declared: dict[str, Any], message: str) -> None:
    with pytest.raises(SchemaError, match=message):
        ObjectType("p", **{"properties": ("x", "v"), **declared})
