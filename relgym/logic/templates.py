"""The ways in which a literal's arguments can be filled."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Final

from relgym.logic.clause import ANY, Literal
from relgym.logic.facts import Facts

__all__ = ["FIRST", "NEW", "Template", "templates"]

NEW: Final = ANY
"""Pattern code of a new variable; the same argument of the negated literal is universal."""

FIRST: Final = NEW - 1
"""Pattern code of the first existential variable; the second is one less, and so on."""


@dataclass(frozen=True, order=True)
class Template:
    """A relation or function and a pattern for its arguments.

    `slots` holds, per argument, the number of a target variable, `NEW`, or a code below `NEW` for an
    existential variable that is yet to be chosen.
    """

    name: str
    slots: tuple[int, ...]

    @cached_property
    def existentials(self) -> int:
        """How many existing existential variables the pattern takes."""
        return sum(code < NEW for code in self.slots)

    @cached_property
    def fresh(self) -> int:
        """How many new variables the pattern introduces."""
        return sum(code == NEW for code in self.slots)

    def literal(
        self,
        variables: Sequence[int],
        fresh: int,
        negated: bool,
        op: str | None = None,
        threshold: float = 0.0,
    ) -> Literal:
        """Return the literal for chosen existential variables and the number of the first new one."""
        args, unused = [], itertools.count(fresh)
        for code in self.slots:
            if code == NEW:
                args.append(ANY if negated else next(unused))
            else:
                args.append(code if code >= 0 else variables[FIRST - code])
        return Literal(self.name, tuple(args), negated, op, threshold)


def templates(facts: Facts, names: Sequence[str], arity: int, max_new: int) -> Iterator[Template]:
    """Yield all templates of some relations or functions.

    Parameters
    ----------
    facts
        Knows their arities.
    names
        Their names; the templates come in this order.
    arity
        Number of the target's arguments.
    max_new
        Most new variables in one literal.
    """
    for name in names:
        relative = name in facts.relative
        stored = facts.arity(name) - relative
        for slots in _patterns(stored, 1 if relative else 0, arity, max_new):
            # a literal joins the clause by at least one argument; only r(B) alone may float
            if relative or stored <= 1 or any(code != NEW for code in slots):
                yield Template(name, (0, *slots) if relative else slots)


@cache
def _patterns(stored: int, first: int, arity: int, max_new: int) -> tuple[tuple[int, ...], ...]:
    """All ways to fill `stored` arguments without repeating one of the target variables from `first` on."""
    found = []
    for slots in itertools.product([*range(first, arity), FIRST, NEW], repeat=stored):
        chosen = [code for code in slots if code >= 0]
        if len(set(chosen)) == len(chosen) and slots.count(NEW) <= max_new:
            numbers = itertools.count()
            found.append(tuple(FIRST - next(numbers) if code == FIRST else code for code in slots))
    return tuple(found)
