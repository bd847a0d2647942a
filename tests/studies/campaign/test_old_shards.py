"""A shard that an earlier version wrote is read to the rows that it was written from.

`shard_format_1/` holds one of three episodes and two policies on preset `hard`, as format 1 wrote it; its
bytes never change. A new format keeps this test and adds a shard of its own.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from hda.flight.episode_row import ROW_COLUMNS
from studies.campaign.shards import SHARD_FORMAT, ShardError, read_shard, shard_path

SHARD = shard_path(Path(__file__).parent / "shard_format_1", 0, 3)
AS_WRITTEN = "ac366b39de9856a452f961683f8c045b618534acc350180a00055fec9b95df79"


def rewritten(folder: Path, **changes: object) -> Path:
    """The shard with another header."""
    head, _, body = SHARD.read_bytes().partition(b"\n")
    path = folder / SHARD.name
    path.write_bytes(json.dumps({**json.loads(head), **changes}).encode() + b"\n" + body)
    return path


def test_the_old_shard_is_as_it_was_written() -> None:
    assert hashlib.sha256(SHARD.read_bytes()).hexdigest() == AS_WRITTEN


def test_an_old_shard_is_read_to_its_rows() -> None:
    chunk, session = read_shard(SHARD)
    header, *lines = [json.loads(line) for line in SHARD.read_text(encoding="utf-8").splitlines()]
    assert (chunk.first, chunk.last, chunk.attempts) == (0, 3, 1)
    assert session == header["session"]
    assert list(chunk.rows) == ["single-divert", "nearest-safe"]
    for line in lines:
        rows = chunk.rows[line["policy"]]
        written = [dict(zip(header["columns"], values, strict=True)) for values in line["rows"]]
        assert [vars(row) for row in rows] == written
        assert np.array_equal(chunk.decision_time[line["policy"]], line["decision_time"])


def test_numbers_of_an_old_shard_have_their_old_meaning() -> None:
    second = read_shard(SHARD)[0].rows["single-divert"][1]
    assert (second.episode, second.tile, second.outcome) == (1, 1017, "unsafe-site")
    assert (second.safe_site, second.success) == (False, False)
    assert (second.decisions, second.fallbacks) == (8, 0)
    assert second.miss_distance_m == 0.09586368139501848
    assert second.touchdown_speed_mps == 0.6021144503541483
    assert second.propellant_percent == 66.63358134364717
    assert second.minimum_slant_angle_deg == 72.76326011552226
    assert second.maximum_thrust_n == 4741.969535915792
    assert second.reward == -1.7275058952858366
    assert second.flight_time_s == 39.14031877540539
    assert (second.touchdown_x_m, second.touchdown_y_m) == (468.7102714480604, 672.673637402578)


def test_one_policy_of_an_old_shard_is_read_alone() -> None:
    chunk, _ = read_shard(SHARD, policies=("nearest-safe",))
    assert list(chunk.rows) == ["nearest-safe"]
    assert [row.episode for row in chunk.rows["nearest-safe"]] == [0, 1, 2]


@pytest.mark.parametrize("unknown", [SHARD_FORMAT + 1, 0, "1", None])
def test_a_shard_of_an_unknown_format_is_refused_by_both_numbers(tmp_path: Path, unknown: object) -> None:
    path = rewritten(tmp_path, format=unknown)
    with pytest.raises(ShardError) as refusal:
        read_shard(path)
    assert str(path) in str(refusal.value)
    assert f"shard format {unknown!r}" in str(refusal.value)
    assert f"reads {SHARD_FORMAT}" in str(refusal.value)


def test_a_shard_with_other_columns_is_refused_by_their_names(tmp_path: Path) -> None:
    columns = [*ROW_COLUMNS[:-2], "touchdown_z_m", ROW_COLUMNS[-1]]
    with pytest.raises(ShardError, match=r"other columns \(touchdown_x_m, touchdown_z_m\)"):
        read_shard(rewritten(tmp_path, columns=columns))
