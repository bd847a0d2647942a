"""Episodes on a Dask cluster: a scheduler that runs already, or jobs of a Slurm cluster (dask-jobqueue).

Workers get names and numbers (the study, the episodes) and give back rows. Dask carries them as pickles
between the processes of the cluster, and whoever reaches its scheduler can run code on its workers. So a
cluster is trusted: keep it on a closed network, or give it TLS certificates. Nothing on a disk is unpickled.

A worker that has other versions or sources than this process refuses its tasks: its rows might differ.
"""

from __future__ import annotations

import logging
import shutil
import threading
import uuid
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sized
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any, cast

from studies.campaign.executor import WorkerDiedError
from studies.campaign.provenance import identify_software

if TYPE_CHECKING:
    from dask_jobqueue.slurm import SLURMCluster
    from distributed import Client

CONNECT_SECONDS = 10.0
_INSTALL = "pip install 'lunar-hda[cluster]'"
_LOST = "the scheduler was lost; --resume goes on"
_ONE_AT_A_TIME = threading.Lock()


class ClusterError(ValueError):
    """The cluster cannot be reached, was lost, or does not run what this process runs."""


class DaskExecutor(Executor):
    """Runs functions on the workers of a Dask cluster.

    The scheduler gives the tasks of a dead worker to others by itself, as often as its own setting
    `distributed.scheduler.allowed-failures` (3) allows; the number of restarts is kept for each task.
    """

    def __init__(self, client: Client, paths: tuple[str, ...] = ()) -> None:
        """Begin to listen to the cluster.

        Args:
            client: connected to the scheduler.
            paths: paths `package.module:Name` of policies; their sources must be the same on every worker.
        """
        self._client = client
        self._executor = client.get_executor(pure=False)
        self._paths = paths
        self._software = identify_software(paths)
        self._keys: dict[Future[Any], str] = {}
        self._restarts: Counter[str] = Counter()
        # the scheduler sends this before the result of a task that was begun again, on the same stream
        client.subscribe_topic("all", self._notice)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Hand a function to the cluster; its future fails with this module's errors, or with its own."""
        key = f"{fn.__name__}-{uuid.uuid4()}"
        inner = self._executor.submit(run_alike, self._software, self._paths, fn, *args, key=key, **kwargs)
        outer: Future[Any] = Future()
        self._keys[outer] = key

        def pass_on(done: Future[Any]) -> None:
            try:
                outer.set_result(done.result())
            except CancelledError:
                outer.set_exception(ClusterError(_LOST))
            except BaseException as error:
                outer.set_exception(self._translate(error))

        inner.add_done_callback(pass_on)
        return outer

    def count_workers(self) -> int:
        """How many tasks can run at once, now."""
        try:
            return len(cast("Sized", self._client.nthreads()))
        except OSError as error:
            raise ClusterError(_LOST) from error

    def count_restarts(self, future: Future[Any]) -> int:
        """How often a finished task was lost with its worker and begun again; asked once."""
        return self._restarts.pop(self._keys.pop(future), 0)

    def _notice(self, event: tuple[float, Mapping[str, Any]]) -> None:
        _, message = event
        if message.get("action") == "remove-worker":
            own = set(self._keys.values())
            lost = (*message["processing-tasks"], *message["lost-computed-tasks"])
            self._restarts.update(key for key in lost if key in own)

    @staticmethod
    def _translate(error: BaseException) -> BaseException:
        from distributed.client import FutureCancelledError
        from distributed.scheduler import KilledWorker

        if isinstance(error, KilledWorker):
            return WorkerDiedError(f"a worker of the cluster died {error.allowed_failures + 1} times")
        if isinstance(error, FutureCancelledError):
            return ClusterError(_LOST)
        return error


def run_alike(
    software: Mapping[str, Any], paths: tuple[str, ...], function: Callable[..., Any], *arguments: Any
) -> Any:
    """Call a function, on a worker that runs the same software; one call at a time in each process.

    Raises:
        ClusterError: the software differs; the message names the first difference.
    """
    here = _software_here(paths)
    for key in software:
        if here[key] != software[key]:
            raise ClusterError(f"a worker runs other software: {_first_difference(key, software, here)}")
    with _ONE_AT_A_TIME:  # threads of one worker would gain nothing, and share caches
        return function(*arguments)


@cache
def _software_here(paths: tuple[str, ...]) -> dict[str, Any]:
    """Software of this worker, looked at once: what it has imported does not change any more."""
    return identify_software(paths)


def _first_difference(key: str, ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> str:
    one, other = ours[key], theirs[key]
    if isinstance(one, dict):
        inner = next(name for name in sorted({*one, *other}) if one.get(name) != other.get(name))
        return f"{key}.{inner} is {one.get(inner)} here, {other.get(inner)} there"
    return f"{key} is {one} here, {other} there"


@contextmanager
def dask_scheduler(address: str, paths: tuple[str, ...] = ()) -> Iterator[Executor]:
    """The workers of a Dask scheduler that runs already.

    Args:
        address: such as tcp://host:8786.
        paths: paths of policies that are not registered.

    Raises:
        ClusterError: Dask is not installed, or nothing answers there.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ClusterError(f"scheduler needs Dask: {_INSTALL}") from None
    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError(f"scheduler: no Dask scheduler answers at {address!r}: {error}") from error
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what goes wrong is raised here as well
    with client:
        yield DaskExecutor(client, paths)


@contextmanager
def slurm_jobs(jobs: int, paths: tuple[str, ...] = ()) -> Iterator[Executor]:
    """Workers in jobs of a Slurm cluster, which end with this process; it must be able to submit jobs.

    Args:
        jobs: jobs to submit.
        paths: paths of policies that are not registered.

    Raises:
        ClusterError: dask-jobqueue or Slurm is not installed, or the jobs are not described.
    """
    cluster = describe_slurm()
    try:
        if shutil.which("sbatch") is None:
            raise ClusterError("slurm: there is no sbatch here; run this on a login node of a Slurm cluster")
        from distributed import Client

        cluster.scale(jobs=jobs)
        with Client(cluster, set_as_default=False) as client:
            yield DaskExecutor(client, paths)
    finally:
        cluster.close()


def describe_slurm() -> SLURMCluster:
    """A cluster without jobs yet; `job_script()` says what it will submit.

    A job has one process for each of its cores. Dask's configuration describes it (jobqueue.slurm in
    ~/.config/dask/jobqueue.yaml: cores, memory, queue, account, walltime).

    Raises:
        ClusterError: dask-jobqueue is not installed, or the configuration lacks what a job needs.
    """
    try:
        from dask import config
        from dask_jobqueue.slurm import SLURMCluster
    except ImportError:
        raise ClusterError(f"slurm needs dask-jobqueue: {_INSTALL}") from None
    cores = config.get("jobqueue.slurm.cores", None)
    missing = [n for n in ("cores", "memory") if not config.get(f"jobqueue.slurm.{n}", None)]
    if missing:
        raise ClusterError(
            f"slurm: Dask's configuration must set {' and '.join(f'jobqueue.slurm.{n}' for n in missing)}"
            " (in ~/.config/dask/jobqueue.yaml, or DASK_JOBQUEUE__SLURM__CORES=8 in the environment)"
        )
    prologue = [
        *(config.get("jobqueue.slurm.job-script-prologue", None) or ()),
        "export OMP_NUM_THREADS=1",  # one process for each core
    ]
    return SLURMCluster(
        processes=int(cores), job_script_prologue=prologue, scheduler_options={"dashboard": False}
    )
