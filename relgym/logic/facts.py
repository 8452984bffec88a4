"""What FOIL reasons about: relations and numeric functions over the objects of many worlds (thesis §3.4.2).

A *world* is one time step (or, for plain logic programming, one example structure). Its objects are integers.
The thesis adds a time argument to every relation; here it is the first axis of every array.
"""

from __future__ import annotations

import copy
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing, refusing_calls
from relgym.errors import ConfigError
from relgym.logic.clause import ANY, Literal

__all__ = ["Bool", "Facts", "Float", "Int", "facts_from_tuples"]

Bool: TypeAlias = NDArray[np.bool_]
Float: TypeAlias = NDArray[np.float64]
Int: TypeAlias = NDArray[np.int64]

Tuples: TypeAlias = Iterable[tuple[Hashable, ...]]


@refusing_calls(ConfigError)
@dataclass(frozen=True, eq=False)
class Facts:
    """Relations and numeric functions over W worlds of at most K objects each.

    Parameters
    ----------
    relations
        Name → boolean array of shape (W, K, …, K), one axis of length K per argument.
    exists
        Shape (W, K): which object slots are taken. Relations of free slots are ignored.
    numeric
        Name → float64 array of shape (W, K, …, K); NaN where the function is undefined. Without any K axis it
        is a number of the world.
    relative
        Names of relations and functions whose first argument is always the target and is not stored: an array
        of shape (W, K) is printed ``name(A, B)``, one of shape (W,) ``name(A)``.

    Raises
    ------
    ConfigError
        If an array's shape or type is another, or a name is used both for a relation and for a function.

    Notes
    -----
    Many learning problems share one `Facts`: worlds are referred to by index, and `with_numeric` gives the
    same relations other functions for the price of a dictionary. Derived arrays are computed once, when first
    needed.
    """

    relations: Mapping[str, Bool]
    exists: Bool
    numeric: Mapping[str, Float] = field(default_factory=dict)
    relative: frozenset[str] = frozenset()
    _masked: dict[str, Bool] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        for name, array in {"exists": self.exists, **self.relations, **self.numeric}.items():
            if not isinstance(array, np.ndarray):
                raise ConfigError(f"{name}: expected an array, got {type(array).__name__}.")
        if self.exists.ndim != 2 or self.exists.dtype != np.bool_:
            raise ConfigError(f"exists: expected booleans of shape (W, K), got {_kind(self.exists)}.")
        for name, relation in self.relations.items():
            self._check(name, relation, np.dtype(np.bool_))
        self._check_numeric()

    def _check_numeric(self) -> None:
        both = sorted(set(self.relations) & set(self.numeric))
        if both:
            raise ConfigError(
                f"{both[0]!r} names both a relation and a numeric function; rename one of them."
            )
        for name, values in self.numeric.items():
            self._check(name, values, np.dtype(np.float64))

    def _check(self, name: str, array: NDArray[np.generic], dtype: np.dtype[np.generic]) -> None:
        worlds, objects = self.exists.shape
        shape = (worlds,) + (objects,) * (array.ndim - 1)
        if array.dtype != dtype or array.shape != shape:
            raise ConfigError(f"{name}: expected {dtype} of shape {shape}, got {_kind(array)}.")

    @property
    def worlds(self) -> int:
        """Number of worlds, W."""
        return int(self.exists.shape[0])

    @property
    def objects(self) -> int:
        """Number of object slots, K."""
        return int(self.exists.shape[1])

    @property
    def all_exist(self) -> bool:
        """Whether every object slot is taken in every world."""
        return bool(self.exists.all())

    def arity(self, name: str) -> int:
        """Number of arguments of a relation or function as printed, an unstored target included."""
        if name not in self.relations and name not in self.numeric:
            raise ConfigError(f"name={name!r}: expected one of {sorted({*self.relations, *self.numeric})}")
        array = self.relations[name] if name in self.relations else self.numeric[name]
        return array.ndim - 1 + (name in self.relative)

    def with_numeric(self, numeric: Mapping[str, Float], relative: frozenset[str] | None = None) -> Facts:
        """Return the same relations with other numeric functions; nothing is copied."""
        found = copy.copy(self)  # the relations have been checked
        object.__setattr__(found, "numeric", numeric)
        object.__setattr__(found, "relative", self.relative if relative is None else relative)
        found._check_numeric()
        return found

    def relation(self, name: str) -> Bool:
        """Return a relation, shape (W, K, …), that is false wherever an argument doesn't exist."""
        found = self._masked.get(name)
        if found is None:
            if name not in self.relations:
                raise ConfigError(f"name={name!r}: expected one of the relations {sorted(self.relations)}")
            found = self._masked[name] = self._mask(self.relations[name])
        return found

    def truth(self, literal: Literal) -> Bool:
        """Return where a literal's test is true, its negation left aside.

        Parameters
        ----------
        literal
            Its variables become axes, in the order of the arguments; `ANY` arguments are quantified away.

        Returns
        -------
        Shape (W, K, …). A *relative* name's unstored first argument is an axis of length 1.
        """
        self.require(literal)
        if literal.op is None:
            truth = self.relation(literal.relation)
        else:
            truth = self._mask(compare(self.numeric[literal.relation], literal))
        if literal.relation in self.relative:
            truth = truth[:, np.newaxis]
        quantified = tuple(axis + 1 for axis, arg in enumerate(literal.args) if arg == ANY)
        return np.asarray(truth.any(axis=quantified)) if quantified else truth

    def require(self, literal: Literal) -> None:
        """Check that the facts know a literal's relation or function, and that the number of arguments fits.

        Raises
        ------
        ConfigError
            If they don't; or if a *relative* name's first argument isn't the target, variable 0.
        """
        known = self.relations if literal.op is None else self.numeric
        if literal.relation not in known:
            kind = "relations" if literal.op is None else "numeric functions"
            raise ConfigError(f"{literal}: expected one of the {kind} {sorted(known)}.")
        if len(literal.args) != self.arity(literal.relation):
            raise ConfigError(f"{literal}: expected {self.arity(literal.relation)} arguments.")
        if literal.relation in self.relative and literal.args[0] != 0:
            raise ConfigError(f"{literal}: the first argument of {literal.relation} is always the target, A.")

    def _mask(self, truth: Bool) -> Bool:
        """Make a relation false wherever one of its arguments doesn't exist."""
        if self.all_exist:
            return truth
        for axis in range(1, truth.ndim):
            shape = [1] * truth.ndim
            shape[0], shape[axis] = self.exists.shape
            truth = truth & self.exists.reshape(shape)
        return truth


