"""Models that several modules ask; nobody teaches them anything more (who wants to, copies them)."""

from __future__ import annotations

import pytest
from worlds import ROOM_TARGETS, RawStep, learned, room, schema_of

from relgym.model.world_model import WorldModel


@pytest.fixture(scope="session")
def room_steps() -> list[RawStep]:
    return room(0, 400)


@pytest.fixture(scope="session")
def room_model(room_steps: list[RawStep]) -> WorldModel:
    return learned(schema_of(room_steps, ROOM_TARGETS), room_steps)
