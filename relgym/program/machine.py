"""The kernel as machine code: compiled once on a machine, in a process of its own, and kept in a file.

The file lies where Python keeps what it compiles (`__pycache__`), else in the user's folder for such things; its name
says of which text, compiler and processor it is. Compiling takes a process of two seconds and 130 MB, which ends by
itself; it proves what it made on an empty program before anybody else loads it. Loading takes 0.03 to 0.06 s, nearly
all of it the import of llvmlite.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import importlib.util
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.program.compiling import Array, Type, assembly

__all__ = ["SEE", "Machine", "build", "entries", "folders", "main", "make", "optimized"]

_RUN, _ROLL, SEE = "relgym_run", "relgym_roll", "relgym_see"
_ADDRESS, _NUMBER = ctypes.c_void_p, ctypes.c_int64
_RUNNING: Final = ctypes.CFUNCTYPE(_NUMBER, _ADDRESS, _NUMBER, *(ctypes.c_bool,) * 3, *(_ADDRESS,) * 6)
_ROLLING: Final = ctypes.CFUNCTYPE(
    _NUMBER, _ADDRESS, *(_NUMBER,) * 3, ctypes.c_bool, *(_NUMBER,) * 2, *(_ADDRESS,) * 4
)
_SEEING: Final = ctypes.CFUNCTYPE(_NUMBER, _ADDRESS, _NUMBER, *(_ADDRESS,) * 6)
_DIGEST: Final = 32
"""Length of the digest that a file begins with."""

_SOURCES: Final = ("compiling.py", "kernel.py", "machine.py", "records.py", "tape.py")
"""What the machine code depends on."""


class Machine:
    """The kernel, loaded.

    Parameters
    ----------
    code
        An object file, as `build` makes it.
    """

    def __init__(self, code: bytes) -> None:
        import llvmlite.binding as llvm

        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        self.call = _RUNNING(self._engine.get_function_address(_RUN))
        """`relgym.program.kernel.run` on addresses, of arrays that lie in one piece."""
        self._roll = _ROLLING(self._engine.get_function_address(_ROLL))
        self.see = _SEEING(self._engine.get_function_address(SEE))
        """`relgym.program.kernel.see`, likewise."""

    def run(
        self,
        space: NDArray[Any],
        vectors: NDArray[np.float64],
        following: NDArray[np.float64],
        told: tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]],
        *,
        settling: bool,
    ) -> int:
        """A step of many scenes.

        Parameters
        ----------
        space
            Work space with the tape in it.
        vectors, following
            State vectors and where the next ones go, shape ``(n, width)``.
        told
            Where outcomes (int8), modes (int64) and margins go, shape ``(n, answers)``, and how probably values are
            right and how far off they may be, shape ``(2, n, answers)``; the last of any shape unless `settling`.
        settling
            Whether how right predictions were decides who gives a value.

        Returns
        -------
        0, or why some scene can't be.
        """
        vectors = np.ascontiguousarray(vectors, dtype=np.float64)
        places = (each.ctypes.data for each in (space, vectors, following, *told))
        return int(self.call(next(places), len(vectors), settling, False, True, *places))

    def roll(
        self,
        space: NDArray[Any],
        vectors: NDArray[np.float64],
        steps: int,
        actions: NDArray[np.float64],
        first: int,
        *,
        settling: bool,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Many steps of many scenes, each from what was predicted last.

        Parameters
        ----------
        space
            Work space with the tape in it.
        vectors
            State vectors, shape ``(n, width)``.
        steps
            How many steps.
        actions
            The numbers of actions, shape ``(steps, n, k)``; k is 0 where those in the state vectors stay.
        first
            Column of their first one.
        settling
            As for `run`.

        Returns
        -------
        The last state vectors of which all was predicted, and of how many steps that was; below 0 of a scene that can't
        be.
        """
        vectors, actions = (np.ascontiguousarray(each, dtype=np.float64) for each in (vectors, actions))
        following, lasted = np.empty(vectors.shape), np.empty(len(vectors), dtype=np.int64)
        numbers = len(vectors), len(vectors), steps, settling, first, actions.shape[-1]
        places = (each.ctypes.data for each in (space, actions, vectors, following, lasted))
        self._roll(next(places), *numbers, *places)
        return following, lasted


