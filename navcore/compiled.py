"""Numba decorators of the compiled kernels, whose machine code is kept on disk
(`navcore.kernel_cache`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core.dispatcher import Dispatcher
from numba.extending import intrinsic as numba_intrinsic

from navcore.kernel_cache import SharedCache

Function = TypeVar("Function", bound=Callable[..., object])


def _cached(function: Function, **options: Any) -> Function:
    dispatcher = numba.njit(nogil=True, **options)(function)
    if isinstance(dispatcher, Dispatcher):  # not with NUMBA_DISABLE_JIT
        cache = SharedCache(dispatcher.py_func)  # type: ignore[no-untyped-call]
        dispatcher._cache = cache  # type: ignore[attr-defined]
    return cast(Function, dispatcher)


def compiled(function: Function) -> Function:
    """Compile a function with a disk cache and without holding the interpreter lock."""
    return _cached(function)


def finite(function: Function) -> Function:
    """Compile a function that meets neither NaN nor the sign of zero: a minimum is one instruction
    then."""
    return _cached(function, fastmath={"nnan", "nsz"})


def lean(function: Function) -> Function:
    """Compile a function that makes no arrays, without reference counting, which would take most of
    its time."""
    return _cached(function, _nrt=False)


def inlined(function: Function) -> Function:
    """Compile a step of an inner loop into its callers, because passing an array takes seven
    arguments."""
    return _cached(function, _nrt=False, forceinline=True)


def instruction(function: Callable[..., Any]) -> Any:
    """Make a generator of LLVM code callable from compiled functions."""
    return numba_intrinsic(function)
