"""A study that is killed, at any moment and in any part, ends with the bytes of one that never was."""

import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from hda.task.presets import PRESETS
from studies.campaign import monte_carlo
from studies.campaign.claimed_folder import Existing, FolderError
from studies.campaign.command_line import resumable
from studies.campaign.executor import WorkerDiedError
from studies.campaign.monte_carlo import Chunk, Study, chunk_bounds, fly_chunk, fly_chunks
from studies.campaign.study_folder import StudyFolder, open_study_folder
from studies.compare.command import Comparison, compare

POLICIES = ("no-divert", "single-divert")
EPISODES = 60
STUDY = Study(PRESETS["paper"], POLICIES, 30)


def options(out: Path, **changes: Any) -> Comparison:
    plain = Comparison(episodes=EPISODES, policies=POLICIES, workers=1, out=out, figures=False, report=False)
    return replace(plain, **changes)


def contents(folder: Path) -> tuple[bytes, bytes]:
    return (folder / "episodes.csv").read_bytes(), (folder / "table.csv").read_bytes()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole") / "study"
    compare(options(out))
    return out


def start(out: Path, workers: int) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "studies.compare", "--episodes", str(EPISODES), "--policies", *POLICIES]
    command += ["--workers", str(workers), "--no-figures", "--no-report", "--resume", "--out", str(out)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def kill_until_finished(out: Path, workers: int, kills: int, rng: random.Random) -> None:
    """Kill -9 the program at random instants after its n-th shard, then let it end."""
    for _ in range(kills):
        there = len(list(out.glob("shards/*.jsonl")))
        program = start(out, workers)
        deadline = time.monotonic() + 120
        wanted = there + rng.randint(0, 2)
        while program.poll() is None and len(list(out.glob("shards/*.jsonl"))) < wanted:
            assert time.monotonic() < deadline
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, 0.05))
        program.kill()
        program.communicate()
    program = start(out, workers)
    output, _ = program.communicate(timeout=300)
    assert program.returncode == 0, output


def test_killed_and_resumed_gives_the_same_bytes(whole: Path, tmp_path: Path) -> None:
    kill_until_finished(tmp_path / "study", workers=1, kills=2, rng=random.Random(1))
    assert contents(tmp_path / "study") == contents(whole)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_killed_often_with_two_workers_gives_the_same_bytes(whole: Path, tmp_path: Path, seed: int) -> None:
    kill_until_finished(tmp_path / "study", workers=1 + seed % 2, kills=4, rng=random.Random(seed))
    assert contents(tmp_path / "study") == contents(whole)


def test_a_finished_episode_is_not_flown_again(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "study"
    compare(options(out))
    for path in sorted(out.glob("shards/episodes-*.jsonl"))[2:4]:
        path.unlink()
    (out / "shards" / ".episodes-000000020-000000030.jsonl.999").write_text("half a dra")
    flown: list[int] = []

    def note(study: Study, first: int, last: int) -> Chunk:
        flown.append(first)
        return fly_chunk(study, first, last)

    monkeypatch.setattr(monte_carlo, "fly_chunk", note)
    compare(options(out, resume=True))
    assert flown == [20, 30]
    assert contents(out) == contents(whole)
    assert not list(out.glob("shards/.*"))
    sessions = json.loads((out / "provenance.json").read_text())["flight"]["sessions"]
    assert sorted(entry["episodes"] for entry in sessions) == [20, 40]


def test_a_damaged_shard_is_named_and_flown_again(
    whole: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "study"
    compare(options(out))
    shard = sorted(out.glob("shards/episodes-*.jsonl"))[1]
    head, _, body = shard.read_bytes().partition(b"\n")
    shard.write_bytes(head + b"\n" + body.replace(b"success", b"crashed", 1))
    compare(options(out, resume=True))
    assert contents(out) == contents(whole)
    assert "checksum" in capfd.readouterr().err


def test_a_shard_is_hashed_once_for_all_policies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import hashlib

    hashed: list[int] = []
    monkeypatch.setattr(
        "studies.campaign.shards.hashlib",
        SimpleNamespace(sha256=lambda body: hashed.append(len(body)) or hashlib.sha256(body)),
    )
    compare(options(tmp_path / "study"))
    shards = len(list((tmp_path / "study").glob("shards/episodes-*.jsonl")))
    assert len(hashed) == 2 * shards  # as it is written, and as it is read


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"episodes": 70}, r"study\.episodes was 60, is 70"),
        ({"study_seed": 1}, r"study\.study_seed was 0, is 1"),
        ({"preset": "hard"}, r"preset\.name was .paper., is .hard."),
        ({"split": "tuning"}, r"study\.split was .validation., is .tuning."),
        ({"policies": ("single-divert",)}, r"study\.policies"),
    ],
)
def test_another_study_is_refused_by_name(whole: Path, changes: dict[str, Any], named: str) -> None:
    before = contents(whole)
    with pytest.raises(FolderError, match=named):
        compare(options(whole, resume=True, **changes))
    assert contents(whole) == before