def _target() -> Any:
    """What LLVM knows of this machine; a new record each time, since who runs code makes it their own."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=2,
        reloc="default",
        codemodel="jitdefault",
    )


def make() -> Machine | None:
    """Load the kernel, which is compiled in another process if no file holds it; None: that failed."""
    name = _name()
    for folder in folders():
        code = _read(folder / name)
        if code is not None:
            return Machine(code)
    code = _built()
    if code is None:
        return None
    for folder in folders():
        with contextlib.suppress(OSError):
            _write(folder / name, code)
            break
    return Machine(code)


def folders() -> Iterator[Path]:
    """Where machine code may be kept: the first one that can be written to."""
    with contextlib.suppress(NotImplementedError):
        yield Path(importlib.util.cache_from_source(__file__)).parent
    with contextlib.suppress(RuntimeError):
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "relgym"


def _name() -> str:
    import llvmlite
    import llvmlite.binding as llvm

    here, found = Path(__file__).parent, hashlib.sha256()
    for source in _SOURCES:
        found.update((here / source).read_bytes())
    system = (llvmlite.__version__, llvm.get_default_triple(), llvm.get_host_cpu_name())
    found.update(repr((*system, llvm.get_host_cpu_features().flatten())).encode())
    return f"kernel-{found.hexdigest()[:16]}.o"


def _read(file: Path) -> bytes | None:
    """What a file holds, if it is whole."""
    try:
        content = file.read_bytes()
    except OSError:
        return None
    digest, code = content[:_DIGEST], content[_DIGEST:]
    return code if hashlib.sha256(code).digest() == digest else None


def _write(file: Path, code: bytes) -> None:
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    number, name = tempfile.mkstemp(dir=file.parent)
    try:
        with os.fdopen(number, "wb") as stream:
            stream.write(hashlib.sha256(code).digest() + code)
        os.replace(name, file)
    except BaseException:
        os.unlink(name)
        raise


def _built() -> bytes | None:
    """What a process of its own compiles, or this one, if there is no Python to begin another; None: it failed."""
    if not sys.executable or getattr(sys, "frozen", False):
        return build()
    code = f"import sys; sys.path[:] = {sys.path!r}; from relgym.program.machine import main; main()"
    quiet: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    try:
        done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, check=False, **quiet)
    except OSError:
        return None
    return done.stdout if done.returncode == 0 else None


def main() -> None:
    """Compile the kernel, prove that it runs, and write it to the standard output."""
    code = build()
    machine, space = Machine(code), _empty()
    nothing = np.empty((1, 0))
    if machine.run(space, nothing, nothing, (nothing,) * 4, settling=False) != 0:
        raise SystemExit(1)
    sys.stdout.buffer.write(code)


def _empty() -> NDArray[Any]:
    """A work space with the tape of a program that says nothing."""
    from relgym.program.tape import SPACE

    return np.zeros(1, dtype=SPACE)


def build() -> bytes:
    """Compile the kernel here and now; an object file."""
    from relgym.program.tape import SPACE

    module, target = _optimized(assembly(entries(), SPACE), _target())
    return bytes(target.emit_object(module))


def optimized(text: str, processor: str) -> str:
    """LLVM's assembly for some kind of processor, which it names, as the assembly of that kind."""
    import llvmlite.binding as llvm

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(llvm.parse_assembly(text).triple)
    module, machine = _optimized(text, target.create_target_machine(cpu=processor, opt=3))
    return str(machine.emit_assembly(module))


def _optimized(text: str, target: Any) -> tuple[Any, Any]:
    import llvmlite.binding as llvm

    module = llvm.parse_assembly(text)
    module.verify()
    tuning = llvm.create_pipeline_tuning_options(speed_level=2)
    # One scene at a time, few of anything: vectors of LLVM's and loops written out cost a second and win nothing.
    tuning.loop_vectorization = tuning.slp_vectorization = tuning.loop_unrolling = False
    builder = llvm.create_pass_builder(target, tuning)
    builder.getModulePassManager().run(module, builder)
    return module, target


def _flat(elements: str) -> tuple[Type, ...]:
    """Types of arrays, none of which overlaps another one, by those of their entries."""
    return tuple(Array(element, (0,), f"given {k}") for k, element in enumerate(elements.split()))


def entries() -> dict[str, tuple[Callable[..., Any], tuple[Type, ...]]]:
    """What is compiled, and the types of its arguments, by the names under which others call it."""
    from relgym.program import kernel

    return {
        _RUN: (kernel.run, ("space", "i64", "i1", "i1", "i1", *_flat("double double i8 i64 double double"))),
        _ROLL: (
            kernel.roll,
            ("space", *("i64",) * 3, "i1", *("i64",) * 2, *_flat("double double double i64")),
        ),
        "relgym_forget": (kernel.forget, ("space",)),
        SEE: (kernel.see, ("space", "i64", *_flat("double i8 i8 i8 double i64"))),
    }
