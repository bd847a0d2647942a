"""Processes for a library call: they work wherever it is made, a plain script or an interpreter's prompt too.

The standard pool runs the caller's main module again in each worker. A script without
`if __name__ == "__main__":` would there make the same call again, and break the pool; one that is piped in
cannot be run again at all. Workers made here know nothing of the main module. What a worker cannot do is
done in the calling process.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import current_process
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

_starting = threading.Lock()


@contextmanager
def _without_main() -> Iterator[None]:
    """An empty main module, which a child has no reason to run."""
    with _starting:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main


class _Worker(SpawnProcess):
    """A fresh interpreter that does not run the caller's main module."""

    def start(self) -> None:
        with _without_main():
            super().start()


class _WorkerContext(SpawnContext):
    Process = _Worker


def map_in_processes(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    workers: int,
    initializer: Callable[[], None] | None = None,
    on_done: Callable[[], None] = lambda: None,
) -> list[Result]:
    """The function of each item, in order, by several processes.

    Args:
        function: of a module, not of the caller's script.
        items: what it is called with.
        workers: processes; one works in this process.
        initializer: called once in each worker.
        on_done: called in this process after each item.

    Raises:
        Exception: whatever the function raises.
    """
    results: dict[int, Result] = {}
    if min(workers, len(items)) > 1 and not current_process().daemon:
        pool = ProcessPoolExecutor(
            min(workers, len(items)), mp_context=_WorkerContext(), initializer=initializer
        )
        try:
            futures: dict[Future[Result], int] = {}
            for number, item in enumerate(items):
                futures[pool.submit(function, item)] = number
            for future in as_completed(futures):
                results[futures[future]] = future.result()
                on_done()
        except (BrokenProcessPool, OSError):
            pass  # killed, or no process can be had: what is missing is done below
        finally:
            pool.shutdown(cancel_futures=True)
    for number, item in enumerate(items):
        if number not in results:
            results[number] = function(item)
            on_done()
    return [results[number] for number in range(len(items))]
