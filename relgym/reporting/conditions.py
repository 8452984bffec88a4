"""Conditions as text, and back: ``some close B [normal-y(A, B) > 0.5 and approaching(A, B)]``.

A is the object whose property is predicted. What a variable ranges over is part of the condition: ``struck`` objects
are what A approaches fastest of all that it touches, ``close`` ones all that touch it, or else the nearest one; without
either word every object counts. A itself belongs to all three.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from relgym.errors import ConfigError
from relgym.logic.clause import ANY, Clause, Literal
from relgym.reporting.functions import Sum, parse_sum, split_outside, whole_of

__all__ = [
    "CONTEXTS",
    "Condition",
    "Test",
    "as_tests",
    "condition_text",
    "equal_to",
    "parse_condition",
    "parts_of",
]

CONTEXTS: Final = {"approached": "struck", "touching": "close", "all": ""}
"""Words for the objects that a variable ranges over."""

FLAG: Final = "?"
"""Marks the name of a number that is 1 or 0 as something holds or not; it is told as a relation is."""

_BY_WORD: Final = {word: context for context, word in CONTEXTS.items()}
_FLIPPED: Final = {"<=": ">", ">": "<="}
_VARIABLE = r"(?:[A-Z]|V\d+)"
_RELATION = re.compile(rf"(?P<name>[^\s()\[\]]+)\((?P<args>{_VARIABLE}(?:, {_VARIABLE})*)\)")
_QUANTIFIER = re.compile(
    rf"(?P<sign>some|no) (?:(?P<word>struck|close) )?(?P<names>{_VARIABLE}(?:, {_VARIABLE})*) \[(?P<body>.*)\]"
)
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_EQUAL = re.compile(rf"\|(?P<name>.+) (?P<sign>[-+]) (?P<value>{_NUMBER})\|")


@dataclass(frozen=True)
class Test:
    """One test: that a clause holds, or that it doesn't.

    Attributes
    ----------
    clause
        A conjunction about A (variable 0) and objects that there are. Numbers without arguments are sums of properties
        (`relgym.reporting.functions`).
    context
        What its variables range over, see `CONTEXTS`.
    negated
        Whether it must not hold.
    """

    __test__ = False  # pytest: not a test case

    clause: Clause
    context: str = "all"
    negated: bool = False

    @cached_property
    def text(self) -> str:
        """The test as text; `parse_condition` reads it back."""
        return _test_text(self)

    @property
    def opposite(self) -> Test:
        """The test that holds where this one doesn't, and nowhere else."""
        return as_tests(self.clause, self.context, negated=not self.negated)[0]

    def __str__(self) -> str:
        return self.text


Condition = tuple[Test, ...]
"""A conjunction; an empty one holds always."""


def as_tests(clause: Clause, context: str, *, negated: bool = False) -> Condition:
    """A clause, or its negation, as tests in normal form.

    A clause whose parts share no variable becomes several tests. What says that nothing is so becomes ``no B [...]``.
    """
    parts = [clause] if negated else list(parts_of(clause))
    return tuple(_normal(part, context, negated=negated) for part in parts)


def parts_of(clause: Clause) -> Iterator[Clause]:
    """Conjuncts that share no existential variable."""
    groups: list[tuple[set[int], list[Literal]]] = []
    for literal in clause.literals:
        mine = {v for v in literal.variables if v >= clause.arity}
        joined = [g for g in groups if g[0] & mine]
        rest = [g for g in groups if not g[0] & mine]
        members = [each for g in joined for each in g[1]] + [literal]
        groups = [*rest, (mine.union(*(g[0] for g in joined)), members)]
    for _, members in groups:
        yield Clause.of(members, clause.arity)


