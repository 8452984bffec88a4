"""What isn't explained, and what would explain it: which features to switch on, or that none will do."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.approximation import LEFT, approximate, normal_reach, terms_of
from relgym.clustering.columns import SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.clustering.features import library_of, offered, switched_on
from relgym.clustering.mode import NOISE, sum_text
from relgym.config.constants import MAJORITY, MOST_FEATURES, NEARLY_ALL, ROUGH
from relgym.model.parts import Parts
from relgym.model.reports.distant import DistantForce, distant_forces
from relgym.model.reports.text import percent
from relgym.model.target.property_model import PropertyModel
from relgym.scene.objects import ACTION, TASK

__all__ = ["Advice", "advices", "advise", "together"]

LIBRARIES = (("trig",), ("products",), ("trig", "products"))
"""What is tried, from small to large."""

LAST_RESORT = ("trig", "degree4")
"""What is tried when nothing else leaves less than `GOOD`."""

GOOD, BETTER = 0.01, 0.75
"""A share of the change so small is explained; so much less than before is better."""

EQUAL, CLOSE = 3.0, 1.5
"""What leaves more than the best by at most this factor is as good: of what explains, and of what comes close."""

MOST = 0.5
"""With so large a share of noise the target counts as unexplained, however little modes and guesses leave."""

LEAST, ROWS, UNEXPLAINED = 100, 1000, 0.1
"""Fewer examples than this say nothing; the newest so many are looked at; so large a share of noise needs advice."""

_EXACT, FINE = 1e-5, 1e-3
"""Shares of the change that count as nothing, and as nothing to be mended."""


@dataclass(frozen=True, slots=True)
class Advice:
    """What one target lacks.

    Attributes
    ----------
    target
        Such as ``self.v``.
    unexplained
        Share of the recent examples that no mode explains.
    left
        Share of the change's standard deviation that the present modes leave; 1 if there are none.
    features
        What to switch on (``ModelConfig(features=...)``), behind all that is on; empty: nothing that was tried explains
        it.
    law
        The law that was found with these features, as text; empty without any.
    remains
        Share of the change that it would leave; NaN if there were too few examples to try anything.
    wrong, spoken
        How many of the latest predictions were wrong, of how many, where too many were for anybody to say that the
        modes explain it (`relgym.model.target.hindsight`); else 0.
    forces
        What moves objects of the type without touching them, if the target is a component of their velocity.
    """

    target: str
    unexplained: float
    left: float
    features: tuple[str, ...]
    law: str
    remains: float
    wrong: int = 0
    spoken: int = 0
    forces: tuple[DistantForce, ...] = ()

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Advice:
        """Read what `dataclasses.asdict` wrote."""
        forces = (
            DistantForce(**each | {"objects": tuple(each["objects"])}) for each in data.get("forces", ())
        )
        return cls(**{**data, "features": tuple(data["features"]), "forces": tuple(forces)})

    def __str__(self) -> str:
        return self.told(f"ModelConfig(features={self.features})")

    def told(self, remedy: str) -> str:
        """What is lacking, as text, with `remedy` for what switches the features on."""
        now = "; ".join([self._now(), *map(str, self.forces)])
        if math.isnan(self.remains):
            return now
        if not self.features or (self.forces and self.remains > GOOD):
            return f"{now}; no library of features that was tried explains it"
        close = f"comes closest, and leaves {percent(self.remains)}"
        if self.remains <= GOOD:
            close = "explains it" + ("" if self.remains <= FINE else f" but for {percent(self.remains)}")
        if self.remains > GOOD:
            now += "; no library of features that was tried explains it"
        return f"{now}; {remedy} {close}: {self.law}"

    def _now(self) -> str:
        rough = "" if self.left >= 1.0 else f"an approximation that leaves {percent(self.left)} of the change"
        if not self.spoken:
            # Where most is left over, a function of some of the examples is no approximation of them all.
            lost = self.unexplained > MOST
            return f"unexplained; {rough}" if rough and lost else rough or "unexplained"
        lately = f"{self.wrong} of the latest {self.spoken} predictions were wrong"
        if rough or self.unexplained > UNEXPLAINED:
            return f"unexplained; {rough and f'{rough}, and '}{lately}"
        return (
            f"unexplained; its modes cover the examples, but nothing tells which of them holds when: {lately}"
        )


@dataclass(frozen=True, slots=True)
class _Trial:
    features: tuple[str, ...]
    left: float
    law: str
    size: int
    bare: bool = False  # whether the law needs none of the features
    squares: float = 0.0  # mean square of what it leaves of all examples


def advise(model: PropertyModel, table: ExampleTable) -> Advice | None:
    """What a target lacks; None if its modes explain it, or if too little is known yet.

    Cost: several regressions on at most `ROWS` examples with up to some thousand features, about a second; nothing is
    changed.
    """
    if model.explained_by is not None:
        return None
    known, enough = model.hindsight, len(model.clusterer.y) >= LEAST
    if not model.undecided:
        return _lacks(model, table) if enough else None
    found = _lacks(model, table) if enough else Advice(str(model.target), 0.0, 1.0, (), "", math.nan)
    return None if found is None else replace(found, wrong=known.wrong, spoken=known.spoken)


def _lacks(model: PropertyModel, table: ExampleTable) -> Advice | None:
    """`advise`, but for how predictions came out, of a target with some examples."""
    clusterer, undecided = model.clusterer, model.undecided
    recent = np.arange(max(0, len(clusterer.y) - ROWS), len(clusterer.y))
    noise = float((clusterer.labels[recent] == NOISE).mean())
    change = clusterer.y[recent] - _present(model, table, recent)
    # A noise that was only supposed may be a curve for features to follow.
    rough = clusterer.approximate or (
        clusterer.config.noise_std == "auto" and clusterer.scale.sigma > ROUGH * clusterer.floor
    )
    left = min(1.0, _remains(model, table, recent) / max(float(change.std()), 1e-300)) if rough else 1.0
    covered = left <= FINE or (noise <= UNEXPLAINED and not rough)
    if covered and not undecided:
        return None
    left = 1.0 if covered else left
    known = offered(model.config.features, model.target.type)
    trials = [_try(model, table, recent, kinds) for kinds in LIBRARIES if not known.issuperset(kinds)]
    good = min((t.left for t in trials if t is not None), default=1.0) <= GOOD
    if not good and not known.issuperset(LAST_RESORT):
        trials.append(_try(model, table, recent, LAST_RESORT))
    found = [t for t in trials if t is not None]
    if undecided:  # a law in place of several modes must tell what one of them alone doesn't
        least = _least_squares(model, table, recent)
        found = [t for t in found if t.squares <= MAJORITY * least]
    best = _choose(found, left)
    if best is not None and best.bare:
        if clusterer.clusters and best.left <= GOOD and not undecided:
            return None  # the law is of the form that it has, and what it leaves is noise
        best = None
    if best is not None and (best.left <= GOOD or not covered):
        return Advice(str(model.target), noise, left, best.features, best.law, best.left)
    if noise <= UNEXPLAINED and not clusterer.approximate and not undecided:
        return None  # it is noise indeed
    return Advice(str(model.target), noise, left, (), "", 1.0)


def _entries(model: PropertyModel, kinds: tuple[str, ...]) -> tuple[str, ...]:
    """What is on and these kinds; among several types for this one alone, since others' laws would only be blurred."""
    others = {t.name for t in model.schema.types} - {ACTION, TASK, model.target.type}
    return switched_on(model.config.features, model.target.type, kinds, alone=not others)


