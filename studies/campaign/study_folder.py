"""The folder of a study: one writer at a time, never another study's, and nothing finished is flown twice.

DIR/shards/study.json says what the study is (parameters, versions, digests of the sources); beside it stand
the finished chunks of episodes (`studies.campaign.shards`). DIR/.lock is held by the process that writes;
the system frees it when that process dies, however it dies.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

from studies.campaign.monte_carlo import Chunk, Study, chunk_bounds
from studies.campaign.provenance import identify_study
from studies.campaign.shards import ShardError, read_shard, shard_path, write_durably, write_shard

_PRODUCTS = (
    "episodes.csv",
    "episodes.parquet",
    "paired.csv",
    "provenance.json",
    "report.html",
    "table.csv",
    "table.md",
    "timings.csv",
)
_PRODUCT_PATTERNS = (
    "figures/histograms.png",
    "figures/trajectory-*.png",
    "shards/study.json",
    "shards/episodes-*.jsonl",
    "shards/.*.jsonl.*",
    "trajectories/*.npz",
)


class FolderError(ValueError):
    """The folder may not be written: another process does, or it holds another study."""


class Existing(StrEnum):
    """What to do with a folder that holds a study."""

    REFUSE = "refuse"
    RESUME = "resume"
    OVERWRITE = "overwrite"


@dataclass(frozen=True)
class StudyFolder:
    """An open folder; only `open_study_folder` makes one.

    Attributes:
        path: the folder.
        study: the study in it.
        session: names this run of the program in the shards.
    """

    path: Path
    study: Study
    session: str

    @property
    def shards(self) -> Path:
        """Where finished chunks are kept."""
        return self.path / "shards"

    def find_finished(self) -> tuple[set[tuple[int, int]], list[str]]:
        """Bounds of every finished chunk, and what is wrong with those that must fly again (and go)."""
        finished, damages = set(), []
        for first, last in chunk_bounds(self.study):
            path = shard_path(self.shards, first, last)
            if not path.exists():
                continue
            try:
                chunk, _ = read_shard(path)
                if tuple(chunk.rows) != self.study.policies:
                    raise ShardError(f"{path} is damaged: it holds other policies")
                finished.add((first, last))
            except ShardError as error:
                damages.append(str(error))
                path.unlink()
        return finished, damages

    def read_chunks(
        self, policies: Collection[str] | None = None, *, checked: bool = False
    ) -> Iterator[Chunk]:
        """The chunks of the whole study in the order of their episodes, one at a time.

        Args:
            policies: only the rows of these; of all by default.
            checked: all were read once before, so their checksums are not computed again.

        Raises:
            ShardError: a shard is damaged.
            OSError: one is missing.
        """
        for first, last in chunk_bounds(self.study):
            yield read_shard(shard_path(self.shards, first, last), policies, checked=checked)[0]

    def store(self, chunk: Chunk) -> None:
        """Keep a finished chunk; when this returns, it is on the disk."""
        write_shard(self.shards, chunk, self.session)

    def describe_flight(self) -> dict[str, Any]:
        """For the provenance, once the chunks were read: the runs of the program, and the retried chunks."""
        sessions: dict[str, int] = {}
        retries = []
        for first, last in chunk_bounds(self.study):
            chunk, session = read_shard(shard_path(self.shards, first, last), policies=(), checked=True)
            sessions[session] = sessions.get(session, 0) + last - first
            if chunk.attempts > 1:
                retries.append({"episodes": [first, last - 1], "attempts": chunk.attempts})
        return {
            "sessions": [{"session": name, "episodes": count} for name, count in sorted(sessions.items())],
            "retries_after_a_worker_died": retries,
        }


@contextmanager
def open_study_folder(path: Path, study: Study, existing: Existing) -> Iterator[StudyFolder]:
    """Open a folder for a study, or say why not, before any episode is flown.

    Args:
        path: made if it does not exist.
        study: what is to be flown.
        existing: what to do where the folder holds a study already. `RESUME` in an empty folder begins anew,
            so that one command line serves a job that may be killed and started again.

    Raises:
        FolderError: another process writes there; or the folder holds a study and `existing` is `REFUSE`; or
            it is `RESUME` and the study there has other parameters or versions: the message names them.
        OSError: the folder cannot be made or written.
    """
    path.mkdir(parents=True, exist_ok=True)
    with _only_writer(path):
        identity = json.loads(json.dumps(identify_study(study), default=str))
        held = path / "shards" / "study.json"
        begun = held.exists() or any((path / name).exists() for name in _PRODUCTS)
        if begun and existing is Existing.REFUSE:
            raise FolderError(
                f"{path} holds a study already; --resume goes on with it if it is the same,"
                " --overwrite replaces it, --out names another folder"
            )
        if begun and existing is Existing.RESUME:
            _check_same_study(held, identity)
        elif begun:
            _remove_products(path)
        held.parent.mkdir(exist_ok=True)
        for draft in held.parent.glob(".*.jsonl.*"):
            draft.unlink()  # a killed process was writing it
        if not held.exists():
            write_durably(held, (json.dumps(identity, indent=1, sort_keys=True) + "\n").encode())
        started = datetime.now(UTC).isoformat(timespec="milliseconds")
        yield StudyFolder(path, study, f"{started} {platform.node()} {os.getpid()}")


@contextmanager
def _only_writer(path: Path) -> Iterator[None]:
    """Hold the folder's lock; the system frees it when the process dies, however it dies."""
    from filelock import FileLock, Timeout

    lock = FileLock(path / ".lock", timeout=0)
    owner = path / ".owner"
    try:
        lock.acquire()
    except Timeout:
        try:
            who = owner.read_text().strip()
        except OSError:
            who = "another process"
        raise FolderError(f"{path} is being written by {who}; wait for it or choose another --out") from None
    try:
        now = datetime.now(UTC).isoformat(timespec="seconds")
        owner.write_text(f"process {os.getpid()} on {platform.node()} since {now}\n")
        yield
    finally:
        owner.unlink(missing_ok=True)
        lock.release()


def _check_same_study(held: Path, identity: dict[str, Any]) -> None:
    folder = held.parent.parent
    try:
        there = json.loads(held.read_text())
    except FileNotFoundError:
        raise FolderError(f"{folder} holds no shards to go on from; --overwrite flies anew") from None
    except (ValueError, RecursionError) as error:
        raise FolderError(f"{held} is damaged ({error}); --overwrite flies anew") from error
    differences = list(_differences(there, identity))
    if differences:
        shown = "; ".join(differences[:8])
        more = f"; and {len(differences) - 8} more" if len(differences) > 8 else ""
        raise FolderError(
            f"{folder} holds another study: {shown}{more}. Run it as it was begun, or --overwrite it"
        )


def _differences(there: Any, here: Any, name: str = "") -> Iterator[str]:
    """Name every leaf in which two parsed JSON values differ."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in sorted({*there, *here}):
            yield from _differences(there.get(key), here.get(key), f"{name}.{key}" if name else key)
    elif there != here:
        yield f"{name} was {_short(there)}, is {_short(here)}"


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _remove_products(path: Path) -> None:
    """Remove what an earlier study left, and nothing else."""
    for name in _PRODUCTS:
        (path / name).unlink(missing_ok=True)
    for pattern in _PRODUCT_PATTERNS:
        for product in path.glob(pattern):
            product.unlink()
