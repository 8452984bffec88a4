"""Literals, clauses and definitions: the language that FOIL writes its rules in (thesis §3.4.1, §4.3.2).

Variables are small integers. Numbers below a clause's `arity` are the arguments of the target relation,
printed ``A``, ``B``, …; all later ones are existential: *there is* an object that makes the clause true.
`ANY`, printed ``*``, stands inside negated literals only and is universal: ``¬intersect(A, *)`` holds if A
intersects nothing.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from string import ascii_uppercase
from typing import Any, Final

from relgym.arguments import refusing_calls
from relgym.config.constants import SAME_DIGITS
from relgym.errors import ConfigError

__all__ = ["ANY", "Clause", "Coverage", "Definition", "Literal", "Slot"]


class Slot(enum.IntEnum):
    """What may stand in an argument's place where no variable's number does, in literals and their patterns.

    Attributes
    ----------
    ANY
        Universal, in a negated literal; in a pattern (`NEW`) a new variable, that is universal if it is negated.
    OLD
        In a pattern: the first existential variable that the clause has; the second is one less, and so on.
    """

    ANY = -1
    NEW = ANY
    OLD = -2


ANY: Final = Slot.ANY
"""The universally quantified argument of a negated literal, printed ``*``."""

_OPERATORS = (None, "<=", ">")


def _variable_name(variable: int) -> str:
    if variable == ANY:
        return "*"
    return ascii_uppercase[variable] if variable < len(ascii_uppercase) else f"V{variable}"


def _require(plain: Mapping[str, Any], *names: str) -> None:
    missing = [name for name in names if name not in plain]
    if missing:
        raise ConfigError(f"expected what to_dict gives, with {list(names)}; {missing} are missing")


@refusing_calls(ConfigError)
@dataclass(frozen=True, slots=True)
class Literal:
    """One test: a relation or its negation, or a numeric function compared with a threshold.

    Parameters
    ----------
    relation
        Name of the relation or, if `op` is given, of the numeric function.
    args
        Variable numbers, without repeats; `ANY` only if the literal is negated.
    negated
        Whether the test is that *no* assignment of objects to the `ANY` arguments makes the rest true.
    op
        ``"<="`` or ``">"`` for numeric literals, otherwise ``None``. An undefined value satisfies neither.
    threshold
        What the function's value is compared with; 0 and without meaning for relations.

    Raises
    ------
    ConfigError
        If a variable is repeated, `ANY` stands in a literal that isn't negated, the operator is unknown or
        the threshold isn't finite.
    """

    relation: str
    args: tuple[int, ...] = ()
    negated: bool = False
    op: str | None = None
    threshold: float = 0.0

    def __post_init__(self) -> None:
        if self.op not in _OPERATORS:
            raise ConfigError(f"{self.relation}: expected the operator '<=', '>' or None, got {self.op!r}.")
        if not math.isfinite(self.threshold):
            raise ConfigError(f"{self.relation}: expected a finite threshold, got {self.threshold}.")
        if min(self.args, default=0) < ANY or len(set(self.variables)) < len(self.variables):
            raise ConfigError(f"{self.relation}: expected distinct variables >= 0 or ANY, got {self.args}.")
        if ANY in self.args and not self.negated:
            raise ConfigError(f"{self.relation}{self.args}: ANY is universal; use it in a negated literal.")

    @property
    def variables(self) -> tuple[int, ...]:
        """The arguments that are variables, that is, all but `ANY`."""
        return tuple([arg for arg in self.args if arg != ANY])

    def rename(self, names: Mapping[int, int]) -> Literal:
        """Return the literal with every variable replaced by its entry in `names`."""
        if missing := set(self.variables) - set(names):
            raise ConfigError(
                f"names: expected an entry for each variable of {self}, {sorted(missing)} have none"
            )
        args = tuple(ANY if arg == ANY else names[arg] for arg in self.args)
        return Literal(self.relation, args, self.negated, self.op, self.threshold)

    def __str__(self) -> str:
        args = f"({', '.join(_variable_name(arg) for arg in self.args)})" if self.args else ""
        text = f"{self.relation}{args}"
        if self.op is not None:
            text = f"{text} {self.op} {self.threshold:.6g}"
            return f"¬({text})" if self.negated else text
        return f"¬{text}" if self.negated else text

    def to_dict(self) -> dict[str, Any]:
        """Return a plain dictionary that JSON can hold; fields at their defaults are left out."""
        plain: dict[str, Any] = {"relation": self.relation, "args": list(self.args)}
        if self.negated:
            plain["negated"] = True
        if self.op is not None:
            plain |= {"op": self.op, "threshold": self.threshold}
        return plain

    @staticmethod
    def from_dict(plain: Mapping[str, Any]) -> Literal:
        """Inverse of `to_dict`."""
        _require(plain, "relation", "args")
        negated, threshold = plain.get("negated", False), float(plain.get("threshold", 0.0))
        return Literal(plain["relation"], tuple(plain["args"]), negated, plain.get("op"), threshold)


@refusing_calls(ConfigError)
@dataclass(frozen=True)
class Clause:
    """A conjunction of literals with shared variables: the body of a Horn clause (§3.4.1).

    Parameters
    ----------
    literals
        The conjuncts. None at all: the clause is always true.
    arity
        Number of arguments of the target; these variables are bound before the clause is tested.

    Raises
    ------
    ConfigError
        If an existential variable occurs in negated literals only, where it would mean "some object doesn't";
        `Clause.of` turns such variables into ``*``.
    """

    literals: tuple[Literal, ...]
    arity: int = 1

    def __post_init__(self) -> None:
        loose = _loose_variables(self.literals, self.arity)
        if loose:
            names = ", ".join(_variable_name(variable) for variable in sorted(loose))
            raise ConfigError(
                f"{self}: {names} occurs in negated literals only; use Clause.of, which writes *."
            )

    @staticmethod
    def of(literals: Iterable[Literal], arity: int = 1) -> Clause:
        """Build a clause in normal form.

        Variables that are left in negated literals only become `ANY`, the other existential ones are numbered
        in the order of their first appearance, and repeated literals are dropped.
        """
        literals = tuple(literals)
        names: dict[int, int] = {variable: variable for variable in _variables(literals) if variable < arity}
        names |= dict.fromkeys(_loose_variables(literals, arity), ANY)
        fresh = arity
        for variable in _variables(literals):
            if variable not in names:
                names[variable] = fresh
                fresh += 1
        return Clause(tuple(dict.fromkeys(literal.rename(names) for literal in literals)), arity)

    @cached_property
    def variables(self) -> int:
        """Number of variables, the target's arguments included."""
        return max(self.arity, max(_variables(self.literals), default=-1) + 1)

    def without(self, index: int) -> Clause:
        """Return the clause in normal form without its literal number `index`."""
        return Clause.of(self.literals[:index] + self.literals[index + 1 :], self.arity)

    def replace(self, index: int, literal: Literal) -> Clause:
        """Return the clause with its literal number `index` replaced."""
        return Clause((*self.literals[:index], literal, *self.literals[index + 1 :]), self.arity)

    def connected(self) -> Clause:
        """Return the clause ordered for reading: a literal comes after one that shares a variable with it."""
        waiting, ordered = list(self.literals), list[Literal]()
        bound = set(range(self.arity))
        while waiting:
            safe = [each for each in waiting if not each.negated or bound >= set(each.variables)]
            joined = [each for each in safe if not each.variables or bound & set(each.variables)]
            ordered.append((joined or safe)[0])
            bound |= set(ordered[-1].variables)
            waiting.remove(ordered[-1])
        return Clause.of(ordered, self.arity)

    def __iter__(self) -> Iterator[Literal]:
        return iter(self.literals)

    def __len__(self) -> int:
        return len(self.literals)

    def __str__(self) -> str:
        return " ∧ ".join(str(literal) for literal in self.literals) or "true"

    def to_dict(self) -> dict[str, Any]:
        """Return a plain dictionary that JSON can hold."""
        return {"arity": self.arity, "literals": [literal.to_dict() for literal in self.literals]}

    @staticmethod
    def from_dict(plain: Mapping[str, Any]) -> Clause:
        """Inverse of `to_dict`."""
        _require(plain, "literals", "arity")
        return Clause(tuple(Literal.from_dict(literal) for literal in plain["literals"]), plain["arity"])