def _normal(clause: Clause, context: str, *, negated: bool) -> Test:
    if len(clause) == 1 and clause.variables == clause.arity:
        literal = clause.literals[0]
        if literal.negated and ANY in literal.args:  # nothing is so: no B [...]
            fresh = iter(range(clause.arity, clause.arity + len(literal.args)))
            args = tuple(next(fresh) if arg == ANY else arg for arg in literal.args)
            positive = Literal(literal.relation, args, False, literal.op, literal.threshold)
            return Test(Clause((positive,), clause.arity), context, not negated)
        if literal.negated:
            positive = Literal(literal.relation, literal.args, False, literal.op, literal.threshold)
            return Test(Clause((positive,), clause.arity), "all", not negated)
        if negated and literal.op is not None and not literal.args and not _EQUAL.fullmatch(literal.relation):
            other = Literal(literal.relation, (), False, _FLIPPED[literal.op], literal.threshold)
            return Test(Clause((other,), clause.arity), "all")
        return Test(clause, "all", negated)
    alone = all(ANY not in each.args for each in clause.literals) and clause.variables == clause.arity
    return Test(clause, "all" if alone else context, negated)


# ------------------------------------------------------------------ as text
def condition_text(condition: Iterable[Test]) -> str:
    """A conjunction as text; empty for none."""
    return " and ".join(test.text for test in condition)


def _test_text(test: Test) -> str:
    clause, word = test.clause, CONTEXTS[test.context]
    fresh = clause.variables - clause.arity
    body = " and ".join(_literal_text(each, clause.variables, word) for each in clause.literals)
    if fresh:
        names = ", ".join(_name(v) for v in range(clause.arity, clause.variables))
        return f"{'no' if test.negated else 'some'} {f'{word} ' if word else ''}{names} [{body}]"
    if not test.negated:
        return body if len(clause) == 1 else f"[{body}]"
    if len(clause) > 1:
        return f"not [{body}]"
    literal = clause.literals[0]
    if literal.op is not None and _EQUAL.fullmatch(literal.relation) and literal.threshold == 0.0:
        return body.replace(" = ", " != ")
    return f"not {body}"


def _literal_text(literal: Literal, variables: int, word: str) -> str:
    if ANY in literal.args:
        fresh = iter(range(variables, variables + len(literal.args)))
        args = tuple(next(fresh) if arg == ANY else arg for arg in literal.args)
        names = ", ".join(_name(arg) for arg in args if arg >= variables)
        inner = Literal(literal.relation, args, False, literal.op, literal.threshold)
        return f"no {f'{word} ' if word else ''}{names} [{_plain(inner)}]"
    positive = Literal(literal.relation, literal.args, False, literal.op, literal.threshold)
    return f"not {_plain(positive)}" if literal.negated else _plain(positive)


def _plain(literal: Literal) -> str:
    name = literal.relation
    if literal.args:
        name = f"{name}({', '.join(map(_name, literal.args))})"
    if literal.op is None:
        return name
    if name.endswith(FLAG):
        return name.removesuffix(FLAG) if literal.op == ">" else f"not {name.removesuffix(FLAG)}"
    equal = _EQUAL.fullmatch(name)
    if equal and literal.op == "<=":
        sign = "-" if equal["sign"] == "+" else ""
        slack = f" within {number_text(literal.threshold)}" if literal.threshold else ""
        return f"{equal['name']} = {sign}{number_text(float(equal['value']))}{slack}"
    if name.startswith("-") and not literal.args:  # told from the other side
        return f"{_turned(name)} {'>=' if literal.op == '<=' else '<'} {number_text(0.0 - literal.threshold)}"
    return f"{name} {literal.op} {number_text(literal.threshold)}"


def _turned(text: str) -> str:
    """The negative of a sum."""
    found = parse_sum(text)
    return Sum(tuple((-weight, name) for weight, name in found.terms), -found.constant).text(9)


def equal_to(name: str, value: float, slack: float = 0.0) -> Literal:
    """The literal that a number is another one, within some slack."""
    apart = f"{'-' if value >= 0.0 else '+'} {number_text(abs(value))}"
    return Literal(f"|{name} {apart}|", (), False, "<=", slack)


def number_text(value: float, digits: int = 6) -> str:
    """A threshold, with as few digits as say the same number, at least `digits`."""
    text = f"{value:.{digits}g}"
    return text if float(text) == value else repr(value)


def _name(variable: int) -> str:
    return chr(ord("A") + variable) if variable < 26 else f"V{variable}"


# ------------------------------------------------------------------ from text
def parse_condition(text: str, arity: int = 1) -> Condition:
    """Read what `condition_text` wrote.

    Raises
    ------
    ConfigError
        The text says nothing in this language.
    """
    return tuple(_parse_test(part, arity) for part in split_outside(text, " and "))


