"""What rule lists say of scenes, worked out from the rules and the scenes alone.

Nothing of a learner takes part: relations and contacts are measured, conditions tested, functions summed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from relgym.errors import SchemaError
from relgym.laws.book import LawBook
from relgym.laws.touching import Contacts
from relgym.logic.batch import matches
from relgym.logic.clause import Clause
from relgym.logic.facts import Facts
from relgym.logic.situations import situation
from relgym.mixing import mixed
from relgym.reporting.conditions import Condition, Test
from relgym.reporting.functions import Column, Sum, evaluated
from relgym.reporting.motion import MotionRules
from relgym.scene.objects import SceneLayout
from relgym.scene.relations import Extractor, Relations
from relgym.scene.schema import SceneSchema
from relgym.scene.surroundings import Surroundings, surroundings

if TYPE_CHECKING:
    from relgym.reporting.rules import Bound, Experience, PropertyRules, RuleList, RuleRole

__all__ = ["Evaluated", "SceneBatch", "bounds_reached", "branches_of", "evaluate", "holds"]

_Bools = NDArray[np.bool_]
_Floats = NDArray[np.float64]
_PRIMED = re.compile(r"([\w.]+)'")


@dataclass(frozen=True, slots=True)
class Evaluated:
    """What rules say of n scenes.

    Attributes
    ----------
    values
        Next values by (object, property), shape ``(n,)``; NaN where there is no prediction.
    branches
        Number of the branch that decided, likewise; -1 where none did. Laws of motion have none.
    players
        Names of the objects in the roles of the branch, by (object, property) and label, shape ``(n,)`` of body
        numbers; -1 where none plays it.
    following
        Next state vectors, shape ``(n, width)``; what isn't predicted keeps its value.
    """

    values: dict[tuple[str, str], _Floats]
    branches: dict[tuple[str, str], NDArray[np.int64]]
    players: dict[tuple[str, str], dict[str, NDArray[np.int64]]]
    following: _Floats


@lru_cache(maxsize=16)
def _extractor(schema: SceneSchema) -> Extractor:
    return Extractor(schema)


@dataclass
class SceneBatch:
    """n scenes with the same objects, as conditions see them.

    Parameters
    ----------
    schema, layout, vectors
        The scenes, state vectors of shape ``(n, layout.width)``.
    following
        Next values as far as known, of the same shape.
    """

    schema: SceneSchema
    layout: SceneLayout
    vectors: _Floats
    following: _Floats
    _facts: dict[tuple[int, str], Facts] = field(default_factory=dict)
    _seen: dict[int, Surroundings] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.extractor = _extractor(self.schema)
        self.relations: Relations = self.extractor.extract(self.layout, self.vectors)
        self.unary = self.extractor.unary(self.layout)

    def __len__(self) -> int:
        return len(self.vectors)

    def column(self, index: int, name: str) -> _Floats:
        """A property by name as an object sees it, shape ``(n,)``; NaN where there is none, or no single one."""
        source = self.following if name.endswith("'") else self.vectors
        bare = name.rstrip("'")
        if bare in self.layout.types[index].properties:
            return np.asarray(source[:, self.layout.column(index, bare)])
        kind, _, prop = bare.rpartition(".")
        where = self.layout.of_type(kind) if kind else ()
        if len(where) == 1 and prop in self.layout.types[where[0]].properties:
            return np.asarray(source[:, self.layout.column(where[0], prop)])
        return np.full(len(self), np.nan)

    def holds(self, index: int, test: Test, numbers: Mapping[str, _Floats] | None = None) -> _Bools:
        """Whether a test holds for an object, shape ``(n,)``; `numbers` are next values not yet in `following`."""
        rows = np.arange(len(self))
        found: _Bools = (
            self._matches(index, test.clause, test.context, (rows,), numbers or {}) != test.negated
        )
        return found

    def fulfils(self, index: int, condition: Condition, body: int) -> _Bools:
        """Whether a condition of A, an object, and B, a body by number, holds; shape ``(n,)``."""
        rows = np.arange(len(self))
        found = np.ones(len(self), dtype=np.bool_)
        for test in condition:
            found &= self._matches(index, test.clause, test.context, (rows, body), {}) != test.negated
        return found

    def familiar(self, index: int, experience: Experience) -> _Bools:
        """Whether a situation is one that was seen, shape ``(n,)``."""
        embodied = index in self.layout.bodies
        count = len(self.layout.bodies) if embodied else 1
        n = len(self)
        target = np.full(n, self.layout.bodies.index(index) if embodied else 0, dtype=np.int64)
        prints = np.zeros(n, dtype=np.uint64)
        for context, binary, unary in experience.relations:
            table = np.zeros((n, len(binary), count, count), dtype=np.bool_)
            for k, name in enumerate(binary):
                table[:, k] = self._relation(name, count, embodied)
            own = np.zeros((n, len(unary), count), dtype=np.bool_)
            for k, name in enumerate(unary):
                own[:, k] = self._relation(name, count, embodied)
            prints = mixed(prints + situation(table, own, target, self._shown(index, context, count)))
        return np.isin((prints >> np.uint64(40)).astype(np.int64), experience.seen)

    def _matches(
        self,
        index: int,
        clause: Clause,
        context: str,
        rest: tuple[NDArray[np.intp], *tuple[int, ...]],
        numbers: Mapping[str, _Floats],
    ) -> _Bools:
        rows, *bodies = rest
        place = self.layout.bodies.index(index) if index in self.layout.bodies else 0
        tuples = np.column_stack([rows, np.full(len(rows), place), *(np.full(len(rows), b) for b in bodies)])
        return matches(clause, self.facts(index, clause, context, numbers), tuples.astype(np.int64))

    def facts(self, index: int, clause: Clause, context: str, numbers: Mapping[str, _Floats]) -> Facts:
        """What a clause asks for, as far as a context shows it."""
        embodied = index in self.layout.bodies
        count = len(self.layout.bodies) if embodied else 1
        relations: dict[str, _Bools] = {}
        numeric: dict[str, _Floats] = {}
        relative = set()
        for literal in clause.literals:
            name = literal.relation
            if literal.op is None:
                relations[name] = self._relation(name, count, embodied)
            elif literal.args:
                numeric[name] = self._pair(index, name) if embodied else np.full((len(self), 1), np.nan)
                relative.add(name)
            else:
                numeric[name] = evaluated(name, self.reader(index, numbers), np.empty(len(self)))
        return Facts(relations, self._shown(index, context, count), numeric, frozenset(relative))

    def reader(self, index: int, numbers: Mapping[str, _Floats]) -> Column:
        """How functions read properties as an object sees them; `numbers` go before."""

        def read(name: str) -> _Floats:
            return numbers[name] if name in numbers else self.column(index, name)

        return read

    def _relation(self, name: str, count: int, embodied: bool) -> _Bools:
        n = len(self)
        if name in self.unary:
            found = self.unary[name] if embodied else np.zeros(1, dtype=np.bool_)
            return np.broadcast_to(np.asarray(found, dtype=np.bool_), (n, count))
        if name not in self.extractor.names:
            raise SchemaError(
                f"rules speak of {name!r}, a relation that these scenes don't know; there are "
                f"{sorted((*self.extractor.names, *self.unary))}"
            )
        return self.relations.relation(name) if embodied else np.zeros((n, 1, 1), dtype=np.bool_)

    def _shown(self, index: int, context: str, count: int) -> _Bools:
        if context == "all" or index not in self.layout.bodies:
            return np.ones((len(self), count), dtype=np.bool_)
        seen = self._around(index)
        return seen.close if context == "touching" or seen.struck is None else seen.struck

    def _around(self, index: int) -> Surroundings:
        body = self.layout.bodies.index(index)
        if body not in self._seen:
            features = tuple(self.extractor.features)
            self._seen[body] = surroundings(self.relations, body, features, offsets=self.schema.offsets)
        return self._seen[body]

    def _pair(self, index: int, name: str) -> _Floats:
        """A number of A and each other body, shape ``(n, K)``."""
        features = tuple(self.extractor.features)
        body = self.layout.bodies.index(index)
        if name in features:
            return np.asarray(self._around(index).contacts[..., features.index(name)])
        found = np.full((len(self), len(self.layout.bodies)), np.nan)
        prop = name.removeprefix("other-")
        for k, other in enumerate(self.layout.bodies):
            if k != body and prop in self.layout.types[other].properties:
                found[:, k] = self.vectors[:, self.layout.column(other, prop)]
        return found


def evaluate(rules: RuleList, schema: SceneSchema, layout: SceneLayout, vectors: _Floats) -> Evaluated:
    """What follows n scenes with the same objects.

    Parameters
    ----------
    rules
        The rules, as they were learned or as they were read.
    schema, layout, vectors
        The scenes, state vectors of shape ``(n, layout.width)``.

    Raises
    ------
    SchemaError
        The rules speak of relations that these scenes don't know.
    """
    following = np.array(vectors, dtype=np.float64)
    scenes = SceneBatch(schema, layout, np.asarray(vectors, dtype=np.float64), following)
    found = Evaluated({}, {}, {}, following)
    lost: dict[tuple[str, str], _Bools] = {}
    _move(rules, scenes, found, lost)
    for part in rules.properties:
        for index in layout.of_type(part.type):
            values, branch, players = _values(part, scenes, index)
            for pair in _needs(part):
                values[lost.get(pair, np.zeros(len(vectors), dtype=np.bool_))] = np.nan
            if part.doubt:
                values[:] = np.nan
            column = layout.column(index, part.property)
            told = np.isfinite(values)
            following[told, column] = values[told]
            key = (part.type, part.property)
            lost[key] = lost.get(key, np.zeros(len(vectors), dtype=np.bool_)) | ~told
            name = (layout.names[index], part.property)
            found.values[name], found.branches[name], found.players[name] = values, branch, players
    _derive(rules, scenes, found, lost)
    _wrap(layout, found)
    return found


def _move(rules: RuleList, scenes: SceneBatch, found: Evaluated, lost: dict[tuple[str, str], _Bools]) -> None:
    """Laws of motion, in place."""
    if rules.motion is None:
        return
    book = _book(rules.motion, scenes.schema)
    layout = scenes.layout
    cast = book.cast(layout)
    motion = book.motion(Contacts.of(cast, scenes.relations, scenes.vectors), scenes.vectors)
    for kind, names in rules.motion.components:
        for k, prop in enumerate(names):
            lost[kind, prop] = np.zeros(len(scenes), dtype=np.bool_)
            for index in layout.of_type(kind):
                body = layout.bodies.index(index)
                values = np.where(motion.known[:, body], motion.velocity[k, :, body], np.nan)
                told = np.isfinite(values)
                found.following[told, layout.column(index, prop)] = values[told]
                lost[kind, prop] |= ~told
                found.values[layout.names[index], prop] = values


@lru_cache(maxsize=16)
def _book(motion: MotionRules, schema: SceneSchema) -> LawBook:
    return motion.book(schema)


def _derive(
    rules: RuleList, scenes: SceneBatch, found: Evaluated, lost: dict[tuple[str, str], _Bools]
) -> None:
    layout = scenes.layout
    for law in rules.kinematics:
        for index in layout.of_type(law.type):
            source = found.following if law.uses_next else scenes.vectors
            rate = source[:, layout.column(index, law.rate)]
            values = scenes.vectors[:, layout.column(index, law.property)] + law.step * rate
            if law.uses_next and (law.type, law.rate) in lost:
                values = np.where(lost[law.type, law.rate], np.nan, values)
            told = np.isfinite(values)
            found.following[told, layout.column(index, law.property)] = values[told]
            found.values[layout.names[index], law.property] = values


def _wrap(layout: SceneLayout, found: Evaluated) -> None:
    for index, kind in enumerate(layout.types):
        for prop in kind.angles:
            column, key = layout.column(index, prop), (layout.names[index], prop)
            found.following[:, column] -= 2.0 * np.pi * np.round(found.following[:, column] / (2.0 * np.pi))
            if key in found.values:
                values = found.values[key]
                found.values[key] = values - 2.0 * np.pi * np.round(values / (2.0 * np.pi))


def _needs(part: PropertyRules) -> frozenset[tuple[str, str]]:
    """(type, property) pairs whose next values functions or conditions read."""
    texts = [b.function.text() for b in part.branches if b.function is not None]
    texts += [test.text for b in part.branches for case in b.cases for test in case]
    texts += [test.text for bound in part.bounds for test in bound.tests]
    found = set()
    for name in _PRIMED.findall(" ".join(texts)):
        kind, _, prop = name.rpartition(".")
        found.add((kind or part.type, prop))
    return frozenset(found - {(part.type, part.property)})


def branches_of(part: PropertyRules, scenes: SceneBatch, index: int) -> Iterator[tuple[int, _Bools]]:
    """Each branch's number, and in which scenes it is reached and holds, shape ``(n,)``."""
    waiting = np.ones(len(scenes), dtype=np.bool_)
    for number, branch in enumerate(part.branches):
        here = waiting & _some(scenes, index, branch.cases)
        if branch.function is not None and _absent(part, scenes.layout, index, branch.function):
            continue
        yield number, here
        waiting &= ~here


