"""A shard gives back what was kept, bit for bit, and whatever is done to it is noticed."""

import json
import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.flight.episode_row import EpisodeRow
from studies.campaign.monte_carlo import Chunk
from studies.campaign.shards import ShardError, read_shard, shard_path, write_durably, write_shard

KINDS = {
    "str": st.text(max_size=20),
    "int": st.integers(-(2**53), 2**53),
    "bool": st.booleans(),
    "float": st.floats(),
}


def rows_of(policy: str, first: int, last: int) -> st.SearchStrategy[list[EpisodeRow]]:
    drawn = {field.name: KINDS[str(field.type)] for field in fields(EpisodeRow)}
    return st.tuples(
        *(
            st.builds(EpisodeRow, **{**drawn, "policy": st.just(policy), "episode": st.just(k)})
            for k in range(first, last)
        )
    ).map(list)


def bits(row: EpisodeRow) -> list[object]:
    values = (getattr(row, field.name) for field in fields(EpisodeRow))
    return [value.hex() if isinstance(value, float) else (type(value), value) for value in values]


def example(first: int = 0, last: int = 2) -> Chunk:
    row = (0, 1000, "success", True, False, 0.1, 1 / 3, 67.0, 71.0, 4500.0, 1.0, 45.0, 9, 0, 1.5, 2.5)
    rows = [EpisodeRow("a", k, *row[1:]) for k in range(first, last)]
    return Chunk(first, last, {"a": rows}, {"a": np.array([0.001, 0.002])}, attempts=2)


@settings(max_examples=30)
@given(rows=rows_of("a", 3, 5), other=rows_of("b", 3, 5))
def test_a_shard_keeps_every_bit(
    tmp_path_factory: pytest.TempPathFactory, rows: list[EpisodeRow], other: list[EpisodeRow]
) -> None:
    seconds = {"a": np.array([0.25, 1e-6]), "b": np.array([0.5])}
    path = write_shard(tmp_path_factory.mktemp("shard"), Chunk(3, 5, {"a": rows, "b": other}, seconds), "now")
    chunk, session = read_shard(path)
    assert session == "now"
    assert [bits(row) for row in chunk.rows["a"]] == [bits(row) for row in rows]
    assert [bits(row) for row in chunk.rows["b"]] == [bits(row) for row in other]
    assert all(np.array_equal(chunk.decision_time[name], seconds[name]) for name in seconds)
    assert list(chunk.rows) == ["a", "b"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shard(tmp_path_factory.mktemp("whole"), example(), "now")


@given(data=st.data())
def test_a_changed_or_cut_shard_is_refused_or_reads_the_same(whole: Path, data: st.DataObject) -> None:
    content = bytearray(whole.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        del content[at:]
    else:
        content[at] = data.draw(st.integers(0, 255))
    path = whole.with_name("changed") / whole.name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
    try:
        chunk, _ = read_shard(path)
    except ShardError:
        return
    assert chunk.rows == example().rows  # a byte of the session or the number of attempts


@given(content=st.binary(max_size=300))
def test_rubbish_is_refused(whole: Path, content: bytes) -> None:
    path = whole.with_name("rubbish") / whole.name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
    with pytest.raises(ShardError):
        read_shard(path)


@pytest.mark.parametrize(
    "header", ["[]", "null", "1", '"x"', "{}", "[" * 100_000, '{"format": 1, "columns": 3}', "9" * 5000]
)
def test_a_header_of_another_shape_is_refused(tmp_path: Path, header: str) -> None:
    path = shard_path(tmp_path, 0, 2)
    path.write_text(header + "\n")
    with pytest.raises(ShardError):
        read_shard(path)


def test_a_shard_under_another_name_is_refused(whole: Path, tmp_path: Path) -> None:
    path = shard_path(tmp_path, 2, 4)
    path.write_bytes(whole.read_bytes())
    with pytest.raises(ShardError, match="holds episodes 0 to 1"):
        read_shard(path)


def test_numbers_are_plain_json(whole: Path) -> None:
    lines = whole.read_text().splitlines()
    assert json.loads(lines[0])["attempts"] == 2
    assert json.loads(lines[1])["rows"][0][7] == 1 / 3
    assert len(lines) == 2


def test_a_failed_write_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    write_durably(path, b"first")

    def full_disk(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(OSError, match="No space"):
        write_durably(path, b"second")
    assert path.read_bytes() == b"first"
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_not_a_number_survives(tmp_path: Path) -> None:
    chunk = example()
    row = EpisodeRow(**{**vars(chunk.rows["a"][0]), "reward": math.nan, "miss_distance_m": -math.inf})
    path = write_shard(tmp_path, Chunk(0, 1, {"a": [row]}, chunk.decision_time), "now")
    back = read_shard(path)[0].rows["a"][0]
    assert math.isnan(back.reward)
    assert back.miss_distance_m == -math.inf
