"""Mode functions over roles, and which objects play them in an example (§3.2.3, §3.2.4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.mode import Mode, Role
from relgym.scene.objects import Target
from relgym.thesis.examples import Arrangement
from relgym.thesis.regression import Line

__all__ = ["Casting", "Cluster", "castings", "roles_of"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Casting:
    """A mode's function with its roles played by certain objects of an arrangement.

    Attributes
    ----------
    objects
        Who plays each role, the target first.
    columns, weights
        Of the state vector.
    intercept
        As of the mode.
    """

    objects: tuple[int, ...]
    columns: tuple[int, ...]
    weights: tuple[float, ...]
    intercept: float

    def value(self, x: Sequence[float]) -> float:
        """The function of one state vector."""
        total = self.intercept
        for column, weight in zip(self.columns, self.weights, strict=True):
            total += weight * x[column]
        return total

    def values(self, x: Floats) -> Floats:
        """The function of state vectors, shape ``(n, width)``; the same bits as `value`."""
        total = np.full(len(x), self.intercept)
        for column, weight in zip(self.columns, self.weights, strict=True):
            total = total + weight * x[:, column]
        return total


@dataclass
class Cluster:
    """A mode while it is learned.

    Attributes
    ----------
    number
        Its id; it is never given again.
    roles
        The target's first, then those of other objects (`relgym.clustering.mode.Role`).
    intercept
        Constant term.
    """

    number: int
    roles: tuple[Role, ...]
    intercept: float
    _known: dict[tuple[tuple[str, ...], int], tuple[Casting, ...]] = field(default_factory=dict, repr=False)

    @property
    def weights(self) -> int:
        """How many weights it has."""
        return sum(len(role.terms) for role in self.roles)

    @property
    def parameters(self) -> int:
        """How many weights it has, and a constant that isn't 0."""
        return self.weights + (self.intercept != 0.0)

    def become(self, roles: tuple[Role, ...], intercept: float) -> bool:
        """Take over another function; whether it is another one."""
        if (roles, intercept) == (self.roles, self.intercept):
            return False
        self.roles, self.intercept = roles, intercept
        self._known.clear()
        return True

    def castings(self, arrangement: Arrangement) -> tuple[Casting, ...]:
        """All ways to fill its roles; none if there are too few objects of a type."""
        known = self._known.get(arrangement.key)
        if known is None:
            known = self._known[arrangement.key] = tuple(castings(self.roles, self.intercept, arrangement))
        return known

    def errors(self, arrangement: Arrangement, x: Floats, y: Floats) -> Floats:
        """Least error over all castings of each example; infinite if there is none."""
        least = np.full(len(x), np.inf)
        for casting in self.castings(arrangement):
            least = np.minimum(least, np.abs(casting.values(x) - y))
        return least

    def error(self, arrangement: Arrangement, x: Sequence[float], y: float) -> float:
        """Of one example; the same bits as `errors`."""
        return min((abs(c.value(x) - y) for c in self.castings(arrangement)), default=float("inf"))

    def cast(self, arrangement: Arrangement, x: Floats, y: Floats) -> NDArray[np.intp]:
        """Number of the casting with the least error of each example."""
        errors = [np.abs(casting.values(x) - y) for casting in self.castings(arrangement)]
        chosen: NDArray[np.intp] = np.argmin(np.stack(errors), axis=0)
        return chosen

    def mode(self, target: Target, examples: int) -> Mode:
        """The mode as a record."""
        own, *others = self.roles
        return Mode(self.number, target, (own, *sorted(others)), self.intercept, examples=examples)


def castings(roles: Sequence[Role], intercept: float, arrangement: Arrangement) -> Iterator[Casting]:
    """All assignments of different objects to the roles; the target's is played by the target."""
    layout = arrangement.layout
    offers: list[tuple[int, ...]] = [(arrangement.target,)]
    for role in roles[1:]:
        offers.append(tuple(i for i in layout.of_type(role.type) if i != arrangement.target))
    for objects in product(*offers):
        if len(set(objects)) == len(objects):
            columns = [
                layout.column(i, prop)
                for i, role in zip(objects, roles, strict=True)
                for prop, _ in role.terms
            ]
            weights = [weight for role in roles for _, weight in role.terms]
            yield Casting(objects, tuple(columns), tuple(weights), intercept)


def roles_of(line: Line, arrangement: Arrangement, columns: Sequence[int] | None = None) -> tuple[Role, ...]:
    """Cut a line into one role for each object with a weight (Figure 3.3).

    Parameters
    ----------
    line, arrangement
        What was learned, of which state vectors.
    columns
        Which column of the state vector each of the line's stands for; default: they are the same.
    """
    terms: dict[int, list[tuple[str, float]]] = {arrangement.target: []}
    for column, weight in zip(line.columns, line.weights, strict=True):
        index, number = arrangement.place(column if columns is None else columns[column])
        prop = arrangement.layout.types[index].properties[number]
        terms.setdefault(index, []).append((prop, weight))
    own = terms.pop(arrangement.target)
    types = arrangement.layout.types
    others = sorted(Role(types[i].name, tuple(sorted(found))) for i, found in terms.items())
    return (Role(types[arrangement.target].name, tuple(sorted(own))), *others)
