"""Prefetching: compute items ahead of time in threads, in their order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

A = TypeVar("A")
B = TypeVar("B")


def prefetching(threads: int) -> Callable[[Callable[[A], B], Iterable[A]], Iterator[B]]:
    """Return a `map` whose threads work ahead by at most two results each; `map` itself for 0.

    An error of the function is raised in the position of its result.
    """

    def mapped(function: Callable[[A], B], items: Iterable[A]) -> Iterator[B]:
        rest = iter(items)
        with ThreadPoolExecutor(max_workers=threads, thread_name_prefix="prefetch") as pool:
            ahead: deque[Future[B]] = deque(
                pool.submit(function, item) for item in islice(rest, 2 * threads)
            )
            try:
                while ahead:
                    result = ahead.popleft().result()
                    ahead.extend(pool.submit(function, item) for item in islice(rest, 1))
                    yield result
            finally:
                for future in ahead:
                    future.cancel()

    return mapped if threads else map
