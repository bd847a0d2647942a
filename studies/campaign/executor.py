"""Where episodes run: processes of this machine, or a Dask cluster (`studies.campaign.cluster`).

Whatever runs them is a `concurrent.futures.Executor` that is opened when it is needed. Results come back in
any order, and the bytes of a study do not depend on which executor flew it.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from multiprocessing import get_context, parent_process
from typing import Any, Protocol, runtime_checkable

OpenExecutor = Callable[[], AbstractContextManager[Executor | None]]
"""Opens an executor; None in place of one means this process."""


class WorkerDiedError(ValueError):
    """Workers died again and again while they held the same episodes."""


@runtime_checkable
class ClusterExecutor(Protocol):
    """An executor that begins the tasks of a dead worker again by itself, on workers that come and go."""

    def count_workers(self) -> int:
        """How many tasks can run at once, now."""
        ...

    def count_restarts(self, future: Future[Any]) -> int:
        """How often a finished task was lost with its worker and begun again."""
        ...


@contextmanager
def local_processes(workers: int) -> Iterator[Executor | None]:
    """Processes on this machine; None for one worker, which flies in this process."""
    if workers == 1:
        yield None
        return
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_begin_worker)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def advise_script() -> str:
    """What a script must do whose workers die since they run it again; empty where no script runs."""
    main = sys.modules["__main__"]
    if getattr(main, "__spec__", None) is not None or not hasattr(main, "__file__"):
        return ""
    return '; a script must call for a study under `if __name__ == "__main__":`, since every worker reads it'


def _begin_worker() -> None:
    """One thread, since its siblings keep the other cores busy, and no life beyond the parent's."""
    import numba

    numba.set_num_threads(1)
    _end_with_parent()


def _end_with_parent() -> None:
    """Let this worker end when its parent is killed; else it would wait for work for ever."""
    parent = parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="watch-parent", daemon=True).start()
