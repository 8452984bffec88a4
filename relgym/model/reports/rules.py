"""From what was learned to rule lists: votes of pairs of modes become one ordered list of branches.

The votes are a function of the conditions that classifiers test. So is a decision list over the same conditions: it is
learned from the examples that the classifiers remember, labelled by who wins the vote there (not by what really held),
and says the same for each of them. Where several modes predict the same value, the simplest one is named: what rests
rests, and doesn't bounce with no velocity.

- *From votes to a list* (`relgym.model.reports.rules`). Which mode wins is a function of the conditions that the
  pairs' classifiers test. So is a decision list over the same conditions (`relgym.numeric.decision_list`), learned
  from the remembered examples, labelled by who wins the vote, not by what held. It repeats every vote among them, but
  for up to 0.02 % that no mode explains anyway. Where no short list does so, it is long.
- *The simplest that says the same.* Where modes agree on the value, the one with fewest parameters is named: a ball
  that rests isn't said to bounce with no velocity.
- *Contexts are printed.* ``some struck B [...]``, ``no close B [...]``: what a variable ranges over is part of the
  condition.
- *Names.* Long conditions get a name from what happens where they hold (`bouncing`, ``at rest``, `drifting`);
  `WorldModel.name_condition` gives another one, kept in the file.
- *Explanations* (`relgym.model.reports.explain`) are told from the list: the branch that decided, its conditions, and
  for each branch before it one condition that fails there, all evaluated in that scene. Where vote and list differ,
  the vote is told, and only conditions that hold.
- *Files* keep the list's text and the advice: what was learned from isn't needed to tell them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import NOISE as UNKNOWN
from relgym.classification.role_classifier import RoleKind
from relgym.classification.views import View
from relgym.clustering.mode import NOISE, Mode
from relgym.config.constants import DIGITS, LEFT_OPEN, ROUGH, ROUNDED
from relgym.laws.frames import axis_names
from relgym.logic.batch import matches
from relgym.logic.clause import Clause, Literal
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.target.conditions import needed
from relgym.model.target.property_model import PropertyModel
from relgym.numeric.decision_list import Rule, decision_list
from relgym.numeric.tree import DecisionTree
from relgym.reporting.conditions import FLAG, Condition, Test, as_tests, equal_to, parts_of
from relgym.reporting.functions import Sum, parse_sum
from relgym.reporting.motion import MotionRules
from relgym.reporting.naming import named
from relgym.reporting.rules import Bound, Branch, Derivation, Experience, PropertyRules, RuleList, RuleRole
from relgym.scene.axes import Axes
from relgym.scene.objects import Scene, SceneLayout, Target
from relgym.scene.schema import SceneSchema

if TYPE_CHECKING:
    from relgym.model.world_model import WorldModel

__all__ = ["agreement", "doubted", "functions_of", "of_laws", "rule_list", "tested"]

_PREDICTED: Final = OUTCOMES.index(Outcome.PREDICTED)

_CLOSE: Final = 1e-4
"""Values that differ by no more than this part of what usually changes are the same but for digits."""

_EXACT: Final = 9
"""Significant digits of numbers within conditions, where rounding isn't coarser (`DIGITS`)."""

DOUBT: Final = 2e-4
"""The list may differ from the votes for so large a share of the examples, if nothing explains those anyway."""


def rule_list(model: WorldModel) -> RuleList:
    """The rules of a model that remembers what it learned from.

    Cost: some 10 ms for each property with several modes.
    """
    advice = {a.target: str(a) for a in model.advice()}
    parts = [
        model.property_model(target.type, target.property)
        for target in model.targets
        if not model.governs(target)
    ]
    properties = tuple(replace(_property(part), advice=advice.get(str(part.target), "")) for part in parts)
    return of_laws(model, doubted(RuleList(model.seen, _scope(model), properties), parts))


def of_laws(model: WorldModel, rules: RuleList) -> RuleList:
    """The same rules, with those that no history is needed for: laws of motion, and kinematics."""
    laws = tuple(
        Derivation(k.type, k.property, k.rate, k.step, k.uses_next) for k in model.schema.derivations
    )
    return replace(rules, motion=_motion(model), kinematics=laws)


