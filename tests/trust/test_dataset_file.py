"""The plain file: what was written comes back, equal data give equal bytes, and no file runs code."""

import json
import os
import zipfile
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rl.dataset import Dataset, DatasetError, Transitions, read_dataset
from rl.dataset.plain_file import write_dataset
from tests.rl.dataset.made import LENGTHS, make_transitions

CARD = {"policies": [{"name": "a"}, {"name": "b"}], "preset": "paper"}


def equal(one: Transitions, other: Transitions) -> bool:
    names = [field.name for field in fields(Transitions)]
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


@settings(max_examples=20)
@given(lengths=LENGTHS, seed=st.integers(0, 99), text=st.text(max_size=9))
def test_what_was_written_comes_back(
    tmp_path_factory: pytest.TempPathFactory, lengths: list[int], seed: int, text: str
) -> None:
    path = tmp_path_factory.mktemp("plain") / "d.npz"
    made = Dataset({**CARD, "text": text}, make_transitions(lengths, seed))
    write_dataset(path, made)
    first = path.read_bytes()
    found = read_dataset(path)
    assert equal(found.transitions, made.transitions)
    assert {**made.card, "format": 1} == found.card
    write_dataset(path, made)
    assert path.read_bytes() == first
    with np.load(path, allow_pickle=False) as members:
        assert np.array_equal(members["rewards"], made.transitions.rewards)


@settings(max_examples=150)
@given(data=st.data())
def test_a_damaged_file_is_refused_or_the_same(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("damaged") / "d.npz"
    made = Dataset(CARD, make_transitions([2, 3], 5))
    write_dataset(path, made)
    content = path.read_bytes()
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        path.write_bytes(content[:at])
    else:
        bit = 1 << data.draw(st.integers(0, 7))
        path.write_bytes(content[:at] + bytes([content[at] ^ bit]) + content[at + 1 :])
    try:
        found = read_dataset(path)
    except DatasetError:
        return
    assert equal(found.transitions, made.transitions)


class Trap:
    """Its pickle makes a folder when it is read."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.folder),)


def test_a_pickle_in_a_member_is_not_opened(tmp_path: Path) -> None:
    path, sprung = tmp_path / "d.npz", tmp_path / "sprung"
    write_dataset(path, Dataset(CARD, make_transitions([2], 0)))
    with np.load(path, allow_pickle=False) as members:
        arrays = dict(members)
    for name in arrays:
        trapped: dict[str, Any] = {**arrays, name: np.array([Trap(sprung)], dtype=object)}
        np.savez(path, **trapped)
        with pytest.raises(DatasetError, match="damaged, or not a dataset"):
            read_dataset(path)
    assert not sprung.exists()


def test_an_environment_in_a_card_is_only_text(tmp_path: Path) -> None:
    path, sprung = tmp_path / "d.npz", tmp_path / "sprung"
    spec = json.dumps({"id": "Trap-v0", "entry_point": "os:mkdir", "kwargs": {"path": str(sprung)}})
    write_dataset(path, Dataset({**CARD, "env_spec": spec}, make_transitions([2], 0)))
    assert read_dataset(path).card["env_spec"] == spec
    assert not sprung.exists()


def rewrite(path: Path, **arrays: Any) -> None:
    with np.load(path, allow_pickle=False) as members:
        kept: dict[str, Any] = dict(members)
    np.savez(path, **{**kept, **arrays})


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"more": np.zeros(3)}, "is not a dataset"),
        ({"card": np.array("{")}, "the card is damaged"),
        ({"card": np.array("[" * 100_000)}, "the card is damaged"),
        ({"card": np.array("[]")}, "the card lists no policies"),
        ({"card": np.array(3)}, "the card is no text"),
        ({"card": np.array(json.dumps({**CARD, "format": 9}))}, "has format 9, but this program reads 1"),
        ({"policy": np.array([2])}, "names a policy that its card does not list"),
        ({"policy": np.array([-1])}, "names a policy that its card does not list"),
        ({"rewards": np.zeros(2, np.float32)}, "rewards must have 1 axes"),
    ],
)
def test_a_foreign_file_is_refused(tmp_path: Path, arrays: dict[str, Any], message: str) -> None:
    path = tmp_path / "d.npz"
    write_dataset(path, Dataset(CARD, make_transitions([2], 0)))
    rewrite(path, **arrays)
    with pytest.raises(DatasetError, match=message):
        read_dataset(path)


def test_what_is_no_archive_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros(3), allow_pickle=False)
    with zipfile.ZipFile(tmp_path / "b.npz", "w") as file:
        file.writestr("card.npy", "rubbish")
    for name in ("a.npy", "b.npz", "none.npz"):
        with pytest.raises(DatasetError, match=name):
            read_dataset(tmp_path / name)


def write_members(path: Path, contents: dict[str, bytes]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in contents.items():
            file.writestr(name, content)


def members_of(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as file:
        return {name: file.read(name) for name in file.namelist()}


@pytest.mark.parametrize(
    ("name", "message"), [("card", "the card is no text"), ("rewards", "unpack to .* pass most_bytes")]
)
def test_a_small_file_that_unpacks_to_much_is_refused_unread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, message: str
) -> None:
    path = tmp_path / "d.npz"
    write_dataset(path, Dataset(CARD, make_transitions([2], 0)))
    write_members(path, {**members_of(path), f"{name}.npy": bytes(20_000_000)})
    assert path.stat().st_size < 40_000

    def unpack(*_: Any) -> Any:
        raise AssertionError("it was unpacked")

    monkeypatch.setattr(zipfile.ZipFile, "open", unpack)
    with pytest.raises(DatasetError, match=message):
        read_dataset(path, most_bytes=10_000_000)


def test_a_limit_is_that_of_all_arrays_together(tmp_path: Path) -> None:
    path = tmp_path / "d.npz"
    write_dataset(path, Dataset(CARD, make_transitions([2, 3], 0)))
    size = sum(len(content) for name, content in members_of(path).items() if name != "card.npy")
    assert read_dataset(path, size).card["preset"] == "paper"
    with pytest.raises(DatasetError, match=f"unpack to {size} bytes, more than {size - 1}"):
        read_dataset(path, size - 1)


def test_a_member_given_twice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "d.npz"
    write_dataset(path, Dataset(CARD, make_transitions([2], 0)))
    with zipfile.ZipFile(path, "a") as file, pytest.warns(UserWarning, match="Duplicate"):
        file.writestr("rewards.npy", b"")
    with pytest.raises(DatasetError, match="is not a dataset"):
        read_dataset(path)