def _remains(model: PropertyModel, table: ExampleTable, rows: NDArray[np.intp]) -> float:
    """Standard deviation of what the modes leave of nearly all examples, whichever of them is taken."""
    c = model.clusterer
    parts = [k.errors(table, c.rows[rows], c.y[rows], c.scale)[0] for k in c.clusters.values()]
    if not parts:
        return math.inf
    # Where no mode applies the error is infinite, and between that and others there is no middle.
    reach = float(np.quantile(np.min(parts, axis=0), NEARLY_ALL, method="higher")) / normal_reach()
    return max(c.scale.sigma, reach)


def _least_squares(model: PropertyModel, table: ExampleTable, rows: NDArray[np.intp]) -> float:
    """Mean square of what the best single mode leaves of the newest signature's examples; infinite if none applies."""
    c = model.clusterer
    ids = table.signature_ids[c.rows[rows]]
    rows = rows[ids == ids[-1]]
    errors = [k.errors(table, c.rows[rows], c.y[rows], c.scale)[0] for k in c.clusters.values()]
    return min((float(np.square(each).mean()) for each in errors), default=math.inf)


def advices(parts: Parts) -> tuple[Advice, ...]:
    """`advise` for all targets that modes predict, with the forces that objects exert from afar."""
    found = {t: advise(parts.models[t], parts.tables[t.type]) for t in parts.targets if not parts.governs(t)}
    lacking = {target: each for target, each in found.items() if each is not None}
    forces = distant_forces(parts, tuple(lacking))
    for target, each in lacking.items():
        if target.type in forces and target.property in parts.schema.type(target.type).velocity:
            lacking[target] = replace(each, forces=forces[target.type])
    return tuple(lacking.values())


