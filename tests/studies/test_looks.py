"""The looks study: what it counts, how it scores, and what stands in its folder."""

import csv
import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from hda.ground.library import Ground, load_tile
from hda.sensing.gridding import ElevationMap, PixelGrid
from hda.sensing.measured_look import MeasuredGround
from hda.task.presets import PRESETS
from studies.campaign.claimed_folder import FolderError
from studies.looks import counts as looks_counts
from studies.looks.calibration import EDGES, StatementCounts, count_statements, score_statements
from studies.looks.command import Looks, study_looks
from studies.looks.counts import LookSeries, PixelCounts, count_pixels, place_look, sensor_of
from studies.looks.picture import draw_calibration, draw_looks
from studies.looks.table import score_looks

LIDAR = PRESETS["lidar"]
SERIES = LookSeries(LIDAR, looks=2, off_nadir=math.radians(10.0), threshold=0.5, study_seed=3)


def tile_of(number: int):
    return load_tile(Ground(LIDAR.terrain, LIDAR.criteria), number, "tuning")


@pytest.mark.parametrize("slant_range", [150.0, 950.0])
def test_a_look_is_taken_at_its_range_and_angle_and_falls_toward_its_target(slant_range: float):
    tile = tile_of(2000)
    state, target = place_look(SERIES, tile, 1, slant_range)
    offset = state.position - target
    assert np.linalg.norm(offset) == pytest.approx(slant_range)
    assert math.acos(offset[2] / slant_range) == pytest.approx(math.radians(10.0))
    assert tile.hazard_share(target, 100.0) >= 0.8
    np.testing.assert_allclose(np.cross(state.velocity, offset), 0.0, atol=1e-9)
    other, same_target = place_look(SERIES, tile, 1, 2.0 * slant_range)
    np.testing.assert_array_equal(target, same_target)
    np.testing.assert_allclose(np.cross(other.position - target, offset), 0.0, atol=1e-6)


def test_a_look_that_tells_the_truth_counts_as_right_in_every_pixel(monkeypatch: pytest.MonkeyPatch):
    """The count itself: a verdict taken from the true map has precision and recall of one."""
    tile = tile_of(2001)

    def tell_the_truth(lidar, flown_tile, state, target, series, number) -> MeasuredGround:
        shape = flown_tile.deterministic.shape
        grid = PixelGrid(0, 0, 1.0, *shape)
        elevation = ElevationMap(grid, np.zeros(shape), np.ones(shape), np.ones(shape, np.int32))
        return MeasuredGround(elevation, flown_tile.deterministic.astype(float), np.ones(shape, dtype=bool))

    monkeypatch.setattr(looks_counts, "take_look", tell_the_truth)
    counted = count_pixels(SERIES, 2001, 64, 600.0)
    assert counted.called == counted.right == counted.safe
    assert counted.known == counted.pixels == 2 * 64 * 64
    assert 0.0 < counted.safe / counted.pixels < 0.2  # around first targets at least 80 % is hazard
    assert tile.deterministic.any()


def test_the_score_is_the_ratios_over_all_tiles_and_wider_than_wilsons():
    counts = [
        PixelCounts(40, 50, 30, 90, 100),
        PixelCounts(10, 0, 0, 95, 100),
        PixelCounts(50, 60, 45, 100, 100),
    ]
    row = score_looks(64, 300.0, 1.1, 4, counts)
    assert row.looks == 12
    assert row.safe == pytest.approx(100 / 300)
    assert row.known == pytest.approx(285 / 300)
    assert row.precision.estimate == pytest.approx(75 / 110)
    assert row.recall.estimate == pytest.approx(75 / 100)
    assert row.recall.low < 0.66  # Wilson's from 100 pixels is 0.66; tiles differ
    blind = score_looks(64, 300.0, 1.1, 1, [PixelCounts(0, 0, 0, 0, 100)])
    assert math.isnan(blind.precision.estimate)


def test_more_rays_and_less_range_make_a_look_truer():
    def precision(rays: int, slant_range: float) -> float:
        found = [count_pixels(SERIES, number, rays, slant_range) for number in range(2000, 2010)]
        return sum(counted.right for counted in found) / sum(counted.called for counted in found)

    far, near, fine = precision(64, 950.0), precision(64, 300.0), precision(128, 950.0)
    assert far + 0.2 < near
    assert far + 0.2 < fine


