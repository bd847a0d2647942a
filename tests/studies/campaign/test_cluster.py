"""A study on a Dask cluster has the bytes of one on this machine, also where a worker is killed."""

import csv
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

from studies.campaign.cluster import ClusterError, dask_scheduler, describe_slurm, run_alike, slurm_jobs
from studies.campaign.provenance import identify_software
from studies.compare.command import Comparison, choose_executor, compare

POLICIES = ("no-divert", "single-divert")
EPISODES = 100
DEADLINE = 600.0  # a worker imports and compiles; a busy machine takes its time


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class LoopbackCluster:
    """A scheduler and two workers, each a process of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.address = f"tcp://127.0.0.1:{free_port()}"
        port = self.address.rpartition(":")[2]
        self.scheduler = self.start("scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")
        wait_until(lambda: "Scheduler at" in self.log("scheduler"), self.scheduler)
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--memory-limit", "0")
        self.workers = [
            self.start("worker", self.address, *options, "--name", name, log=name) for name in ("a", "b")
        ]
        for name, worker in zip("ab", self.workers, strict=True):
            wait_until(lambda name=name: "Registered to" in self.log(name), worker)

    def start(self, kind: str, *arguments: str, log: str = "scheduler") -> subprocess.Popen[bytes]:
        with (self.folder / f"{log}.log").open("wb") as stream:
            command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *arguments]
            return subprocess.Popen(
                command, stdout=stream, stderr=subprocess.STDOUT, cwd=self.folder, env=environment()
            )

    def log(self, name: str) -> str:
        return (self.folder / f"{name}.log").read_text()

    def stop(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


def environment() -> dict[str, str]:
    """This tree for workers that start in another folder."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(("", *sys.path)).lstrip(os.pathsep)}


def wait_until(condition, process: subprocess.Popen, seconds: float = DEADLINE) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.005)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[LoopbackCluster]:
    (tmp_path / "cluster").mkdir()
    loopback = LoopbackCluster(tmp_path / "cluster")
    yield loopback
    loopback.stop()


def start_study(out: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "studies.compare", "--episodes", str(EPISODES), "--policies", *POLICIES]
    command += ["--no-figures", "--no-report", "--resume", "--out", str(out), *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def contents(folder: Path) -> tuple[bytes, ...]:
    return tuple((folder / name).read_bytes() for name in ("episodes.csv", "table.csv", "paired.csv"))


def test_a_killed_worker_costs_a_labelled_retry_and_no_byte(cluster: LoopbackCluster, tmp_path: Path) -> None:
    out = tmp_path / "study"
    program = start_study(out, "--scheduler", cluster.address)
    wait_until(lambda: len(list(out.glob("shards/*.jsonl"))) >= 2, program)
    cluster.workers[0].send_signal(signal.SIGKILL)
    output, _ = program.communicate(timeout=DEADLINE)
    assert program.returncode == 0, output
    assert "a worker died: episodes" in output
    retries = json.loads((out / "provenance.json").read_text())["flight"]["retries_after_a_worker_died"]
    assert retries
    assert all(entry["attempts"] == 2 for entry in retries)
    compare(
        Comparison(
            episodes=EPISODES,
            policies=POLICIES,
            workers=1,
            out=tmp_path / "local",
            figures=False,
            report=False,
        )
    )
    assert contents(out) == contents(tmp_path / "local")
    with (out / "episodes.csv").open() as stream:
        assert len(list(csv.DictReader(stream))) == EPISODES * len(POLICIES)


@pytest.mark.slow
def test_a_lost_scheduler_is_one_line_and_the_study_goes_on_here(
    cluster: LoopbackCluster, tmp_path: Path
) -> None:
    out = tmp_path / "study"
    program = start_study(out, "--scheduler", cluster.address)
    wait_until(lambda: len(list(out.glob("shards/*.jsonl"))) >= 2, program)
    cluster.scheduler.kill()
    output, _ = program.communicate(timeout=DEADLINE)
    assert program.returncode == 2, output
    assert "the scheduler was lost; --resume goes on" in output
    assert "Traceback" not in output
    program = start_study(out, "--workers", "1")
    output, _ = program.communicate(timeout=DEADLINE)
    assert program.returncode == 0, output


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x", "127.0.0.1:1"])
def test_no_scheduler_there_is_a_clear_error(monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    monkeypatch.setattr("studies.campaign.cluster.CONNECT_SECONDS", 0.5)
    with pytest.raises(ClusterError, match="no Dask scheduler answers at"), dask_scheduler(address):
        pass


def test_without_dask_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.setitem(sys.modules, "dask_jobqueue.slurm", None)
    with (
        pytest.raises(ClusterError, match=r"pip install 'lunar-hda\[cluster\]'"),
        dask_scheduler("tcp://x:1"),
    ):
        pass
    with pytest.raises(ClusterError, match=r"pip install 'lunar-hda\[cluster\]'"), slurm_jobs(1):
        pass


def test_two_executors_exclude_each_other() -> None:
    with pytest.raises(ValueError, match="scheduler and slurm exclude each other"):
        choose_executor(Comparison(scheduler="tcp://x:1", slurm=True))


def test_a_worker_of_other_software_refuses() -> None:
    software = json.loads(json.dumps(identify_software()))
    assert run_alike(software, (), len, [1, 2]) == 2
    software["versions"]["numpy"] = "0.0.1"
    with pytest.raises(ClusterError, match=r"versions\.numpy is 0\.0\.1 here"):
        run_alike(software, (), len, [1, 2])
    with pytest.raises(ClusterError, match=r"python is 2\.7 here"):
        run_alike({"python": "2.7"}, (), len, [1, 2])


SLURM = {
    "jobqueue.slurm.cores": 4,
    "jobqueue.slurm.memory": "8GB",
    "jobqueue.slurm.queue": "short",
    "jobqueue.slurm.account": "landers",
    "jobqueue.slurm.walltime": "02:00:00",
    "jobqueue.slurm.interface": "lo",
    "jobqueue.slurm.job-script-prologue": ["module load python"],
}


def slurm_configuration(values: dict[str, Any]) -> AbstractContextManager[Any]:
    """Dask's configuration with these values; the defaults of dask-jobqueue must be in it before."""
    import dask_jobqueue  # noqa: F401
    from dask import config

    return config.set(values)


def test_the_job_that_slurm_would_get() -> None:
    with slurm_configuration(SLURM):
        cluster = describe_slurm()
        try:
            script = cluster.job_script().splitlines()
        finally:
            cluster.close()
    assert script[0].startswith("#!")
    wanted = {"-p short", "-A landers", "-n 1", "--cpus-per-task=4", "--mem=8G", "-t 02:00:00"}
    assert wanted <= {line.removeprefix("#SBATCH ") for line in script}
    assert script.index("module load python") < script.index("export OMP_NUM_THREADS=1")
    worker = next(line for line in script if "dask_worker" in line)
    assert worker.startswith(sys.executable)
    assert "--nworkers 4 " in worker
    assert "--nthreads 1 " in worker


def test_a_machine_without_slurm_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with (
        slurm_configuration(SLURM),
        pytest.raises(ClusterError, match="slurm: there is no sbatch here"),
        slurm_jobs(1),
    ):
        pass
    with (
        slurm_configuration({"jobqueue.slurm.cores": None, "jobqueue.slurm.memory": None}),
        pytest.raises(ClusterError, match=r"must set jobqueue\.slurm\.cores and jobqueue\.slurm\.memory"),
        slurm_jobs(1),
    ):
        pass
