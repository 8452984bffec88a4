"""Why a model predicts what it predicts: mode, roles, deciding clause and runner-up, as records and as text."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from relgym.classification.examples import Example, ExampleBatch
from relgym.classification.ranking import Verdict
from relgym.classification.views import View
from relgym.clustering.mode import Mode
from relgym.logic.csp import solutions, world_of
from relgym.model.prediction import Prediction
from relgym.model.text import amount, as_relations
from relgym.scene.objects import Scene

if TYPE_CHECKING:
    from relgym.model.property_model import PropertyModel
    from relgym.model.world_model import WorldModel

__all__ = ["Explanation", "Reason", "explain", "explanations"]


@dataclass(frozen=True, slots=True)
class Reason:
    """Why one mode was preferred to another one.

    Attributes
    ----------
    runner_up
        Id of the mode that was not chosen.
    runner_up_value
        What it would have predicted; NaN if its roles are open.
    clause
        The clause that decided; empty if none held and that decided.
    objects
        (variable, object name) of an assignment that makes the clause true, the target first.
    tests
        Numeric tests that had the last word (§3.4.4); empty if there were none.
    winner
        Id of the mode that this pair preferred.
    correct, incorrect
        Training examples that went the same way, of the winner and of its runner-up.
    """

    runner_up: int
    runner_up_value: float
    clause: str
    objects: tuple[tuple[str, str], ...]
    tests: str
    winner: int
    correct: float
    incorrect: float


@dataclass(frozen=True, slots=True)
class Explanation:
    """How the prediction of one property of one object came about.

    Attributes
    ----------
    prediction
        The prediction.
    now
        The property's present value.
    mode
        The mode that predicted it; none if no mode did.
    digits
        Significant digits in the text.
    reasons
        The mode against every other one, in the order of the ranking; the first is its strongest runner-up.
    laws
        What laws of motion predicted it, a line each, where they and no mode did: the free law, then every
        contact.
    limit
        When the mode holds if it takes no part in the vote, a limit or a stop, where others would lead too far.
    beyond
        Tests of the place, if it is one where modes don't speak (`relgym.model.scope`).
    """

    prediction: Prediction
    now: float
    mode: Mode | None
    digits: int
    reasons: tuple[Reason, ...]
    laws: tuple[str, ...] = ()
    limit: str = ""
    beyond: str = ""

    def __str__(self) -> str:
        p, d = self.prediction, self.digits
        name = f"{p.object}.{p.property}"
        if self.laws:
            first, *rest = self.laws
            head = f"{name}: {self.now:.{d}g} -> {p.value:.{d}g}"
            return "\n".join([head, f"  laws      {first}", *(f"            {line}" for line in rest)])
        if self.mode is None:
            said = f"-> {p.value:.{d}g}, a guess" if p.informed else "keeps its value: no prediction"
            lines = [f"{name}: {self.now:.{d}g} {said}", f"  outcome   {p.outcome.value}"]
            return "\n".join(
                [*lines, f"  because   no mode speaks where {self.beyond}"] if self.beyond else lines
            )
        lines = [f"{name}: {self.now:.{d}g} -> {p.value:.{d}g}"]
        examples = amount(self.mode.examples, "training example")
        lines.append(f"  mode      {self.mode.id}: {self.mode.formula(d)}  ({examples})")
        lines.append(f"  roles     {self._roles(self.mode)}")
        if not p.ok:
            lines.append(f"  outcome   {p.outcome.value}")
        if self.limit:
            return "\n".join([*lines, f"  because   {self.limit}"])
        lines += self._because() if self.reasons else ["  because   no other mode is known"]
        return "\n".join(lines)

    def _roles(self, mode: Mode) -> str:
        own, *others = self.prediction.roles
        labels = mode.role_labels()[1:]
        return ", ".join([own, *(f"{label} = {name}" for label, name in zip(labels, others, strict=True))])

    def _because(self) -> list[str]:
        reason = self.reasons[0]
        lines = [f"  because   {_clause_text(reason)}"]
        if reason.tests:
            lines.append(f"            and {reason.tests}")
        lines.append(
            f"            in training right {reason.correct:,.0f} times, wrong {reason.incorrect:,.0f} times"
        )
        says = f"which says {reason.runner_up_value:.{self.digits}g}"
        if math.isnan(reason.runner_up_value):
            says = "whose roles would have to be filled first"
        lines.append(f"  runner-up mode {reason.runner_up}, {says}; margin {self.prediction.margin:.3g}")
        return lines


def explain(model: WorldModel, scene: Scene, *, digits: int = 7) -> str:
    """Why the model predicts what it predicts for a scene, as text.

    Raises
    ------
    ObservationError
        NaN or infinity somewhere, or another schema.
    """
    found = explanations(model, scene, digits=digits)
    if not found:
        return "Nothing is predicted: the model has no targets yet, or the scene none of their objects."
    return "\n\n".join(map(str, found))


def explanations(model: WorldModel, scene: Scene, *, digits: int = 7) -> tuple[Explanation, ...]:
    """One explanation per target of every object, in causal order; as `explain`, for programs."""
    prediction = model.predict_one(scene)
    parts = iter(prediction.parts)
    found = []
    for target in model.targets:
        part = model.property_model(target.type, target.property)
        for index in scene.layout.of_type(target.type):
            one = next(parts)
            now = float(scene.vector[scene.layout.column(index, target.property)])
            if model.governs(target):
                lines = model.law_lines(scene, index, digits) if one.ok else ()
                found.append(Explanation(one, now, None, digits, (), lines))
                continue
            mode = next(m for m in part.modes if m.id == one.mode) if one.mode else None
            if part.bounds(one.mode):
                found.append(Explanation(one, now, mode, digits, (), limit=_limit(part, one.mode)))
                continue
            if mode is None:
                tests = part.beyond(model.percept(scene), index, prediction.scene.vector)
                beyond = as_relations(tests, part.flags)
                found.append(Explanation(one, now, None, digits, (), beyond=beyond))
                continue
            reasons = _reasons(model, part, scene, index, prediction.scene, mode.id)
            found.append(Explanation(one, now, mode, digits, reasons))
    return tuple(found)


def _limit(part: PropertyModel, mode: int) -> str:
    if mode in part.stops:
        return f"it holds {part.stops.text(mode, part.target.property)}"
    return "another mode would lead beyond it, and it is a limit"


def _reasons(
    model: WorldModel, part: PropertyModel, scene: Scene, index: int, following: Scene, chosen: int
) -> tuple[Reason, ...]:
    percept = model.percept(scene)
    example = part.example(percept, index, following.vector)
    values = part.mode_values(percept, index, following.vector)
    names = [scene.layout.names[i] for i in scene.layout.bodies if index in scene.layout.bodies]
    by_mode = dict(zip(part.classifier.modes, values, strict=True))
    reasons = []
    for verdict in part.classifier.explain(example, values):
        # Where a mode ranked higher can't fill its roles, its own pair with the chosen mode says why it led.
        runner_up = verdict.runner_up if verdict.winner == chosen else verdict.winner
        objects = _objects(part, example, values, verdict, names or [scene.layout.names[index]])
        clause = "" if verdict.clause is None else as_relations(str(verdict.clause), part.flags)
        tree = as_relations(verdict.tree, part.flags)
        counts = (verdict.correct, verdict.incorrect)
        reasons.append(Reason(runner_up, by_mode[runner_up], clause, objects, tree, verdict.winner, *counts))
    return tuple(reasons)


def _objects(
    part: PropertyModel, example: Example, values: list[float], verdict: Verdict, names: list[str]
) -> tuple[tuple[str, str], ...]:
    """Objects for which the deciding clause holds; `names` are those of the example's objects."""
    if verdict.clause is None:
        return ()
    pair = {verdict.winner, verdict.runner_up}
    classifier = next(c for c in part.classifier.classifiers if {c.i, c.j} == pair)
    view = View.of_batch(ExampleBatch.of(example), part.classifier.modes, np.array([values]))
    world = world_of(view.facts(classifier.context, classifier.scope), 0)
    bound = next(solutions(verdict.clause, world, (example.target,)), ())
    return tuple((chr(ord("A") + k), names[each]) for k, each in enumerate(bound))


def _clause_text(reason: Reason) -> str:
    if not reason.clause:
        return "none of the clauses that tell the two modes apart holds"
    where = ", ".join(f"{variable} = {name}" for variable, name in reason.objects)
    return f"{reason.clause}, with {where}" if where else reason.clause
