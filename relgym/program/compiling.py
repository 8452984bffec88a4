"""How the kernel is compiled: once, as a whole.

numba would optimise and assemble each of the kernel's functions with all that it calls, and these once more in every
function that calls them. Here they are lowered, and optimised and assembled once, in the function that is entered from
Python. What that leaves is the same code, in a fraction of the time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.typed_passes import NoPythonSupportedFeatureValidation

__all__ = ["compiled", "entered"]

_F = TypeVar("_F", bound=Callable[..., Any])


class _Part(JITCodeLibrary):  # type: ignore[misc]
    """Code that goes into the library of whoever calls it, and is nothing alone.

    Of a numba that calls what is left out here by other names, it is optimised and assembled all the same.
    """

    @property
    def codegen(self) -> Any:
        """Who makes code; of what isn't there alone nothing is to be noted."""
        return _Silent(self._codegen)

    def _optimize_final_module(self) -> None:
        """Leave it to the caller's library."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _Silent:
    """What makes code, but for noting where the globals of a function lie: read from disk, parts have none either."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, env: Any) -> None:
        """Do nothing."""


@register_pass(mutates_CFG=False, analysis_only=False)
class _AsPart(FunctionPass):  # type: ignore[misc]
    """Have a function lowered into a `_Part`."""

    _name = "relgym_as_part"

    def __init__(self) -> None:
        FunctionPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Make the library that the function is lowered into."""
        state.library = _Part(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return False


class _PartCompiler(CompilerBase):  # type: ignore[misc]
    def define_pipelines(self) -> list[Any]:
        """The usual passes, and `_AsPart` before lowering."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_AsPart, NoPythonSupportedFeatureValidation)
        passes.finalize()
        return [passes]


def compiled(function: _F) -> _F:
    """Compile together with what calls it; nothing else can."""
    found: _F = numba.njit(
        error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=_PartCompiler
    )(function)
    return found


def entered(function: _F) -> _F:
    """Compile when first called; keep what was compiled on disk, where some folder can be written to."""
    try:
        found: _F = numba.njit(error_model="numpy", no_cfunc_wrapper=True, cache=True)(function)
    except RuntimeError:  # no folder for the cache
        found = numba.njit(error_model="numpy", no_cfunc_wrapper=True)(function)
    return found
