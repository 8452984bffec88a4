"""How the kernel is compiled: once, as a whole.

numba would optimise and assemble each of the kernel's functions with all that it calls, and these once more in every
function that calls them. Here they are lowered, and optimised and assembled once, in the function that is entered from
Python. What that leaves is the same code, in a fraction of the time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numba
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.typed_passes import NoPythonSupportedFeatureValidation

__all__ = ["compiled", "entered"]

_F = TypeVar("_F", bound=Callable[..., Any])


class _Part(JITCodeLibrary):
    """Code that goes into the library of whoever is entered, and is nothing alone.

    Of a numba that calls what is left out here by other names, it is optimised and assembled all the same.
    """

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self._whole: Any = None

    @property
    def codegen(self) -> Any:
        """Who makes code; of what isn't there alone nothing is to be noted."""
        return _Unnoted(self._codegen)

    def finalize(self) -> None:
        """Take nothing more in; what this calls is linked where it is entered."""
        self._raise_if_finalized()
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalize_dynamic_globals()
        self._finalized = True

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _get_module_for_linking(self) -> Any:
        """The part and all that it calls, each once."""
        if self._whole is None:
            self._whole = super()._get_module_for_linking().clone()
            for library in self._called({id(self)}):
                own = CPUCodeLibrary._get_module_for_linking(library)
                self._whole.link_in(own, preserve=True)
        return self._whole

    def _called(self, seen: set[int]) -> Iterator[CPUCodeLibrary]:
        """All libraries that this one needs."""
        for library in self._linking_libraries:
            if id(library) not in seen:
                seen.add(id(library))
                yield library
                if isinstance(library, _Part):
                    yield from library._called(seen)


class _Unnoted:
    """What makes code, but for noting where the globals of a function lie: read from disk, parts have none either."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, env: Any) -> None:
        """Do nothing."""


@register_pass(mutates_CFG=False, analysis_only=False)
class _AsPart(FunctionPass):
    """Have a function lowered into a `_Part`."""

    _name = "relgym_as_part"

    def __init__(self) -> None:
        FunctionPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Make the library that the function is lowered into."""
        state.library = _Part(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return False


class _PartCompiler(CompilerBase):
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
