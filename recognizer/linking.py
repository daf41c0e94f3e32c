"""Kernels that kernels call, as parts to be linked.

numba optimises a callee and makes machine code of it, and does both again in each of its callers,
level by level. A part is typed and lowered once, and left at that: only what Python calls is
optimised, with all that is linked into it, and made machine code of. That halves the time it takes
to compile palpate.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult, compile_result
from numba.core.environment import lookup_environment


class PartLibrary(JITCodeLibrary):
    """Code that is linked into other code and never run by itself."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._codegen._scan_and_fix_unresolved_refs(self._final_module)
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """What is kept of it: there is no object code."""
        self._ensure_finalized()
        return self.name, "bitcode", self._final_module.as_bitcode()


class PartCompiler(Compiler):
    """Compiles parts."""

    def compile_extra(self, func: Any) -> CompileResult:
        """Lower a function, and stop there."""
        self.state.library = PartLibrary(self.state.targetctx.codegen(), func.__qualname__)
        self.state.flags.no_compile = True
        return _callable(super().compile_extra(func))


class WholeLibrary(JITCodeLibrary):
    """Code that Python calls, with its parts."""

    def _finalize_specific(self) -> None:
        super()._finalize_specific()
        # A part never ran, so that nobody has told its code where its constants are.
        for variable in self._final_module.global_variables:
            if variable.name.startswith("_ZN08NumbaEnv"):
                environment = lookup_environment(variable.name)
                if environment is not None:
                    self._codegen.set_env(variable.name, environment)


class WholeCompiler(Compiler):
    """Compiles what Python calls."""

    def compile_extra(self, func: Any) -> CompileResult:
        """Compile a function and its parts."""
        self.state.library = WholeLibrary(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(func)


def rebuilt_part(target_context: Any, kept: Any) -> CompileResult:
    """A part as it was kept."""
    (name, _, bitcode), described, environment, signature, *rest, referenced = kept
    library = PartLibrary(target_context.codegen(), name)
    library._final_module = llvm.parse_bitcode(bitcode)
    library._finalize_final_module()
    objectmode, lifted, annotation, reload_init = rest
    return _callable(
        compile_result(
            target_context=target_context,
            typing_context=target_context.typing_context,
            library=library,
            environment=environment,
            entry_point=None,
            fndesc=described,
            type_annotation=annotation,
            signature=signature,
            objectmode=objectmode,
            lifted=lifted,
            reload_init=reload_init,
            referenced_envs=referenced,
        )
    )


def _callable(part: CompileResult) -> CompileResult:
    """A part that callers find by a handle; nothing can be called through it from Python."""
    described = part.fndesc
    handle = _dynfunc.make_function(
        described.lookup_module(),
        described.qualname.split(".")[-1],
        "",
        0,
        part.environment,
        (part.library,),
    )
    part.target_context.insert_user_function(handle, described, [part.library])
    return part._replace(entry_point=handle)
