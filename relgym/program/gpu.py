"""The kernel on a graphics card: the same functions, a thread for each scene.

What `relgym.program.compiling` writes is handed to LLVM's back end for Nvidia's cards instead of the processor's; CuPy
loads it and looks after the card's memory. Arithmetic is IEEE's there, too, and nothing is contracted: all but sines
and cosines (`relgym.program.trigonometry`) have the same bits. A thread works in a space of its own, made to measure,
and all read the one tape.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.program.compiling import Variant, assembly
from relgym.program.machine import SEE, entries, optimized
from relgym.program.tape import Sizes, space_of
from relgym.program.trigonometry import cosine, sine

__all__ = ["Card", "CardError", "ptx", "roomy"]

OLDEST: Final = "sm_75"
"""The oldest cards that today's drivers compile for; they make machine code for newer ones of the same text."""

THREADS, GROUPS = 128, 16
"""Threads of a group, and groups for each multiprocessor at most: hardly any steps a second depend on them."""

MANY: Final = 1 << 20
"""Scenes that lie on a card at once, at most: a million of 65 numbers are 0.5 GB, and as many next ones."""


class CardError(Exception):
    """There is no card, or nothing to use it with: why, and what to do."""


def roomy(sizes: Sizes) -> Sizes:
    """Sizes of a work space for programs of about the same size: powers of two."""
    return Sizes(*(1 << max(size - 1, 0).bit_length() for size in sizes))


def own_space(sizes: Sizes) -> np.dtype[np.void]:
    """Where a thread works on a scene: a space without a tape, and without memory of other scenes."""
    return space_of(sizes._replace(code=1, numbers=1, remembered=1))


def variant(sizes: Sizes, address_space: int) -> Variant:
    """What is to be understood otherwise than for the processor: nothing is remembered, and the tape lies elsewhere."""
    shared = (
        f"addrspacecast (ptr addrspace({address_space}) @relgym_%s to ptr)" if address_space else "@relgym_%s"
    )
    return Variant(
        constants={"REMEMBERED": 1, "REMEMBERED_MODES": 0, "MOST_CONTACTS": sizes.contacts},
        elsewhere={name: shared % name for name in ("code", "numbers")},
        instead={math.sin: sine, math.cos: cosine},
        lanes=False,
    )


def text(sizes: Sizes, address_space: int) -> str:
    """LLVM's assembly of the kernel in a work space of some sizes, with the tape in global variables."""
    place = f"addrspace({address_space}) " if address_space else ""
    tape = (
        f"@relgym_code = {place}externally_initialized global [{sizes.code} x i64] zeroinitializer, align 16\n"
        f"@relgym_numbers = {place}externally_initialized global [{sizes.numbers} x double] zeroinitializer, align 16\n"
    )
    needed = {name: entry for name, entry in entries().items() if name != SEE}
    return tape + assembly(needed, own_space(sizes), variant(sizes, address_space))


def ptx(sizes: Sizes, processor: str = OLDEST) -> str:
    """The kernel in the language of Nvidia's cards."""
    threads = _THREADS.format(size=own_space(sizes).itemsize)
    return optimized(f'target triple = "nvptx64-nvidia-cuda"\n{text(sizes, 1)}\n{threads}', processor)


_THREAD: Final = """
  %space = alloca [{size} x i8], align 16
  call void @llvm.memset.p0.i64(ptr align 16 %space, i8 0, i64 {size}, i1 false)
  call void @relgym_forget(ptr %space)
  %group = call i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
  %size = call i32 @llvm.nvvm.read.ptx.sreg.ntid.x()
  %groups = call i32 @llvm.nvvm.read.ptx.sreg.nctaid.x()
  %place = call i32 @llvm.nvvm.read.ptx.sreg.tid.x()
  %ahead = mul i32 %group, %size
  %mine = add i32 %ahead, %place
  %all = mul i32 %groups, %size
  %from = zext i32 %mine to i64
  %by = zext i32 %all to i64
  %settles = icmp ne i64 %settling, 0
  %width = load i64, ptr addrspace(1) @relgym_code
  br label %head
head:
  %i = phi i64 [ %from, %start ], [ %next, %body ]
  %more = icmp slt i64 %i, %n
  br i1 %more, label %body, label %end
body:
  %next = add i64 %i, %by
  %row = mul i64 %i, %width
  %now = getelementptr double, ptr %vectors, i64 %row
  %after = getelementptr double, ptr %following, i64 %row
"""

_THREADS: Final = (
    """
declare i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.ntid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.nctaid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.tid.x()
declare void @llvm.memset.p0.i64(ptr, i8, i64, i1)

define ptx_kernel void @relgym_roll_each(i64 %n, i64 %settling, i64 %steps, i64 %first, i64 %count, ptr %actions,
  ptr %vectors, ptr %following, ptr %lasted) {{
start:"""
    + _THREAD
    + """
  %skipped = mul i64 %i, %count
  %taken = getelementptr double, ptr %actions, i64 %skipped
  %here = getelementptr i64, ptr %lasted, i64 %i
  call void @relgym_roll(ptr %space, i64 1, i64 %n, i64 %steps, i1 %settles, i64 %first, i64 %count, ptr %taken,
    ptr %now, ptr %after, ptr %here)
  br label %head
end:
  ret void
}}

define ptx_kernel void @relgym_run_each(i64 %n, i64 %settling, i64 %answers, ptr %vectors, ptr %following,
  ptr %outcomes, ptr %modes, ptr %margins, ptr %sure, ptr %wrong) {{
start:"""
    + _THREAD
    + """
  %skipped = mul i64 %i, %answers
  %twice = shl i64 %skipped, 1
  %outcome = getelementptr i8, ptr %outcomes, i64 %skipped
  %mode = getelementptr i64, ptr %modes, i64 %skipped
  %margin = getelementptr double, ptr %margins, i64 %skipped
  %known = getelementptr double, ptr %sure, i64 %twice
  %bad = call i64 @relgym_run(ptr %space, i64 1, i1 %settles, i1 false, i1 true, ptr %now, ptr %after, ptr %outcome,
    ptr %mode, ptr %margin, ptr %known)
  %here = getelementptr i64, ptr %wrong, i64 %i
  store i64 %bad, ptr %here
  br label %head
end:
  ret void
}}
"""
)
"""A thread takes one scene after the other, in a work space of its own."""


