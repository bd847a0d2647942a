"""The belief on measured looks: which reading a cell keeps, what it is worth, and whether that holds."""

from dataclasses import replace

import numpy as np
import pytest

import hda
from hda.flight.episode import fly
from hda.flight.record import EpisodeRecord
from hda.look_statistics import LookStatistics, count_readings, count_record
from hda.policies.beliefs.belief import LEVEL_SHARES, LEVELS
from hda.policies.beliefs.measured_belief import MeasuredBelief, classify_readings
from hda.policies.beliefs.measured_readings import (
    DENSITY_EDGES,
    HOLE,
    PROBABILITY_EDGES,
    SHAPE,
    ReadingCounts,
    read_counts,
    safe_shares,
    write_counts,
)
from hda.policies.hazard_aware import fuse_look
from hda.safety.criteria import SafetyCriteria
from hda.sensing.gridding import PIXEL_SIZES, ElevationMap, PixelGrid
from hda.sensing.measured_look import MeasuredGround, assess_elevation
from tests.equality import same

CRITERIA = SafetyCriteria()
CENTER = np.array([100.0, 100.0, 50.0])


def flat(pixel_size: float, first: int, cells: int, count: int = 1, noise: float = 0.01) -> MeasuredGround:
    """Level ground of `cells` cells along each side."""
    grid = PixelGrid(first, first, pixel_size, cells, cells)
    shape = grid.shape
    return assess_elevation(
        ElevationMap(
            grid, np.full(shape, 40.0), np.full(shape, noise), np.full(shape, count, dtype=np.int32)
        ),
        CRITERIA,
    )


def fused(*grounds: MeasuredGround) -> MeasuredBelief:
    belief = MeasuredBelief.blank(CENTER, 32)
    for ground in grounds:
        belief = belief.fused(ground, CRITERIA, 100.0)
    return belief


def flights(preset: str, episodes: range, split: str) -> list[EpisodeRecord]:
    policy = hda.make_policy("nearest-safe")
    return [fly(policy, hda.sample_scenario(preset, 0, episode, split)) for episode in episodes]