def holds(
    scenes: SceneBatch, index: int, condition: Condition, numbers: Mapping[str, _Floats] | None = None
) -> _Bools:
    """Whether a condition holds for an object, shape ``(n,)``."""
    found = np.ones(len(scenes), dtype=np.bool_)
    for test in condition:
        found &= scenes.holds(index, test, numbers)
    return found


def _some(scenes: SceneBatch, index: int, cases: tuple[Condition, ...]) -> _Bools:
    """Where one of some cases holds; everywhere if there are none."""
    found = np.full(len(scenes), not cases, dtype=np.bool_)
    for case in cases:
        found |= holds(scenes, index, case)
    return found


def _values(
    part: PropertyRules, scenes: SceneBatch, index: int
) -> tuple[_Floats, NDArray[np.int64], dict[str, NDArray[np.int64]]]:
    values, decided = np.full(len(scenes), np.nan), np.full(len(scenes), -1, dtype=np.int64)
    playing: dict[str, NDArray[np.int64]] = {}
    for number, here in branches_of(part, scenes, index):
        decided[here] = number
        function = part.branches[number].function
        if function is None or not here.any():
            continue
        numbers, players = _cast(part, scenes, index, function)
        for label, bodies in players.items():
            playing.setdefault(label, np.full(len(scenes), -1, dtype=np.int64))[here] = bodies[here]
        read = scenes.reader(index, numbers)
        values[here] = function.values(read, values)[here]
    if part.experience is not None:
        values[~scenes.familiar(index, part.experience)] = np.nan
    for bound in part.bounds:
        values = _bounded(part, bound, scenes, index, values)
    return values, decided, playing


