"""Learning from one transition: one example per target of every object that stays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.clusterer import ClusterReport
from relgym.config.constants import FOUNDING, SELDOM
from relgym.html import html_table
from relgym.model.learning.forgetting import forget
from relgym.model.learning.stillness import recall
from relgym.model.parts import Parts
from relgym.model.percepts.perception import Percept
from relgym.model.percepts.scenes import next_values, passage, unwrapped
from relgym.model.predicting.chaining import due, inquire, revise
from relgym.model.predicting.prediction import ScenePrediction
from relgym.model.target.hindsight import Confirmed
from relgym.model.target.property_model import bodies_of
from relgym.scene.objects import TASK, Target, Transition
from relgym.scheduling.agenda import Budget
from relgym.scheduling.renewal import came_due

__all__ = ["NOTHING", "LearnReport", "finish", "learn"]


NOTHING: Final[Mapping[tuple[str, str], Confirmed]] = MappingProxyType({})
"""Of a transition of which nobody looked back at what was predicted."""


@dataclass(slots=True)  # not frozen: made in every step
class LearnReport:
    """What one transition taught.

    Attributes
    ----------
    parts
        Per (object, property): what its clusterer did; not for targets whose modes rest, since laws suffice, nor for
        what came as predicted and isn't learned from, since others stand for it (`Calibration.confirm`, `thin`).
    work
        Cells (`ModelConfig.cells_per_step`) spent on re-learning classifiers.
    set_aside
        Whether the transition held a gross error and wasn't learned from (`relgym.model.percepts.screening`).
    counted
        Whether it was counted and no more: modes, laws and what tells when they hold are what they were.
    """

    parts: dict[tuple[str, str], ClusterReport]
    work: int
    set_aside: bool = False
    counted: bool = False

    @property
    def changed(self) -> bool:
        """Whether any target's set of modes changed."""
        return any(part.changed for part in self.parts.values())

    def _repr_html_(self) -> str:
        head = ("target", "mode (0: noise)", "explained by", "new modes", "gone")
        rows = [
            (f"{name}.{prop}", part.mode, _ids(part.fits), _ids(part.created), _ids(part.removed))
            for (name, prop), part in self.parts.items()
        ]
        return html_table(f"Learned; re-learning took {self.work:,} cells", head, rows)


def _ids(modes: tuple[int, ...]) -> str:
    return ", ".join(map(str, modes))


def learn(
    parts: Parts,
    percept: Percept,
    transition: Transition,
    only: frozenset[int] | None = None,
    told: ScenePrediction | None = None,
    confirmed: Mapping[tuple[str, str], Confirmed] = NOTHING,
) -> LearnReport:
    """Take up one transition, whose first scene has been perceived and whose numbers are finite.

    Parameters
    ----------
    parts, percept, transition
        Who learns, the first scene, and what happened.
    only
        Indices of the objects to be learned from; all others are there to be seen. Default: all.
    told
        What was predicted, if somebody asked: it saves looking at what came as it was told.
    confirmed
        What of it came out as such predictions do, by (object, property), if somebody looked back
        (`relgym.model.target.hindsight.look_back`).
    """
    before, after = transition.before, transition.after
    found = parts.discover_targets(before, after) if parts.open else ()
    stays = passage(before.layout, after.layout).stays
    following = unwrapped(before.layout, before.vector, next_values(before, after))
    reports: dict[tuple[str, str], ClusterReport] = {}
    budget = parts.agenda.open()
    idle = parts.idle
    if not idle:
        _go_on(parts, budget)
    searches = _for_searches(budget)
    rows = {name: table.seen for name, table in parts.tables.items()}
    learned = False
    for type_name in parts.by_type:
        if parts.laws is not None and parts.laws.suffice(type_name, parts.targets):
            continue
        for index in before.layout.of_type(type_name):
            if (only is None or index in only) and stays[index]:
                learned |= _learn_object(parts, percept, index, following, reports, searches, confirmed)
    for target in found:  # behind the change: of what is always the same hardly a function is verified
        table = parts.tables[target.type]
        recall(parts, target, len(table) - table.seen + rows.get(target.type, 0), searches)
    for type_name, table in parts.tables.items() if reports else ():
        if parts.open and came_due(rows[type_name], table.seen, max(FOUNDING), SELDOM):
            parts.looks += due(parts, type_name)
        forget(table, [model for _, model in parts.by_type[type_name]], parts.config.history)
    _inquire(parts, budget)
    heard = (
        parts.laws is not None
        and bool(parts.laws.learner.sources)
        and parts.laws.learn_one(percept, following, _there(parts, transition, only), parts.models, told)
    )
    work = 0
    if not idle or learned or heard:
        work = _refresh(parts, budget)
        parts.agenda.close(budget, [t for t in parts.targets if parts.models[t].clusterer.searching])
        parts.idle = not budget.spent and _nothing_waits(parts)
    counted = not (learned or heard or budget.spent or found)
    return LearnReport(reports, work, counted=counted)


def _nothing_waits(parts: Parts) -> bool:
    """Whether nothing is under way, and nothing will be before something is learned."""
    if parts.looks or parts.inquiry is not None or parts.agenda.waiting:
        return False
    return not any(parts.models[target].waits for target in parts.targets if not parts.governs(target))


