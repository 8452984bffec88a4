"""What a classifier is shown: one object's relational situation and numbers at one time step (§3.4.2)."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError, ObservationError

__all__ = [
    "NOISE",
    "Bools",
    "Example",
    "ExampleBatch",
    "Floats",
    "Vocabulary",
    "consequence",
    "difference",
    "mode_value",
    "turned",
]

Bools: TypeAlias = NDArray[np.bool_]
Floats: TypeAlias = NDArray[np.float64]

NOISE = -1
"""Stands for "no mode" wherever an example's mode is asked for (§3.2.1)."""


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """Names of everything that examples of one target hold, in the order of their arrays.

    Parameters
    ----------
    relations
        Binary relations (R).
    unary
        Unary relations (U), object types among them.
    pair
        Real-valued features of the target and another object (F), printed ``name(A, B)``.
    own
        Real-valued features of the target alone or of objects without a body (A).
    contact
        Those names that are contact facts, which the thesis didn't have.
    follows
        Own features that move along with the target: (name, k) says that ``name' = name + k * target'``. For each
        mode, ``name + k * F`` is offered as a number too: where the object would get to if that mode held.
    present
        The own feature that modes predict the next value of; empty: it isn't among them. For each mode, ``F * present``
        is offered as a number too: less than zero where that mode would turn the motion round.

    Raises
    ------
    ConfigError
        A name occurs twice or is reserved for mode functions (``F3``, ``F1 - F3``).
    """

    relations: tuple[str, ...]
    unary: tuple[str, ...]
    pair: tuple[str, ...] = ()
    own: tuple[str, ...] = ()
    contact: frozenset[str] = frozenset()
    follows: tuple[tuple[str, float], ...] = ()
    present: str = ""

    def __post_init__(self) -> None:
        names = Counter((*self.relations, *self.unary, *self.pair, *self.own))
        twice = sorted(name for name, count in names.items() if count > 1)
        reserved = sorted(name for name in names if re.fullmatch(r"F\d+( - F\d+)?", name))
        if twice or reserved:
            raise ConfigError(
                "names of relations and features must differ from one another and from mode functions' "
                f"(F0, F1, ...); rename {twice + reserved}"
            )

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON-able dictionary."""
        names = ("relations", "unary", "pair", "own")
        plain = {name: list(getattr(self, name)) for name in names}
        follows = [list(pair) for pair in self.follows]
        return plain | {"contact": sorted(self.contact), "follows": follows, "present": self.present}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Vocabulary:
        """Inverse of `to_dict`."""
        names = {name: tuple(data[name]) for name in ("relations", "unary", "pair", "own")}
        follows = tuple((str(name), float(k)) for name, k in data["follows"])
        return cls(**names, contact=frozenset(data["contact"]), follows=follows, present=data["present"])


@dataclass(frozen=True, slots=True)
class Example:
    """One example of one target, with K objects; K may differ between examples.

    Parameters
    ----------
    table
        Truth of every binary relation for every ordered pair of objects, shape ``(R, K, K)``.
    unary
        Truth of every unary relation, shape ``(U, K)``.
    close
        The target and all objects that touch it, or else the nearest one, shape ``(K,)``: the context
        (§3.4.2).
    approached
        The target and what it approaches fastest of what it touches, shape ``(K,)``: a narrower context, which holds
        what decides a collision. Default: as `close`.
    pair
        Features of (target, other), shape ``(K, F)``; NaN where undefined.
    own
        The target's own features, shape ``(A,)``; NaN where undefined.
    target
        Index of the object whose behaviour is classified: FOIL's A.
    key
        Identifies the relational state whatever the order of objects; examples are kept per mode and key.
    row
        Where the example came from (a row of the model's history); -1 for a query.
    """

    table: Bools
    unary: Bools
    close: Bools
    pair: Floats
    own: Floats
    target: int = 0
    key: bytes = b""
    row: int = -1
    approached: Bools | None = None

    @property
    def struck(self) -> Bools:
        """`approached`, or its default."""
        return self.close if self.approached is None else self.approached

    def with_own(self, own: Floats, row: int = -1) -> Example:
        """The same situation with other own features, of another row of the history."""
        return Example(
            self.table, self.unary, self.close, self.pair, own, self.target, self.key, row, self.approached
        )


@dataclass(frozen=True, slots=True)
class ExampleBatch:
    """Examples with the same objects: as `Example`, each array with a leading axis of length n.

    `unary` and others may be broadcast views (``np.broadcast_to``): nothing is written to.
    """

    table: Bools
    unary: Bools
    close: Bools
    pair: Floats
    own: Floats
    target: int = 0
    approached: Bools | None = None

    @property
    def struck(self) -> Bools:
        """`approached`, or its default."""
        return self.close if self.approached is None else self.approached

    def __len__(self) -> int:
        return len(self.table)

    def __getitem__(self, index: int) -> Example:
        return self.at(index)

    def at(self, index: int, key: bytes = b"") -> Example:
        """One of them, in the relational state of a key."""
        i = index
        arrays = self.table[i], self.unary[i], self.close[i], self.pair[i], self.own[i]
        return Example(*arrays, self.target, key, approached=self.struck[i])

    @classmethod
    def of(cls, example: Example) -> ExampleBatch:
        """A batch of one."""
        return cls.stack([example])

    @classmethod
    def stack(cls, examples: Sequence[Example]) -> ExampleBatch:
        """A batch of examples that share number of objects and target index."""
        return cls(
            np.stack([e.table for e in examples]),
            np.stack([e.unary for e in examples]),
            np.stack([e.close for e in examples]),
            np.stack([e.pair for e in examples]),
            np.stack([e.own for e in examples]),
            examples[0].target,
            np.stack([e.struck for e in examples]),
        )


def check_example(vocabulary: Vocabulary, example: Example) -> None:
    """Raise `ObservationError` where an example's shapes don't follow the vocabulary."""
    k = example.table.shape[-1]
    expected = {
        "table": (len(vocabulary.relations), k, k),
        "unary": (len(vocabulary.unary), k),
        "close": (k,),
        "struck": (k,),
        "pair": (k, len(vocabulary.pair)),
        "own": (len(vocabulary.own),),
    }
    for name, shape in expected.items():
        if getattr(example, name).shape != shape:
            raise ObservationError(
                f"example {example.row}: expected {name} of shape {shape} for {k} objects, "
                f"got {getattr(example, name).shape}; build it with the relations that the vocabulary names"
            )
    if not 0 <= example.target < k:
        raise ObservationError(f"example {example.row}: target {example.target} is none of its {k} objects")


def mode_value(mode: int) -> str:
    """Name under which a mode's prediction enters clauses and trees."""
    return f"F{mode}"


def consequence(name: str, k: float, mode: int) -> str:
    """Name of the number that says where a property would get to if a mode held."""
    size = f"{abs(k):.6g}"
    return f"{name} {'-' if k < 0 else '+'} {'' if size == '1' else f'{size} '}{mode_value(mode)}"


def turned(mode: int, present: str) -> str:
    """Name of the product of a mode's prediction and the present value: negative where the sign changes."""
    return f"{mode_value(mode)} * {present}"


def difference(i: int, j: int) -> str:
    """Name of the difference of two modes' predictions."""
    return f"F{i} - F{j}"