def test_before_any_look_the_prior_holds_everywhere():
    belief = MeasuredBelief.blank(CENTER, 16)
    assert (belief.side, belief.corner) == (32, (84, 84))
    assert not belief.seen.any()
    prior = LEVEL_SHARES[LEVELS.size // 2 :].sum() / LEVEL_SHARES.sum()
    assert belief.probability() == pytest.approx(prior)


def test_what_a_look_knows_is_read_and_its_edge_is_not():
    belief = fused(flat(1.0, 80, 40))
    rows, columns = np.nonzero(belief.seen)
    assert (rows.min(), rows.max()) == (80 + 5 - 68, 119 - 5 - 68)
    assert (columns.min(), columns.max()) == (80 + 5 - 68, 119 - 5 - 68)
    assert belief.probability()[belief.seen].min() > 0.9
    assert belief.cell(np.array([68.5, 68.5])) == (0, 0)


def test_the_finest_map_that_knows_a_cell_decides_whatever_the_order():
    coarse, fine = flat(2.5, 24, 40), flat(1.0, 90, 30)
    for belief in (fused(coarse, fine), fused(fine, coarse)):
        inner = belief.cell(np.array([105.0, 105.0]))
        outer = belief.cell(np.array([80.0, 80.0]))
        assert inner is not None
        assert outer is not None
        assert PIXEL_SIZES[belief.size_class[inner]] == 1.0
        assert PIXEL_SIZES[belief.size_class[outer]] == 2.5
        assert belief.probability()[inner] > belief.probability()[outer]


def test_a_second_look_at_the_same_ground_adds_its_points():
    once, twice = fused(flat(1.0, 80, 40)), fused(flat(1.0, 80, 40), flat(1.0, 80, 40))
    assert twice.elevations[1.0].count.sum() == 2 * once.elevations[1.0].count.sum()
    assert (twice.density_class >= once.density_class).all()
    assert (twice.density_class > once.density_class).any()


def test_a_rock_that_one_look_stepped_over_stays_once_another_has_hit_it():
    clear = flat(1.0, 80, 40)
    height = clear.elevation.height.copy()
    height[20, 20] += 1.0
    rock = assess_elevation(replace(clear.elevation, height=height), CRITERIA)
    for belief in (fused(clear, rock), fused(rock, clear)):
        place = belief.cell(np.array([100.5, 100.5]))
        assert place is not None
        assert belief.probability()[place] < 0.05


def holed(ground: MeasuredGround, *cells: tuple[int, int]) -> MeasuredGround:
    """The same ground without an echo from some cells."""
    height, count = ground.elevation.height.copy(), ground.elevation.count.copy()
    for cell in cells:
        height[cell], count[cell] = np.nan, 0
    return assess_elevation(replace(ground.elevation, height=height, count=count), CRITERIA)


def test_a_hole_is_a_reading_of_its_own():
    ground = holed(flat(1.0, 80, 40), (20, 20))
    reading, density = classify_readings(ground, CRITERIA)
    assert reading[20, 20] == HOLE
    assert reading[10, 10] != HOLE
    assert reading[0, 0] == -1  # the lander does not fit on the map there
    assert density.max() < SHAPE[1]
    belief = fused(ground)
    assert belief.probability_class[belief.seen].max() == HOLE


def test_what_a_coarser_map_knows_replaces_a_hole_whatever_the_order():
    coarse, fine = flat(2.5, 24, 40), holed(flat(1.0, 80, 40), (20, 20))
    first, second = fused(coarse, fine), fused(fine, coarse)
    for belief in (first, second):
        place = belief.cell(np.array([100.5, 100.5]))
        beside = belief.cell(np.array([90.5, 90.5]))
        assert place is not None
        assert beside is not None
        assert PIXEL_SIZES[belief.size_class[place]] == 2.5
        assert belief.probability_class[place] != HOLE
        assert PIXEL_SIZES[belief.size_class[beside]] == 1.0
    np.testing.assert_array_equal(first.size_class, second.size_class)
    np.testing.assert_array_equal(first.probability_class, second.probability_class)


def test_of_two_holes_the_finer_maps_stays_whatever_the_order():
    coarse, fine = holed(flat(2.5, 24, 40), (16, 16)), holed(flat(1.0, 80, 40), (20, 20))
    for belief in (fused(coarse, fine), fused(fine, coarse)):
        place = belief.cell(np.array([100.5, 100.5]))
        assert place is not None
        assert belief.probability_class[place] == HOLE
        assert PIXEL_SIZES[belief.size_class[place]] == 1.0


@pytest.mark.parametrize(
    ("pixel_size", "cells", "footprint_diameter"),
    [(5.0, 40, 4.0), (1.0, 6, 10.0)],
    ids=["a cell swallows the lander", "the map is smaller than the lander"],
)
def test_where_nothing_can_be_assessed_there_is_no_hole(
    pixel_size: float, cells: int, footprint_diameter: float
):
    criteria = replace(CRITERIA, footprint_diameter=footprint_diameter)
    ground = assess_elevation(flat(pixel_size, 0, cells).elevation, criteria)
    reading, _ = classify_readings(ground, criteria)
    assert (reading == -1).all()
    assert not MeasuredBelief.blank(CENTER, 32).fused(ground, criteria, 100.0).seen.any()


def test_a_look_leaves_the_old_belief_as_it_was():
    before = fused(flat(2.5, 24, 40))
    kept = [layer.copy() for layer in (before.size_class, before.density_class, before.probability_class)]
    before.fused(flat(1.0, 80, 40), CRITERIA, 100.0)
    for layer, old in zip(
        (before.size_class, before.density_class, before.probability_class), kept, strict=True
    ):
        np.testing.assert_array_equal(layer, old)
    assert list(before.elevations) == [2.5]


def test_nothing_measured_changes_nothing():
    empty = ElevationMap(
        PixelGrid(0, 0, 1.0, 0, 0), np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0), int)
    )
    belief = fused(flat(1.0, 80, 40))
    assert belief.fused(assess_elevation(empty, CRITERIA), CRITERIA, 100.0) is belief


