"""A setting on a user's own ground: tiles without enough hazard are left out and named."""

from pathlib import Path

import numpy as np
import pytest

from hda.ground.library import Ground, check_split, tile_numbers
from hda.ground.own_terrain import OWN_SPLIT, OwnTerrain
from hda.task.own_ground import place_preset
from hda.task.scenario import sample_scenario
from hda.terrain.generator import generate_terrain, terrain_rng
from hda.terrain.settings import PAPER_TERRAIN


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three tiles: smooth, hazardous, smooth but for a round field of blocks in the middle."""
    rng = np.random.default_rng(0)
    smooth = rng.normal(scale=1e-3, size=(1000, 1000)) + 0.01 * np.arange(1000)
    hazardous = generate_terrain(PAPER_TERRAIN, terrain_rng(7))
    blocks = smooth.copy()
    row, column = np.mgrid[:1000, :1000]
    blocks += 3.0 * ((rng.random(blocks.shape) < 0.1) & (np.hypot(row - 500, column - 500) < 60.0))
    path = tmp_path_factory.mktemp("mixed") / "mixed.npy"
    np.save(path, np.hstack([smooth, hazardous, blocks]))
    return path


def test_tiles_without_enough_hazard_are_left_out_and_named(
    mixed: Path, cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    preset = place_preset("paper", mixed, workers=1)
    assert isinstance(preset.terrain, OwnTerrain)
    assert preset.terrain.tiles == (0, 1, 2)
    assert preset.terrain.too_safe == (0, 2)
    assert preset.terrain.description()["too_safe"] == (0, 2)
    told = capsys.readouterr().err
    assert "mixed.npy: 2 of 3 tiles are not flown over, tiles 0, 2" in told
    assert "--hazard-share" in told
    ground = Ground(preset.terrain, preset.criteria)
    assert tile_numbers(OWN_SPLIT, ground) == (1,)
    assert {sample_scenario(preset, 0, episode, OWN_SPLIT).tile.number for episode in range(20)} == {1}
    with pytest.raises(ValueError, match="tile 0 does not belong"):
        check_split(0, OWN_SPLIT, ground)


def test_a_smaller_share_flies_over_all_of_them(
    mixed: Path, cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The tiles are the same, so they are built once."""
    strict = place_preset("paper", mixed, workers=1)
    capsys.readouterr()
    preset = place_preset("paper", mixed, hazard_share=0.0, workers=1)
    output = capsys.readouterr()
    assert output.err == ""
    assert "building" not in output.out
    assert Ground(preset.terrain, preset.criteria).key == Ground(strict.terrain, strict.criteria).key
    flown = {sample_scenario(preset, 0, episode, OWN_SPLIT).tile.number for episode in range(30)}
    assert flown == {0, 1, 2}


def test_a_tile_that_is_flown_over_has_targets_for_every_episode(mixed: Path, cache: Path) -> None:
    """A share that one place in a thousand has: some episode would find none and stop the study."""
    from hda.ground.library import load_tile

    preset = place_preset("paper", mixed, hazard_share=0.0, workers=1)
    tile = load_tile(Ground(preset.terrain, preset.criteria), 2, OWN_SPLIT)
    places = np.random.default_rng(0).uniform(250.0, 750.0, (20_000, 2))
    shares = np.array([tile.hazard_share(place, 100.0) for place in places])
    rare = float(np.quantile(shares, 0.999))
    assert 0.2 < rare < shares.max()
    placed = place_preset("paper", mixed, hazard_share=rare, workers=1)
    assert isinstance(placed.terrain, OwnTerrain)
    assert 2 in placed.terrain.too_safe


def test_only_where_no_tile_is_left_it_stops(mixed: Path, cache: Path, tmp_path: Path) -> None:
    path = tmp_path / "smooth.npy"
    np.save(path, np.load(mixed, allow_pickle=False)[:, :1000])
    with pytest.raises(ValueError, match=r"smooth\.npy: no tile has enough first targets") as caught:
        place_preset("paper", path, workers=1)
    assert "\n" not in str(caught.value)
