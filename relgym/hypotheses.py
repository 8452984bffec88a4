"""Explanations from outside: hypothesis classes that compete with modes for what a property will be next.

Modes are linear. Who knows of another form that laws may have, a period, a saturation, a table, a regressor that was
tuned for years, teaches it to every model without touching the core:

1. a `HypothesisClass` *proposes* a `Law` for one property, from examples;
2. the core *scores* it in bits: the law is kept if it codes the examples, itself included, in fewer bits than that
   nothing changes, than least squares, and than the law kept before, by ten bits and those that tell which of
   the proposals it was;
3. from then on it is one of the experts of `relgym.model.predicting.calibration`: before each step it says what comes
next, and
   once it has coded what came in fewer bits than whoever spoke until then, it speaks. How often it was right is
   counted like anybody's, so its claims are calibrated.

A class that has nothing to say in a world costs the time of its proposals, no prediction and no claim.
`register_hypothesis` makes it known by a name; ``ModelConfig(hypotheses=("name",))`` asks for it, and model files refer
to it by that name.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing
from relgym.errors import ConfigError

__all__ = [
    "Examples",
    "HypothesisClass",
    "Law",
    "Proposal",
    "code_length",
    "register_hypothesis",
    "registered",
]


@dataclass(frozen=True, slots=True)
class Examples:
    """What is known of one property of one type.

    Attributes
    ----------
    names
        Names of the columns: ``x`` for the object's own property, ``action.u`` for that of an object without a body.
    x
        What there was before each step, shape ``(n, len(names))``, in the properties' units; the oldest first.
    y
        What the property was after it, shape ``(n,)``.
    present
        What it was before, shape ``(n,)``.
    resolution
        Differences up to this are rounding, in units of the property; > 0.
    """

    names: tuple[str, ...]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    present: NDArray[np.float64]
    resolution: float


class Law(Protocol):
    """An explanation of one property, its numbers fitted."""

    @property
    def parameters(self) -> int:
        """How many numbers were fitted or chosen; each is charged half of log2 of the number of examples."""

    def predict(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Next values of rows ``(n, columns)`` with the examples' columns, shape ``(n,)``; NaN: it doesn't say.

        Row by row: what it says of one must not depend, to the last bit, on which others it is asked about.
        """

    def text(self) -> str:
        """The law for people, as ``x' = x + 0.5 sin(6.28 t / 17)``."""

    def to_json(self) -> dict[str, Any]:
        """Plain data that the class's `from_json` reads back to the last bit."""


Proposal: TypeAlias = Law | Generator[int, None, "Law | None"] | None
"""A law, none, or a search that can be interrupted: it yields cells of work (`relgym.scheduling.work`), some 250,000
at a time at most, and returns a law or none."""


@runtime_checkable
class HypothesisClass(Protocol):
    """A form that laws may have."""

    name: str
    """A Python identifier; model files refer to it."""

    def propose(self, examples: Examples) -> Proposal:
        """The best law of this form, None if there is none; deterministic, and examples aren't changed."""

    def from_json(self, data: Mapping[str, Any]) -> Law:
        """Read what a law's `to_json` wrote."""


_classes: dict[str, HypothesisClass] = {}


@refusing(ConfigError)
def register_hypothesis(kind: HypothesisClass) -> None:
    """Make a class of hypotheses available under its name; one of the same name is replaced.

    Parameters
    ----------
    kind
        To learn in the background it must be one that a process can be sent: an instance of a class at the top level
        of a module.

    Raises
    ------
    ConfigError
        It lacks a method, or its name is no identifier.
    """
    if not isinstance(kind, HypothesisClass):
        raise ConfigError(
            f"{kind!r} is no hypothesis class; expected a name, propose(examples) and from_json(data), see "
            "relgym.hypotheses.HypothesisClass"
        )
    if not str(kind.name).isidentifier():
        raise ConfigError(f"expected an identifier as a hypothesis class's name, got {kind.name!r}")
    _classes[kind.name] = kind


@refusing(ConfigError)
def registered(name: str) -> HypothesisClass:
    """The class of that name; `ConfigError` when there is none in this process."""
    if name not in _classes:
        raise ConfigError(
            f"hypotheses: no class {name!r} is registered in this process, known are {sorted(_classes)}; call "
            "relgym.hypotheses.register_hypothesis first, as where the model was made"
        )
    return _classes[name]


@refusing(ConfigError)
def code_length(errors: NDArray[np.float64], resolution: float, parameters: int = 0) -> float:
    """Bits that it takes to state errors, and the numbers of the law that made them.

    An error of k resolutions takes ``1 + 2 log2(1 + k)`` bits, as a universal code of whole numbers does (Elias 1975);
    never more than the 64 of a number stated as it is, so no outlier decides. A NaN is a number stated as it is.

    Parameters
    ----------
    errors
        In units of the property, shape ``(n,)``.
    resolution
        As of `Examples`.
    parameters
        Each takes half of log2 n bits (Rissanen 1978).

    Examples
    --------
    >>> code_length(np.array([0.0, 3.0, 1e300]), 1.0)
    70.0
    """
    most, sizes = float(np.finfo(np.float64).bits), np.abs(errors) / resolution
    bits = np.where(np.isnan(errors), most, np.minimum(1.0 + 2.0 * np.log2(1.0 + sizes), most))
    return float(bits.sum()) + 0.5 * parameters * math.log2(max(len(errors), 2))
