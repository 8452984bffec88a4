"""The causal order in which a type's properties follow from one another: kinematics discovered, not declared.

Where a target is better described with another one's *next* value, it is given that (`Target.given`) and comes after
it: ``x' = x + k v'``. Of two properties each follows from the other (``v' = (x' - x) / k`` is as true), so something
must decide which one goes first: what keeps what it was. A law of change builds on the property's own present value;
a law without it is taken only where none of the former kind contradicts it. Through noise a difference such as
``(x' - x) / k`` is never taken: it says of v' what x' says of it, k times less exactly. What is never given away is a
circle.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import PRIME, SlotSignature
from relgym.clustering.discovery import Scale, identified, is_law, law_cells
from relgym.config.clustering import ClusteringConfig
from relgym.config.constants import ALIKE, DRAWS, ENOUGH, NEARLY_ALL, SEARCHED_ROWS, VERIFYING
from relgym.numeric.ransac import consensus
from relgym.numeric.stepwise import LinearFit
from relgym.scene.objects import TASK, Target
from relgym.scheduling.work import Steps, Task, resumable

if TYPE_CHECKING:
    from relgym.model.parts import Parts

__all__ = ["Inquiry", "Look", "due", "in_order", "inquire", "revise"]

_Pair = tuple[str, str]

Look = tuple[str, str, bool]
"""Type and property to look at, and whether only laws count that build on the property's own present value."""


@dataclass(frozen=True, slots=True)
class _Found:
    """A law with next values.

    Attributes
    ----------
    given
        Whose next values it uses.
    inert
        Whether it builds on the property's own present value.
    difference
        Whether it is the change of another property.
    lead
        For pure kinematics: the rate and its coefficient.
    """

    given: tuple[_Pair, ...]
    inert: bool
    difference: bool
    lead: tuple[str, float] | None


@dataclass(frozen=True, slots=True)
class _Criterion:
    """What a law with next values must be better than.

    Attributes
    ----------
    share, size
        Share of the rows that modes explain, and parameters of the largest one.
    config, seed
        As in the configuration.
    """

    share: float
    size: float
    config: ClusteringConfig
    seed: int


def due(parts: Parts, type_name: str) -> list[Look]:
    """Looks to take at a type's targets, in this order: at all for laws of change before any other ones."""
    targets = [t for t in parts.targets if t.type == type_name and t.type != TASK]
    return [(type_name, target.property, inert) for inert in (True, False) for target in targets]


@dataclass(frozen=True, slots=True)
class Inquiry:
    """A look that is being taken: a search under way.

    Attributes
    ----------
    look
        What is looked at, and how.
    target
        The target as it was when it began.
    task
        The search.
    """

    look: Look
    target: Target
    task: Task[_Found | None]


def inquire(parts: Parts, look: Look) -> Inquiry | None:
    """Begin to look for a law with next values of one target.

    Cost of the search: at most `SEARCHED_ROWS` rows; none where the target is explained already, by laws of two terms,
    or by laws of change where others are looked for.
    """
    type_name, prop, _ = look
    return _search(parts, parts.property_model(type_name, prop).target, look)


def revise(parts: Parts, inquiry: Inquiry) -> None:
    """A search for a law with next values is done: give the target what it needs."""
    type_name, prop, _ = inquiry.look
    target = parts.property_model(type_name, prop).target
    found = inquiry.task.result
    if found is None or target != inquiry.target or not set(found.given) <= set(_free(parts, target)):
        return  # what was true of the order then needn't be now
    parts.retarget(target, replace(target, given=found.given))
    if found.lead is not None:
        rate, step = found.lead
        parts.lead((type_name, rate), prop, step)


def in_order(targets: Iterable[Target]) -> tuple[Target, ...]:
    """Targets such that each comes after those it is given, otherwise as they are; the task's come last."""
    left, done = sorted(targets, key=lambda t: t.type == TASK), []
    if not any(t.given for t in left):
        return tuple(left)
    while left:
        waiting = {(t.type, t.property) for t in left}
        nxt = next((t for t in left if waiting.isdisjoint(t.given)), left[0])
        left.remove(nxt)
        done.append(nxt)
    return tuple(done)


def _search(parts: Parts, target: Target, look: Look) -> Inquiry | None:
    """The search for a law with next values that describes a target better than its modes do, if it is worth while."""
    model, table = parts.models[target], parts.tables[target.type]
    clusterer = model.clusterer
    if len(clusterer.y) < ENOUGH:
        return None
    recent = np.arange(max(0, len(clusterer.y) - SEARCHED_ROWS), len(clusterer.y))
    ids = table.signature_ids[clusterer.rows[recent]]
    recent = recent[ids == ids[-1]]
    share = float((clusterer.labels[recent] != 0).mean())
    size = max((m.parameters for m in model.modes), default=math.inf)
    most = max(model.modes, key=lambda m: m.examples, default=None)
    inert = most is not None and any(name == target.property for name, _ in most.roles[0].terms)
    if share >= NEARLY_ALL and (size <= 2 or (inert and not look[2])):
        return None
    slots = table.signatures[int(ids[-1])]
    free = _free(parts, target)
    order = _columns(slots, replace(target, given=free))
    x, y = slots.matrix(table.x[clusterer.rows[recent]], order), clusterer.y[recent]
    scales = tuple(dict.fromkeys((replace(clusterer.scale, sigma=clusterer.floor), clusterer.scale)))
    criterion = _Criterion(share, size, parts.config.clustering, parts.config.seed)
    task = Task(_sought, x, y, slots, order, scales, criterion, inert=look[2])
    return Inquiry(look, target, task)