def _bounded(part: PropertyRules, bound: Bound, scenes: SceneBatch, index: int, values: _Floats) -> _Floats:
    if bound.kind == "at least":
        return np.where(values < bound.value, bound.value, values)
    if bound.kind == "at most":
        return np.where(values > bound.value, bound.value, values)
    if bound.kind == "change within":
        now = scenes.column(index, part.property)
        return np.asarray(np.clip(values, now + bound.value, now + bound.most))
    reached = holds(scenes, index, bound.tests, {f"{part.property}'": values}) & np.isfinite(values)
    return np.where(reached, bound.value, values)


def bounds_reached(part: PropertyRules, scenes: SceneBatch, index: int, function: Sum) -> tuple[Bound, ...]:
    """Bounds that change what a function says of the only scene there is."""
    numbers, _ = _cast(part, scenes, index, function)
    values = function.values(scenes.reader(index, numbers), np.empty(len(scenes)))
    found = []
    for bound in part.bounds:
        after = _bounded(part, bound, scenes, index, values)
        if after[0] != values[0]:
            found.append(bound)
        values = after
    return tuple(found)


def _absent(part: PropertyRules, layout: SceneLayout, index: int, function: Sum) -> bool:
    """Whether a function reads an object of a type of which there are too few in a layout."""
    wanted: dict[str, int] = {}
    labels = {label: role for role in part.roles for label in role.labels}
    seen = set()
    for name in _owners(function):
        role = labels.get(name)
        if name not in seen:
            wanted[role.type if role else name] = wanted.get(role.type if role else name, 0) + 1
        seen.add(name)
    return any(sum(i != index for i in layout.of_type(kind)) < count for kind, count in wanted.items())