def agreement(model: WorldModel, rules: RuleList, scenes: Iterable[Scene]) -> tuple[RuleList, float]:
    """Compare what rules say of scenes, and nothing but the rules, with what the model says.

    Parameters
    ----------
    model
        The model.
    rules
        Its rules, such as they were read back from their text.
    scenes
        Where to compare.

    Returns
    -------
    The rules with the result in `RuleList.agreement`, and the share of predictions that agree: of equal value, but for
    a ten-thousandth of the root mean square change (the digits that the text shows), or both without a prediction.
    """
    groups: dict[SceneLayout, tuple[SceneSchema, list[NDArray[np.float64]]]] = {}
    for scene in scenes:
        groups.setdefault(scene.layout, (scene.schema, []))[1].append(scene.vector)
    pairs: dict[tuple[str, str], list[NDArray[np.float64]]] = {}
    for layout, (schema, rows) in groups.items():
        vectors = np.array(rows)
        found = model.predict_batch(layout, vectors)
        said = rules.predict_batch(schema, layout, vectors)
        for k, (name, prop) in enumerate(found.parts):
            index = layout.index(name)
            column = layout.column(index, prop)
            value = np.where(found.outcomes[:, k] == _PREDICTED, found.vectors[:, column], np.nan)
            rule = said.get((name, prop), np.full(len(vectors), np.nan))
            pair = np.stack([value, rule, vectors[:, column]])
            pairs.setdefault((layout.types[index].name, prop), []).append(pair)
    total = same = abstained = 0
    for parts in pairs.values():
        value, rule, now = np.concatenate(parts, axis=1)
        equal, none = _same(value, rule, now)
        total, same, abstained = total + len(now), same + int(equal.sum()), abstained + int(none.sum())
    steps = sum(len(rows) for _, rows in groups.values())
    share = same / total if total else 1.0
    percent = f"{100.0 * _floor(share):.5g} %"
    text = f"on {steps:,} steps these rules say what the model says of {percent} of {total:,} values"
    text += f"; both make no prediction of {abstained:,} of them" if abstained else ""
    return replace(rules, agreement=f"{text}."), share