@resumable
def _sought(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    slots: SlotSignature,
    order: NDArray[np.intp],
    scales: tuple[Scale, ...],
    criterion: _Criterion,
    *,
    inert: bool,
) -> Steps[_Found | None]:
    """What is looked for; where only laws of change count and another one is better, a law without what that one reads.

    Of a place, a sensor that shows it says more than its own speed does, until the sensor fails.
    """
    while (found := (yield from _better.steps(x, y, slots, order, scales, criterion))) is not None:
        if found.inert >= inert:
            return found
        names = {(name, f"{prop}{PRIME}") for name, prop in found.given}
        columns = [slots.at(int(c)) for c in order]
        kept = [k for k, c in enumerate(columns) if (slots.types[c.slot].name, c.property) not in names]
        x, order = x[:, kept], order[kept]
    return None


@resumable
def _better(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    slots: SlotSignature,
    order: NDArray[np.intp],
    scales: tuple[Scale, ...],
    criterion: _Criterion,
) -> Steps[_Found | None]:
    """The law with next values that explains more of some rows than modes do, or as many more briefly.

    It must explain half of them; where it explains a tenth more it is better, whatever its length.

    Parameters
    ----------
    x, y
        Rows and responses.
    slots, order
        Signature of the rows, and what columns they have of it.
    scales
        That of rounding alone, and that which is assumed, if it is another one.
    criterion
        What it must be better than.
    """
    config = criterion.config
    lengths = sorted({min(2, config.max_terms), config.max_terms})
    for scale, terms in itertools.product(scales, lengths):
        rng = np.random.default_rng([criterion.seed, len(y)])
        found = yield from consensus.steps(
            x,
            y,
            sigma=scale.sigma,
            tolerance=scale.tolerance,
            terms=terms,
            size=terms + 1 + VERIFYING,
            draws=DRAWS,
            rng=rng,
            misfit=scale.misfit,
        )
        if found is not None:
            found = yield from identified.steps(x, y, found.fit, scale=scale, support=config.support)
        if found is None or 2 * found.size < len(y) or not is_law(x, y, found, x.shape[1], scale):
            continue
        gain, little = found.size / len(y) - criterion.share, 1.0 - NEARLY_ALL
        if gain <= little and (gain <= -little or found.fit.terms >= criterion.size):
            continue
        yield law_cells(found, x.shape[1])
        law = _read(slots, order, found.fit)
        if law is None or not law.difference or scale == scales[0]:
            return law
    return None


def _free(parts: Parts, target: Target) -> tuple[_Pair, ...]:
    """Pairs whose next values the target may be given without a circle."""
    after = {(target.type, target.property)}
    for _ in parts.targets:
        after |= {(t.type, t.property) for t in parts.targets if not after.isdisjoint(t.given)}
    every = [(t.type, t.property) for t in parts.targets if t.type == target.type]
    return tuple(pair for pair in every if pair not in after)


def _columns(slots: SlotSignature, target: Target) -> NDArray[np.intp]:
    """The target's own columns and bodiless objects', features aside, next values behind; the pose too."""
    order, _ = slots.preference(target)
    width = slots.core
    plain: NDArray[np.intp] = order[order < width]
    return plain


def _read(slots: SlotSignature, order: NDArray[np.intp], fit: LinearFit) -> _Found | None:
    columns = [slots.at(int(order[c])) for c in fit.columns]
    weights = {(c.slot, c.property): w for c, w in zip(columns, fit.weights, strict=True)}
    nexts = {key: w for key, w in weights.items() if key[1].endswith(PRIME)}
    if not nexts:
        return None
    now = {key: weights.get((key[0], key[1].rstrip(PRIME)), 0.0) for key in nexts}
    given = tuple(dict.fromkeys((slots.types[slot].name, prop.rstrip(PRIME)) for slot, prop in nexts))
    inert = 0 in fit.columns
    # Weights of x' and of x that nearly all cancels out of make a difference of the two.
    cancel = any(abs(w + now[key]) < (1.0 - NEARLY_ALL) * abs(w) for key, w in nexts.items())
    lead = None
    if inert and len(columns) == 2 and fit.intercept == 0.0:
        (((_, rate), coefficient),) = nexts.items()
        own = sum(fit.weights) - coefficient
        lead = (rate.rstrip(PRIME), coefficient) if abs(own - 1.0) < ALIKE else None
    return _Found(given, inert, cancel and not inert, lead)
