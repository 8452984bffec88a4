"""Why a model predicts what it predicts: the branch of its rules that decided, and why, as records and as text.

What is printed is true of the scene: every condition was tested there, apart from the model, by the rules' own
evaluation. Where the model's votes differ from its rules, the votes are told.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from relgym.logic.csp import solutions, world_of
from relgym.model.predicting.calibration import EXPERTS
from relgym.model.predicting.prediction import Prediction
from relgym.model.reports.rules import functions_of, tested
from relgym.model.reports.text import amount
from relgym.reporting.conditions import Test
from relgym.reporting.evaluation import Evaluated, SceneBatch, bounds_reached, evaluate, holds
from relgym.reporting.naming import word_for
from relgym.reporting.rules import Bound, Branch, PropertyRules, RuleList, bound_text
from relgym.scene.objects import Scene

if TYPE_CHECKING:
    from relgym.model.target.property_model import PropertyModel
    from relgym.model.world_model import WorldModel

__all__ = ["Because", "Explanation", "RunnerUp", "explain", "explanations"]

CLOSE = 1e-6
"""Values that differ by no more than this part of them are the same."""


@dataclass(frozen=True, slots=True)
class Because:
    """A condition that holds in the scene.

    Attributes
    ----------
    test
        The condition.
    objects
        (variable, object name) of objects of which it is true, A left aside.
    """

    test: Test
    objects: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        where = ", ".join(f"{variable} = {name}" for variable, name in self.objects)
        return f"{self.test}, with {where}" if where else str(self.test)


@dataclass(frozen=True, slots=True)
class RunnerUp:
    """What would have been predicted otherwise.

    Attributes
    ----------
    function
        As text.
    value
        What it would have said; NaN if the objects in its roles would have to be found first.
    correct, incorrect
        Training examples that went the same way, rightly and wrongly.
    """

    function: str
    value: float
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
    digits
        Significant digits in the text.
    branch
        The branch of the rules that decided; None if none did, or if the votes differ from the rules.
    word
        What happens, in a word: the branch's name, or one made from its function.
    function
        The function that gave the value, as text; empty without a prediction.
    because
        Why: conditions that hold in the scene.
    objects
        (name in the function, object) of objects in its roles.
    bounds
        What had the last word on the value.
    runner_up
        What would have been predicted otherwise.
    laws
        What laws of motion predicted it, a line each, where they and no branch did.
    lacks
        What moves the object and isn't explained, a sentence each, where nothing is predicted.
    """

    prediction: Prediction
    now: float
    digits: int
    branch: Branch | None = None
    word: str = ""
    function: str = ""
    because: tuple[Because, ...] = ()
    objects: tuple[tuple[str, str], ...] = ()
    bounds: tuple[Bound, ...] = ()
    runner_up: RunnerUp | None = None
    laws: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        p, d = self.prediction, self.digits
        name = f"{p.object}.{p.property}"
        if self.laws:
            yield f"{name}: {self.now:.{d}g} -> {p.value:.{d}g}"
            yield from _labelled("laws", self.laws)
            return
        if not p.ok:
            said = (
                f"-> {p.value:.{d}g}, a guess"
                if p.informed or p.value != self.now
                else "keeps its value: no prediction"
            )
            yield f"{name}: {self.now:.{d}g} {said}"
            yield f"  outcome   {p.outcome.value}"
            yield from _labelled("lacks", self.lacks)
        else:
            yield f"{name}: {self.now:.{d}g} -> {p.value:.{d}g}"
        if self.function:
            word = f"{self.word}: " if self.word else ""
            steps = f"  ({amount(self.branch.steps, 'training step')})" if self.branch is not None else ""
            yield f"  {'rule' if self.branch is not None else 'vote'}      {word}{self.function}{steps}"
        if self.objects:
            yield f"  objects   {', '.join(f'{label} = {each}' for label, each in self.objects)}"
        if self.because:
            yield from _labelled("because", tuple(map(str, self.because)))
        elif self.function and self.branch is not None and p.ok:
            yield "  because   no other rule is known"
        yield from _labelled("then", tuple(bound_text(b, p.property, d) for b in self.bounds))
        if self.runner_up is not None:
            says = "whose objects would have to be found first"
            if not math.isnan(self.runner_up.value):
                says = f"which says {self.runner_up.value:.{d}g}"
            margin = f"; margin {p.margin:.3g}" if p.margin else ""
            yield f"  runner-up {self.runner_up.function}, {says}{margin}"


def _labelled(label: str, lines: tuple[str, ...]) -> Iterator[str]:
    for number, line in enumerate(lines):
        yield f"  {(label if not number else '').ljust(10)}{line}"


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
    """One explanation per target of every object, in causal order; as `explain`, for programs.

    Cost: some milliseconds, once the model's rules are known (`WorldModel.rules`).
    """
    prediction = model.predict_one(scene)
    vectors = scene.vector[None]
    told = None
    following = prediction.scene.vector[None]
    if model.has_rules:
        rules = model.rules()
        told = rules, evaluate(rules, scene.schema, scene.layout, vectors)
        following = told[1].following
    scenes = SceneBatch(scene.schema, scene.layout, vectors, following)
    parts = iter(prediction.parts)
    forces = {advice.target: advice.forces for advice in model.advice() if advice.forces}
    found = []
    for target in model.targets:
        for index in scene.layout.of_type(target.type):
            one = next(parts)
            now = float(scene.vector[scene.layout.column(index, target.property)])
            if model.governs(target):
                lines = model.law_lines(scene, index, digits) if one.ok else ()
                found.append(Explanation(one, now, digits, laws=lines))
            else:
                part = model.property_model(target.type, target.property)
                if one.audit is not None and one.audit.speaker >= len(EXPERTS):
                    law = part.candidates.statement(one.audit.speaker - len(EXPERTS))
                    found.append(Explanation(one, now, digits, laws=(law,)))
                    continue
                seen = _Seen(model, told, part, scenes, prediction.scene, index, digits)
                each = seen.explained(one, now)
                named = {one.object, target.type}
                lacks = tuple(str(f) for f in forces.get(str(target), ()) if named.intersection(f.objects))
                found.append(each if one.ok else replace(each, lacks=lacks))
    return tuple(found)