def _parse_test(text: str, arity: int) -> Test:
    match = _QUANTIFIER.fullmatch(text)
    if match:
        context = _BY_WORD[match["word"] or ""]
        names = match["names"].split(", ")
        literals = _literals(match["body"], context, text)
        clause = Clause(tuple(literals), arity)
        if clause.variables != arity + len(names):
            raise ConfigError(
                f"condition {text!r}: expected {', '.join(names)} and no others to be used in it"
            )
        return Test(clause, context, match["sign"] == "no")
    negated = text.startswith("not ")
    bare = text.removeprefix("not ")
    if bare.startswith("[") and bare.endswith("]"):
        words = {m["word"] or "" for m in map(_QUANTIFIER.fullmatch, split_outside(bare[1:-1], " and ")) if m}
        context = _BY_WORD[words.pop()] if len(words) == 1 else "all"
        return Test(_closed(_literals(bare[1:-1], context, text), arity, text), context, negated)
    if " != " in bare:
        name, value = bare.rsplit(" != ", 1)
        return Test(Clause((equal_to(name, _number(value, text)),), arity), "all", True)
    return as_tests(_closed([_parse_literal(bare, text)], arity, text), "all", negated=negated)[0]


def _closed(literals: Iterable[Literal], arity: int, whole: str) -> Clause:
    """A clause of nothing but the objects that are given."""
    clause = Clause(tuple(literals), arity)
    if clause.variables > arity:
        raise ConfigError(f"condition {whole!r}: it speaks of an object that no 'some' or 'no' introduces")
    return clause


def _literals(body: str, context: str, whole: str) -> list[Literal]:
    found = []
    for part in split_outside(body, " and "):
        inner = _QUANTIFIER.fullmatch(part)
        if inner is None:
            literal, negated = _parse_literal(part.removeprefix("not "), whole), part.startswith("not ")
            if negated and literal.relation.endswith(FLAG):
                literal, negated = Literal(literal.relation, (), False, "<=", literal.threshold), False
            found.append(Literal(literal.relation, literal.args, negated, literal.op, literal.threshold))
            continue
        if inner["sign"] != "no" or _BY_WORD[inner["word"] or ""] != context:
            raise ConfigError(f"condition {whole!r}: expected 'no', of the same objects, within brackets")
        literal, loose = _parse_literal(inner["body"], whole), inner["names"].split(", ")
        args = tuple(ANY if _name(arg) in loose else arg for arg in literal.args)
        found.append(Literal(literal.relation, args, True, literal.op, literal.threshold))
    return found


def _parse_literal(text: str, whole: str) -> Literal:
    for mark, op in ((" >= ", "<="), (" < ", ">")):
        if mark in text:
            name, value = text.rsplit(mark, 1)
            return Literal(_turned(name), (), False, op, 0.0 - _number(value, whole))
    for op in (" <= ", " > "):
        if op in text:
            name, value = text.rsplit(op, 1)
            relation, args = _called(name)
            return Literal(relation, args, False, op.strip(), _number(value, whole))
    if " = " in text:
        name, value = text.rsplit(" = ", 1)
        value, _, slack = value.partition(" within ")
        return equal_to(name, _number(value, whole), _number(slack or "0", whole))
    relation, args = _called(text)
    if args:
        return Literal(relation, args)
    if not re.fullmatch(r"[^\s()\[\]]+", text):
        raise ConfigError(f"condition {whole!r}: expected a relation such as touching(A, B), got {text!r}")
    return Literal(f"{text}{FLAG}", (), False, ">", 0.5)


def _called(text: str) -> tuple[str, tuple[int, ...]]:
    match = _RELATION.fullmatch(text)
    if match is None:
        return text, ()
    names = match["args"].split(", ")
    return match["name"], tuple(whole_of(n[1:]) if len(n) > 1 else ord(n) - ord("A") for n in names)


def _number(text: str, whole: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ConfigError(f"condition {whole!r}: expected a number, got {text!r}") from None


def joined(conditions: Sequence[Condition]) -> Condition:
    """Conjunction of several, no test twice."""
    return tuple(dict.fromkeys(test for condition in conditions for test in condition))
