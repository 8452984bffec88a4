"""Which object plays which role? First-order descriptions of the objects that a mode reads (§3.5)."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import Bools, Example, Floats, Vocabulary
from relgym.classification.exemplars import Exemplars
from relgym.classification.learning import foil_config
from relgym.classification.roles import Option, Places, RoleDescription, RoleKind, fillings, stances
from relgym.classification.views import Scope, View
from relgym.config import ClassificationConfig
from relgym.config.constants import ANSWERS, CALL, SAME_DIGITS
from relgym.logic.clause import Definition
from relgym.logic.csp import World, matches
from relgym.logic.facts import Facts
from relgym.logic.foil import learn
from relgym.scheduling.work import Steps, Task, resumable

__all__ = ["RoleClassifier", "RoleKind"]

_Rows: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class _Lesson:
    """What one description is to be learned from.

    Parameters
    ----------
    facts
        All examples.
    positives, negatives
        (example, target, object) of those bound to the role, and of others of their type: shape ``(n, 3)``.
    weights, weights_against
        How many seen examples each stands for, shape ``(n,)``.
    """

    facts: Facts
    positives: _Rows
    negatives: _Rows
    weights: Floats
    weights_against: Floats

    def errors(self, definition: Definition) -> float:
        """Weight of what a definition gets wrong."""
        taken, meant = (
            np.logical_or.reduce(
                [
                    np.zeros(len(tuples), dtype=np.bool_),
                    *(matches(c, self.facts, tuples) for c in definition.clauses),
                ]
            )
            for tuples in (self.negatives, self.positives)
        )
        return float(self.weights[~meant].sum() + self.weights_against[taken].sum())


@resumable
def _learned(lessons: Sequence[_Lesson], config: ClassificationConfig) -> Steps[list[Definition | None]]:
    """A definition of each role; none where nobody else could be bound to it."""
    found: list[Definition | None] = []
    for lesson in lessons:
        if not len(lesson.negatives):
            found.append(None)
            continue
        definition = yield from learn.steps(
            lesson.facts,
            lesson.positives,
            lesson.negatives,
            pos_weights=lesson.weights,
            neg_weights=lesson.weights_against,
            config=foil_config(config),
        )
        found.append(definition)
    return found


class RoleClassifier:
    """Binds objects to the roles of one mode, the target's own role left aside.

    Parameters
    ----------
    vocabulary
        Names of what examples hold.
    kinds
        Kind of every role; roles of equal kind are interchangeable and share one description.
    config
        Settings.

    Notes
    -----
    Descriptions use all relations, whatever the context of mode classifiers is (§3.5), and no numbers.
    Negative examples are the other objects of the role's type in the same example; if there never are any,
    any object of the type will do. Unlike the original, which went through the roles greedily, all roles are
    assigned together, so that none takes an object that only another one could.

    Where descriptions leave a choice, objects that have all that players so far had in common come first. If
    that leaves a choice too, and examples never did, then the situation is a new one: a caller may want to know.
    """

    def __init__(
        self, vocabulary: Vocabulary, kinds: Sequence[RoleKind], config: ClassificationConfig
    ) -> None:
        self.vocabulary = vocabulary
        self.kinds = tuple(kinds)
        self.config = config
        full = Scope.of(vocabulary, config)
        self._scope = Scope(full.relations, full.unary, (), ())
        self.descriptions = tuple(
            RoleDescription(kind, tuple(at for at, other in enumerate(self.kinds) if other == kind))
            for kind in sorted(set(self.kinds))
        )
        self.seen = 0.0
        self.learned = 0.0
        self.errors = 0.0
        self.contradictions = 0.0
        self.stale = bool(self.kinds)
        # What is being learned anew, if that was begun, and the weight of what it is taught by; files keep neither.
        self._draft: Task[list[Definition | None]] | None = None
        self._taught = 0.0
        self._answers: dict[tuple[Any, ...], tuple[Places | None, bool]] = {}
        self._extensions: dict[tuple[Any, ...], list[set[int]]] = {}

    # ----- asking -----

    def assign(
        self, example: Example, order: Sequence[int] | None = None, *, sure: bool = False
    ) -> Places | None:
        """Object playing each role, or none if some role can't be filled.

        Parameters
        ----------
        example
            The example.
        order
            All object indices, the ones to prefer first where nothing else decides; default: ascending.
        sure
            Whether to fill no role where nothing but `order` decides, unless that was so in examples too.

        Notes
        -----
        The assignment with the highest sum of log-odds, no object twice; of equal ones that with most typical
        players. Answers are kept per relational state.
        """
        rank = None if order is None else tuple(order)
        key = (example.target, example.table.tobytes(), example.unary.tobytes(), rank)
        if key not in self._answers:
            if len(self._answers) >= ANSWERS:
                self._answers.clear()
            self._answers[key] = self._search(example, rank or tuple(range(example.table.shape[-1])))
        found, single = self._answers[key]
        return found if single or self.errors > 0 or not sure else None

    def describe(self) -> list[str]:
        """One line per kind of role, as in Figure 3.8."""
        return [str(description) for description in self.descriptions]

    # ----- learning -----

    def observe(self, example: Example, roles: Sequence[int], weight: float = 1.0) -> bool:
        """Learn from the role binding of one example of the mode, which stands for so many.

        Returns whether that contradicts the descriptions. They must tell the players from the others by themselves:
        that the right objects happened to come first in the order of preference doesn't count. Learns nothing (that is
        `refresh`).
        """
        if not self.kinds:
            return False
        self.seen += weight
        stance = stances(example)
        for description in self.descriptions:
            if description.witness(stance[[roles[at] for at in description.places]]):
                self._answers.clear()
        wrong = any(
            described != {roles[at] for at in description.places}
            for description, described in zip(self.descriptions, self._described(example), strict=True)
            if description.definition is not None
        )
        self.contradictions += weight * wrong
        grown = self.errors > 0 and self.seen >= self.config.relearn_growth * max(self.learned, 1.0)
        self.stale = self.stale or self.contradictions > self.errors or grown or self._has_choice(example)
        return wrong

    def recall(self, exemplars: Exemplars, mode: int) -> None:
        """Take in how players stood in a mode's exemplars, many of which may be known to be its own only now."""
        rows, roles = self._lessons(exemplars, mode)
        if not len(rows):
            return
        view = View.of_exemplars(exemplars)
        for description in self.descriptions:
            who = roles[rows][:, list(description.places)].ravel()
            where = np.repeat(rows, len(description.places))
            if description.witness(_stances_of(view, where, view.target[where], who)):
                self._answers.clear()

    def refresh(self, exemplars: Exemplars, mode: int, budget: float = math.inf) -> int:
        """Learn stale descriptions anew from a mode's exemplars as far as a budget goes; the cells spent.

        They are learned in pieces (`Task`) of the exemplars that there are when that begins. Of those that come in the
        meantime is counted what the new descriptions get wrong. Not `stale`: done.
        """
        if not self.stale:
            return 0
        rows, roles = self._lessons(exemplars, mode)
        if not len(rows):
            return 0
        view, roles, weights = View.of_exemplars(exemplars).take(rows), roles[rows], exemplars.weights()[rows]
        if self._draft is None:
            self._begin(view, roles, weights)
            assert self._draft is not None, "begun"
        work = CALL + self._draft.advance(int(min(budget, sys.maxsize)))
        if self._draft.done:
            self._adopt(self._draft.result, view, roles, weights)
        return work

    # ----- state -----

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON-able dictionary."""
        names = ("seen", "learned", "errors", "contradictions", "stale")
        return {
            **{name: getattr(self, name) for name in names},
            "kinds": [[kind.type, [list(term) for term in kind.weights]] for kind in self.kinds],
            "definitions": [
                None if d.definition is None else d.definition.to_dict() for d in self.descriptions
            ],
            "common": [
                None if d.common is None else np.flatnonzero(d.common).tolist() for d in self.descriptions
            ],
        }

    @classmethod
    def from_dict(
        cls, data: dict[str, Any], vocabulary: Vocabulary, config: ClassificationConfig
    ) -> RoleClassifier:
        """Inverse of `to_dict`."""
        kinds = [RoleKind(t, tuple((str(p), float(w)) for p, w in weights)) for t, weights in data["kinds"]]
        self = cls(vocabulary, kinds, config)
        stance = np.arange(2 * len(vocabulary.relations) + len(vocabulary.unary))
        known = zip(self.descriptions, data["definitions"], data["common"], strict=True)
        for description, definition, common in known:
            description.definition = None if definition is None else Definition.from_dict(definition)
            description.common = None if common is None else np.isin(stance, common)
        for name in ("seen", "learned", "errors", "contradictions", "stale"):
            setattr(self, name, data[name])
        return self

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_answers": {}, "_extensions": {}}

    # ----- inside -----

    def _lessons(self, exemplars: Exemplars, mode: int) -> tuple[_Rows, _Rows]:
        """Slots of a mode's exemplars whose players are known, and the players in all slots."""
        roles = exemplars.columns["roles"][:, : len(self.kinds)]
        known = (exemplars.assigned == mode) & (roles >= 0).all(axis=1)
        return np.flatnonzero(known & (roles.shape[1] == len(self.kinds))), roles

    def _lesson(self, description: RoleDescription, view: View, roles: _Rows, weights: Floats) -> _Lesson:
        """What tells a role's objects from the others of their type (§3.5)."""
        every = np.arange(len(view))
        able = view.unary[:, self.vocabulary.unary.index(description.kind.type)] & view.exists
        able[every, view.target] = False
        plays = np.zeros_like(able)
        plays[every[:, None], roles[:, list(description.places)]] = True
        for_, against = (
            np.column_stack([rows, view.target[rows], who])
            for rows, who in (np.nonzero(able & plays), np.nonzero(able & ~plays))
        )
        return _Lesson(
            view.facts("all", self._scope), for_, against, weights[for_[:, 0]], weights[against[:, 0]]
        )

    def _begin(self, view: View, roles: _Rows, weights: Floats) -> None:
        """Begin to learn all descriptions anew."""
        lessons = [self._lesson(description, view, roles, weights) for description in self.descriptions]
        for description, lesson in zip(self.descriptions, lessons, strict=True):
            where, targets, who = lesson.positives.T
            description.witness(_stances_of(view, where, targets, who))
        self._draft, self._taught = Task(_learned, lessons, self.config), float(weights.sum())

    def _adopt(self, found: Sequence[Definition | None], view: View, roles: _Rows, weights: Floats) -> None:
        """Take over descriptions that were learned, and count what they get wrong of the exemplars there are now."""
        self.errors = 0.0
        for description, definition in zip(self.descriptions, found, strict=True):
            description.definition = definition
            if definition is not None:
                self.errors += self._lesson(description, view, roles, weights).errors(definition)
        self.learned, self.seen = self._taught, max(self.seen, float(weights.sum()))
        self.contradictions, self.stale, self._draft = 0.0, False, None
        self._answers.clear()
        self._extensions.clear()

    def _search(self, example: Example, order: Places) -> tuple[Places | None, bool]:
        """Joint search over all kinds for the assignment with the highest score; whether no other is as good."""
        options = [self._options(description, example, order) for description in self.descriptions]
        best: tuple[tuple[float, int], Places] | None = None
        single = True
        for (score, typical), chosen in fillings(self.descriptions, options, frozenset()):
            total = (
                round(score, SAME_DIGITS),
                typical,
            )  # the same scores summed in another order are the same score
            single &= best is None or total != best[0]
            if best is None or total > best[0]:
                best, single = (total, tuple(each for _, each in sorted(chosen))), True
        if best is None:
            return None, True
        return best[1], single and best[0][1] == len(self.kinds)

    def _options(self, description: RoleDescription, example: Example, order: Places) -> list[Option]:
        """The best candidates, best first.

        They are one more than all roles together can take, which is enough to tell whether there is a choice.
        """
        world, able = self._world(example), set(self._of_type(description, example))
        typical = description.typical(stances(example))
        scored = [
            (score, bool(typical[each]), -at, each)
            for at, each in enumerate(order)
            if each in able
            if (score := description.score(world, example.target, each)) is not None
        ]
        return sorted(scored, reverse=True)[: len(self.kinds) + 1]

    def _described(self, example: Example) -> list[set[int]]:
        """Objects of its type for which each description holds; kept per relational state."""
        key = (example.target, example.table.tobytes(), example.unary.tobytes())
        if key not in self._extensions:
            if len(self._extensions) >= ANSWERS:
                self._extensions.clear()
            world = self._world(example)
            self._extensions[key] = [
                {each for each in self._of_type(d, example) if d.holds(world, example.target, each)}
                for d in self.descriptions
            ]
        return self._extensions[key]

    def _world(self, example: Example) -> World:
        v = self.vocabulary
        relations = dict(zip(v.relations, example.table, strict=True)) | dict(
            zip(v.unary, example.unary, strict=True)
        )
        return World(relations, np.ones(example.table.shape[-1], dtype=np.bool_))

    def _of_type(self, description: RoleDescription, example: Example) -> list[int]:
        is_type = example.unary[self.vocabulary.unary.index(description.kind.type)]
        return [each for each in np.flatnonzero(is_type).tolist() if each != example.target]

    def _has_choice(self, example: Example) -> bool:
        """Whether there are more objects of a type than roles, and no description to choose by."""
        for description in self.descriptions:
            if description.definition is None:
                of_type = example.unary[self.vocabulary.unary.index(description.kind.type)].copy()
                of_type[example.target] = False
                if of_type.sum() > len(description.places):
                    return True
        return False


def _stances_of(view: View, where: _Rows, targets: _Rows, who: _Rows) -> Bools:
    """How some objects stood to the targets, in the order of `stances`: shape ``(n, 2 R + U)``."""
    towards, back = view.table[where, :, who, targets], view.table[where, :, targets, who]
    return np.concatenate([towards, back, view.unary[where, :, who]], axis=1)
