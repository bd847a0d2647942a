"""The claim on a results folder: one writer at a time, and never the work of another run.

A file in the folder says what the run there is. DIR/.lock is held by the process that writes; the system
frees it when that process dies, however it dies.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

from studies.campaign.shards import write_durably


class FolderError(ValueError):
    """The folder may not be written: another process does, or it holds another study."""


class Existing(StrEnum):
    """What to do with a folder that holds a study."""

    REFUSE = "refuse"
    RESUME = "resume"
    OVERWRITE = "overwrite"


@dataclass(frozen=True)
class Contents:
    """What a run leaves in its folder.

    Attributes:
        identity: path in the folder of the file that says what the run is.
        products: names of files each of which shows that a run was there.
        traces: patterns of what else a run may leave, its finished work too.
    """

    identity: str
    products: tuple[str, ...]
    traces: tuple[str, ...]


@contextmanager
def claim_folder(
    path: Path, contents: Contents, identity: dict[str, Any], existing: Existing
) -> Iterator[str]:
    """Hold a folder for a run, or say why not, before any work is done.

    Args:
        path: made if it does not exist.
        contents: what such a run leaves there.
        identity: all that decides the run's rows; what is not JSON in it counts by its text.
        existing: what to do where the folder holds a run already. `RESUME` in an empty folder begins anew, so
            that one command line serves a job that may be killed and started again.

    Yields:
        The name of this session of the program.

    Raises:
        FolderError: another process writes there; or the folder holds a run and `existing` is `REFUSE`; or
            it is `RESUME` and the run there is another: the message names the differences.
        OSError: the folder cannot be made or written.
    """
    path.mkdir(parents=True, exist_ok=True)
    with _only_writer(path):
        here = json.loads(json.dumps(identity, default=str))
        held = path / contents.identity
        begun = held.exists() or any((path / name).exists() for name in contents.products)
        if begun and existing is Existing.REFUSE:
            raise FolderError(
                f"{path} holds a study already; --resume goes on with it if it is the same,"
                " --overwrite replaces it, --out names another folder"
            )
        if begun and existing is Existing.RESUME:
            _check_same_run(path, held, here)
        elif begun:
            _remove_contents(path, contents)
        held.parent.mkdir(exist_ok=True)
        if not held.exists():
            write_durably(held, (json.dumps(here, indent=1, sort_keys=True) + "\n").encode())
        started = datetime.now(UTC).isoformat(timespec="milliseconds")
        yield f"{started} {platform.node()} {os.getpid()}"


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


def _check_same_run(folder: Path, held: Path, identity: dict[str, Any]) -> None:
    try:
        there = json.loads(held.read_text())
    except FileNotFoundError:
        raise FolderError(f"{folder} holds no finished work to go on from; --overwrite begins anew") from None
    except (ValueError, RecursionError) as error:
        raise FolderError(f"{held} is damaged ({error}); --overwrite begins anew") from error
    differences = list(name_differences(there, identity))
    if differences:
        shown = "; ".join(differences[:8])
        more = f"; and {len(differences) - 8} more" if len(differences) > 8 else ""
        raise FolderError(
            f"{folder} holds another study: {shown}{more}. Run it as it was begun, or --overwrite it"
        )


def name_differences(there: Any, here: Any, name: str = "") -> Iterator[str]:
    """Name every leaf in which two parsed JSON values differ: what it was there, and what it is here."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in sorted({*there, *here}):
            yield from name_differences(there.get(key), here.get(key), f"{name}.{key}" if name else key)
    elif there != here:
        yield f"{name} was {_short(there)}, is {_short(here)}"


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _remove_contents(path: Path, contents: Contents) -> None:
    """Remove what an earlier run left, and nothing else; last what says whose it is."""
    for name in contents.products:
        (path / name).unlink(missing_ok=True)
    for pattern in contents.traces:
        for trace in path.glob(pattern):
            trace.unlink()
    (path / contents.identity).unlink(missing_ok=True)
