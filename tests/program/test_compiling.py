"""Functions as machine code do what they do as Python: each kind of statement, and the whole kernel."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_programs import by_kernel, made

from relgym.program import kernel
from relgym.program.compiling import Array, CompileError, assembly
from relgym.program.tape import encoded

SPACE = np.dtype([("a", np.int64, (3, 4)), ("b", np.float64, (4,)), ("h", np.uint64, (2,))], align=True)
TOP = np.uint64(0x9E3779B97F4A7C15)
SHIFT = np.uint64(7)
ENGINES: list[Any] = []
"""Kept alive."""


def compiled(function: Callable[..., Any], *types: str, result: Any = ctypes.c_int64) -> Callable[..., Any]:
    """A function of a space and numbers, as machine code."""
    llvm = pytest.importorskip("llvmlite.binding")
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    module = llvm.parse_assembly(assembly({"entry": (function, ("space", *types))}, SPACE))
    module.verify()
    engine = llvm.create_mcjit_compiler(module, llvm.Target.from_default_triple().create_target_machine())
    engine.finalize_object()
    ENGINES.append(engine)
    kinds = [ctypes.c_double if t == "double" else ctypes.c_int64 for t in types]
    call = ctypes.CFUNCTYPE(result, ctypes.c_void_p, *kinds)(engine.get_function_address("entry"))
    return lambda space, *values: call(space.ctypes.data, *values)


def fresh() -> np.ndarray[Any, Any]:
    space = np.zeros(1, SPACE)
    space["a"][0], space["b"][0] = np.arange(12).reshape(3, 4), [0.5, -1.5, math.inf, math.nan]
    return space


lanes = range


def pair(s, x):  # type: ignore[no-untyped-def]
    return s.b[x], x + 1


def row_sum(row, n):  # type: ignore[no-untyped-def]
    found = 0
    for k in range(n):
        found += row[k]
    return found


def statements(s, n):  # type: ignore[no-untyped-def]
    """Loops that skip and stop, parts of arrays, tuples, either of two values."""
    total, k = 0, 0
    while True:
        k += 1
        if k > n:
            break
        if k % 3 == 0:
            continue
        total += k
    for k in range(n - 1, -1, -2):
        total = 2 * total - k
    for k in lanes(min(n, 4)):
        total += s.a[2, k] * (k < 3)
    for each in (1, 3, 2):
        if each == 2 and n > 2:
            break
        total += s.a[each, 0] if each < 3 else 100
    i, j = (1, 2) if n > 3 else (2, 1)
    row = s.a[i]
    row[0] = s.a[j, 1] = total
    s.a[0, 3] += row_sum(s.a[j], 4) // 3
    b, following = pair(s, min(n, 1))
    if not (b > 0.0) or following == 2:
        total -= 7
    return total + (following << 2 | 1) + (-total >> 1) + abs(-n) + max(n, 2)


def numbers(s, x, y):  # type: ignore[no-untyped-def]
    """Floats, those that can't be compared among them."""
    s.b[0] = math.sqrt(abs(x)) + math.sin(y) * math.cos(x)
    s.b[1] = min(x, y) - max(y, x) / 2
    s.b[2] = np.round(x * 3) if math.isfinite(x) and x < y else -y
    return (x < y) + 2 * (x != x) + 4 * (x == y or not y > 0.0) + 8 * (0.0 <= x <= 1.0)


def hashes(s, n):  # type: ignore[no-untyped-def]
    """Whole numbers without a sign."""
    h = np.uint64(n) * TOP
    h = (h ^ (h >> SHIFT)) * TOP
    s.h[0] = ~h
    return np.int64(h & np.uint64(1023))


@given(st.integers(0, 9))
def test_statements(n: int) -> None:
    here, there = fresh(), fresh().view(np.recarray)
    assert STATEMENTS(here, n) == statements(there[0], n)
    assert here.tobytes() == there.tobytes()


@given(*[st.floats(-1e6, 1e6) | st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0])] * 2)
def test_numbers(x: float, y: float) -> None:
    here, there = fresh(), fresh().view(np.recarray)
    if math.isinf(x) or math.isinf(y):
        x, y = (v if math.isfinite(v) else math.nan for v in (x, y))
    assert NUMBERS(here, x, y) == numbers(there[0], np.float64(x), np.float64(y))
    np.testing.assert_array_equal(here["b"], there["b"])


@given(st.integers(0, 2**40))
def test_whole_numbers_without_a_sign(n: int) -> None:
    here, there = fresh(), fresh().view(np.recarray)
    with np.errstate(over="ignore"):
        assert HASHES(here, n) == hashes(there[0], np.int64(n))
    assert here.tobytes() == there.tobytes()


@pytest.mark.parametrize("seed", range(12))
def test_the_kernel_as_python(seed: int) -> None:
    """The kernel is plain Python, too, and says the same to the bit."""
    program, vectors = made(seed)
    vectors = vectors[:4]
    n, count = len(vectors), len(program.answers)
    space = encoded(program).space().view(np.recarray)
    after, sure = np.empty(vectors.size), np.full(2 * n * count, np.nan)
    outcomes, modes, margins = (
        np.empty(n * count, np.int8),
        np.empty(n * count, np.int64),
        np.empty(n * count),
    )
    settling = any(a.trust is not None for a in program.answers)
    with np.errstate(all="ignore"):
        assert not kernel.run(
            space[0], n, settling, False, True, vectors.ravel(), after, outcomes, modes, margins, sure
        )
    said = by_kernel(program, vectors)
    for mine, its in zip((after, outcomes, modes, margins, *sure.reshape(2, -1)), said, strict=True):
        np.testing.assert_array_equal(mine, its.ravel())


def unheard(s, n):  # type: ignore[no-untyped-def]
    return [n]


def rounded(s, n):  # type: ignore[no-untyped-def]
    k = 0
    k = n / 2
    return k


def unnamed(s, n):  # type: ignore[no-untyped-def]
    return nobody + n  # type: ignore[name-defined]  # noqa: F821


@pytest.mark.parametrize(
    ("function", "why"), [(unheard, r"\[n\]"), (rounded, "double where i64"), (unnamed, "the name nobody")]
)
def test_what_cannot_be_compiled_says_where(function: Callable[..., Any], why: str) -> None:
    with pytest.raises(CompileError, match=rf"{function.__name__}, line \d+: .*{why}"):
        assembly({"entry": (function, ("space", "i64"))}, SPACE)


def test_arrays_of_different_places_are_told_apart() -> None:
    text = assembly({"entry": (numbers, ("space", "double", "double"))}, SPACE)
    assert '!{!"b", !0, i64 0}' in text and "!tbaa" in text
    assert Array("i64", (3,), "a") != Array("i64", (3,), "b")


STATEMENTS, HASHES = compiled(statements, "i64"), compiled(hashes, "i64")
NUMBERS = compiled(numbers, "double", "double")