def _owners(function: Sum) -> tuple[str, ...]:
    """Types and labels before a dot, in the order in which they occur."""
    names = [word for _, term in function.terms for word in re.findall(r"([^\W\d]\w*)\.[^\W\d]", term)]
    return tuple(dict.fromkeys(names))


# ------------------------------------------------------------------ roles
def _cast(
    part: PropertyRules, scenes: SceneBatch, index: int, function: Sum
) -> tuple[dict[str, _Floats], dict[str, NDArray[np.int64]]]:
    """Numbers of the objects in a function's roles, and which bodies these are; NaN, -1 where it isn't settled."""
    owners, layout = _owners(function), scenes.layout
    roles = [r for r in part.roles if set(r.labels) & set(owners)]
    numbers: dict[str, _Floats] = {}
    players: dict[str, NDArray[np.int64]] = {}
    for role in [role for role in roles if role.place]:
        others = [i for i in layout.of_type(role.type) if i != index]
        for prop in scenes.schema.type(role.type).properties if role.place <= len(others) else ():
            column = layout.column(others[role.place - 1], prop)
            numbers[f"{role.labels[0]}.{prop}"] = scenes.vectors[:, column]
            numbers[f"{role.labels[0]}.{prop}'"] = scenes.following[:, column]
    roles = [role for role in roles if not role.place]
    if not roles:
        return numbers, players
    levels = [_levels(scenes, index, role) for role in roles]
    patterns, which = np.unique(np.concatenate(levels, axis=1), axis=0, return_inverse=True)
    width = len(layout.bodies)
    filled = [_filled(roles, [p[k * width : (k + 1) * width] for k in range(len(roles))]) for p in patterns]
    labels = [label for role in roles for label in role.labels]
    for place, label in enumerate(labels):
        bodies = np.array([-1 if f is None else f[place] for f in filled], dtype=np.int64)
        players[label] = bodies[which.reshape(-1)]
        kind = next(role.type for role in roles if label in role.labels)
        for prop in scenes.schema.type(kind).properties:
            for mark, source in (("", scenes.vectors), ("'", scenes.following)):
                columns = [
                    layout.column(i, prop) if prop in layout.types[i].properties else 0 for i in layout.bodies
                ]
                at = np.array(columns, dtype=np.intp)[players[label]]
                values = source[np.arange(len(scenes)), at]
                numbers[f"{label}.{prop}{mark}"] = np.where(players[label] >= 0, values, np.nan)
    return numbers, players