def test_the_study_writes_its_folder_goes_on_and_refuses_another(tmp_path):
    options = Looks(rays=(32, 64), ranges=(300.0, 150.0), looks=2, tiles=6, flights=2, out=tmp_path / "looks")
    rows, beliefs = study_looks(options)
    assert [(row.rays, row.slant_range) for row in rows] == [
        (32, 300.0),
        (32, 150.0),
        (64, 300.0),
        (64, 150.0),
    ]
    with (tmp_path / "looks" / "table.csv").open() as stream:
        lines = list(csv.DictReader(stream))
    assert [float(line["recall_percent"]) for line in lines] == pytest.approx(
        [100.0 * row.recall.estimate for row in rows], abs=1e-6
    )
    assert (tmp_path / "looks" / "looks.png").stat().st_size > 10_000
    assert (tmp_path / "looks" / "flight.png").stat().st_size > 50_000
    assert (tmp_path / "looks" / "calibration.png").stat().st_size > 10_000
    assert {row.rays for row in beliefs} == {32, 64}
    before = (tmp_path / "looks" / "journal" / "items.jsonl").read_bytes()
    again = study_looks(replace(options, resume=True))
    assert again == (rows, beliefs)
    assert (tmp_path / "looks" / "journal" / "items.jsonl").read_bytes() == before
    with pytest.raises(FolderError):
        study_looks(replace(options, study_seed=1))


def test_the_figure_draws_both_ratios_over_the_range():
    counts = [PixelCounts(40, 50, 30, 90, 100), PixelCounts(50, 60, 45, 100, 100)]
    rows = [score_looks(rays, far, 1.0, 1, counts) for rays in (64, 128) for far in (900.0, 300.0)]
    figure = draw_looks(rows)
    for axis, name in zip(figure.axes, ("precision", "recall"), strict=True):
        assert [container.get_label() for container in axis.containers] == ["64 x 64 rays", "128 x 128 rays"]
        line = cast("Any", axis.containers[0]).lines[0]
        np.testing.assert_allclose(np.asarray(line.get_xdata(), dtype=float), [300.0, 900.0])
        np.testing.assert_allclose(
            np.asarray(line.get_ydata(), dtype=float), 100.0 * getattr(rows[0], name).estimate
        )


def test_statements_are_scored_by_class_and_by_tile():
    classes = len(EDGES) - 1
    nothing = (0,) * (classes - 1)
    flights = [
        StatementCounts(1, (*nothing, 100), (*nothing, 99.5), (*nothing, 100)),
        StatementCounts(1, (*nothing, 100), (*nothing, 99.5), (*nothing, 90)),
        StatementCounts(2, (*nothing, 200), (*nothing, 199.0), (*nothing, 198)),
    ]
    (row,) = score_statements(128, flights)
    assert row.told == pytest.approx(0.995)
    assert row.cells == 400
    assert row.safe.estimate == pytest.approx(388 / 400)
    assert row.safe.low < 388 / 400 - 0.02  # two tiles tell their spread badly
    axis = draw_calibration([row]).axes[0]
    assert [container.get_label() for container in axis.containers] == ["128 x 128 rays"]


def test_a_flights_statements_are_those_of_its_belief():
    counted = count_statements(LIDAR, 64, study_seed=0, episode=0)
    assert sum(counted.cells) > 20_000
    for cells, told, safe, low, high in zip(
        counted.cells, counted.told, counted.safe, EDGES[:-1], EDGES[1:], strict=True
    ):
        assert 0 <= safe <= cells
        assert low * cells - 1e-6 <= told <= high * cells + 1e-6


def test_bad_options_are_named():
    with pytest.raises(ValueError, match="preset must have a ranging LIDAR"):
        sensor_of(PRESETS["paper"])
    with pytest.raises(ValueError, match="ranges"):
        Looks(ranges=(0.0,))
    with pytest.raises(ValueError, match="rays must hold at least one number"):
        Looks(rays=())
