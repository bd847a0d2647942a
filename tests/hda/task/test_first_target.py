"""Tiles without first targets are passed over, the same in every process, and named."""

from dataclasses import replace

import numpy as np
import pytest

from hda.ground.library import Ground, load_tile
from hda.ground.tile import Tile
from hda.task.first_target import offers_targets, probe_tile
from hda.task.presets import PRESETS
from hda.task.random_streams import EpisodeStreams
from hda.task.rules import StartConditions
from hda.task.scenario import draw_scenario

PAPER = PRESETS["paper"]
NUMBERS = [2, 3, 5, 7]


@pytest.fixture(scope="module")
def tiles() -> dict[int, Tile]:
    """One tile of ground four times over; of 3 and 7 all is safe."""
    whole = load_tile(Ground(PAPER.terrain, PAPER.criteria), 1000, "validation")
    safe = replace(whole, deterministic=np.ones((1000, 1000), dtype=np.bool_))
    return {number: replace(safe if number in (3, 7) else whole, number=number) for number in NUMBERS}


def test_only_tiles_with_targets_are_flown_and_evenly(tiles: dict[int, Tile]) -> None:
    flown, left_out = [], set()
    for episode in range(400):
        scenario = draw_scenario(PAPER, EpisodeStreams(0, episode), "own", NUMBERS, lambda k: tiles[k])
        flown.append(scenario.tile.number)
        left_out.update(scenario.left_out)
        assert scenario.tile.number not in scenario.left_out
    assert left_out == {3, 7}
    assert set(flown) == {2, 5}
    assert abs(flown.count(2) - 200) < 4.5 * 10.0  # binomial, a standard deviation of 10: 7e-6


def test_nothing_changes_where_all_are_fit(tiles: dict[int, Tile]) -> None:
    """The tile is the stream's first draw, the target follows, as where no tile is ever passed over."""
    for episode in range(50):
        streams = EpisodeStreams(1, episode)
        scenario = draw_scenario(PAPER, streams, "own", [2, 5], lambda k: tiles[k])
        assert scenario.left_out == ()
        rng = streams.scenario()
        assert scenario.tile.number == [2, 5][int(rng.integers(2))]
        place = rng.uniform(250.0, 750.0), rng.uniform(250.0, 750.0)
        if tiles[2].hazard_share(np.array(place), 100.0) >= 0.8:
            assert tuple(scenario.nominal_target[:2]) == place


def test_without_any_tile_the_way_out_is_named(tiles: dict[int, Tile]) -> None:
    with pytest.raises(ValueError, match=r"no tile of split 'own' has enough .*smaller start\.hazard_share"):
        draw_scenario(PAPER, EpisodeStreams(0, 0), "own", [3, 7], lambda k: tiles[k])


def test_the_answer_for_a_tile_is_always_the_same(tiles: dict[int, Tile]) -> None:
    for tile in tiles.values():
        start = StartConditions(hazard_share=0.9)
        assert probe_tile(tile, start) == probe_tile(replace(tile), start)
        assert offers_targets(tile, start) == probe_tile(tile, start)[0]
    assert offers_targets(tiles[3], StartConditions(hazard_share=0.0))
    assert not offers_targets(tiles[3], StartConditions(hazard_share=0.01))
