"""Prepare things ahead of time in threads, in their order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

A = TypeVar("A")
B = TypeVar("B")


def prefetching(threads: int) -> Callable[[Callable[[A], B], Iterable[A]], Iterator[B]]:
    """Like `map`, but that many threads work ahead by at most two results each; 0 threads is `map`
    itself.

    An error of the function is raised where its result would have come.
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
