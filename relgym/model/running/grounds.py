"""What a program was lowered from: as long as a model holds the same, its program says what the model says.

Most transitions change what is counted, not what is said: a program is lowered anew only when something else is read
than before. Votes do change with every example, as do the mode that held last and how far regressions reach; they
are no reason to lower, but written into the program that there is (`relgym.model.running.runner.Runner.follow`).
"""

from __future__ import annotations

from operator import is_
from typing import TYPE_CHECKING, Any, NamedTuple

from relgym.model.target.property_model import PropertyModel

if TYPE_CHECKING:
    from relgym.model.parts import Parts

__all__ = ["Grounds"]


class Grounds(NamedTuple):
    """What `relgym.model.running.lowering.lowered` and `relgym.model.running.runner` read of a model, votes left aside.

    Attributes
    ----------
    things
        What is replaced when it changes, compared by identity; kept alive, so that an identity stays its own.
    numbers
        What is compared by value.
    """

    things: tuple[Any, ...]
    numbers: tuple[Any, ...]

    @classmethod
    def of(cls, parts: Parts) -> Grounds:
        """Those of a model as it is. Cost: some microseconds a target, and one a mode."""
        things: list[Any] = [parts.targets]
        numbers: list[Any] = []
        if parts.laws is not None:
            book = parts.laws.learner.book
            things += (book.pair, book.inertia, *book.free.values())
            numbers += (parts.laws.governed, book.tolerance, tuple(book.free), dict(book.shares))
        asked = set()
        for target in parts.targets:
            if _read(parts.models[target], things, numbers, votes=not parts.governs(target)):
                asked.add(target.type)
        for name in sorted(asked):
            weights, others = parts.regressions[name].solved
            things += weights
            numbers.append(others)
        return cls(tuple(things), tuple(numbers))

    def same(self, other: Grounds) -> bool:
        """Whether a program lowered from these is one of the others, too."""
        return (
            len(self.things) == len(other.things)
            and all(map(is_, self.things, other.things))
            and self.numbers == other.numbers
        )


def _read(model: PropertyModel, things: list[Any], numbers: list[Any], *, votes: bool) -> bool:
    """What is read of one target; whether that asks regressions."""
    clusterer, classifier, asks = model.clusterer, model.classifier, model.asks_regressions
    known = model.fallback
    things += (known.scope, model.limits, model.stops, model.spreads, model.conditions, known.guess)
    things += (known.guess_beyond, classifier.vocabulary, *classifier.classifiers)
    things += [cluster.mode for cluster in clusterer.clusters.values()]
    numbers += (
        tuple(clusterer.clusters),
        classifier.modes,
        clusterer.approximate,
        model.surmise,
        asks,
        model.tells_how_far,
        known.lawless,
    )
    if not votes:
        return asks
    numbers += (model.undecided, model.lost)
    if len(classifier.modes) > 1 and not model.lost:
        familiar = classifier._familiarity()
        things.append(familiar)
        numbers.append(len(familiar.seen))  # of which none is ever forgotten
    numbers.append(tuple(sorted(model.functions.places.items())) if model.functions.places else ())
    for mode, cast in model.casting.classifiers.items():
        numbers += (mode, cast.errors > 0)
        for d in cast.descriptions:
            things.append(d.definition)
            numbers.append(None if d.common is None else d.common.tobytes())
    return asks
