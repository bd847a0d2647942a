"""The filter over tiles of the benchmark: its walk of the ground must not be surer than the ground allows."""

import numpy as np
import pytest
from scipy.stats import chi2

import hda
from hda.navigation import NavigationSystem, measure_ranges
from hda.navigation.layout import GROUND
from hda.navigation.sensor_errors import SensorErrors
from tests.hda.navigation.filter_cases import Run, fly_many, run_filter

SYSTEM = NavigationSystem()
UPRIGHT = SensorErrors(np.zeros(3), 0.0, np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3))
RUNS = 200


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    tiles = [hda.sample_scenario("paper", 0, episode).tile.elevation for episode in range(3)]
    out = []
    for k, descent in enumerate(fly_many(RUNS, seed=60)):
        ground = descent.path[:, 2] - measure_ranges(tiles[k % 3], descent.path, UPRIGHT)
        out.append(run_filter(SYSTEM, descent, ground, np.random.default_rng([61, k])))
    return out


@pytest.mark.parametrize("step", [1, 2, 4, 8, 16, 32, 64, 128, 256])
def test_the_ground_changes_no_faster_than_the_filter_believes(step: int):
    height = hda.sample_scenario("paper", 0, 1, split="tuning").tile.elevation
    believed = SYSTEM.relief * np.sqrt(-2.0 * np.expm1(-step / SYSTEM.relief_length))
    assert (height[:, step:] - height[:, :-step]).std() < believed


def test_the_gate_leaves_the_altimeter_its_readings(runs: list[Run]):
    squares = np.concatenate([run.squares[:, 0] for run in runs])
    squares = squares[np.isfinite(squares)]
    assert (squares > SYSTEM.numbers(0.5).gates[0]).mean() < 0.005
    assert squares.mean() < 1.0


def test_position_less_site_and_velocity_err_as_the_filter_says(runs: list[Run]):
    """Mean square of six numbers over 200 runs, not above what one in 10 000 would exceed."""
    total = 0.0
    for run in runs:
        error = np.concatenate([run.error[-1, :3] - run.error[-1, 10:13], run.error[-1, 3:6]])
        total += error @ np.linalg.solve(run.final.relative_covariance, error)
    assert total < chi2.isf(1e-4, 6 * RUNS)


def test_the_ground_below_is_known_within_what_the_filter_says(runs: list[Run]):
    height = np.array([run.error[-1][2] - run.error[-1][GROUND] for run in runs])
    deviation = [
        run.final.covariance[2, 2] + run.final.covariance[9, 9] - 2.0 * run.final.covariance[2, 9]
        for run in runs
    ]
    assert (height**2 / np.array(deviation)).sum() < chi2.isf(1e-4, RUNS)
