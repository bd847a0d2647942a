"""Finished chunks of a study on disk, one file each, so that a killed study goes on where it was.

A shard is JSON lines: a header with the checksum of what follows, then one line per policy. It is written
under a temporary name, flushed to the disk and moved into place, so a name that exists holds a whole chunk.
Numbers are kept to the last bit.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from hda.flight.episode_row import ROW_COLUMNS, EpisodeRow
from studies.campaign.monte_carlo import Chunk

SHARD_FORMAT = 1
_COLUMN_TYPES: dict[str, type] = {"str": str, "int": int, "bool": bool, "float": float}


class ShardError(ValueError):
    """A shard is damaged, or is not one."""


def shard_path(folder: Path, first: int, last: int) -> Path:
    """Where the chunk of episodes first to last - 1 is kept."""
    return folder / f"episodes-{first:09d}-{last:09d}.jsonl"


def write_durably(path: Path, content: bytes) -> None:
    """Write a file so that after a crash it is either whole or not there.

    Raises:
        OSError: the folder cannot be written, or the disk is full; the path is then as it was.
    """
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with draft.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(draft, path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise
    if hasattr(os, "O_DIRECTORY"):  # POSIX: the new name must reach the disk too
        descriptor = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def write_shard(folder: Path, chunk: Chunk, session: str) -> Path:
    """Keep a finished chunk; `session` says which run of the program flew it."""
    lines = []
    for policy, rows in chunk.rows.items():
        seconds = [round(float(value), 9) for value in chunk.decision_time[policy]]
        values = [[getattr(row, name) for name in ROW_COLUMNS] for row in rows]
        lines.append(json.dumps({"policy": policy, "rows": values, "decision_time": seconds}))
    body = "".join(f"{line}\n" for line in lines).encode()
    header = {
        "format": SHARD_FORMAT,
        "first": chunk.first,
        "last": chunk.last,
        "attempts": chunk.attempts,
        "left_out": chunk.left_out,
        "session": session,
        "columns": ROW_COLUMNS,
        "sha256": hashlib.sha256(body).hexdigest(),
    }
    path = shard_path(folder, chunk.first, chunk.last)
    write_durably(path, json.dumps(header).encode() + b"\n" + body)
    return path


def read_shard(
    path: Path, policies: Collection[str] | None = None, *, checked: bool = False
) -> tuple[Chunk, str]:
    """Read a chunk back, with the session that flew it.

    Args:
        path: the file.
        policies: only the rows of these; of all by default.
        checked: its checksum was found right before, so it is not computed again.

    Raises:
        ShardError: the file is damaged, of another format, or does not hold what its name says.
        OSError: it cannot be read.
    """
    head, _, body = path.read_bytes().partition(b"\n")
    try:
        header = json.loads(head)
        _check_version(path, header)
        if not checked and hashlib.sha256(body).hexdigest() != header["sha256"]:
            raise ShardError(f"{path} is damaged: its checksum does not hold")
        lines = body.splitlines()
        if policies is not None:
            heads = tuple(f'{{"policy": {json.dumps(name)}, '.encode() for name in policies)
            lines = [line for line in lines if line.startswith(heads)]
        chunk = _parse_chunk(header, [json.loads(line) for line in lines])
        session = str(header["session"])
    except ShardError:
        raise
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise ShardError(f"{path} is damaged: {type(error).__name__}: {error}") from error
    if path.name != shard_path(path.parent, chunk.first, chunk.last).name:
        raise ShardError(f"{path} holds episodes {chunk.first} to {chunk.last - 1}")
    return chunk, session


def _check_version(path: Path, header: dict[str, Any]) -> None:
    """Refuse a shard of an unknown format or of other columns, and say which."""
    held = header["format"]
    if type(held) is not int or held != SHARD_FORMAT:
        raise ShardError(
            f"{path} was written by another version: shard format {held!r}, this one reads {SHARD_FORMAT}"
        )
    columns = tuple(header["columns"])
    if columns != ROW_COLUMNS:
        odd = ", ".join(sorted(map(str, {*columns} ^ {*ROW_COLUMNS}))) or "the same in another order"
        raise ShardError(f"{path} was written by another version: other columns ({odd})")


def _parse_chunk(header: dict[str, Any], lines: list[dict[str, Any]]) -> Chunk:
    first, last, attempts = header["first"], header["last"], header["attempts"]
    if not all(type(value) is int for value in (first, last, attempts)) or not 0 <= first < last:
        raise ShardError("a shard is damaged: its header has no valid episode numbers")
    left_out = header.get("left_out", [])  # an older shard has none
    if not all(type(number) is int for number in left_out):
        raise ShardError("a shard is damaged: its header has no valid numbers of tiles")
    rows: dict[str, list[EpisodeRow]] = {}
    seconds: dict[str, np.ndarray] = {}
    for line in lines:
        policy = line["policy"]
        rows[policy] = [_parse_row(values) for values in line["rows"]]
        seconds[policy] = np.array(line["decision_time"], dtype=np.float64)
        if [row.episode for row in rows[policy]] != list(range(first, last)):
            raise ShardError(f"a shard is damaged: policy {policy!r} lacks episodes of {first} to {last - 1}")
    return Chunk(first, last, rows, seconds, attempts, tuple(left_out))


def _parse_row(values: list[Any]) -> EpisodeRow:
    if len(values) != len(ROW_COLUMNS):
        raise ShardError(f"a shard is damaged: a row has {len(values)} columns, not {len(ROW_COLUMNS)}")
    for name, value in zip(ROW_COLUMNS, values, strict=True):
        wanted = _COLUMN_TYPES[EpisodeRow.__annotations__[name]]
        if type(value) is not wanted:
            raise ShardError(f"a shard is damaged: {name} is {value!r}, not {wanted.__name__}")
    return EpisodeRow(*values)
