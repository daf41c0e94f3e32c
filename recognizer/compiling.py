"""How kernels are compiled and kept.

A kernel is a function that numba compiles. Three things differ from `numba.njit`. What kernels call
is compiled as `linking` has it. Arguments that a kernel hands to another as constants are typed as
what they are, a number or a truth value: numba compiles a callee anew for each constant. And what
is compiled is kept under a stamp that covers all kernels, see `kernel_store`.
"""

# numba's inner parts say little of their types.
# pyright: reportIncompatibleMethodOverride=false, reportAttributeAccessIssue=false
# pyright: reportPrivateImportUsage=false

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import Any

from numba.core import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.options import DefaultOptions
from numba.core.registry import CPUDispatcher

from .kernel_store import kernel_folder, stamp
from .linking import PartCompiler, WholeCompiler, rebuilt
from .preparing import COMPILES_HERE, prepare, tell_compiled


class _Locator(_CacheLocator):
    """Says where one kernel is kept."""

    def __init__(self, py_func: Callable[..., Any], py_file: str) -> None:
        self._py_file = py_file
        self._place = f"{py_func.__module__}-{py_func.__code__.co_firstlineno}"

    def get_cache_path(self) -> str:
        return str(kernel_folder())

    def get_source_stamp(self) -> str:
        return stamp()

    def get_disambiguator(self) -> str:
        return self._place

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _Locator:
        return cls(py_func, py_file)


class _Kept(CompileResultCacheImpl):
    _locator_classes = [_Locator]  # noqa: RUF012

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        return rebuilt(target_context, payload)


class _Cache(FunctionCache):
    """What is kept of one kernel; the first one that is missing has all of them compiled."""

    _impl_class = _Kept

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        # Past what numba gets ready to compile, which takes as long as to load a kernel.
        found = self._load_overload(sig, target_context)
        if found is None and COMPILES_HERE not in os.environ and prepare():
            found = self._load_overload(sig, target_context)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        # A folder that was prepared for others, or a full disk: it is compiled again next time.
        with suppress(OSError):
            super().save_overload(sig, data)


class _PartOfOthers(CPUDispatcher):
    """A kernel as other kernels call it."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """The types of a call, of which no argument is a constant."""
        named = {name: types.unliteral(value) for name, value in kws.items()}
        return super().get_call_template(tuple(map(types.unliteral, args)), named)

    def compile(self, sig: Any) -> Any:
        """Compile for given types, and say so."""
        known = len(self.overloads)
        handle = super().compile(sig)
        if len(self.overloads) > known:
            tell_compiled(self.py_func.__name__)
        return handle


class Kernel(CPUDispatcher):
    """A kernel as Python calls it."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        """Compile a function when it is called, with options of `numba.njit`."""
        # A wrapper for calls through pointers, which nobody makes, takes as long as the kernel.
        options = {"nopython": True, "boundscheck": None, "no_cfunc_wrapper": True, **options}
        super().__init__(function, targetoptions=options, pipeline_class=WholeCompiler)
        if kernel_folder() is not None:
            self._cache = _Cache(function)

    @cached_property
    def _part(self) -> _PartOfOthers:
        """The same for other kernels, of which most are never called while they are kept."""
        options = {**self.targetoptions, "no_cpython_wrapper": True}
        return _PartOfOthers(self.py_func, targetoptions=options, pipeline_class=PartCompiler)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """The types of a call by another kernel."""
        return self._part.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        """What another kernel calls."""
        return self._part.get_overload(sig)


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Kernel]:
    """Compiles a kernel with options of `numba.njit`."""

    return lambda function: Kernel(function, options)


kernel = compiled()
"""Compiles a kernel that may make arrays."""

inlined = compiled(inline="always")
"""Compiles a small kernel into each of its callers."""

# numba counts references to arrays with atomic instructions, at each tuple unpacked and each row
# passed on: more than half of a search's time. Its own sorting kernels leave the counting out with
# this option, which has no public name; a numba without it counts.
_UNCOUNTED: dict[str, Any] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}

borrowing = compiled(**_UNCOUNTED)
"""Compiles a kernel that makes no array and returns none: its callers keep all that it is given."""

_VECTORISED: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "nnan", "nsz"}}

vectorised = compiled(**_VECTORISED, **_UNCOUNTED)
"""Compiles a borrowing kernel whose inner loops are to become vector instructions: nothing divides
by zero or makes a NaN, no sign of a zero matters, products and sums may be contracted."""
