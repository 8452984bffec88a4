"""The ways in which a literal's arguments can be filled."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

from relgym.logic.clause import ANY, Literal, Slot
from relgym.logic.facts import Facts

__all__ = ["Template", "templates"]


@dataclass(frozen=True, order=True)
class Template:
    """A relation or function and a pattern for its arguments.

    `slots` holds, per argument, the number of a target variable, `Slot.NEW`, or `Slot.OLD` and below for an
    existential variable that is yet to be chosen.
    """

    name: str
    slots: tuple[int, ...]

    @cached_property
    def existentials(self) -> int:
        """How many existing existential variables the pattern takes."""
        return sum(code < Slot.NEW for code in self.slots)

    @cached_property
    def fresh(self) -> int:
        """How many new variables the pattern introduces."""
        return sum(code == Slot.NEW for code in self.slots)

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
            if code == Slot.NEW:
                args.append(ANY if negated else next(unused))
            else:
                args.append(code if code >= 0 else variables[Slot.OLD - code])
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
            if relative or stored <= 1 or any(code != Slot.NEW for code in slots):
                yield Template(name, (0, *slots) if relative else slots)


@cache
def _patterns(stored: int, first: int, arity: int, max_new: int) -> tuple[tuple[int, ...], ...]:
    """All ways to fill `stored` arguments without repeating one of the target variables from `first` on."""
    found = []
    for slots in itertools.product([*range(first, arity), Slot.OLD, Slot.NEW], repeat=stored):
        chosen = [code for code in slots if code >= 0]
        if len(set(chosen)) == len(chosen) and slots.count(Slot.NEW) <= max_new:
            numbers = itertools.count()
            found.append(tuple(Slot.OLD - next(numbers) if code == Slot.OLD else code for code in slots))
    return tuple(found)
