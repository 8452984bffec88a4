"""Two models of one world made one: modes united by function, clauses learned again from both memories.

What each remembers is put together as if one model had seen both histories. A mode of the other model that says what a
known one says takes up its examples; another one is taken over, and may unite with known ones like any new mode
(§3.2.5).
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import Example
from relgym.clustering.examples import ExampleTable
from relgym.errors import ConfigError
from relgym.model.learning.forgetting import forget
from relgym.model.parts import Parts
from relgym.model.percepts.scenes import mismatch
from relgym.model.predicting.chaining import in_order
from relgym.model.target.property_model import PropertyModel
from relgym.scene.objects import Target

__all__ = ["merge"]


def merge(parts: Parts, other: Parts, *, follow_laws: bool) -> None:
    """Take up all that another model remembers, as far as memory goes; the other one stays as it is.

    Parameters
    ----------
    parts, other
        Models of the same schema and configuration (seeds may differ), both with their history.
    follow_laws
        Whether the other's laws of motion are taken over in place of these: laws rest on few contacts and can't be
        put together from two models.

    Raises
    ------
    ConfigError
        Another schema, configuration, or way to find targets.
    """
    _check(parts, other)
    _agree_on_targets(parts, other)
    moved = {name: _append(parts, name, table) for name, table in sorted(other.tables.items())}
    for theirs, model in other.models.items():
        mine = parts.property_model(theirs.type, theirs.property)
        rows = moved[theirs.type]
        _take_up(mine, model, parts.tables[theirs.type], rows)
    for name, regression in other.regressions.items():
        if name in parts.regressions and regression.seen > parts.regressions[name].seen:
            parts.regressions[name] = copy.deepcopy(regression)  # sums about other centres don't add up
    parts.screen.absorb(other.screen)
    for name, table in parts.tables.items():
        forget(table, [m for t, m in parts.models.items() if t.type == name], parts.config.history)
    if follow_laws and parts.laws is not None:
        parts.laws = laws = copy.deepcopy(other.laws)
        if laws is not None:
            laws.mark(parts.models)


def _check(parts: Parts, other: Parts) -> None:
    difference = mismatch(other.schema, parts.schema) or mismatch(parts.schema, other.schema)
    for what in ("kinematics", "offsets", "precision"):
        theirs, mine = getattr(other.schema, what), getattr(parts.schema, what)
        same = set(theirs) == set(mine) if what == "kinematics" else theirs == mine
        if not (difference or same):
            difference = f"{what}={theirs} instead of {mine}"
    if difference:
        raise ConfigError(f"the other model is of another world: {difference}; merge models of one schema")
    if replace(other.config, seed=parts.config.seed) != parts.config or other.open != parts.open:
        raise ConfigError(
            "the other model has another configuration or other targets: learn both with the same ModelConfig (but for "
            "the seed) and the same targets"
        )


def _agree_on_targets(parts: Parts, other: Parts) -> None:
    """Targets of either model; who is given what, where only the other one found out."""
    for theirs in other.targets:
        mine = next(
            (t for t in parts.targets if (t.type, t.property) == (theirs.type, theirs.property)), None
        )
        if mine is None:
            parts.add_target(replace(theirs, given=()))
            mine = next(t for t in parts.targets if (t.type, t.property) == (theirs.type, theirs.property))
        if theirs.given and not mine.given and not _circular(parts.targets, mine, theirs):
            parts.retarget(mine, replace(mine, given=theirs.given))
    for theirs, model in other.models.items():
        for prop, step in model.classifier.vocabulary.follows:
            parts.lead((theirs.type, theirs.property), prop, step)


def _circular(targets: tuple[Target, ...], mine: Target, theirs: Target) -> bool:
    changed = in_order([replace(t, given=theirs.given) if t == mine else t for t in targets])
    places = {(t.type, t.property): k for k, t in enumerate(changed)}
    return any(places.get(pair, -1) > places[t.type, t.property] for t in changed for pair in t.given)


def _append(parts: Parts, type_name: str, theirs: ExampleTable) -> NDArray[np.int64]:
    """Put the other's rows behind these; the new number of each."""
    table = parts.tables[type_name]
    signatures = [parts.signature_of(tuple(t.name for t in s.types)) for s in theirs.signatures]
    keys = theirs.stratum_keys
    numbers = [
        table.add(
            signatures[s],
            theirs.x[k, : len(signatures[s].columns)],
            keys[stratum],
            bodies[: len(signatures[s].types)],  # the rest is padding, as wide as their widest row
        )
        for k, (s, stratum, bodies) in enumerate(
            zip(theirs.signature_ids.tolist(), theirs.strata.tolist(), theirs.bodies.tolist(), strict=True)
        )
    ]
    return np.array(numbers, dtype=np.int64)


def _take_up(
    mine: PropertyModel, theirs: PropertyModel, table: ExampleTable, moved: NDArray[np.int64]
) -> None:
    first = len(mine.clusterer.y)
    same = mine.target.given == theirs.target.given
    mine.past.clear()  # of two histories neither comes first
    mine.clusterer.absorb(theirs.clusterer, table, moved[theirs.clusterer.rows], functions=same)
    mine.follow(table)
    numbers = first + theirs.classifier.exemplars.rows
    for example, weight in _exemplars(theirs, mine, table, numbers):
        mine.remember(table, example, weight)
    mine.follow(table)
    mine.start_over(table)
    mine.hindsight = mine.hindsight.united(theirs.hindsight)
    mine.calibration = mine.calibration.united(theirs.calibration)
    mine.vouch()


def _exemplars(
    theirs: PropertyModel, mine: PropertyModel, table: ExampleTable, numbers: NDArray[np.int64]
) -> Iterator[tuple[Example, float]]:
    """What the other's classifiers remember, with its new numbers and own features."""
    weights = theirs.classifier.exemplars.weights()
    for slot, (number, weight) in enumerate(zip(numbers.tolist(), weights.tolist(), strict=True)):
        row = mine.clusterer.rows[number]
        signature = table.signatures[table.signature_ids[row]]
        ahead = mine.conditions.values(signature, table.x[row : row + 1])[0]
        example, _ = theirs.remembered(slot)
        yield example.with_own(np.concatenate([example.own, ahead]), number), weight