@pytest.mark.parametrize("preset", ["lidar", "lidar-coarse"])
def test_it_is_calibrated_on_tiles_that_it_was_not_counted_on(preset: str):
    """Share of safe ground among cells of like probability, over all looks of flights on tuning tiles.

    The cells of a tile are no independent draws: the bounds hold what 24 tiles' spread allows.
    """
    told, true = [], []
    for record in flights(preset, range(24), "tuning"):
        belief = None
        truth = record.scenario.tile.deterministic
        for observation in record.observations:
            belief = fuse_look(observation, record.scenario.view, belief)
        assert belief is not None
        rows, columns = np.nonzero(belief.seen)
        north, east = rows + belief.corner[1], columns + belief.corner[0]
        inside = (np.minimum(north, east) >= 0) & (np.maximum(north, east) < 1000)
        told.append(belief.probability()[rows[inside], columns[inside]])
        true.append(truth[north[inside], east[inside]])
    probability, safe = np.concatenate(told), np.concatenate(true)
    for low, high, slack in (
        (0.0, 0.02, 0.01),
        (0.02, 0.2, 0.05),
        (0.2, 0.6, 0.15),
        (0.6, 0.9, 0.12),
        (0.9, 1.0, 0.04),
    ):
        own = (probability >= low) & (probability <= high)
        assert own.sum() > 3000, (low, high)
        assert safe[own].mean() == pytest.approx(probability[own].mean(), abs=slack), (low, high)


def test_the_counts_name_their_command_and_rise_with_the_reading(tmp_path):
    counts = read_counts()
    assert (
        counts.cells.shape
        == counts.safe.shape
        == SHAPE
        == (9, DENSITY_EDGES.size + 1, PROBABILITY_EDGES.size + 2)
    )
    assert (counts.safe <= counts.cells).all()
    share = safe_shares()
    assert ((share >= 0.0) & (share <= 1.0)).all()
    fine = counts.safe[0].sum(0)[:HOLE] / np.maximum(counts.cells[0].sum(0)[:HOLE], 1)
    assert (np.diff(fine) > -0.01).all()
    assert fine[-1] > 0.97
    assert fine[0] < 0.01
    from hda.policies.beliefs.measured_readings import TABLE

    assert '"command": "python -m hda.look_statistics' in TABLE.read_text()
    write_counts(counts, "python -m hda.look_statistics", tmp_path / "counts.json")
    assert same(read_counts(tmp_path / "counts.json"), counts)
    (tmp_path / "counts.json").write_text(
        TABLE.read_text().replace('"density_edges": [1.2', '"density_edges": [1.3')
    )
    with pytest.raises(ValueError, match="other classes"):
        read_counts(tmp_path / "counts.json")


def test_every_class_that_a_look_gave_or_changed_is_counted_with_the_truth_under_it():
    (record,) = flights("lidar", range(1), "train")
    counts = ReadingCounts(np.zeros(SHAPE, dtype=np.int64), np.zeros(SHAPE, dtype=np.int64))
    count_record(record, counts)
    view, belief, cells = record.scenario.view, None, 0
    first = fuse_look(record.observations[0], view, None)
    assert isinstance(first, MeasuredBelief)
    for observation in record.observations:
        belief = fuse_look(observation, view, belief)
    assert isinstance(belief, MeasuredBelief)
    cells = int(belief.seen.sum())
    assert counts.cells.sum() >= cells >= first.seen.sum() > 10_000
    assert 0 < counts.safe.sum() < 0.3 * counts.cells.sum()
    again = count_readings(LookStatistics(episodes=1, rays=(128,)))
    assert same(again, counts)


@pytest.mark.parametrize("error", ["navigation_position_error", "navigation_velocity_error"])
def test_looks_that_lie_beside_their_ground_are_not_counted(error: str, monkeypatch: pytest.MonkeyPatch):
    preset = hda.PRESETS["lidar"]
    lost = replace(preset, name="lost", rules=replace(preset.rules, **{error: 0.5}))
    monkeypatch.setitem(hda.PRESETS, "lost", lost)
    with pytest.raises(ValueError, match="preset must have no navigation errors"):
        count_readings(LookStatistics(episodes=1, preset="lost"))
