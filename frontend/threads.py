"""Threads: many items worked on at once, the results in the order of the items."""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
_AHEAD = 4  # items a thread that wait for it: enough that none idles, few enough to be held


def in_order(work: Callable[[_Item], _Result], items: Iterable[_Item]) -> Iterator[_Result]:
    """Work on items in as many threads as there are processors.

    Parameters
    ----------
    work : callable
        What is done with an item. Threads gain where it lets go of the interpreter's lock, as kernels, transforms and
        array arithmetic do; it must give the same whichever thread runs it.
    items : iterable
        Taken one by one by the calling thread, little ahead of the results.

    Yields
    ------
    result
        One an item, in their order. An error comes at its item's turn; where the caller stops, no further item begins.
    """
    n = os.cpu_count() or 1
    waiting: deque[Future[_Result]] = deque()
    with ThreadPoolExecutor(max_workers=n) as pool:
        try:
            for item in items:
                waiting.append(pool.submit(work, item))
                if len(waiting) > _AHEAD * n:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()
