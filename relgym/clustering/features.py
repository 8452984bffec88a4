"""Non-linear features as further regression columns (§5.1's wish): products, powers, sines, users' functions.

A feature is a product of *atoms*; an atom is a column as it is, its sine or cosine at a frequency, or a function that
the user registered. Features belong to the target object (slot 0), even where an action takes part in the product.
They are stated by name (``cos(3 x)``, ``action.force cos(th)``), and a mode that uses one is still linear in it, so
everything that is learned of linear modes holds for them too.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing
from relgym.config.constants import DEGREES, MOST_FEATURES
from relgym.errors import ConfigError

__all__ = [
    "NO_FEATURES",
    "Atom",
    "Feature",
    "Library",
    "check_entries",
    "features_for",
    "functions_of",
    "known_kinds",
    "library_of",
    "offered",
    "register_function",
    "switched_on",
]

_POLYNOMIALS = ("squares", "products", "degree3", "degree4")
_ENTRY = re.compile(r"(?:(?P<type>[^:]+):)?(?P<kind>\w+)(?:\((?P<names>[\w, ]+)\))?")

Function = Callable[[NDArray[np.float64]], NDArray[np.float64]]
_functions: dict[str, Function] = {}


@refusing(ConfigError)
def register_function(name: str, function: Function) -> None:
    """Make a function of one number available as a feature by its name.

    Parameters
    ----------
    name
        A Python identifier; model files refer to it, so register it before loading one.
    function
        Maps a float64 array element by element; must be defined wherever the env goes. To learn in the background it
        must be one that a process can be sent: a ``def`` at the top level of a module, no lambda.

    Raises
    ------
    ConfigError
        The name is no identifier or means something already, or the function doesn't map arrays.
    """
    if not name.isidentifier() or name in {"trig", "sin", "cos", *_POLYNOMIALS}:
        raise ConfigError(f"expected a new identifier as a function's name, got {name!r}; choose another one")
    tried = np.array([0.5, 1.0])
    try:
        with np.errstate(all="ignore"):
            shape = np.shape(function(tried))
    except Exception as error:
        raise ConfigError(
            f"feature {name!r} can't be worked out for an array of numbers ({error!r}); write it with numpy, or "
            f"register numpy.vectorize({name})"
        ) from error
    if shape != tried.shape:
        raise ConfigError(
            f"feature {name!r} gives shape {shape} for an array of shape {tried.shape}, expected that"
        )
    _functions[name] = function


def _degree_of(kind: str) -> int:
    """The highest degree of what such features are products of."""
    if kind not in _POLYNOMIALS:
        return 1
    return int(kind.removeprefix("degree")) if kind.startswith("degree") else 2


def functions_of(entries: Iterable[str]) -> dict[str, Function]:
    """Registered functions that entries of ``ModelConfig.features`` name, by name."""
    kinds = [match["kind"] for entry in entries if (match := _ENTRY.fullmatch(entry))]
    return {kind: _functions[kind] for kind in kinds if kind in _functions}


def known_kinds() -> tuple[str, ...]:
    """All kinds of features that there are, registered functions last."""
    return ("trig", *_POLYNOMIALS, *sorted(_functions))


@dataclass(frozen=True, slots=True)
class Atom:
    """A factor of a feature: column `column` as it is, or a function of `frequency` times it."""

    column: int
    function: str = ""
    frequency: int = 1

    def values(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """On rows ``(n, d)``, shape ``(n,)``."""
        column: NDArray[np.float64] = x[:, self.column]
        if not self.function:
            return column
        if self.function == "sin":
            return np.sin(self.frequency * column)
        if self.function == "cos":
            return np.cos(self.frequency * column)
        return np.asarray(_registered(self.function)(column), dtype=np.float64)

    def text(self, name: str) -> str:
        """How it is printed, given the column's name."""
        if not self.function:
            return name
        return f"{self.function}({name if self.frequency == 1 else f'{self.frequency} {name}'})"