@pytest.mark.parametrize("key", ["versions.numpy", "sources.hda", "python", "machine", "terrain_key"])
def test_other_versions_are_refused_by_name(tmp_path: Path, key: str) -> None:
    with open_study_folder(tmp_path, STUDY, Existing.REFUSE):
        pass
    held = tmp_path / "shards" / "study.json"
    identity = json.loads(held.read_text())
    inner = identity
    *path, last = key.split(".")
    for part in path:
        inner = inner[part]
    inner[last] = "0.0.1"
    held.write_text(json.dumps(identity))
    with (
        pytest.raises(FolderError, match=rf'{key} was "0\.0\.1"'),
        open_study_folder(tmp_path, STUDY, Existing.RESUME),
    ):
        pass


@pytest.mark.parametrize("content", ["", "{", "[]", "null", "[" * 100_000, "\x00"])
def test_a_damaged_identity_is_refused(tmp_path: Path, content: str) -> None:
    with open_study_folder(tmp_path, STUDY, Existing.REFUSE):
        pass
    (tmp_path / "shards" / "study.json").write_text(content)
    with pytest.raises(FolderError), open_study_folder(tmp_path, STUDY, Existing.RESUME):
        pass


def test_a_study_is_not_overwritten_unless_asked(tmp_path: Path) -> None:
    kept = [
        tmp_path / name for name in ("notes.txt", "figures/mine.png", "shards/mine", "trajectories/a.csv")
    ]
    for path in kept:
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
    compare(options(tmp_path, episodes=10))
    before = contents(tmp_path)
    with pytest.raises(FolderError, match=r"--resume.*--overwrite"):
        compare(options(tmp_path, episodes=12))
    assert contents(tmp_path) == before
    with pytest.raises(ValueError, match="exclude each other"):
        compare(options(tmp_path, resume=True, overwrite=True))
    compare(options(tmp_path, episodes=12, overwrite=True))
    assert contents(tmp_path) != before
    assert len(list(tmp_path.glob("shards/*.jsonl"))) == 2
    assert all(path.read_text() == "mine" for path in kept)


