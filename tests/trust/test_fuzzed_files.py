"""Whatever stands in a weight file, log, shard or study folder: a labelled error, or what was kept."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.flight.episode_row import EpisodeRow
from hda.policies.beliefs.surroundings import safe_share_table
from rl.inference.artefacts import ArtefactError, card_digest, load_artefact, save_artefact
from rl.policies.actor import load_actor
from rl.training.run_folder import read_rows, read_run
from studies.campaign.claimed_folder import Existing, FolderError
from studies.campaign.monte_carlo import Chunk, Study, chunk_bounds
from studies.campaign.shards import ShardError, read_shard, shard_path
from studies.campaign.study_folder import open_study_folder

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
HOW = st.sampled_from(["cut", "flip", "rubbish", "grow"])


def damaged(content: bytes, data: st.DataObject) -> bytes:
    """The content cut short, with a bit flipped, replaced or with something behind it."""
    how = data.draw(HOW)
    if how == "cut":
        return content[: data.draw(st.integers(0, len(content) - 1))]
    if how == "flip":
        at = data.draw(st.integers(0, len(content) - 1))
        return content[:at] + bytes([content[at] ^ (1 << data.draw(st.integers(0, 7)))]) + content[at + 1 :]
    return (
        data.draw(st.binary(max_size=60)) if how == "rubbish" else content + data.draw(st.binary(max_size=9))
    )


# ---- weights ----

TENSORS = {
    "layer.0.weight": np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 4),
    "layer.0.bias": np.ones(4),
}
CARD = {"seed": 3, "layout": "curved", "hidden": [8, 8]}


@pytest.mark.parametrize("suffix", [".safetensors", ".json"])
@settings(max_examples=80)
@given(data=st.data())
def test_damaged_weights_are_refused_or_the_same(
    tmp_path_factory: pytest.TempPathFactory, suffix: str, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("weights") / "agent"
    whole = save_artefact(path, "actor", TENSORS, CARD)
    file = path.with_suffix(suffix)
    file.write_bytes(damaged(file.read_bytes(), data))
    try:
        read = load_artefact(path, "actor")
    except ArtefactError:
        return
    assert read.card == whole.card
    assert read.digest == whole.digest
    assert all(np.array_equal(read.tensors[name], tensor) for name, tensor in TENSORS.items())


@settings(max_examples=40)
@given(
    name=st.sampled_from(["layout", "hidden", "action_ranges", "encoding_version", "tensors", "kind"]),
    value=JSON,
)
def test_a_foreign_card_is_refused(tmp_path_factory: pytest.TempPathFactory, name: str, value: Any) -> None:
    """Its checksum holds, but it says something else."""
    path = tmp_path_factory.mktemp("foreign") / "agent"
    save_artefact(path, "actor", TENSORS, CARD)
    card = {**json.loads(path.with_suffix(".json").read_text()), name: value}
    path.with_suffix(".json").write_text(json.dumps({**card, "card_sha256": card_digest(card)}))
    with pytest.raises(ArtefactError):
        load_actor(path)


@pytest.mark.parametrize("content", ["[" * 100_000, "9" * 5000, '{"tensors": {}, "format": []}', "\ufeff{}"])
def test_a_card_that_breaks_readers_is_refused(tmp_path: Path, content: str) -> None:
    save_artefact(tmp_path / "agent", "actor", TENSORS, CARD)
    (tmp_path / "agent.json").write_text(content)
    with pytest.raises(ArtefactError):
        load_artefact(tmp_path / "agent", "actor")


# ---- logs ----

LOG = b"step,updates,reward\r\n100,50,-1.5\r\n200,150,\r\n300,250,0.25\r\n"


@settings(max_examples=80)
@given(data=st.data())
def test_a_damaged_log_is_refused_or_has_whole_rows(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("log") / "validation.csv"
    path.write_bytes(damaged(LOG, data))
    try:
        rows = read_rows(path)
    except ValueError as error:
        assert "validation.csv" in str(error)  # noqa: PT017 - either is right
        return
    for row in rows:
        int(row["step"])
        assert all(value == "" or float(value) is not None for value in row.values())


@pytest.mark.parametrize("kept", range(len(LOG)))
def test_a_log_that_was_cut_keeps_its_finished_lines(tmp_path: Path, kept: int) -> None:
    (tmp_path / "training.csv").write_bytes(LOG[:kept])
    finished = LOG[:kept].count(b"\n") - 1
    assert [row["step"] for row in read_rows(tmp_path / "training.csv")] == ["100", "200", "300"][
        : max(0, finished)
    ]


@given(content=st.binary(max_size=80) | JSON.map(lambda value: json.dumps(value).encode()))
def test_a_foreign_record_of_a_run_is_refused(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    folder = tmp_path_factory.mktemp("run")
    (folder / "run.json").write_bytes(content)
    with pytest.raises(ValueError, match="run"):
        read_run(folder)


def test_the_table_of_surroundings_is_whole() -> None:
    table = safe_share_table()
    assert table.shape == (12, 12)
    assert ((table >= 0.0) & (table <= 1.0)).all()


# ---- resumed studies ----

KINDS: dict[str, Callable[[int], object]] = {
    "str": lambda _: "success", "int": int, "bool": lambda k: k % 2 == 0, "float": lambda k: k / 3.0
}  # fmt: skip


def flown(study: Study, first: int, last: int) -> Chunk:
    """A chunk such as flying gives back, made up: only what is kept of it matters here."""
    rows = {
        name: [
            EpisodeRow(
                **{
                    **{column: KINDS[str(kind)](k) for column, kind in EpisodeRow.__annotations__.items()},
                    "policy": name,
                    "episode": k,
                }  # pyright: ignore[reportArgumentType]
            )
            for k in range(first, last)
        ]
        for name in study.policies
    }
    return Chunk(first, last, rows, {name: np.full(last - first, 0.5) for name in study.policies})


@settings(max_examples=60)
@given(data=st.data())
def test_a_damaged_folder_is_refused_or_gives_what_was_flown(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    from hda.task.presets import PRESETS

    study = Study(PRESETS["paper"], ("no-divert", "oracle"), 25, 4)
    path = tmp_path_factory.mktemp("study") / "study"
    chunks = [flown(study, *bounds) for bounds in chunk_bounds(study)]
    with open_study_folder(path, study, Existing.REFUSE) as folder:
        for chunk in chunks:
            folder.store(chunk)
    files = sorted(file for file in (path / "shards").iterdir() if file.suffix in (".json", ".jsonl"))
    assert len(files) == 4
    file = data.draw(st.sampled_from(files))
    file.write_bytes(damaged(file.read_bytes(), data))
    try:
        with open_study_folder(path, study, Existing.RESUME):
            pass
    except FolderError:
        assert file.name == "study.json"
        return
    for chunk in chunks:
        try:
            read, _ = read_shard(shard_path(path / "shards", chunk.first, chunk.last))
        except ShardError:
            assert file.name == shard_path(path, chunk.first, chunk.last).name
            continue
        assert read.rows == chunk.rows


@given(content=st.binary(max_size=60) | JSON.map(lambda value: json.dumps(value).encode()))
@settings(max_examples=60)
def test_a_folder_with_a_foreign_record_is_refused(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    from hda.task.presets import PRESETS

    path = tmp_path_factory.mktemp("study")
    (path / "shards").mkdir()
    (path / "shards" / "study.json").write_bytes(content)
    study = Study(PRESETS["paper"], ("no-divert",), 5)
    for existing in (Existing.REFUSE, Existing.RESUME):
        with pytest.raises(FolderError), open_study_folder(path, study, existing):
            pass