def _variables(literals: Iterable[Literal]) -> list[int]:
    return list(dict.fromkeys(variable for literal in literals for variable in literal.variables))


def _loose_variables(literals: Iterable[Literal], arity: int) -> set[int]:
    """Existential variables that no literal binds, because all that they occur in are negated."""
    bound = {variable for literal in literals if not literal.negated for variable in literal.variables}
    return {variable for variable in _variables(literals) if variable >= arity and variable not in bound}


@dataclass(frozen=True, slots=True)
class Coverage:
    """How many training tuples, by weight, something covers (the counts of tables 3.2 and 4.3)."""

    positives: float = 0.0
    negatives: float = 0.0

    @property
    def total(self) -> float:
        """Positives and negatives together."""
        return self.positives + self.negatives

    @property
    def precision(self) -> float:
        """Share of positives; 0 if nothing is covered."""
        return self.positives / self.total if self.total > 0 else 0.0


@refusing_calls(ConfigError)
@dataclass(frozen=True)
class Definition:
    """A disjunction of clauses that describes one class of tuples (§3.4.1), and how well it did in training.

    Parameters
    ----------
    clauses
        The disjuncts in the order in which they are tried; none at all: always false.
    arity
        Number of arguments of the target relation.
    negated
        Whether the clauses describe the *negative* tuples (§3.4.5, "Negated" in table 4.3). The definition
        then holds where no clause matches.
    coverage
        Per clause, the tuples that it decides: those it matches and no earlier clause does. Positives and
        negatives are those of the clauses: if the definition is negated, the problem's negatives count as
        positives.
    uncovered
        The tuples that no clause matches, the row "Negative" in table 3.2.
    bits
        Description length of the clauses and of their exceptions.
    work
        Work spent in learning, in tuples x candidate literals; not compared and not stored.
    """

    clauses: tuple[Clause, ...]
    arity: int = 1
    negated: bool = False
    coverage: tuple[Coverage, ...] = ()
    uncovered: Coverage = field(default_factory=Coverage)
    bits: float = 0.0
    work: int = field(default=0, compare=False)

    def __post_init__(self) -> None:
        if self.coverage and len(self.coverage) != len(self.clauses):
            message = f"Expected one count per clause ({len(self.clauses)}), got {len(self.coverage)}."
            raise ConfigError(message)
        if any(clause.arity != self.arity for clause in self.clauses):
            raise ConfigError(
                f"Expected clauses of arity {self.arity}, got {[c.arity for c in self.clauses]}."
            )

    @property
    def rank(self) -> tuple[float, float]:
        """What definitions of one class are compared by, the better one first: errors, then bits."""
        return round(self.errors, SAME_DIGITS), round(self.bits, SAME_DIGITS)

    @property
    def errors(self) -> float:
        """Weight of the training tuples that the definition gets wrong."""
        return sum(count.negatives for count in self.coverage) + self.uncovered.positives

    @property
    def size(self) -> int:
        """Number of literals."""
        return sum(map(len, self.clauses))

    @property
    def performance(self) -> float:
        """Share of the training tuples that the definition gets right, "train perf." in table 3.2."""
        total = sum(count.total for count in self.coverage) + self.uncovered.total
        return 1.0 - self.errors / total if total > 0 else 1.0

    def __len__(self) -> int:
        return len(self.clauses)

    def __str__(self) -> str:
        body = (
            " ∨ ".join(f"({clause})" if len(clause) > 1 else str(clause) for clause in self.clauses)
            or "false"
        )
        return f"¬[{body}]" if self.negated else body

    def to_dict(self) -> dict[str, Any]:
        """Return a plain dictionary that JSON can hold; `from_dict` restores everything but `work`."""
        return {
            "arity": self.arity,
            "negated": self.negated,
            "clauses": [clause.to_dict()["literals"] for clause in self.clauses],
            "coverage": [[count.positives, count.negatives] for count in self.coverage],
            "uncovered": [self.uncovered.positives, self.uncovered.negatives],
            "bits": self.bits,
        }

    @staticmethod
    def from_dict(plain: Mapping[str, Any]) -> Definition:
        """Inverse of `to_dict`."""
        _require(plain, "arity", "clauses", "coverage", "uncovered", "negated", "bits")
        arity = plain["arity"]
        clauses = tuple(Clause.from_dict({"arity": arity, "literals": body}) for body in plain["clauses"])
        coverage = tuple(Coverage(float(good), float(bad)) for good, bad in plain["coverage"])
        good, bad = plain["uncovered"]
        uncovered = Coverage(float(good), float(bad))
        return Definition(clauses, arity, plain["negated"], coverage, uncovered, float(plain["bits"]))
