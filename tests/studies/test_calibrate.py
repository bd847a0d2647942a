"""The calibration: interpolation of the sweep, and what it promises of the frozen presets."""

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from hda.task.presets import PRESETS
from hda.task.scenario import sample_scenario
from hda.terrain.generator import TerrainParameters
from studies.calibrate import (
    SEARCHES,
    Calibration,
    calibrate,
    fly_single_divert,
    interpolate_crossing,
    with_control_period,
)
from studies.campaign.claimed_folder import FolderError
from studies.ground_statistics import measure_ground


def test_crossing_is_linear_between_points() -> None:
    assert interpolate_crossing((10.0, 20.0, 40.0), (95.0, 91.0, 83.0), 89.0) == pytest.approx(25.0)
    assert interpolate_crossing((10.0, 20.0), (95.0, 91.0), 95.0) == pytest.approx(10.0)


def test_a_sweep_that_misses_the_target_is_refused() -> None:
    with pytest.raises(ValueError, match="bracket 60"):
        interpolate_crossing((10.0, 20.0), (95.0, 91.0), 60.0)


def test_frozen_presets_lie_in_their_sweep() -> None:
    for name, search in SEARCHES.items():
        terrain = PRESETS[name].terrain
        assert isinstance(terrain, TerrainParameters)
        value = getattr(terrain.islands, search.parameter)
        assert min(search.values) <= value <= max(search.values)
        assert value == round(value, search.digits)


def test_control_period_is_the_only_change() -> None:
    changed = with_control_period(PRESETS["paper"], 0.25)
    assert changed.rules.control_period == 0.25
    assert changed.terrain == PRESETS["paper"].terrain


def test_ground_statistics_of_a_scenario() -> None:
    scenario = sample_scenario("paper", 0, 3, "validation")
    ground = measure_ground(scenario)
    assert ground.hazard_share >= 0.8
    assert ground.nearest_safe >= 0.0
    assert math.isnan(ground.speck_share) or 0.0 <= ground.speck_share <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "low", "high"), [("paper", 88.7, 90.7), ("hard", 55.0, 65.0)])
def test_single_divert_lands_as_often_as_calibrated(
    tmp_path: Path, name: str, low: float, high: float
) -> None:
    score = fly_single_divert(PRESETS[name], 6000, Calibration(out=tmp_path), name).score
    assert low <= 100.0 * score.safe_site.estimate <= high
    means = {measure: mean.estimate for measure, mean in score.means.items()}
    assert 66.9 <= means["propellant_percent"] <= 70.9
    assert 0.3 <= means["touchdown_speed_mps"] <= 0.8
    assert means["miss_distance_m"] < 0.05
    assert 69.3 <= means["minimum_slant_angle_deg"] <= 72.4
    assert 4250.0 <= means["maximum_thrust_n"] <= 4900.0


def test_a_calibration_is_kept_and_gone_on_with(tmp_path: Path) -> None:
    options = Calibration(episodes=12, ground_episodes=3, workers=1, out=tmp_path)
    row = calibrate(options)
    (folder,) = (tmp_path / "paper").iterdir()
    with (folder / "episodes.csv").open() as stream:
        safe = [line["safe_site"] == "True" for line in csv.DictReader(stream)]
    assert len(safe) == 12
    assert row.score.safe_site.estimate == sum(safe) / 12
    with (tmp_path / "paper.csv").open() as stream:
        (line,) = csv.DictReader(stream)
    assert float(line["safe_site_percent"]) == pytest.approx(100.0 * sum(safe) / 12)
    assert json.loads((tmp_path / "paper-provenance.json").read_text())["options"]["episodes"] == 12
    with pytest.raises(FolderError, match="holds a study already"):
        calibrate(options)
    assert calibrate(replace(options, resume=True)) == row
