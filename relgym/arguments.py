"""What a public function was given, compared with what it says it takes; asked only when it failed.

Functions are written for arguments that fit their annotations, and check what annotations can't say. Where one fails on
something else, `refusing` finds the argument that doesn't fit, and says so in an error of relgym's. What fails although
all arguments fit is a defect, and stays what it was.
"""

from __future__ import annotations

import collections.abc
import functools
import inspect
import math
import os
import reprlib
import types
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from typing import (
    Any,
    Final,
    ForwardRef,
    Literal,
    ParamSpec,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from numpy.typing import NDArray

from relgym.errors import RelgymError

__all__ = ["array_of", "finite", "misfit", "refusing", "refusing_calls", "refusing_fields", "unfit", "whole"]

_P = ParamSpec("_P")
_R = TypeVar("_R")
_C = TypeVar("_C", bound=type)

_RAW: Final = (TypeError, ValueError, AttributeError, LookupError, ArithmeticError, RecursionError)
"""What Python and NumPy raise when they can't use what they were given."""


_FEW: Final = 64
"""Longer vectors are summed up more slowly than asked."""


def refusing(error: type[RelgymError]) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Decorate a public function: where it fails for an argument that doesn't fit its annotation, `error` says so.

    Costs nothing while nothing fails.

    Examples
    --------
    >>> from relgym.errors import ConfigError
    >>> @refusing(ConfigError)
    ... def half(number: float) -> float:
    ...     return number / 2
    >>> half("x")
    Traceback (most recent call last):
        ...
    relgym.errors.ConfigError: half: number='x': expected a finite number; see help(half)
    """

    def decorate(function: Callable[_P, _R]) -> Callable[_P, _R]:
        @functools.wraps(function)
        def refused(*args: _P.args, **kwargs: _P.kwargs) -> _R:
            try:
                return function(*args, **kwargs)
            except RelgymError:
                raise
            except _RAW as raised:
                said = _diagnosis(function, args, kwargs)
                if said:
                    raise error(said) from raised
                raise

        return refused

    return decorate


def refusing_calls(error: type[RelgymError]) -> Callable[[_C], _C]:
    """The same for a class: its constructor, if it has one of its own, and every public method that it defines."""

    def decorate(kind: _C) -> _C:
        for name, method in list(vars(kind).items()):
            if name != "__init__" and name.startswith("_"):
                continue
            if isinstance(method, (classmethod, staticmethod)):
                setattr(kind, name, type(method)(refusing(error)(method.__func__)))
            elif inspect.isfunction(method):
                setattr(kind, name, refusing(error)(method))
        return kind

    return decorate


def refusing_fields(error: type[RelgymError], *, always: bool = False) -> Callable[[_C], _C]:
    """The same for a record: what its fields are given; `always`: also where it doesn't fail for it itself."""

    def decorate(record: _C) -> _C:
        made: Any = record
        init = made.__init__

        @functools.wraps(init)
        def checked(self: Any, *args: Any, **kwargs: Any) -> None:
            if said := _diagnosis(init, (self, *args), kwargs):
                raise error(said)
            init(self, *args, **kwargs)

        made.__init__ = checked if always else refusing(error)(init)
        return record

    return decorate


def unfit(record: Any) -> str:
    """The first field of a record that doesn't fit its annotation, and what was expected; empty where all do."""
    hints = get_type_hints(type(record))
    for field in fields(record):
        value = getattr(record, field.name)
        if expected := misfit(value, hints[field.name]):
            return f"{field.name}={_shown(value)}: expected {expected}"
    return ""


def finite(vector: NDArray[np.float64]) -> bool:
    """Whether all numbers of a vector are finite. For the few numbers of a scene faster than asking each."""
    if len(vector) <= _FEW and math.isfinite(sum(vector.tolist())):
        return True
    return bool(np.isfinite(vector).all())  # the sum of huge numbers may overflow


def whole(what: str, value: Any, least: int, below: int, error: type[RelgymError]) -> int:
    """`value` as an int; `error` unless it is a whole number from `least` to less than `below`."""
    if not _is_whole(value) or not least <= value < below:
        raise error(f"{what}={_shown(value)}: expected a whole number from {least} to {below - 1}")
    return int(value)


def array_of(
    what: str, value: Any, shape: tuple[int | None, ...], error: type[RelgymError]
) -> NDArray[np.float64]:
    """`value` as finite floats of some shape; None there: any length. `error` for anything else."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise error(f"{what}={_shown(value)}: expected an array of numbers") from None
    fits = array.ndim == len(shape) and all(
        n is None or n == m for n, m in zip(shape, array.shape, strict=True)
    )
    if not fits or not np.isfinite(array).all():
        lengths = ", ".join("n" if n is None else str(n) for n in shape)
        said = f"shape {array.shape}" if not fits else "some that aren't finite"
        raise error(
            f"{what}: expected finite numbers of shape ({lengths}{',' * (len(shape) == 1)}), got {said}"
        )
    return array


def _diagnosis(function: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> str:
    """The first argument that doesn't fit; empty where all do, or nobody can tell."""
    name = function.__qualname__.removesuffix(".__init__").replace("<locals>.", "")
    try:
        bound = inspect.signature(function).bind(*args, **kwargs)
    except TypeError as error:
        return f"{name}: {error}; see help({name})"
    hints = _hints(function)
    for parameter, value in bound.arguments.items():
        if parameter in hints and (expected := misfit(value, hints[parameter])):
            return f"{name}: {parameter}={_shown(value)}: expected {expected}; see help({name})"
    return ""


def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    try:
        return get_type_hints(function)
    except (NameError, TypeError, AttributeError):  # some names are for type checkers only
        return _hints_one_by_one(inspect.unwrap(function))


def _hints_one_by_one(function: Callable[..., Any]) -> dict[str, Any]:
    """Annotations of relgym's own source that can be resolved."""
    found: dict[str, Any] = {}
    for name, said in function.__annotations__.items():
        with suppress(NameError, TypeError, AttributeError):
            found[name] = ForwardRef(said)._evaluate(function.__globals__, {}, recursive_guard=frozenset())
    return found


def misfit(value: Any, hint: Any) -> str:
    """What was expected, where a value doesn't fit an annotation; else empty, also where nobody can tell.

    Whole numbers are numbers, and any sequence but text will do for a tuple. Numbers must be finite.
    """
    if hint is Any or isinstance(hint, (TypeVar, str)):
        return ""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        said = [misfit(value, one) for one in inner]
        return "" if not all(said) else " or ".join(dict.fromkeys(said))
    if origin is Literal:
        fits = any(type(value) is type(one) and value == one for one in inner)
        return "" if fits else f"one of {inner}"
    return _no_instance(value, hint) if origin is None else _no_generic(value, origin, inner)


def _no_generic(value: Any, origin: Any, inner: tuple[Any, ...]) -> str:
    if origin is np.ndarray:
        return _no_array(value, inner)
    if origin is tuple:
        return _no_tuple(value, inner)
    if origin is collections.abc.Callable:
        return "" if callable(value) else "a function"
    if not isinstance(origin, type) or origin is type:
        return ""
    if issubclass(origin, os.PathLike):
        return "" if isinstance(value, os.PathLike) else "a path"
    if issubclass(origin, Mapping):
        return _no_mapping(value, inner)
    if origin.__module__ == "collections.abc" and issubclass(origin, Iterable):
        return _no_sequence(value, inner, Sequence if issubclass(origin, Sequence) else Collection)
    return _no_instance(value, origin)


_PLAIN: Final[Mapping[Any, tuple[Callable[[Any], bool], str]]] = {
    None: (lambda value: value is None, "None"),
    type(None): (lambda value: value is None, "None"),
    bool: (lambda value: isinstance(value, (bool, np.bool_)), "True or False"),
    int: (lambda value: _is_whole(value) and abs(int(value)) < 2**31, "a whole number of at most 31 bits"),
    float: (lambda value: _is_number(value), "a finite number"),
    str: (lambda value: isinstance(value, str) and value.isprintable(), "printable text"),
}


def _no_instance(value: Any, hint: Any) -> str:
    if hint in _PLAIN:
        fits, said = _PLAIN[hint]
        return "" if fits(value) else said
    if not isinstance(hint, type):
        return ""
    try:
        return "" if isinstance(value, hint) else f"an object of type {hint.__name__}"
    except TypeError:  # a protocol that can't be asked
        return ""


def _is_whole(value: Any) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _no_array(value: Any, inner: tuple[Any, ...]) -> str:
    plain = bool in inner or "bool" in str(inner)
    try:
        array = np.asarray(value, dtype=np.bool_ if plain else np.float64)
    except (TypeError, ValueError, OverflowError):
        return "an array of numbers"
    return "" if array.ndim and np.isfinite(array).all() else "an array of finite numbers"


def _no_tuple(value: Any, inner: tuple[Any, ...]) -> str:
    if len(inner) == 2 and inner[1] is Ellipsis:
        return _no_sequence(value, inner[:1], Sequence)
    if not _is_sequence(value, inner[:1], Sequence) or len(value) != len(inner):
        return f"a tuple of {len(inner)}"
    said = next((s for one, hint in zip(value, inner, strict=True) if (s := misfit(one, hint))), "")
    return f"in it {said}" if said else ""


def _no_sequence(value: Any, inner: tuple[Any, ...], kind: type) -> str:
    if not _is_sequence(value, inner, kind):
        return "a sequence, such as a tuple"
    said = next((s for one in value if inner and (s := misfit(one, inner[0]))), "")
    return f"a sequence, and in it {said}" if said else ""


def _is_sequence(value: Any, inner: tuple[Any, ...], kind: type) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim > 0 and inner in ((float,), (int,), (bool,))
    return isinstance(value, kind) and not isinstance(value, (str, bytes, Mapping))


def _no_mapping(value: Any, inner: tuple[Any, ...]) -> str:
    if not isinstance(value, Mapping):
        return "a dict"
    key, item = inner if len(inner) == 2 else (Any, Any)
    said = next((s for one in value if (s := misfit(one, key))), "")
    if said:
        return f"a dict whose keys are {said}"
    said = next((s for one in value.values() if (s := misfit(one, item))), "")
    return f"a dict whose values are {said}" if said else ""


def _shown(value: Any) -> str:
    try:
        return reprlib.repr(value).encode("ascii", "backslashreplace").decode()
    except Exception:
        return f"something of type {type(value).__name__}"
