"""Numba decorators of the compiled kernels, and the folder that their machine code is cached in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.extending import intrinsic as numba_intrinsic

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile, keep the result on disk, let other threads run meanwhile."""
    return cast(Function, numba.njit(cache=True, nogil=True)(function))


def lean(function: Function) -> Function:
    """The same for functions that make no arrays: they need not count references, which would take most of their time."""
    return cast(Function, numba.njit(cache=True, nogil=True, _nrt=False)(function))  # type: ignore[call-overload]


def inlined(function: Function) -> Function:
    """The same for steps of an inner loop: compiled into their callers, since an array costs seven arguments to hand on."""
    return cast(
        Function,
        numba.njit(cache=True, nogil=True, _nrt=False, forceinline=True)(function),  # type: ignore[call-overload]
    )


def instruction(function: Callable[..., Any]) -> Any:
    """Make a function that writes machine-independent code callable from compiled ones."""
    return numba_intrinsic(function)
