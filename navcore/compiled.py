"""Numba decorators of the compiled kernels, whose machine code is kept on disk
(`navcore.kernel_cache`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn, TypeVar, cast

import numba
from numba.core.registry import CPUDispatcher
from numba.extending import intrinsic as numba_intrinsic

from navcore.kernel_cache import SharedCache

Function = TypeVar("Function", bound=Callable[..., object])


class NestedKernel(CPUDispatcher):
    """A kernel that has no entry for Python, where a call would end the process."""

    def __call__(self, *_args: object, **_named: object) -> NoReturn:
        """Raise TypeError."""
        raise TypeError(f"{self.py_func.__name__} can be called by compiled functions only")


def _cached(function: Function, **options: Any) -> Function:
    options["no_cfunc_wrapper"] = True  # no kernel is handed to C
    dispatcher = numba.njit(nogil=True, **options)(function)
    if isinstance(dispatcher, CPUDispatcher):  # not with NUMBA_DISABLE_JIT
        cache = SharedCache(dispatcher.py_func)  # type: ignore[no-untyped-call]
        dispatcher._cache = cache  # type: ignore[attr-defined]
    return cast(Function, dispatcher)


def _nested(function: Function, **options: Any) -> Function:
    kernel = _cached(function, no_cpython_wrapper=True, **options)
    if isinstance(kernel, CPUDispatcher):
        kernel.__class__ = NestedKernel  # type: ignore[assignment]
    return kernel


def compiled(function: Function) -> Function:
    """Compile a function that Python calls, with a disk cache and without holding the interpreter
    lock."""
    return _cached(function)


def nested(function: Function) -> Function:
    """Compile a function that only compiled functions call: an entry for Python, which unpacks its
    arguments, would take a fifth of the time for compiling."""
    return _nested(function)


def finite(function: Function) -> Function:
    """Compile a nested function that meets neither NaN nor the sign of zero: a minimum is one
    instruction then."""
    return _nested(function, fastmath={"nnan", "nsz"})


def lean(function: Function) -> Function:
    """Compile a nested function that makes no arrays, without reference counting, which would take
    most of its time."""
    return _nested(function, _nrt=False)


def inlined(function: Function) -> Function:
    """Compile a step of an inner loop into its callers, because passing an array takes seven
    arguments."""
    return _nested(function, _nrt=False, forceinline=True)


def instruction(function: Callable[..., Any]) -> Any:
    """Make a generator of LLVM code callable from compiled functions."""
    return numba_intrinsic(function)