@dataclass(frozen=True)
class _Seen:
    """One object of a scene, and what is known of one of its properties.

    `told`: the rules and what they say of the scene; None of a model that has none (`WorldModel.has_rules`).
    """

    model: WorldModel
    told: tuple[RuleList, Evaluated] | None
    part: PropertyModel
    scenes: SceneBatch
    following: Scene
    index: int
    digits: int

    def explained(self, one: Prediction, now: float) -> Explanation:
        if self.told is None:
            return self._by_vote(one, now) if one.ok else Explanation(one, now, self.digits)
        rules, said = self.told
        told = rules[str(self.part.target)]
        key = (one.object, one.property)
        number = int(said.branches[key][0])
        value = float(said.values[key][0])
        branch = told.branches[number] if number >= 0 else None
        if not one.ok:
            unsaid = branch is not None and branch.function is None
            return Explanation(one, now, self.digits, because=self._why(told, number) if unsaid else ())
        slack = self.part.clusterer.scale.tolerance + CLOSE * max(abs(one.value), abs(now))
        if branch is None or branch.function is None or not abs(value - one.value) <= slack:
            return self._by_vote(one, now)
        return Explanation(
            one,
            now,
            self.digits,
            branch,
            _word(told, branch),
            f"{one.property}' = {branch.function.text(self.digits)}",
            self._why(told, number),
            tuple(self._players(key, said)),
            bounds_reached(told, self.scenes, self.index, branch.function),
            self._runner_up(one),
        )

    def _by_vote(self, one: Prediction, now: float) -> Explanation:
        """What the classifiers' votes say, where the rules say nothing or something else."""
        return Explanation(
            one,
            now,
            self.digits,
            function=self.part.mode(one.mode).formula(self.digits),
            because=self._voted(one.mode),
            runner_up=self._runner_up(one),
        )

    def _why(self, told: PropertyRules, number: int) -> tuple[Because, ...]:
        """Tests of the branch that hold, and for each earlier one a test that doesn't, turned round."""
        branch = told.branches[number]
        case = next((c for c in branch.cases if holds(self.scenes, self.index, c)[0]), ())
        found = list(case)
        for earlier in told.branches[:number]:
            for other in earlier.cases:
                missed = [test.opposite for test in other if not self.scenes.holds(self.index, test)[0]]
                if missed and not set(missed) & set(found):
                    found.append(missed[0])
        return tuple(Because(test, self._with(test)) for test in found)

    def _with(self, test: Test) -> tuple[tuple[str, str], ...]:
        """Objects of which a test is true."""
        clause, layout = test.clause, self.scenes.layout
        if test.negated or clause.variables == clause.arity or self.index not in layout.bodies:
            return ()
        world = world_of(self.scenes.facts(self.index, clause, test.context, {}), 0)
        bound = next(solutions(clause, world, (layout.bodies.index(self.index),)), ())
        names = [layout.names[layout.bodies[body]] for body in bound]
        return tuple((chr(ord("A") + k), name) for k, name in enumerate(names) if k >= clause.arity)

    def _voted(self, winner: int) -> tuple[Because, ...]:
        """What the classifiers tested that tell the vote's winner from the others, as it is in the scene."""
        functions, _ = functions_of(self.part)
        found: dict[Test, None] = {}
        for classifier in self.part.classifier.classifiers:
            if winner in (classifier.i, classifier.j):
                for _, test in tested(self.part, classifier, functions):
                    true = bool(self.scenes.holds(self.index, test)[0])
                    found[test if true else test.opposite] = None
        return tuple(Because(test, self._with(test)) for test in found)

    def _players(self, key: tuple[str, str], said: Evaluated) -> Iterator[tuple[str, str]]:
        layout = self.scenes.layout
        for label, bodies in said.players.get(key, {}).items():
            if bodies[0] >= 0:
                yield label, layout.names[layout.bodies[int(bodies[0])]]

    def _runner_up(self, one: Prediction) -> RunnerUp | None:
        if self.part.bounds(one.mode) or len(self.part.classifier.modes) < 2:
            return None
        percept = self.model.percept(Scene(self.scenes.schema, self.scenes.layout, self.scenes.vectors[0]))
        example = self.part.example(percept, self.index, self.following.vector)
        values = self.part.mode_values(percept, self.index, self.following.vector)
        by_mode = dict(zip(self.part.classifier.modes, values, strict=True))
        for verdict in self.part.classifier.explain(example, values):
            other = verdict.runner_up if verdict.winner == one.mode else verdict.winner
            if other != one.mode and not np.isclose(by_mode[other], one.value, rtol=CLOSE, atol=0.0):
                mode = self.part.mode(other)
                function = mode.formula(self.digits)
                return RunnerUp(function, by_mode[other], verdict.correct, verdict.incorrect)
        return None


def _word(told: PropertyRules, branch: Branch) -> str:
    """What happens where a branch holds; empty where its function has no word that isn't another one's name.

    And of what always holds, which rules don't name either.
    """
    if not branch.cases and len(told.branches) == 1:
        return ""
    if branch.name or branch.function is None:
        return branch.name
    word = word_for(branch.function, told.property)
    return "" if word in told.names else word
