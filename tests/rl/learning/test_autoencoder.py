from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from hda.task.presets import PRESETS
from rl.inference.artefacts import ArtefactError
from rl.inference.latent import (
    LATENT_SIZE,
    encoder_names,
    encoder_of_card,
    encoder_path,
    load_autoencoder,
    load_encoder,
)
from rl.inference.networks import MapEncoder
from rl.learning.autoencoder import (
    Autoencoder,
    AutoencoderSettings,
    autoencoder_from_tensors,
    autoencoder_tensors,
    collect_maps,
    measure_reconstruction,
    normalize_latents,
    pixel_weights,
    reconstruct,
    train_autoencoder,
    turned,
)

PAPER = PRESETS["paper"]


@pytest.fixture(scope="module")
def maps():
    return collect_maps(PAPER, "validation", 40, seed=12345)


def test_maps_are_looks_of_random_rollouts(maps):
    assert maps.dtype == np.uint8
    assert maps.shape[1:] == (64, 64)
    assert 40 * 4 < len(maps) < 40 * 20
    again = collect_maps(PAPER, "validation", 2, seed=12345)
    np.testing.assert_array_equal(again, maps[: len(again)])
    assert 0.0 < (maps > 127).mean() < 0.9


def test_compiled_encoder_equals_torch(maps):
    network = autoencoder_from_tensors(load_autoencoder().tensors)
    encoder = load_encoder()
    images = maps[:50].astype(np.float32) / 255.0
    with torch.no_grad():
        expected = network.encode(torch.from_numpy(images)[:, None]).numpy()
    got = np.stack([encoder.encode(image) for image in images])
    assert got.shape == (50, LATENT_SIZE)
    np.testing.assert_allclose(got, expected, atol=5e-4)


def test_encoding_is_the_same_bits_each_time_and_leaves_the_map_alone(maps):
    image = maps[3].astype(np.float32) / 255.0
    kept = image.copy()
    first = load_encoder().encode(image)
    second = load_encoder().encode(image)
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(image, kept)
    assert not np.shares_memory(first, second)


def test_tensors_round_trip(maps):
    torch.manual_seed(1)
    network = Autoencoder()
    again = autoencoder_from_tensors(autoencoder_tensors(network))
    for name, value in network.state_dict().items():
        torch.testing.assert_close(again.state_dict()[name], value, rtol=0.0, atol=0.0)
    image = maps[0].astype(np.float32) / 255.0
    encoder = MapEncoder.from_tensors(autoencoder_tensors(network))
    expected = network.encode(torch.from_numpy(image)[None, None]).detach().numpy()[0]
    np.testing.assert_allclose(encoder.encode(image), expected, atol=1e-5)


def test_shipped_autoencoder_keeps_most_of_the_variance_of_unseen_ground(maps):
    network = autoencoder_from_tensors(load_autoencoder().tensors)
    card = load_autoencoder().card["reconstruction_error"]["validation"]
    error = measure_reconstruction(network, maps)
    # 300 rollouts in the card, 40 here: the spread between samples of 40 is about 4 %
    assert error.variance_left == pytest.approx(card["variance_left"], rel=0.2)
    assert error.variance_left < 0.2
    assert reconstruct(network, maps[:3]).shape == (3, 64, 64)


def test_shipped_latents_are_about_standard(maps):
    latents = np.stack([load_encoder().encode(m.astype(np.float32) / 255.0) for m in maps])
    assert np.abs(latents.mean(0)).max() < 0.5
    assert np.all((latents.std(0) > 0.6) & (latents.std(0) < 1.5))


def test_normalizing_latents_leaves_reconstructions(maps):
    torch.manual_seed(2)
    network = Autoencoder()
    before = reconstruct(network, maps[:64])
    normalize_latents(network, maps)
    np.testing.assert_allclose(reconstruct(network, maps[:64]), before, atol=1e-5)
    with torch.no_grad():
        latents = network.encode(torch.from_numpy(maps)[:, None].float() / 255.0)
    torch.testing.assert_close(latents.mean(0), torch.zeros(LATENT_SIZE), rtol=0, atol=1e-3)
    torch.testing.assert_close(latents.std(0), torch.ones(LATENT_SIZE), rtol=1e-3, atol=0)


def test_the_eight_symmetries_are_distinct_and_keep_the_pixels():
    image = torch.arange(16.0).reshape(1, 1, 4, 4)
    images = [turned(image, k) for k in range(8)]
    assert len({tuple(i.flatten().tolist()) for i in images}) == 8
    assert all(torch.equal(i.flatten().sort().values, image.flatten()) for i in images)


def test_weights_of_pixels_peak_at_the_centre_and_average_one():
    weights = pixel_weights(AutoencoderSettings())
    assert float(weights.mean()) == pytest.approx(1.0, abs=1e-6)
    assert float(weights[31, 31]) == float(weights.max())
    torch.testing.assert_close(weights, weights.flip(0).T)


def test_training_lowers_the_loss_and_repeats(maps):
    settings = AutoencoderSettings(epochs=3, batch_size=32)
    torch.set_num_threads(1)
    losses = [[loss for _, loss, _ in train_autoencoder(maps, settings, seed=0)] for _ in range(2)]
    assert losses[0][-1] < losses[0][0]
    assert losses[0] == losses[1]


def test_an_encoder_is_found_by_its_name_and_by_the_digest_on_a_card(tmp_path: Path) -> None:
    assert encoder_names()[0] == "autoencoder"
    for name in encoder_names():
        path = encoder_path(name)
        assert encoder_of_card({"autoencoder": load_autoencoder(path).digest}, tmp_path) == path
    with pytest.raises(ValueError, match="unknown encoder 'auto'"):
        encoder_path("auto")
    with pytest.raises(ArtefactError, match="made for autoencoder 'none', but this program has"):
        encoder_of_card({"autoencoder": "none"}, tmp_path)
