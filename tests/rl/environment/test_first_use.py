"""The first episodes on a ground: its tiles are built before, all together, with a bar."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hda.ground import library
from hda.ground.library import Ground, remove_tiles
from hda.task.presets import PRESETS
from rl.environment.map_env import LunarHDAMapEnv
from rl.environment.native.vector_env import LunarHDAMapVectorEnv


@pytest.mark.slow
def test_tiles_are_built_with_a_bar_and_once(monkeypatch, capsys):
    monkeypatch.setitem(library.SPLITS, "train", range(2))
    paper = PRESETS["paper"]
    preset = replace(paper, terrain=replace(paper.terrain, maximum_elevation=50.25))
    ground = Ground(preset.terrain, preset.criteria)
    assert not ground.folder().exists()
    try:
        vector = LunarHDAMapVectorEnv(2, preset=preset)
        assert not ground.folder().exists()
        seen, _ = vector.reset(seed=0)
        assert "building train terrain" in capsys.readouterr().out
        assert sorted(path.name for path in ground.folder().glob("tile-*")) == ["tile-00000", "tile-00001"]
        alone, _ = LunarHDAMapEnv(preset).reset(seed=0)
        assert np.array_equal(seen["map"][0], alone["map"])
        vector.step(np.zeros((2, 5), np.float32))
        assert "building" not in capsys.readouterr().out
    finally:
        remove_tiles(ground)


def test_a_given_scenario_builds_nothing(monkeypatch):
    from hda.task.scenario import sample_scenario

    scenario = sample_scenario("paper", 0, 0, "train")
    env = LunarHDAMapEnv()
    monkeypatch.setattr(
        "rl.environment.episode_source.prepare_tiles", lambda *_: pytest.fail("nothing is to be built")
    )
    env.reset(options={"scenario": scenario})
