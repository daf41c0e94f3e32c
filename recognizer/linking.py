"""Kernels that kernels call, as parts to be linked.

numba optimises a callee and makes machine code of it, and does both again in each of its callers,
level by level. A part is typed and lowered once a process, and left at that: only what Python calls
is optimised, with all that is linked into it, and made machine code of. That halves the time it
takes to compile palpate. Parts aren't kept on disk: what is linked would depend on which process
came first, and the last digits of results on what is linked.
"""

# numba's inner parts say little of their types.
# pyright: reportIncompatibleMethodOverride=false, reportAttributeAccessIssue=false
# pyright: reportPrivateImportUsage=false

from __future__ import annotations

from typing import Any

from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult, compile_result
from numba.core.environment import lookup_environment
from numba.core.runtime import rtsys


class PartLibrary(JITCodeLibrary):
    """Code that is linked into other code and never run by itself."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._codegen._scan_and_fix_unresolved_refs(self._final_module)
        self._finalized = True


class PartCompiler(Compiler):
    """Compiles parts."""

    def compile_extra(self, func: Any) -> CompileResult:
        """Lower a function, and stop there."""
        self.state.library = PartLibrary(self.state.targetctx.codegen(), func.__qualname__)
        self.state.flags.no_compile = True
        part = super().compile_extra(func)
        if self.state.flags.fastmath:
            # Which products and sums are contracted must not depend on what calls them.
            code = part.library._final_module.get_function(part.fndesc.llvm_func_name)
            code.add_function_attribute("noinline")
        return _callable(part)


class WholeLibrary(JITCodeLibrary):
    """Code that Python calls, with its parts."""

    def serialize_using_object_code(self) -> tuple[str, str, Any]:
        """What is kept of it: machine code and the names in it, but nothing to link, which takes as
        long to read as all else."""
        self._ensure_finalized()
        everything = (*self._final_module.functions, *self._final_module.global_variables)
        names = tuple(symbol.name for symbol in everything if not symbol.is_declaration)
        return self.name, "object", (self._get_compiled_object(), names)

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


def rebuilt(target_context: Any, kept: Any) -> CompileResult:
    """What Python calls, as it was kept."""
    (name, _, (machine_code, names)), described, environment, *rest = kept
    rtsys.initialize(target_context)  # what allocates arrays
    library = WholeLibrary(target_context.codegen(), name)
    library.enable_object_caching()
    library._set_compiled_object(machine_code)
    library._finalize_final_module()
    library._codegen._engine._defined_symbols |= set(names)
    fields = ("signature", "objectmode", "lifted", "type_annotation", "reload_init")
    result = compile_result(
        target_context=target_context,
        typing_context=target_context.typing_context,
        library=library,
        entry_point=target_context.get_executable(library, described, environment),
        fndesc=described,
        environment=environment,
        **dict(zip((*fields, "referenced_envs"), rest, strict=True)),
    )
    for one in result.referenced_envs:
        library.codegen.set_env(one.env_name, one)
    return result


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
