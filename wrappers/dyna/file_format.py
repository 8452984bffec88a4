"""The declared format of what a reward model's file holds beside its model, under `extra`."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from relgym.files.records import Count, Finite, Pair, Random, Record
from relgym.model.files.format import SchemaRecord

__all__ = ["RewardModelBody"]

_Steps = Annotated[list[list[Finite]], Meta(max_length=500)]


class RewardModelBody(Record):
    """The scenes' schema, what changes, remembered steps (state vectors), and modes that were right together."""

    schema: SchemaRecord
    changing: list[Pair]
    ends: _Steps
    latest: _Steps
    earlier: _Steps
    passed: Count
    rng: Random
    together: list[tuple[Count, Count]]
    reviewed: tuple[Count, list[Count]]
