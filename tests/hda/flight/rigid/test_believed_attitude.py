"""What a body believes of its attitude in flight: how far it errs, and what loop and sensors make of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import hda
from guidance.arrays import Array
from hda.flight.record import EpisodeRecord
from hda.navigation import Gyroscope, InertialUnit, NavigationSystem
from hda.task.presets import PRESETS, Preset
from hda.task.scenario import sample_scenario

BODY = PRESETS["rigid-body"]


def fly_some(preset: Preset, count: int) -> list[EpisodeRecord]:
    pilot = hda.make_policy("nearest-safe")
    return [hda.fly(pilot, sample_scenario(preset, 21, k, split="tuning")) for k in range(count)]


def attitude_errors(record: EpisodeRecord) -> tuple[Array, Array]:
    """At each look: the angle from the believed to the true attitude [rad] (n, 3), and its covariance."""
    angles, covariances = [], []
    for observation, segment in zip(record.observations, record.segments, strict=True):
        assert segment.body_path is not None
        assert observation.attitude is not None
        assert observation.attitude_covariance is not None
        true, believed = (
            Rotation.from_quat(some, scalar_first=True)
            for some in (segment.body_path[0, 6:10], observation.attitude)
        )
        angles.append((true * believed.inv()).as_rotvec())
        covariances.append(observation.attitude_covariance)
    return np.array(angles), np.array(covariances)


@pytest.mark.slow
def test_in_flight_the_attitude_errs_as_the_filter_says():
    """Each look of 40 flights, one false alarm in a thousand; the first ones, and the last, by themselves."""
    flights = [attitude_errors(record) for record in fly_some(BODY, 40)]
    squares = [np.einsum("ni,nij,nj->n", angle, np.linalg.inv(spread), angle) for angle, spread in flights]
    for k in (0, 2, 4, -1):
        low, high = chi2.ppf([0.5e-3 / 4, 1.0 - 0.5e-3 / 4], 3 * len(squares))
        assert low < sum(square[k] for square in squares) < high
    for _, spread in flights:
        assert (np.linalg.eigvalsh(spread) > 0.0).all()
        assert (np.linalg.eigvalsh(spread[1:]) < 1.2e-6).all()


def test_the_error_moves_in_flight_and_without_a_gyroscope_it_stays():
    moving = attitude_errors(fly_some(BODY, 1)[0])[0]
    fixed = replace(BODY, name="no-gyroscope", navigation=NavigationSystem())
    record = fly_some(fixed, 1)[0]
    still = attitude_errors(record)[0]
    assert np.abs(moving[-1] - moving[0]).max() > 1e-5
    np.testing.assert_allclose(still, np.tile(still[0], (len(still), 1)), atol=1e-6)
    np.testing.assert_allclose(moving[0], still[0], atol=1e-9)  # the same draw
    for observation, segment in zip(record.observations, record.segments, strict=True):
        assert segment.body_path is not None
        np.testing.assert_array_equal(observation.rates, segment.body_path[0, 10:13])


def test_a_gyroscope_that_misreads_its_rates_leans_the_body():
    """0.2 deg/s that the filter takes for noise of 1e-3 of it: the loop flies what it believes."""
    wild = NavigationSystem(inertial=InertialUnit(tilt=1e-6), gyroscope=Gyroscope(bias=math.radians(0.2)))
    preset = replace(BODY, name="wild", navigation=wild)
    angles, covariances = attitude_errors(fly_some(preset, 1)[0])
    assert np.linalg.norm(angles[1]) > math.radians(0.1)  # within the first five seconds
    assert np.sqrt(np.trace(covariances[1])) > math.radians(0.2)
    assert np.linalg.norm(angles[-1]) < 0.2 * np.linalg.norm(angles, axis=1).max()  # it is learnt


def test_equal_episodes_with_a_gyroscope_are_equal_to_the_byte():
    first, again = (fly_some(BODY, 1)[0].body_path for _ in range(2))
    assert first is not None
    assert again is not None
    assert first.tobytes() == again.tobytes()
