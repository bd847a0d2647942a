from __future__ import annotations

import json

import numpy as np
import pytest

from rl.inference.artefacts import ArtefactError, card_digest, load_artefact, save_artefact

TENSORS = {
    "layer.0.weight": np.arange(12, dtype=np.float32).reshape(3, 4),
    "layer.0.bias": np.array([1.0, -2.0, 0.5, 0.0], dtype=np.float32),
}


@pytest.fixture
def path(tmp_path):
    save_artefact(tmp_path / "agent", "actor", TENSORS, {"seed": 3})
    return tmp_path / "agent"


def test_round_trip_is_exact(path):
    artefact = load_artefact(path, "actor")
    assert artefact.card["seed"] == 3
    assert set(artefact.tensors) == set(TENSORS)
    for name, tensor in TENSORS.items():
        np.testing.assert_array_equal(artefact.tensors[name], tensor)
        assert artefact.tensors[name].dtype == tensor.dtype


def test_equal_weights_have_equal_digests_and_others_do_not(path, tmp_path):
    again = save_artefact(tmp_path / "again", "actor", TENSORS, {"seed": 4})
    assert again.digest == load_artefact(path, "actor").digest
    changed = {**TENSORS, "layer.0.bias": TENSORS["layer.0.bias"] * np.float32(1.0000001)}
    assert save_artefact(tmp_path / "changed", "actor", changed, {}).digest != again.digest


@pytest.mark.parametrize("keep", [0, 4, 60, -1])
def test_truncated_weights_are_refused(path, keep):
    file = path.with_suffix(".safetensors")
    file.write_bytes(file.read_bytes()[:keep])
    with pytest.raises(ArtefactError, match="damaged"):
        load_artefact(path, "actor")


def test_every_flipped_bit_is_noticed(path):
    file = path.with_suffix(".safetensors")
    original = file.read_bytes()
    for index in range(0, len(original), 7):
        tampered = bytearray(original)
        tampered[index] ^= 0x10
        file.write_bytes(bytes(tampered))
        with pytest.raises(ArtefactError):
            load_artefact(path, "actor")


def test_pickled_weights_are_refused_and_not_run(path, tmp_path):
    import pickle

    witness = tmp_path / "witness"

    class Trap:
        def __reduce__(self):
            return (open, (str(witness), "w"))

    path.with_suffix(".safetensors").write_bytes(pickle.dumps(Trap()))
    with pytest.raises(ArtefactError):
        load_artefact(path, "actor")
    assert not witness.exists()


def test_missing_files_are_named(path):
    path.with_suffix(".safetensors").unlink()
    with pytest.raises(ArtefactError, match=r"agent\.safetensors"):
        load_artefact(path, "actor")
    path.with_suffix(".json").unlink()
    with pytest.raises(ArtefactError, match=r"agent\.json"):
        load_artefact(path, "actor")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 99}, "format 99"),
        ({"kind": "autoencoder"}, "kind 'autoencoder'"),
        ({"tensors": {}}, "does not belong"),
        ({"tensors": []}, "not a weight card"),
    ],
)
def test_foreign_cards_are_refused(path, change, message):
    card = path.with_suffix(".json")
    changed = {**json.loads(card.read_text()), **change}
    card.write_text(json.dumps({**changed, "card_sha256": card_digest(changed)}))
    with pytest.raises(ArtefactError, match=message):
        load_artefact(path, "actor")


@pytest.mark.parametrize("content", ["", "{", "[1, 2]", "null"])
def test_cards_that_are_no_cards_are_refused(path, content):
    path.with_suffix(".json").write_text(content)
    with pytest.raises(ArtefactError):
        load_artefact(path, "actor")


def test_weights_that_are_not_finite_are_refused(tmp_path):
    save_artefact(tmp_path / "bad", "actor", {"a": np.array([1.0, np.nan], dtype=np.float32)}, {})
    with pytest.raises(ArtefactError, match="not finite"):
        load_artefact(tmp_path / "bad", "actor")