def together(parts: Parts, advice: Iterable[Advice]) -> tuple[str, ...]:
    """What is switched on, and behind it what is advised, as far as all of that can be had at once.

    What most targets need goes first; what would make a library too wide with it is left out.
    """
    found = parts.config.features
    for features, _ in Counter(each.features for each in advice if each.features).most_common():
        more = tuple(dict.fromkeys((*found, *features)))
        if all(_fits(more, known) for table in parts.tables.values() for known in table.signatures):
            found = more
    return found


def _fits(features: tuple[str, ...], known: SlotSignature) -> bool:
    """Whether a type can be offered these features."""
    own = known.types[0]
    slots: SlotSignature = replace(known, nonlinear=library_of(features, own.name, own.angles))
    return slots.feature_count <= MOST_FEATURES


def _choose(trials: Iterable[_Trial], left: float) -> _Trial | None:
    """The smallest library that is as good as the best one, if that is better than what there is.

    One whose law needs no features goes first.
    """
    trials = list(trials)
    least = min((t.left for t in trials), default=1.0)
    good = [t for t in trials if t.left <= max((EQUAL if least <= GOOD else CLOSE) * least, _EXACT)]
    return min(good, key=lambda t: (not t.bare, t.size)) if least <= BETTER * left else None


def _try(
    model: PropertyModel, table: ExampleTable, rows: NDArray[np.intp], kinds: tuple[str, ...]
) -> _Trial | None:
    clusterer = model.clusterer
    ids = table.signature_ids[clusterer.rows[rows]]
    rows = rows[ids == ids[-1]]
    known, entries = table.signatures[int(ids[-1])], _entries(model, kinds)
    library = library_of(entries, known.types[0].name, known.types[0].angles)
    slots: SlotSignature = replace(known, nonlinear=library)
    if slots.feature_count > MOST_FEATURES:
        return None
    order, stages = slots.preference(model.target)
    order = order[: stages[min(1, len(stages) - 1)]]
    x, y = slots.matrix(table.x[clusterer.rows[rows]], order), clusterer.y[rows]
    present = slots.present(table.x[clusterer.rows[rows]], model.target)
    found = approximate(
        x,
        y,
        present,
        floor=clusterer.floor,
        terms=terms_of(len(order), model.config.clustering),
        stds=clusterer.scale.inlier_stds,
        left=LEFT,
        noisy=stages[0],
        lines=False,  # what features add is the question
    )
    if found is None:
        return None
    change = max(float((y - present).std()), 1e-300)  # of all, as what the modes leave is
    text = [
        (w, slots.named(int(order[c]))) for c, w in zip(found.fit.columns, found.fit.weights, strict=True)
    ]
    law = f"{model.target.property}' = {sum_text(text, found.fit.intercept, 4)}"
    bare = all(order[c] < len(slots.columns) for c in found.fit.columns)
    squares = float(np.square(y - found.fit.predict(x)).mean())
    return _Trial(entries, found.sigma / change, law, len(order), bare, squares)


def _present(model: PropertyModel, table: ExampleTable, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """The property's present values."""
    places = model.clusterer.rows[rows]
    values = np.zeros(len(rows))
    for number in np.unique(table.signature_ids[places]):
        part = np.flatnonzero(table.signature_ids[places] == number)
        values[part] = table.signatures[int(number)].present(table.x[places[part]], model.target)
    return values