def _same(
    value: NDArray[np.float64], rule: NDArray[np.float64], now: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which predictions agree, and which are none on either side."""
    none = np.isnan(value) & np.isnan(rule)
    change = np.square(value - now)[~np.isnan(value)]
    slack = _CLOSE * float(np.sqrt(change.mean())) if len(change) else 0.0
    with np.errstate(invalid="ignore"):
        return none | (np.abs(value - rule) <= slack), none


def _floor(share: float) -> float:
    """A share that isn't rounded up to 1."""
    return min(share, 0.99999) if share < 1.0 else 1.0


def _scope(model: WorldModel) -> tuple[tuple[str, int, int], ...]:
    """Numbers of objects of each type with a body in what was learned from."""
    counts: dict[str, list[int]] = {}
    bodies = [t.name for t in model.schema.types if t.has_body]
    for types in model.layouts_seen():
        for name in bodies:
            counts.setdefault(name, []).append(sum(t.name == name for t in types))
    return tuple((name, min(n), max(n)) for name, n in counts.items() if max(n))


def _motion(model: WorldModel) -> MotionRules | None:
    book = model.laws
    if book is None or not model.governed:
        return None
    names = sorted(model.governed)
    letters = "" if book.pair is None else axis_names(book.pair.frame, len(Axes.of(book.schema).used))
    said = {name: tuple(book.components(name)) for name in names}
    # A free law may speak of spins, too; where contacts don't act on surfaces, nothing is said of those.
    free = ((name, book.free[name]) for name in names if name in book.free)
    return MotionRules(
        tuple(law.first(len(said[name])) for name, law in free),
        tuple(said.items()),
        book.pair,
        "".join(letters),
        tuple(sorted(book.shares.items())),
        book.tolerance,
        book.inertia,
    )


def _property(part: PropertyModel) -> PropertyRules:
    target = part.target
    branches: tuple[Branch, ...] = ()
    roles: tuple[RuleRole, ...] = ()
    if part.classifier.modes:
        functions, roles = functions_of(part)
        branches = _within(part, _branches(part, functions))
    unexplained = part.clusterer.population.unexplained
    steps = unexplained + sum(mode.examples for mode in part.modes)
    return PropertyRules(
        target.type,
        target.property,
        named(branches, target.property),
        tuple(_bounds(part)),
        roles,
        steps,
        unexplained,
        experience=_experience(part),
        ended=tuple(mode.formula() for mode in part.modes if mode.id in part.past),
    )


def _experience(part: PropertyModel) -> Experience | None:
    if not part.config.abstain or len(part.classifier.modes) < 2:
        return None
    relations, seen = part.classifier.experience()
    if not any(binary or unary for _, binary, unary in relations) and len(seen) <= 1:
        return None
    return Experience(relations, tuple(sorted({each >> 40 for each in map(int, seen)})))


def doubted(rules: RuleList, models: Iterable[PropertyModel]) -> RuleList:
    """The rules, with what is known by now of whether they are right (`relgym.model.target.hindsight`)."""
    known = {str(target): why for target, why in _doubts(tuple(models)).items()}
    return replace(
        rules, properties=tuple(replace(p, doubt=known.get(p.target, p.doubt)) for p in rules.properties)
    )


_UNTRIED: Final = "nobody could tell yet whether it is right"


def _doubts(parts: Sequence[PropertyModel]) -> dict[Target, str]:
    """Why each property's list predicts nothing, also since all of it reads what isn't predicted; empty if it does."""
    found = {part.target: _doubt(part) for part in parts}
    told = {part.target for part in parts if part.explained_by is not None}
    unpredicted = {(t.type, t.property) for t, why in found.items() if why and t not in told}
    waiting = [part for part in parts if found[part.target] in ("", _UNTRIED)]
    while reading := {part.target: names for part in waiting if (names := _reads(part, unpredicted))}:
        for target, names in reading.items():
            found[target] = f"it reads next values that aren't predicted: {', '.join(names)}"
        unpredicted |= {(target.type, target.property) for target in reading}
        waiting = [part for part in waiting if part.target not in reading]
    return found


def _reads(part: PropertyModel, unpredicted: Collection[tuple[str, str]]) -> list[str]:
    """Those of some properties whose next values its modes read, if each mode reads one."""
    read = [
        needed(part.target, [part.mode(mode)], ()).intersection(unpredicted) for mode in part.classifier.modes
    ]
    own = part.target.type
    names = {prop if name == own else f"{name}.{prop}" for name, prop in frozenset().union(*read)}
    return sorted(names) if all(read) else []


def _doubt(part: PropertyModel) -> str:
    """Why a property's list predicts nothing; empty if it does."""
    if (law := part.explanation()) is not None:
        return f"no rule, but a hypothesis tells, {law}"
    if part.lost:
        return "no law of the form that is looked for describes it"
    if not part.modes:
        return "no mode learned yet"
    if part.doubtful:
        if part.calibration.paused(_PREDICTED):
            return "what it reads was predicted wrongly, and not rightly again yet"
        shares = [100.0 * told.probability for _, _, told in part.calibration.kinds(_PREDICTED)]
        if not shares:
            return _UNTRIED
        share = max(shares)
        return f"at best {share:.3g} % of such predictions are expected to be right, too few to claim any"
    if (share := part.claimed) <= LEFT_OPEN:
        return f"too few such predictions are expected to be right to claim any, but in {100.0 * share:.2g} % of steps"
    known = part.calibration.trials and part.config.abstain
    return "nothing tells yet which of these holds" if part.undecided and not known else ""


# ------------------------------------------------------------------ functions and roles
def functions_of(part: PropertyModel) -> tuple[dict[int, Sum], tuple[RuleRole, ...]]:
    """The modes' functions, their roles named differently wherever they mean different objects."""
    functions: dict[int, Sum] = {}
    roles: dict[tuple[str, int, tuple[Condition, ...]], RuleRole] = {}
    letters = iter("abcdefghijklmnopqrstuvwxyz")
    for number in part.classifier.modes:
        mode = part.mode(number)
        labels = _labels(part, mode, roles, letters)
        functions[number] = _sum(mode, labels)
    return functions, tuple(roles.values())


def _sum(mode: Mode, labels: Sequence[str]) -> Sum:
    terms = [
        (weight, f"{label}.{name}" if label else name)
        for label, role in zip(labels, mode.roles, strict=True)
        for name, weight in role.terms
    ]
    return Sum(tuple(terms), mode.intercept)


def _labels(
    part: PropertyModel,
    mode: Mode,
    known: dict[tuple[str, int, tuple[Condition, ...]], RuleRole],
    letters: Iterator[str],
) -> list[str]:
    labels = list(mode.role_labels())
    described = part.casting.classifiers.get(mode.id)
    rules = {d.kind: d.definition for d in described.descriptions} if described is not None else {}
    for place, (role, number) in enumerate(
        zip(mode.open_roles, part.functions.place(mode.id), strict=False), 1
    ):
        of = role.type, number + 1, ()
        if of not in known:
            known[of] = RuleRole((f"{role.type}_{next(letters)}",), role.type, place=number + 1)
        labels[place] = known[of].labels[0]
    embodied = [role in part.casting.embodied(mode) for role in mode.roles[1:]]
    kinds: dict[RoleKind, list[int]] = {}
    for place, (role, body) in enumerate(zip(mode.roles[1:], embodied, strict=True), start=1):
        if body:
            kinds.setdefault(RoleKind(*role.kind), []).append(place)
    for kind, places in kinds.items():
        definition = rules.get(kind)
        alternatives: tuple[Condition, ...] = ()
        if definition is not None:
            alternatives = tuple(as_tests(clause, "all") for clause in definition.clauses)
        if not alternatives and len(places) == 1 and labels[places[0]] == kind.type:
            continue  # the only one there is
        key = (kind.type, len(places), alternatives)
        if key not in known:
            new = tuple(f"{kind.type}_{next(letters)}" for _ in places)
            known[key] = RuleRole(new, kind.type, alternatives)
        for place, label in zip(places, known[key].labels, strict=True):
            labels[place] = label
    return labels


# ------------------------------------------------------------------ branches
@dataclass(frozen=True, slots=True)
class _Atom:
    """A condition that classifiers test, and where it holds among the remembered examples."""

    test: Test
    truth: NDArray[np.bool_]


def _branches(part: PropertyModel, functions: dict[int, Sum]) -> tuple[Branch, ...]:
    modes = part.classifier.modes
    if len(modes) == 1 or not len(part.classifier.exemplars.rows):
        most = max(modes, key=lambda m: (_counts(part)[m], -m))
        return (_branch(part, (), most, functions, _counts(part)[most]),)
    view, weights, ranking = part.classifier.remembered()
    exemplars = part.classifier.exemplars
    labels = part.clusterer.labels[exemplars.rows.astype(np.intp)]
    if part.past:  # what followed functions that have ended follows none of these
        weights = np.where(np.isin(labels, list(part.past)), 0.0, weights)
    atoms = _atoms(part, view, functions)
    allowed = _allowed(part, view, ranking.modes[:, 0])
    truth = np.array([atom.truth for atom in atoms], dtype=np.bool_).T.reshape(len(view), len(atoms))
    cost = [
        1 + len(atom.test.clause) + (atom.test.context == "all" and atom.test.clause.variables > 1)
        for atom in atoms
    ]
    nobody = exemplars.assigned == UNKNOWN
    rules = decision_list(truth, allowed, weights, cost, doubtful=nobody, budget=DOUBT)
    # What a bound decides is right of every branch: it has the last word.
    bounds = {part.limits.low, part.limits.high, *(each.mode for each in part.stops.every)} - {NOISE}
    right = exemplars.columns["fits"] | np.isin(labels, sorted(bounds))[:, None]
    # Examples stand for others in whole numbers, which add up to a few steps more or less than there were.
    total = part.clusterer.population.unexplained + sum(
        mode.examples for mode in part.modes if mode.id not in part.past
    )
    times = total / max(float(weights.sum()), 1.0)
    found: list[Branch] = []
    left = np.ones(len(view), dtype=np.bool_)  # for later branches
    for rule in rules:
        there = left & np.all([truth[:, k] == yes for k, yes in rule.tests] or [left], axis=0)
        left &= ~there
        wrong = round(times * float(weights[there & ~right[:, rule.label]].sum()))
        branch = _of_rule(part, rule, atoms, modes, functions, steps=round(times * rule.weight), wrong=wrong)
        if found and branch.cases and found[-1].function == branch.function:
            last = found[-1]
            found[-1] = replace(
                last,
                cases=(*last.cases, *branch.cases),
                steps=last.steps + branch.steps,
                wrong=last.wrong + branch.wrong,
            )
        else:
            found.append(branch)
    return tuple(found)


def _of_rule(
    part: PropertyModel,
    rule: Rule,
    atoms: Sequence[_Atom],
    modes: Sequence[int],
    functions: dict[int, Sum],
    *,
    steps: int,
    wrong: int,
) -> Branch:
    tests = [atoms[k].test if yes else atoms[k].test.opposite for k, yes in rule.tests]
    found = _branch(part, tuple(dict.fromkeys(tests)), modes[rule.label], functions, steps)
    return replace(found, wrong=wrong)


def _branch(
    part: PropertyModel, condition: Condition, mode: int, functions: dict[int, Sum], steps: int
) -> Branch:
    return Branch((condition,) if condition else (), functions[mode], steps=steps, spread=_spread(part, mode))


def _spread(part: PropertyModel, mode: int) -> float:
    known = part.spreads.by_mode.get(mode)
    if known is None or known.whole <= max(part.clusterer.floor, part.clusterer.scale.sigma / ROUGH):
        return 0.0
    return known.whole


def _counts(part: PropertyModel) -> dict[int, int]:
    """Training examples of each mode."""
    return {mode.id: mode.examples for mode in part.modes}


def _allowed(part: PropertyModel, view: View, winners: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which modes may be named for each example, shape ``(n, modes)``: the simplest that says what the winner says."""
    modes = part.classifier.modes
    winner = np.searchsorted(np.array(sorted(modes)), winners)
    place = np.array([modes.index(m) for m in sorted(modes)])[winner]
    values = view.values
    said = values[np.arange(len(values)), place]
    slack = part.clusterer.scale.tolerance
    agree: NDArray[np.bool_] = np.abs(values - said[:, None]) <= slack
    agree[np.arange(len(values)), place] = True
    counts = _counts(part)
    simple = np.array([(part.mode(m).parameters, -counts[m]) for m in modes], dtype=np.float64)
    order = np.lexsort((simple[:, 1], simple[:, 0]))
    first = order[np.argmax(agree[:, order], axis=1)]
    allowed = np.zeros_like(agree)
    allowed[np.arange(len(values)), first] = True
    return allowed


def _atoms(part: PropertyModel, view: View, functions: dict[int, Sum]) -> list[_Atom]:
    """All that classifiers test, each condition once."""
    found: dict[Test, _Atom] = {}
    rows = np.arange(len(view))
    for classifier in part.classifier.classifiers:
        facts = view.facts(classifier.context, classifier.scope)
        for piece, test in tested(part, classifier, functions):
            if test not in found and test.opposite not in found:
                found[test] = _Atom(test, matches(piece, facts, view.tuples(rows)))
    for atom in _at_rest(part, view):
        if atom.test not in found and atom.test.opposite not in found:
            found[atom.test] = atom
    return list(found.values())


def tested(
    part: PropertyModel, classifier: BinaryClassifier, functions: dict[int, Sum]
) -> Iterator[tuple[Clause, Test]]:
    """All that a classifier tests, piece by piece, and how that is told."""
    spelled = _spelled(part, classifier, functions)
    for clause in _clauses(classifier):
        for piece in parts_of(clause):
            # What tests a function that can't be written out is left out.
            if not any(spelled.get(literal.relation) == "" for literal in piece):
                yield piece, _as_test(piece, classifier.context, spelled, part.flags)


def _clauses(classifier: BinaryClassifier) -> Iterator[Clause]:
    """All that a classifier tests: its clauses, and with the nodes of their trees."""
    clauses = classifier.definition.clauses
    yield from clauses
    trees = (*classifier.clause_trees, classifier.fall_through_tree)
    for stage, tree in enumerate(trees):
        if tree is None:
            continue
        clause = clauses[stage] if stage < len(clauses) else Clause(())
        scalars = len(classifier.scope.scalars)
        pair = [name for name, _ in classifier.scope.pair]
        for column, threshold in zip(tree.column, tree.threshold, strict=True):
            if column < 0:
                continue
            if column < scalars:
                yield Clause((Literal(classifier.scope.scalars[column], (), False, "<=", threshold),))
            else:
                variable, feature = divmod(column - scalars, len(pair))
                literal = Literal(pair[feature], (0, variable + 1), False, "<=", threshold)
                yield Clause((*clause.literals, literal))


def _as_test(clause: Clause, context: str, spelled: dict[str, str], flags: frozenset[str]) -> Test:
    """A clause as a test, modes' functions written out."""
    literals = tuple(
        _simplified(spelled[each.relation], each) if each.relation in spelled else _flagged(each, flags)
        for each in clause.literals
    )
    return as_tests(Clause(literals, clause.arity), context)[0]


def _flagged(literal: Literal, flags: frozenset[str]) -> Literal:
    """A comparison with digits that people can read; that of a flag with a half is told as a relation."""
    if literal.op is None:
        return literal
    if literal.relation not in flags or literal.args or literal.threshold != 0.5:
        threshold = float(f"{literal.threshold:.{_EXACT}g}")
        return Literal(literal.relation, literal.args, literal.negated, literal.op, threshold)
    return Literal(f"{literal.relation}{FLAG}", (), literal.negated, literal.op, 0.5)


def _simplified(text: str, literal: Literal) -> Literal:
    """A comparison of a sum; a single term stands alone."""
    threshold, op = float(f"{literal.threshold:.{_EXACT}g}"), literal.op
    found = None if text.startswith("(") else parse_sum(text)
    if found is not None and len(found.terms) == 1 and op is not None and found.terms[0][0] != 0.0:
        weight, name = found.terms[0]
        threshold = float(f"{(threshold - found.constant) / weight:.{_EXACT}g}") + 0.0
        if weight > 0.0:
            return Literal(name, (), literal.negated, op, threshold)
        return Literal(f"-{name}", (), literal.negated, op, 0.0 - threshold)
    return Literal(text, (), literal.negated, op, threshold)


def _spelled(part: PropertyModel, classifier: BinaryClassifier, functions: dict[int, Sum]) -> dict[str, str]:
    """Names of numbers that hold modes' functions, written out; empty where a role keeps that from being done."""
    scope = classifier.scope
    if not scope.modes:
        return {}
    texts: dict[str, str] = {}
    plain = scope.scalars[len(scope.own) :]
    i, j = (functions[mode] for mode in scope.modes)
    rough = part.clusterer.floor / max(
        part.clusterer.reach, part.clusterer.floor
    )  # of the property's numbers
    dust, digits = max(ROUNDED, rough), DIGITS if rough > ROUNDED else _EXACT
    sums: list[Sum | None] = [i, j, _plus(i, j, -1.0, dust)]
    sums += [_plus(Sum(((1.0, name),)), f, k, dust) for name, _, k in scope.follows for f in (i, j)]
    closed = all(part.mode(m).roles[1:] == () or not _open(part, m) for m in scope.modes)
    for name, found in zip(plain, sums, strict=False):
        texts[name] = found.text(digits) if found is not None and closed else ""
    turned = plain[len(sums) :]
    names = [name for name, _ in scope.present]
    for name, (own, f) in zip(turned, ((p, f) for p in names for f in (i, j)), strict=True):
        if f.terms or not f.constant:
            product = f"({f.text(digits)}) * {own}"
        else:  # a multiple of one property is a sum, too
            product = Sum(((f.constant, own),)).text(digits)
        texts[name] = product if closed else ""
    return texts


def _open(part: PropertyModel, mode: int) -> bool:
    """Whether several objects may play some role of a mode."""
    return any(role in part.casting.embodied(part.mode(mode)) for role in part.mode(mode).roles[1:])


def _plus(a: Sum, b: Sum, weight: float, dust: float) -> Sum:
    """A sum and a multiple of another one, without terms of which only `dust` is left, as a share of the largest."""
    total: dict[str, float] = {}
    for w, name in (*a.terms, *((weight * w, name) for w, name in b.terms)):
        total[name] = total.get(name, 0.0) + w
    most = max((abs(w) for w, _ in (*a.terms, *b.terms)), default=1.0)
    terms = tuple((w, name) for name, w in total.items() if abs(w) > dust * most)
    return Sum(terms, a.constant + weight * b.constant)


def _at_rest(part: PropertyModel, view: View) -> Iterator[_Atom]:
    """Where a function of one own property says what a constant mode says: ``v = 0``."""
    own = part.classifier.vocabulary.own
    constants = [m for m in part.classifier.modes if not any(r.terms for r in part.mode(m).roles)]
    for constant in constants:
        for mode in part.classifier.modes:
            terms = [(w, name) for role in part.mode(mode).roles for name, w in role.terms]
            if len(terms) != 1 or terms[0][1] not in own or part.mode(mode).roles[0].terms == ():
                continue
            weight, name = terms[0]
            if weight == 0.0:  # what a refit left of a term
                continue
            value = (part.mode(constant).intercept - part.mode(mode).intercept) / weight
            value = 0.0 if abs(value) <= part.clusterer.scale.tolerance else value
            if not math.isfinite(value):
                continue
            test = Test(Clause((equal_to(name, value + 0.0),)), "all")
            yield _Atom(test, view.own[:, own.index(name)] == value)


# ------------------------------------------------------------------ what modes don't say
def _within(part: PropertyModel, branches: tuple[Branch, ...]) -> tuple[Branch, ...]:
    """Branches of where modes speak, and that nothing is predicted elsewhere, whichever is sooner said."""
    tree = part.fallback.scope.tree
    if tree is None:
        return branches
    yes, no = (tuple(_parts(tree, 0, {}, part.flags, said=said)) for said in (True, False))
    if not no:
        return branches
    if not yes:
        return (Branch((), None, reason="unexplained everywhere"),)
    if len(branches) == 1 and not branches[0].cases and sum(map(len, yes)) <= sum(map(len, no)):
        return replace(branches[0], cases=yes), Branch((), None, reason="unexplained elsewhere")
    return Branch(no, None, reason="unexplained there"), *branches


def _parts(
    tree: DecisionTree,
    node: int,
    above: Mapping[tuple[int, str], float],
    flags: frozenset[str],
    *,
    said: bool,
) -> Iterator[Condition]:
    """The largest parts of a tree that only say yes, or only no: of the tests on the way there the tightest ones."""
    if all(tree.says_yes(leaf) is said for leaf in _leaves(tree, node)):
        literals = (Literal(tree.columns[c], (), False, op, value) for (c, op), value in above.items())
        yield tuple(test for one in literals for test in as_tests(Clause((_flagged(one, flags),)), "all"))
    elif tree.column[node] >= 0:
        column, value = tree.column[node], tree.threshold[node]
        for op, below in (("<=", tree.below[node]), (">", tree.above[node])):
            yield from _parts(tree, below, {**above, (column, op): value}, flags, said=said)


def _leaves(tree: DecisionTree, node: int) -> Iterator[int]:
    if tree.column[node] < 0:
        yield node
    else:
        yield from _leaves(tree, tree.below[node])
        yield from _leaves(tree, tree.above[node])


def _bounds(part: PropertyModel) -> Iterator[Bound]:
    if (
        part.clusterer.approximate
        and np.isfinite([part.fallback.scope.least, part.fallback.scope.most]).all()
    ):
        yield Bound("change within", part.fallback.scope.least, part.fallback.scope.most)
    limits, counts = part.limits, _counts(part)
    for mode, kind, value in ((limits.low, "at least", limits.least), (limits.high, "at most", limits.most)):
        if mode in limits:
            yield Bound(kind, value, steps=counts[mode])
    rate = f"{part.target.property}'"
    for stop in part.stops.stops:
        led = Sum(((1.0, stop.property), (stop.step, rate)))
        sign = 1.0 if stop.side < 0.0 else -1.0
        text = Sum(tuple((sign * w, name) for w, name in led.terms)).text(_EXACT)
        tests = as_tests(Clause((Literal(text, (), False, "<=", sign * stop.bound),)), "all")
        yield Bound("if", stop.value, tests=tests, steps=counts[stop.mode])
    for landing in part.stops.landings:
        tests = as_tests(
            Clause((equal_to(f"{landing.property}'", landing.at + 0.0, float(f"{landing.slack:.2g}")),)),
            "all",
        )
        yield Bound("if", landing.value, tests=tests, steps=counts[landing.mode])
