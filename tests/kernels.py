"""Calls of kernels that only compiled functions can call."""

from __future__ import annotations

from typing import Any, TypeVar

import numba

Kernel = TypeVar("Kernel")


def from_python(kernel: Kernel) -> Kernel:
    """Return a function for Python that calls a nested kernel."""

    def call(*values: Any) -> Any:
        return kernel(*values)  # type: ignore[operator]

    return numba.njit(call)  # type: ignore[no-any-return]
