"""How laws are measured: on which seeds, taught by what, and what counts as wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.experiments.episodes import Episode
from relgym.experiments.rooms import Room
from relgym.laws.book import LawBook
from relgym.laws.touching import Contacts
from relgym.model.world_model import WorldModel
from relgym.scene.relations import Extractor

__all__ = ["SEEDS", "TESTS", "WRONG", "Part", "Score", "laws_of", "score", "score_laws", "taught"]

WRONG: Final = 1e-9
"""A velocity component off by more than this is wrong."""

SEEDS: Final = tuple(range(400, 410))
"""Training seeds; nothing was chosen on them."""

TESTS: Final = tuple(range(500, 505))
"""Seeds of the test sets; nothing was chosen on them either."""

Part: TypeAlias = Episode | Room
"""Consecutive scenes with the same objects."""


@dataclass(frozen=True, slots=True)
class Score:
    """One-step predictions: how many, wrong ones, and those that were not made."""

    transitions: int
    wrong: int
    abstained: int

    @property
    def bad(self) -> int:
        """Predictions that aren't right, for whatever reason."""
        return self.wrong + self.abstained

    @property
    def share(self) -> float:
        """Share of predictions that aren't right."""
        return self.bad / self.transitions


def score(model: WorldModel, parts: Iterable[Part]) -> Score:
    """Let a model predict every transition one step ahead."""
    total = wrong = abstained = 0
    for part in parts:
        found = model.predict_batch(part.layout, part.vectors[:-1])
        columns = [part.layout.column(part.layout.index(name), prop) for name, prop in found.parts]
        off = np.abs(found.vectors[:, columns] - part.vectors[1:, columns]).max(axis=1) > WRONG
        total += len(off)
        wrong += int((off & found.ok).sum())
        abstained += int((~found.ok).sum())
    return Score(total, wrong, abstained)


def score_laws(book: LawBook, parts: Iterable[Part]) -> Score:
    """Let laws alone predict every transition of every mover, whether or not a model would go by them."""
    total = wrong = abstained = 0
    for part in parts:
        relations = Extractor(part.schema).extract(part.layout, part.vectors[:-1])
        contacts = Contacts.of(book.cast(part.layout), relations, part.vectors[:-1])
        motion = book.motion(contacts, part.vectors[:-1])
        after = contacts.cast.padded(part.vectors[1:])[contacts.cast.velocities]
        for body in contacts.cast.movers:
            count = len(book.components(contacts.cast.sources[body][0].type.name))
            off = np.abs(motion.velocity[:count, :, body] - after[:count, body]).max(axis=0) > WRONG
            known = motion.known[:, body]
            total += len(known)
            wrong += int((off & known).sum())
            abstained += int((~known).sum())
    return Score(total, wrong, abstained)


def taught(
    parts: Iterable[Part],
    keep: Callable[[Part], NDArray[np.bool_]] | None = None,
    config: ModelConfig | None = None,
) -> WorldModel:
    """A model that learned, one by one, the transitions that `keep` marks (default: all)."""
    model: WorldModel | None = None
    for part in parts:
        model = model or WorldModel(part.schema, config)
        marked = np.ones(len(part), dtype=bool) if keep is None else keep(part)
        for use, transition in zip(marked.tolist(), part.transitions(), strict=True):
            if use:
                model.learn_one(transition)
    assert model is not None, "nothing to learn from, no schema"
    return model


def laws_of(model: WorldModel) -> LawBook:
    """The laws of motion that a model learned."""
    assert model.laws is not None, "frames='auto' learns laws"
    return model.laws
