"""A cliff under the track: the case in which HAKUTO-R's first lander took its altimeter for broken (2023)."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from hda.navigation import NavigationSystem, measure_ranges
from hda.navigation.layout import GROUND
from hda.navigation.sensor_errors import SensorErrors
from tests.hda.navigation.filter_cases import TARGET, Descent, Run, fly_many, run_filter

SYSTEM = NavigationSystem()
STEP_PERIOD = 25
"""The control period in which the track crosses the edge, about 600 m above the target."""


@pytest.fixture(scope="module")
def descents() -> list[Descent]:
    return fly_many(20, seed=40)


def over_a_cliff(descents: list[Descent], system: NavigationSystem, height: float) -> list[Run]:
    runs = []
    for k, descent in enumerate(descents):
        ground = np.where(np.arange(descent.time.size) < STEP_PERIOD, TARGET[2] - height, TARGET[2])
        runs.append(run_filter(system, descent, ground, np.random.default_rng([41, k])))
    return runs


@pytest.mark.parametrize("height", [-300.0, -100.0, 20.0, 100.0, 300.0])
def test_the_altimeter_is_believed_again_within_the_patience(descents: list[Descent], height: float):
    gate = SYSTEM.numbers(0.5).gates[0]
    for run in over_a_cliff(descents, SYSTEM, height):
        squares = run.squares[:, 0]
        rejected = np.flatnonzero(squares > gate)
        assert rejected.size <= SYSTEM.patience + 2
        if abs(height) >= 100.0:
            assert rejected[0] == STEP_PERIOD - 1  # the filter saw it
        assert run.final.rejections[0] == 0
        assert abs(run.error[-1][GROUND]) < 5.0 * np.sqrt(run.covariance[-1][GROUND, GROUND])


@pytest.mark.parametrize("height", [100.0, 300.0])
def test_the_cliff_does_not_reach_the_landing(descents: list[Descent], height: float):
    """Position less site and velocity at the end, 6 x 20 numbers, in their band of one alarm in 10 000."""
    total = 0.0
    for run in over_a_cliff(descents, SYSTEM, height):
        error = np.concatenate([run.error[-1, :3] - run.error[-1, 10:13], run.error[-1, 3:6]])
        total += error @ np.linalg.solve(run.final.relative_covariance, error)
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], 6 * len(descents))
    assert low < total < high


def test_a_filter_without_doubt_never_hears_its_altimeter_again(descents: list[Descent]):
    """What the patience is for: with none the gate stays shut to the end, over a hundred metres off."""
    deaf = replace(SYSTEM, patience=10_000, relief=1.0)
    for run in over_a_cliff(descents[:3], deaf, 300.0):
        squares = run.squares[STEP_PERIOD - 1 :, 0]
        known = np.isfinite(squares)
        assert run.final.rejections[0] == known.sum()
        assert abs(run.error[-1][GROUND]) > 100.0


def test_the_range_down_falls_by_the_cliff_where_the_beam_crosses_its_edge():
    elevation = np.zeros((50, 60), dtype=np.float32)
    elevation[:, 30:] = 40.0
    track = np.array([[x, 20.0, 400.0] for x in (10.0, 25.0, 35.0, 50.0, 70.0)])
    upright = SensorErrors(np.zeros(3), 0.0, np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3))
    ranges = measure_ranges(elevation, track, upright)
    np.testing.assert_allclose(ranges[:4], [400.0, 400.0, 360.0, 360.0], atol=1e-9)
    assert np.isnan(ranges[4])
    tilted = replace(upright, tilt=np.array([0.0, -0.03, 0.0]))  # down leans 3 % to the east
    assert measure_ranges(elevation, track, tilted)[1] == pytest.approx(360.0 * np.hypot(1.0, 0.03), abs=1e-6)
