"""The folder of a study: one writer at a time, never another study's, and nothing finished is flown twice.

DIR/shards/study.json says what the study is (parameters, versions, digests of the sources); beside it stand
the finished chunks of episodes (`studies.campaign.shards`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studies.campaign.claimed_folder import Contents, Existing, claim_folder
from studies.campaign.monte_carlo import Chunk, Study, chunk_bounds
from studies.campaign.provenance import CHECKSUMS, identify_study
from studies.campaign.shards import ShardError, read_shard, shard_path, write_shard

_CONTENTS = Contents(
    identity="shards/study.json",
    products=(
        CHECKSUMS,
        "episodes.csv",
        "episodes.parquet",
        "paired.csv",
        "provenance.json",
        "report.html",
        "table.csv",
        "table.md",
        "timings.csv",
    ),
    traces=(
        "figures/histograms.png",
        "figures/trajectory-*.png",
        "shards/episodes-*.jsonl",
        "shards/.*.jsonl.*",
        "trajectories/*.npz",
    ),
)


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
        """For the provenance, once the chunks were read: runs of the program, retries, tiles left out."""
        sessions: dict[str, int] = {}
        left_out: set[int] = set()
        retries = []
        for first, last in chunk_bounds(self.study):
            chunk, session = read_shard(shard_path(self.shards, first, last), policies=(), checked=True)
            sessions[session] = sessions.get(session, 0) + last - first
            left_out.update(chunk.left_out)
            if chunk.attempts > 1:
                retries.append({"episodes": [first, last - 1], "attempts": chunk.attempts})
        return {
            "sessions": [{"session": name, "episodes": count} for name, count in sorted(sessions.items())],
            "retries_after_a_worker_died": retries,
            "left_out_tiles": sorted(left_out),
        }


@contextmanager
def open_study_folder(path: Path, study: Study, existing: Existing) -> Iterator[StudyFolder]:
    """Open a folder for a study, or say why not, before any episode is flown.

    Args:
        path: made if it does not exist.
        study: what is to be flown.
        existing: what to do where the folder holds a study already (`claim_folder`).

    Raises:
        FolderError: another process writes there; or the folder holds a study and `existing` is `REFUSE`; or
            it is `RESUME` and the study there has other parameters or versions: the message names them.
        OSError: the folder cannot be made or written.
    """
    with claim_folder(path, _CONTENTS, identify_study(study), existing) as session:
        folder = StudyFolder(path, study, session)
        for draft in folder.shards.glob(".*.jsonl.*"):
            draft.unlink()  # a killed process was writing it
        yield folder
