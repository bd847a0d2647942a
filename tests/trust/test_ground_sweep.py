"""Many elevation models made by chance: no void is taken as ground, no ground as void, no slope is wrong."""

import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hda.ground.own_terrain import OwnTerrain, cut_tile, open_own_terrain
from tests.oracles.mapped_plane import SLOPE_DEG, draw_site, measured_slope, write_plane
from tests.trust.made_ground import draw_ground, put_void

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")


def try_to_open(path: Path, side: float | None = None, **options: Any) -> OwnTerrain | str:
    """The terrain, or the one line of its refusal."""
    try:
        return open_own_terrain(path, side, **options)
    except ValueError as error:
        return str(error)


@pytest.mark.parametrize("cases", [40, pytest.param(400, marks=pytest.mark.slow)])
def test_no_void_is_accepted_and_no_ground_is_refused(tmp_path: Path, cases: int) -> None:
    """And with the value that the refusal names, the void is unknown ground, and the rest is as it was."""
    path, used = tmp_path / "site.npy", 0
    for number in range(cases):
        rng = np.random.default_rng([20_261, number])
        ground = draw_ground(rng)
        np.save(path, ground.heights)
        opened = try_to_open(path, ground.side)
        assert isinstance(opened, OwnTerrain), (number, ground.story, opened)
        case = put_void(rng, ground)
        np.save(path, case.heights)
        refusal = try_to_open(path, case.side)
        assert isinstance(refusal, str), (number, case.story)
        assert "no-data value that the file does not declare" in refusal, (number, case.story)
        assert "\n" not in refusal
        named = [float(value) for value in re.findall(r"--nodata=(\S+)", refusal)]
        opened = try_to_open(path, case.side, nodata=named)
        if isinstance(opened, str):  # too much of the tile, or a blurred edge, which is no value
            assert "unknown ground" in opened, (number, case.story, opened)
            continue
        used += 1
        tile = cut_tile(opened, 0)
        cells = np.repeat(np.repeat(case.void, round(case.side), axis=0), round(case.side), axis=1)
        assert np.isnan(tile[cells]).all(), (number, case.story)
        if case.side == 1.0:
            known = np.isfinite(tile)
            np.testing.assert_array_equal(tile[known], case.heights[known])
            beside = case.heights[~known & ~cells].astype(np.float64)  # ground that has just this height
            assert np.isclose(beside[:, None], named, rtol=1e-6, atol=0.0).any(axis=1).all()
    assert used > 0.2 * cases


@pytest.mark.parametrize("cases", [40, pytest.param(400, marks=pytest.mark.slow)])
def test_no_slope_is_off_by_more_than_two_percent(tmp_path: Path, cases: int) -> None:
    """On maps of the Moon, Mars and Earth; what is refused is refused for its scale."""
    path, what = tmp_path / "site.tif", Counter()
    for number in range(cases):
        rng = np.random.default_rng([20_263, number])
        site, side = draw_site(rng), float(rng.choice([2.0, 5.0, 10.0]))
        write_plane(path, site, rng.uniform(0.0, 2.0 * np.pi), side, round(1060 / side))
        opened = try_to_open(path)
        if isinstance(opened, str):
            assert re.search(r"a metre of its map is .*gdalwarp -t_srs", opened), (site, opened)
            what["refused"] += 1
            continue
        what["as it is" if opened.map_scale == (1.0, 1.0) else "corrected"] += 1
        tangents = [np.tan(np.radians(angle)) for angle in (measured_slope(cut_tile(opened, 0)), SLOPE_DEG)]
        assert tangents[0] == pytest.approx(tangents[1], rel=0.02), site
    assert min(what[kind] for kind in ("refused", "as it is", "corrected")) > 0.1 * cases