def _levels(scenes: SceneBatch, index: int, role: RuleRole) -> NDArray[np.int64]:
    """Number of the first alternative that each body fulfils, shape ``(n, K)``; -1 for none."""
    layout = scenes.layout
    found = np.full((len(scenes), len(layout.bodies)), -1, dtype=np.int64)
    able = [k for k, i in enumerate(layout.bodies) if i in layout.of_type(role.type) and i != index]
    for k in able:
        if not role.alternatives:
            found[:, k] = 0
        for level, condition in reversed(list(enumerate(role.alternatives))):
            found[scenes.fulfils(index, condition, k), k] = level
    return found


def _filled(roles: Sequence[RuleRole], levels: Sequence[NDArray[np.int64]]) -> tuple[int, ...] | None:
    """Body of every label, all of them together the best there are; None if there is none, or more than one way."""
    ways = sorted(_fillings(roles, levels, frozenset()))
    if not ways or (len(ways) > 1 and ways[0][0] == ways[1][0]):
        return None
    return ways[0][1]


def _fillings(
    roles: Sequence[RuleRole], levels: Sequence[NDArray[np.int64]], taken: frozenset[int]
) -> Iterator[tuple[int, tuple[int, ...]]]:
    if not roles:
        yield 0, ()
        return
    free = [k for k in np.flatnonzero(levels[0] >= 0).tolist() if k not in taken]
    for chosen in combinations(free, len(roles[0].labels)):
        cost = int(sum(levels[0][k] for k in chosen))
        for more, others in _fillings(roles[1:], levels[1:], taken | set(chosen)):
            yield cost + more, (*chosen, *others)