def _go_on(parts: Parts, budget: Budget) -> None:
    """Go on with what is under way: what is sure to end soon, then searches for modes, those that had least first."""
    turns = [
        (turn, k) for k, t in enumerate(parts.targets) if (turn := parts.models[t].clusterer.turn) is not None
    ]
    for _, k in sorted(turns):
        target = parts.targets[k]
        parts.models[target].approximate(parts.tables[target.type], budget)
    for target in parts.targets:
        table, model = parts.tables[target.type], parts.models[target]
        if model.fallback.guesses.underway or model.candidates.under_way:
            model.reconsider(table, budget)
    searches = _for_searches(budget)
    for waiting in parts.agenda.waiting:
        if not searches.left:
            return
        if isinstance(waiting, Target) and waiting in parts.models:
            before = searches.spent
            parts.models[waiting].go_on(parts.tables[waiting.type], searches)
            parts.agenda.spent_on(waiting, searches.spent - before)


def _for_searches(budget: Budget) -> Budget:
    """What of a budget goes to searches for modes, which may go on for ever: half of it; others get the rest."""
    return budget.part(0.5)


def _inquire(parts: Parts, budget: Budget) -> None:
    """Take the next look at a target's causal order, or go on with the one that is being taken."""
    if parts.inquiry is None and parts.looks and budget.left:
        parts.inquiry = inquire(parts, parts.looks.pop(0))
    if parts.inquiry is not None and budget.work(parts.inquiry.task):
        inquiry, parts.inquiry = parts.inquiry, None
        revise(parts, inquiry)


def _there(parts: Parts, transition: Transition, only: frozenset[int] | None) -> dict[int, bool]:
    """Whether each object stays; of those that move, only some may teach."""
    before = transition.before
    there = dict(enumerate(passage(before.layout, transition.after.layout).stays))
    if only is not None:
        moving = {t.type for t in parts.targets}
        others = (i for i, t in enumerate(before.layout.types) if t.name in moving and i not in only)
        there |= dict.fromkeys(others, False)
    return there


def finish(parts: Parts) -> int:
    """Make all searches that still wait, re-learn every stale classifier and solve regressions; the work spent.

    All of it without a budget.
    """
    budget, parts.idle = Budget(), False
    while parts.looks or parts.inquiry is not None:
        _inquire(parts, budget)
        for target in parts.targets:  # what has begun anew is to be known before the next look
            if not parts.models[target].modes:
                parts.models[target].search(parts.tables[target.type], budget)
    for target in parts.targets:
        parts.models[target].search(parts.tables[target.type], budget)
    parts.agenda.waiting = ()
    work = 0
    for target in parts.targets:
        if not parts.governs(target):
            work += parts.models[target].refresh(None)
            parts.models[target].reconsider(parts.tables[target.type], budget)
    for type_name, regression in parts.regressions.items():
        regression.settle()
        _tell_regressed(parts, type_name)
    return work + budget.spent


def _learn_object(
    parts: Parts,
    percept: Percept,
    index: int,
    following: NDArray[np.float64],
    reports: dict[tuple[str, str], ClusterReport],
    budget: Budget,
    confirmed: Mapping[tuple[str, str], Confirmed],
) -> bool:
    """Learn from one object; whether anybody did."""
    layout = percept.layout
    name = layout.names[index]
    type_name = layout.types[index].name
    weights = _weights(parts, type_name, name, confirmed)
    followed = {
        t.property for t, m in parts.by_type[type_name] if t.property not in weights and m.follows_latest
    }
    # Not `asks_regressions`: what is learned doesn't depend on whether somebody looks back. What is left out here it
    # learns from all the same: it takes little, and to sums every row counts.
    rough = any([model.rough for _, model in parts.by_type[type_name]])
    if not (weights or rough or followed):
        return False
    situation = percept.situation(index)
    x = percept.rows(index, following[None])[0]
    changes: dict[str, float] = {}
    if weights:
        bodies = bodies_of(situation.order[0], layout)
        table = parts.tables[type_name]
        row = table.add(situation.signature, x, situation.keys[0], bodies)
        example = situation.examples.at(0, situation.keys[0])
    for target, model in parts.by_type[type_name]:
        column = layout.column(index, target.property)
        y = float(following[column])
        changes[target.property] = y - (0.0 if type_name == TASK else percept.vectors[0, column])
        if target.property in weights:
            report = model.learn_one(
                table, row, y, situation.signature, example, budget, weights[target.property]
            )
            reports[name, target.property] = report
        elif target.property in followed:
            model.follow_latest(situation.signature, x, y)
    if rough:
        regression = parts.regressions[type_name]
        if regression.learn_one(situation.signature, x, changes):
            _tell_regressed(parts, type_name)
        budget.spend(regression.worked)
    return True


def _weights(
    parts: Parts, type_name: str, name: str, confirmed: Mapping[tuple[str, str], Confirmed]
) -> dict[str, int]:
    """For how many examples that of each property of an object stands that is to be learned from."""
    found: dict[str, int] = {}
    for target, model in parts.by_type[type_name]:
        one = confirmed.get((name, target.property))
        if one is None or one.weight:
            found[target.property] = 1 if one is None else one.weight
        elif not model.take_for_known(one.mode):
            found[target.property] = 1
    return found


def _tell_regressed(parts: Parts, type_name: str) -> None:
    """Let a type's targets know how good regression is, since its weights are new."""
    for target, model in parts.by_type[type_name]:
        known = parts.regressions[type_name].record(target.property)
        if known is not None:
            model.calibration.regressed(*known)


def _refresh(parts: Parts, budget: Budget) -> int:
    """Re-learn stale classifiers and guess anew within the budget; the cells spent on classifiers."""
    spent = 0
    for target in parts.targets:
        if not budget.left:
            break
        if not parts.governs(target):  # no clause is asked where laws predict
            model = parts.models[target]
            work = model.refresh(budget.left)
            budget.spend(work)
            spent += work
            model.reconsider(parts.tables[target.type], budget)
    return spent