def compare(values: Float, literal: Literal) -> Bool:
    """Compare values with a numeric literal's threshold; undefined ones (NaN) satisfy neither side."""
    return values <= literal.threshold if literal.op == "<=" else values > literal.threshold


@refusing(ConfigError)
def facts_from_tuples(
    worlds: Sequence[Mapping[str, Tuples]],
    objects: Sequence[Sequence[Hashable]],
    numeric: Sequence[Mapping[str, Mapping[tuple[Hashable, ...], float]]] | None = None,
) -> tuple[Facts, list[dict[Hashable, int]]]:
    """Build `Facts` from lists of tuples of symbols, the usual input of inductive logic programming.

    Parameters
    ----------
    worlds
        Per world, relation name → the tuples for which it holds; all others are false (§3.4.1).
    objects
        Per world, its objects' symbols.
    numeric
        Per world, function name → tuple → value; undefined elsewhere.

    Returns
    -------
    The facts, and per world the number of each symbol.

    Raises
    ------
    ConfigError
        If a tuple names an unknown object, an object is named twice, a relation's tuples differ in length, or the lists
        are of different numbers of worlds.

    Examples
    --------
    >>> facts, [number] = facts_from_tuples([{"parent": [("ann", "bob")]}], [["ann", "bob"]])
    >>> bool(facts.relations["parent"][0, number["ann"], number["bob"]])
    True
    """
    for what, lists in (("the objects", objects), ("the numbers", worlds if numeric is None else numeric)):
        if len(worlds) != len(lists):
            raise ConfigError(f"Expected {what} of {len(worlds)} worlds, got {len(lists)} lists.")
    for symbols in objects:
        if len(set(symbols)) < len(symbols):
            raise ConfigError(f"Expected every object of a world once, got {list(symbols)}.")
    numbers = [{symbol: number for number, symbol in enumerate(symbols)} for symbols in objects]
    size = max((len(symbols) for symbols in objects), default=0)
    exists = np.array([[slot < len(symbols) for slot in range(size)] for symbols in objects], dtype=np.bool_)
    tables = [{name: dict.fromkeys(rows, 1.0) for name, rows in world.items()} for world in worlds]
    relations = _arrays(tables, numbers, size, 0.0)
    functions = _arrays(numeric or [{} for _ in worlds], numbers, size, np.nan)
    found = {name: array.astype(np.bool_) for name, array in relations.items()}
    return Facts(found, exists.reshape(len(worlds), size), functions), numbers


def _arrays(
    tables: Sequence[Mapping[str, Mapping[tuple[Hashable, ...], float]]],
    numbers: Sequence[Mapping[Hashable, int]],
    size: int,
    default: float,
) -> dict[str, Float]:
    arrays: dict[str, Float] = {}
    for name in sorted({name for table in tables for name in table}):
        lengths = {len(row) for table in tables for row in table.get(name, ())}
        if len(lengths) != 1:
            raise ConfigError(f"{name}: expected tuples of one length, got lengths {sorted(lengths)}.")
        arrays[name] = np.full((len(tables), *(size,) * lengths.pop()), default)
        for world, (table, number) in enumerate(zip(tables, numbers, strict=True)):
            for row, value in table.get(name, {}).items():
                arrays[name][(world, *_slots(name, row, number))] = value
    return arrays


def _slots(name: str, row: tuple[Hashable, ...], number: Mapping[Hashable, int]) -> list[int]:
    unknown = [symbol for symbol in row if symbol not in number]
    if unknown:
        raise ConfigError(f"{name}{row}: {unknown[0]!r} is not among the world's objects {list(number)}.")
    return [number[symbol] for symbol in row]


def _kind(array: NDArray[np.generic]) -> str:
    return f"{array.dtype} of shape {array.shape}"