@dataclass(frozen=True, slots=True)
class Feature:
    """A product of atoms, and its name."""

    name: str
    atoms: tuple[Atom, ...]

    @property
    def columns(self) -> frozenset[int]:
        """Columns it is made of."""
        return frozenset(atom.column for atom in self.atoms)

    def values(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """On rows ``(n, d)``, shape ``(n,)``; multiplied in a fixed order, hence repeatable."""
        product = self.atoms[0].values(x)
        for atom in self.atoms[1:]:
            product = product * atom.values(x)
        return product

    def moved(self, places: Sequence[int]) -> Feature:
        """The same feature of columns that lie elsewhere: column k at ``places[k]``."""
        return replace(self, atoms=tuple(replace(a, column=places[a.column]) for a in self.atoms))


@dataclass(frozen=True)
class Library:
    """Which features a type's targets are offered.

    Parameters
    ----------
    kinds
        Of ``"squares"``, ``"products"`` (of two atoms), ``"degree3"``, ``"degree4"``, ``"trig"`` and registered
        functions' names. With ``"trig"``, products may hold a sine or cosine too.
    angles
        Properties whose sines and cosines are taken; none: all of the target's own.
    """

    kinds: tuple[str, ...] = ()
    angles: tuple[str, ...] = ()

    @cached_property
    def _hash(self) -> int:
        return hash((self.kinds, self.angles))

    def __hash__(self) -> int:
        return self._hash

    def features(self, names: Sequence[str], own: Sequence[bool]) -> tuple[Feature, ...]:
        """Features of some columns, the simplest first.

        Parameters
        ----------
        names
            The columns' names, in order; next values end with a prime.
        own
            Whether a column is a property of the target (or of another object that moves), not of an action.

        Raises
        ------
        ConfigError
            There would be more than `MOST_FEATURES`.
        """
        if not self.kinds:
            return ()
        if (size := self.size(names, own)) > MOST_FEATURES:
            raise ConfigError(
                f"features={self.kinds} of {len(names)} numbers would be {size:,} columns, expected at most "
                f"{MOST_FEATURES:,}; ask for a lower degree, name the angles ('trig(th)'), or split the object in parts"
            )
        atoms, found = self._simplest(names, own)
        for degree in range(2, self._degree + 1):
            # Next values enter products of two only: a library of higher degree would explode.
            factors = atoms if degree == 2 else [a for a in atoms if not names[a.column].endswith("'")]
            for product in itertools.combinations_with_replacement(factors, degree):
                if self._offered(product):
                    found.append(Feature(_product_text(product, names), product))
        return tuple(found)

    def size(self, names: Sequence[str], own: Sequence[bool]) -> int:
        """Number of features of some columns, or a little more; arguments as of `features`."""
        if not self.kinds:
            return 0
        atoms, found = self._simplest(names, own)
        plain = sum(not names[a.column].endswith("'") for a in atoms)
        counts = [len(atoms) if degree == 2 else plain for degree in range(2, self._degree + 1)]
        return len(found) + sum(math.comb(n + d - 1, d) for d, n in enumerate(counts, start=2))

    def _simplest(self, names: Sequence[str], own: Sequence[bool]) -> tuple[list[Atom], list[Feature]]:
        """The factors of products, and the features that are none."""
        turning = [k for k, name in enumerate(names) if own[k] and self._turns(name)]
        waves = [Atom(k, f, w) for k in turning for w in DEGREES for f in ("sin", "cos")]
        users = [kind for kind in self.kinds if kind not in {"trig", *_POLYNOMIALS}]
        for kind in users:
            _registered(kind)
        named = [Atom(k, f) for f in users for k in range(len(names))]
        found = [Feature(atom.text(names[atom.column]), (atom,)) for atom in (*waves, *named)]
        raw = [Atom(k) for k in range(len(names))]
        return [*raw, *(a for a in waves if a.frequency == 1), *named], found

    @property
    def _degree(self) -> int:
        return max(map(_degree_of, self.kinds), default=1)

    def _turns(self, name: str) -> bool:
        return "trig" in self.kinds and (
            not self.angles or name.rstrip("'").rpartition(".")[2] in self.angles
        )

    def _offered(self, product: Sequence[Atom]) -> bool:
        only_squares = "squares" in self.kinds and self._degree == 2 and "products" not in self.kinds
        return not only_squares or len(set(product)) == 1


NO_FEATURES = Library()
"""The library of those who don't ask for one: linear functions."""


def library_of(entries: Iterable[str], type_name: str, angles: tuple[str, ...]) -> Library:
    """What ``ModelConfig.features`` offers the targets of a type.

    Parameters
    ----------
    entries
        Such as ``"trig"`` (of declared angles; if there are none, of all properties), ``"trig(th)"`` (only of that
        property) or ``"cart:products"`` (only for that type).
    type_name, angles
        The type, and those of its properties that are declared angles.

    Raises
    ------
    ConfigError
        An entry that is no known kind and no registered function.
    """
    kinds: dict[str, None] = {}
    named: dict[str, None] = {}
    everywhere = False
    for entry in entries:
        owner, kind, properties = _parsed(entry)
        if owner in (None, type_name):
            kinds[kind] = None
            named |= dict.fromkeys(properties)
            everywhere |= kind == "trig" and not properties
    if not everywhere:
        return Library(tuple(kinds), tuple(named) or angles)
    return Library(tuple(kinds), tuple(dict.fromkeys((*angles, *named))) if angles else ())


def offered(entries: Iterable[str], type_name: str) -> frozenset[str]:
    """Kinds of features that `library_of` offers a type's targets of all properties that have them."""
    parsed = [_parsed(entry) for entry in entries]
    return frozenset(kind for owner, kind, named in parsed if owner in (None, type_name) and not named)


def features_for(entries: Iterable[str], type_name: str) -> tuple[str, ...]:
    """Entries that offer a type's targets something (`relgym.config.ModelConfig.features`)."""
    return tuple(entry for entry in entries if _parsed(entry)[0] in (None, type_name))


def switched_on(
    entries: Iterable[str], type_name: str, kinds: Iterable[str], *, alone: bool = False
) -> tuple[str, ...]:
    """These entries, and behind them what offers a type's targets these kinds as well.

    Parameters
    ----------
    entries
        What is on; it stays on, for other targets may need it.
    type_name, kinds
        Who is to be offered what.
    alone
        Whether there is no other type, and an entry needn't name this one.

    Examples
    --------
    >>> switched_on(("car:trig", "ego:trig"), "ego", ("trig", "products"))
    ('car:trig', 'ego:trig', 'ego:products')
    """
    entries = tuple(entries)
    known, owner = offered(entries, type_name), "" if alone else f"{type_name}:"
    return (*entries, *(f"{owner}{kind}" for kind in kinds if kind not in known))


def check_entries(entries: Iterable[str], types: Mapping[str, Collection[str]]) -> None:
    """Raise `ConfigError` where an entry of ``ModelConfig.features`` would be offered to nobody.

    Parameters
    ----------
    entries
        As of `library_of`.
    types
        Properties of every type, but for the action's.
    """
    for entry in entries:
        owner, _, properties = _parsed(entry)
        if owner is not None and owner not in types:
            raise ConfigError(f"features: {entry!r} is for type {owner!r}; expected one of {sorted(types)}")
        known = sorted({prop for found in types.values() for prop in found})
        if unknown := [name for name in properties if name not in known]:
            raise ConfigError(f"features: {entry!r} names the properties {unknown}; expected some of {known}")


def _parsed(entry: str) -> tuple[str | None, str, list[str]]:
    """Type that an entry is for (``None``: all), its kind, and the properties that it names."""
    match = _ENTRY.fullmatch(entry)
    kind = match["kind"] if match else entry
    if match is None or (kind != "trig" and (match["names"] or kind not in {*_POLYNOMIALS, *_functions})):
        raise ConfigError(
            f"features: {entry!r} is unknown; expected 'trig', 'trig(property)', {sorted(_POLYNOMIALS)}, or a function "
            f"registered before, of which there are {sorted(_functions)}; 'type:kind' offers it to one type only"
        )
    return match["type"], kind, [name.strip() for name in (match["names"] or "").split(",") if name.strip()]


def _registered(name: str) -> Function:
    if name not in _functions:
        raise ConfigError(
            f"features: no function {name!r} is registered in this process; call register_function({name!r}, ...) "
            "first, as where the model was made"
        )
    return _functions[name]


def _product_text(product: Sequence[Atom], names: Sequence[str]) -> str:
    parts = []
    for atom, group in itertools.groupby(product):
        power = len(list(group))
        text = atom.text(names[atom.column])
        parts.append(text if power == 1 else f"{text}^{power}")
    return " ".join(parts)
