"""Streams of transitions for law learners, and how well laws predict them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.laws.book import LawBook, Motion
from relgym.laws.learner import LawLearner
from relgym.laws.touching import Contacts
from relgym.scene.objects import SceneLayout
from relgym.scene.relations import Extractor
from relgym.scene.schema import SceneSchema

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Stream:
    """State vectors of consecutive scenes with the same objects."""

    schema: SceneSchema
    layout: SceneLayout
    vectors: Array


def moved(book: LawBook, stream: Stream, rows: slice = slice(None, -1)) -> tuple[Contacts, Motion]:
    """Contacts in some of a stream's scenes, and what the laws make of them."""
    vectors = stream.vectors[rows]
    relations = Extractor(stream.schema).extract(stream.layout, vectors)
    contacts = Contacts.of(book.cast(stream.layout), relations, vectors)
    return contacts, book.motion(contacts, vectors)


def learn(
    learner: LawLearner, stream: Stream, keep: Callable[[NDArray[np.bool_]], bool] | None = None
) -> None:
    """Teach a stream's transitions, one by one; `keep` chooses by the flags of who touches whom."""
    relations = Extractor(stream.schema).extract(stream.layout, stream.vectors)
    stays = dict.fromkeys(range(len(stream.layout.names)), True)
    touch = relations.relation("intersect")
    for k in range(len(stream.vectors) - 1):
        if keep is None or keep(touch[k]):
            now, after = stream.vectors[k], stream.vectors[k + 1]
            cast = learner.book.cast(stream.layout)
            contacts = Contacts.of(cast, relations.rows(slice(k, k + 1)), now[None])
            learner.learn_one(contacts, now, after, stays)


def taught(
    streams: Iterable[Stream], *, seed: int = 0, learner: LawLearner | None = None, **settings: float
) -> LawLearner:
    """A learner, a new one unless one is handed in, that has seen some streams of one schema."""
    for stream in streams:
        schema = stream.schema
        learner = learner or LawLearner(schema, schema.targets or (), seed=seed, **settings)
        learn(learner, stream)
    assert learner is not None
    return learner


def errors(book: LawBook, streams: Iterable[Stream], tolerance: float = 1e-9) -> tuple[int, int, int]:
    """Transitions of movers that the laws have wrong, that they decline to predict, and all."""
    wrong = abstained = total = 0
    for stream in streams:
        contacts, motion = moved(book, stream)
        cast = contacts.cast
        after = cast.padded(stream.vectors[1:])[cast.velocities]
        for body in cast.movers:
            known = motion.known[:, body]
            count = len(book.components(cast.layout.types[cast.layout.bodies[body]].name))
            off = np.abs(motion.velocity[:count, :, body] - after[:count, body]).max(axis=0)
            wrong += int((known & ~(off <= tolerance)).sum())
            abstained += int((~known).sum())
            total += len(known)
    return wrong, abstained, total


def formulas(book: LawBook, digits: int = 6) -> list[list[str]]:
    """The pair laws' formulas, axis by axis."""
    assert book.pair is not None
    return [[law.formula(digits) for law in laws] for laws in book.pair.axes]