class Card:
    """A graphics card with the kernel on it, for programs of some sizes.

    Parameters
    ----------
    sizes
        What a program needs; one that needs more takes a new one.

    Raises
    ------
    CardError
        There is no card, or no CuPy, or the program is too large for it.
    """

    def __init__(self, sizes: Sizes) -> None:
        self._cupy = cupy = _library()
        self.sizes = roomy(sizes)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "kernel.ptx"
            file.write_text(ptx(self.sizes))
            module = cupy.RawModule(path=str(file))
            try:
                self._roll, self._run = map(module.get_function, ("relgym_roll_each", "relgym_run_each"))
            except cupy.cuda.driver.CUDADriverError as error:
                raise CardError(f"the card refuses a program of this size: {error}") from None
        self._code = cupy.ndarray((self.sizes.code,), np.int64, module.get_global("relgym_code"))
        self._numbers = cupy.ndarray((self.sizes.numbers,), np.float64, module.get_global("relgym_numbers"))
        self._most = GROUPS * cupy.cuda.Device().attributes["MultiProcessorCount"]

    def fits(self, sizes: Sizes) -> bool:
        """Whether a program of some sizes can be run."""
        return all(size <= most for size, most in zip(sizes, self.sizes, strict=True))

    def roll(
        self,
        tape: tuple[NDArray[np.int64], NDArray[np.float64]],
        vectors: NDArray[np.float64],
        steps: int,
        actions: NDArray[np.float64],
        first: int,
        *,
        settling: bool,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """As `relgym.program.machine.Machine.roll`, of the two arrays of a tape."""
        self._lay(tape)
        found = [
            self._rolled(vectors[p], steps, actions[:, p], first, settling) for p in self._parts(len(vectors))
        ]
        return np.concatenate([after for after, _ in found]), np.concatenate([lasted for _, lasted in found])

    def _rolled(
        self,
        vectors: NDArray[np.float64],
        steps: int,
        actions: NDArray[np.float64],
        first: int,
        settling: bool,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        n, cupy = len(vectors), self._cupy
        now, taken = cupy.asarray(vectors), cupy.asarray(np.ascontiguousarray(actions))
        after, lasted = cupy.empty_like(now), cupy.empty(n, dtype=np.int64)
        numbers = map(np.int64, (n, settling, steps, first, actions.shape[-1]))
        self._roll(self._grid(n), (THREADS,), (*numbers, taken, now, after, lasted))
        return cupy.asnumpy(after), cupy.asnumpy(lasted)

    def run(
        self,
        tape: tuple[NDArray[np.int64], NDArray[np.float64]],
        vectors: NDArray[np.float64],
        following: NDArray[np.float64],
        told: tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]],
        *,
        settling: bool,
    ) -> int:
        """As `relgym.program.machine.Machine.run`, of the two arrays of a tape."""
        outcomes, modes, margins, sure = told
        self._lay(tape)
        return max(
            self._ran(vectors[p], following[p], (outcomes[p], modes[p], margins[p], sure[:, p]), settling)
            for p in self._parts(len(vectors))
        )

    def _ran(
        self,
        vectors: NDArray[np.float64],
        following: NDArray[np.float64],
        told: tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]],
        settling: bool,
    ) -> int:
        n, cupy = len(vectors), self._cupy
        outcomes, modes, margins, sure = told
        now, answers = cupy.asarray(vectors), outcomes.shape[1]
        places = [cupy.empty(each.shape, each.dtype) for each in (following, outcomes, modes, margins)]
        known, wrong = cupy.empty((n, 2, answers)), cupy.empty(n, dtype=np.int64)
        numbers = map(np.int64, (n, settling, answers))
        self._run(self._grid(n), (THREADS,), (*numbers, now, *places, known, wrong))
        for to, of in zip((following, outcomes, modes, margins), places, strict=True):
            to[:] = cupy.asnumpy(of)
        if settling:
            sure[:] = cupy.asnumpy(known).swapaxes(0, 1)
        return int(cupy.asnumpy(wrong).max(initial=0))

    def _lay(self, tape: tuple[NDArray[np.int64], NDArray[np.float64]]) -> None:
        for place, part in zip((self._code, self._numbers), tape, strict=True):
            place[: len(part)].set(part)

    def _parts(self, n: int) -> list[slice]:
        """Scenes that lie on the card together, one part after the other."""
        return [slice(k, k + MANY) for k in range(0, max(n, 1), MANY)]

    def _grid(self, n: int) -> tuple[int]:
        return (max(1, min(-(-n // THREADS), self._most)),)


def _library() -> Any:
    """CuPy, if there is a card that it can use."""
    try:
        import cupy
    except ImportError as error:
        raise CardError(
            f"{error}: pip install cupy-cuda13x, or the one for your driver's version of CUDA"
        ) from None
    try:
        cupy.cuda.Device().use()
    except (cupy.cuda.runtime.CUDARuntimeError, cupy.cuda.driver.CUDADriverError) as error:
        raise CardError(f"no card that can be used: {error}") from None
    return cupy