def test_a_folder_that_was_half_removed_is_still_that_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the new study would take the shards that are left for its own."""
    compare(options(tmp_path, episodes=20))
    unlink = Path.unlink

    def stopped(path: Path, missing_ok: bool = False) -> None:
        if path.name.startswith("episodes-") and path.suffix == ".jsonl":
            raise KeyboardInterrupt
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", stopped)
    with pytest.raises(KeyboardInterrupt):
        compare(options(tmp_path, episodes=20, study_seed=1, overwrite=True))
    monkeypatch.undo()
    with pytest.raises(FolderError, match="holds a study already"):
        compare(options(tmp_path, episodes=20, study_seed=1))
    with pytest.raises(FolderError, match=r"study\.study_seed was 0, is 1"):
        compare(options(tmp_path, episodes=20, study_seed=1, resume=True))


@pytest.mark.parametrize("way", ["--resume goes on", "the same command goes on"])
def test_a_user_who_stops_a_study_reads_how_it_goes_on(capfd: pytest.CaptureFixture[str], way: str) -> None:
    with pytest.raises(SystemExit) as stopped, resumable(way):
        raise KeyboardInterrupt
    assert stopped.value.code == 130
    assert f"finished work is kept, {way}" in " ".join(capfd.readouterr().err.split())


def test_tables_without_shards_are_a_study_too(tmp_path: Path) -> None:
    (tmp_path / "episodes.csv").write_text("policy\n")
    with pytest.raises(FolderError, match="holds a study already"):
        compare(options(tmp_path))
    with pytest.raises(FolderError, match="no finished work"):
        compare(options(tmp_path, resume=True))


HOLD = """
import sys, time
from pathlib import Path
from tests.studies.campaign.test_resume import STUDY
from studies.campaign.claimed_folder import Existing
from studies.campaign.study_folder import open_study_folder
with open_study_folder(Path(sys.argv[1]), STUDY, Existing.RESUME):
    print("held", flush=True)
    time.sleep(60)
"""


def test_one_writer_at_a_time_and_a_dead_one_is_forgotten(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    holder = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with (
            pytest.raises(FolderError, match=rf"being written by process {holder.pid} on "),
            open_study_folder(tmp_path, STUDY, Existing.RESUME),
        ):
            pass
    finally:
        holder.kill()
        holder.communicate()
    assert (tmp_path / ".owner").exists()  # it had no time to clean up
    with open_study_folder(tmp_path, STUDY, Existing.RESUME) as folder:
        assert folder.find_finished() == (set(), [])


def test_a_dead_worker_costs_a_retry_and_is_labelled(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "study"
    store = StudyFolder.store
    killed: list[int] = []

    def store_and_kill(folder: StudyFolder, chunk: Chunk) -> None:
        store(folder, chunk)
        if not killed:
            victim = multiprocessing.active_children()[0].pid
            assert victim is not None
            os.kill(victim, signal.SIGKILL)
            killed.append(victim)

    monkeypatch.setattr(StudyFolder, "store", store_and_kill)
    compare(options(out, workers=2))
    assert killed
    assert contents(out) == contents(whole)
    retries = json.loads((out / "provenance.json").read_text())["flight"]["retries_after_a_worker_died"]
    assert retries
    assert all(entry["attempts"] == 2 for entry in retries)


class DyingExecutor:
    """Runs nothing; every worker of it dies."""

    def submit(self, function: Any, *arguments: Any) -> Any:
        from concurrent.futures import BrokenExecutor, Future

        future: Future[Any] = Future()
        future.set_exception(BrokenExecutor("a worker died"))
        return future


def test_a_chunk_that_kills_every_worker_is_an_error_at_last() -> None:
    from contextlib import contextmanager

    opened: list[int] = []

    @contextmanager
    def open_executor() -> Any:
        opened.append(1)
        yield DyingExecutor()

    with pytest.raises(WorkerDiedError, match="died 3 times while it held episodes 20 to 29"):
        list(fly_chunks(STUDY, chunk_bounds(STUDY), open_executor))
    assert len(opened) == 3


@pytest.mark.slow
def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    program = start(tmp_path / "study", workers=2)
    deadline = time.monotonic() + 120
    while not list(tmp_path.glob("study/shards/*.jsonl")):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    orphans = [
        int(pid) for pid in Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text().split()
    ]
    assert orphans
    program.kill()
    program.communicate()
    while any(Path(f"/proc/{pid}/cmdline").exists() and alive(pid) for pid in orphans):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def alive(pid: int) -> bool:
    return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
