"""Sizes, in small."""

from __future__ import annotations

import pytest

from relgym.experiments.speed import sizes as sizes
from relgym.experiments.speed.sizes import cost, many_bodies, many_kinds, many_properties


def test_worlds_are_as_large_as_they_say() -> None:
    (bodies, *_), (kinds, *_), (properties, *_) = (
        list(make(20, 3)) for make in (many_bodies, many_kinds, many_properties)
    )
    assert len(bodies.before.layout.bodies) == 20
    assert len({kind.name for kind in kinds.before.layout.types}) == 20
    changed = bodies.after.vector != bodies.before.vector
    assert changed.any()
    still = properties.before.vector == properties.after.vector
    assert properties.before.layout.width == 20 and still.sum() == 14


def test_what_it_costs_is_told_or_why_it_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    few = {
        "few": (lambda size: many_kinds(size, 20), 5),
        "wide": (lambda size: many_properties(size, 2), 2800),
    }
    monkeypatch.setattr(sizes, "WORLDS", few)
    found = cost("few")
    assert found["steps"] == 20 and 0.0 < found["mean"] <= found["worst"] and found["memory"] > 10.0
    assert not found["refused"]
    refused = cost("wide")
    assert refused["steps"] == 0 and "at most 256" in refused["refused"]
