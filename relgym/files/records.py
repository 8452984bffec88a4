"""Declared formats: records whose types and ranges msgspec checks, and the numbers and names that they are made of.

A format is written down once, as `msgspec.Struct` classes, and `checked` holds plain data against it. Importing this
module loads msgspec, so modules that should be light import it inside functions.
"""

from __future__ import annotations

import sys
from typing import Annotated, Any, TypeAlias

import msgspec
from msgspec import Meta

from relgym.errors import ModelFileError, RelgymError

__all__ = [
    "LARGEST",
    "Amount",
    "Count",
    "Finite",
    "Hex",
    "Name",
    "Noise",
    "Number",
    "Pair",
    "Random",
    "Record",
    "Share",
    "Spread",
    "Weight",
    "checked",
    "plain",
]

_MOST = sys.float_info.max

Finite: TypeAlias = Annotated[float, Meta(ge=-_MOST, le=_MOST, description="a finite number")]
Amount: TypeAlias = Annotated[float, Meta(ge=0.0, le=_MOST, description="a finite number, at least 0")]
LARGEST = 1e120
"""A number beyond this can't be learned from: its square nears the largest that there is."""

Number: TypeAlias = Annotated[
    float, Meta(ge=0.0, le=LARGEST, description="a number's size, as far as any can be learned from")
]
Noise: TypeAlias = Annotated[
    float,
    Meta(ge=1.0 / LARGEST, le=LARGEST, description="a deviation whose square is neither zero nor infinite"),
]
Spread: TypeAlias = Annotated[float, Meta(ge=0.0, description="at least 0; Infinity where there is no bound")]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0, description="a share, from 0 to 1")]
Weight: TypeAlias = Annotated[
    float, Meta(ge=0.0, le=2.0**53, description="how many examples count, at least 0")
]
Count: TypeAlias = Annotated[int, Meta(ge=0, le=2**53, description="a whole number, at least 0")]
Name: TypeAlias = Annotated[str, Meta(min_length=1, max_length=1_000, description="a name")]
Hex: TypeAlias = Annotated[str, Meta(pattern=r"^([0-9a-f]{2})*$", description="bytes in hexadecimal")]
Pair: TypeAlias = tuple[Name, Name]


class Record(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """A JSON object with exactly the fields declared; those with a default may be missing.

    `plain` leaves those out, so that whoever reads a record meets what is missing every time, not in odd files alone.
    """


class _Pcg64(Record):
    """The two numbers of NumPy's generator PCG64, each less than 2**128."""

    state: Annotated[int, Meta(ge=0)]
    inc: Annotated[int, Meta(ge=0)]

    def __post_init__(self) -> None:
        if max(self.state, self.inc) >= 2**128 or not self.inc % 2:
            raise ValueError("expected numbers less than 2**128, and an odd inc")


class Random(Record):
    """State of a random number generator (`numpy.random.PCG64`)."""

    bit_generator: Annotated[str, Meta(pattern="^PCG64$")]
    state: _Pcg64
    has_uint32: Annotated[int, Meta(ge=0, le=1)]
    uinteger: Annotated[int, Meta(ge=0, le=2**32 - 1)]


def plain(record: msgspec.Struct) -> dict[str, Any]:
    """Plain data of a record: every number of the type declared, and nothing that a default says."""
    found: dict[str, Any] = msgspec.to_builtins(record)
    return found


def checked(data: Any, kind: Any, what: str, *, error: type[RelgymError] = ModelFileError) -> Any:
    """Plain data as records of a declared kind.

    Parameters
    ----------
    data
        As `json.loads` gives it.
    kind
        What it should be: a record, or a union of some.
    what
        What to call it in errors.
    error
        What to raise.

    Raises
    ------
    RelgymError
        Of the kind asked for: something is missing or too many, of another type or out of range. The message
        says where (``$.a[0]``).
    """
    try:
        return msgspec.convert(data, kind)
    except (msgspec.ValidationError, RecursionError, UnicodeEncodeError) as problem:
        said = "it is nested too deep" if isinstance(problem, RecursionError) else str(problem)
        raise error(
            f"{what} isn't as the format says ({said}): it was damaged or made by another program; save it again"
        ) from None
