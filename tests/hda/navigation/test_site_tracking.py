"""The landing site in the filter: errors shared with the vehicle cancel in what a landing needs."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance.state import State
from hda.navigation import (
    FixDraws,
    Gyroscope,
    NavigationState,
    NavigationSystem,
    SiteFixes,
    begin_navigation,
    choose_site,
    draw_fix,
    draw_sensor_errors,
    find_site,
    track_site,
)
from tests.hda.navigation.filter_cases import TARGET

SYSTEM = NavigationSystem()
HIGH = State(np.array([420.0, 560.0, 950.0]), np.array([3.0, -4.0, -25.0]), 1200.0)
UPRIGHT = replace(SYSTEM, inertial=replace(SYSTEM.inertial, tilt=0.0))
SEEDS = st.integers(0, 2**32 - 1)


def begin(system: NavigationSystem, seed: int = 0) -> NavigationState:
    return begin_navigation(system, HIGH, TARGET, draw_sensor_errors(system, np.random.default_rng(seed)))


def test_before_a_look_the_site_is_as_far_off_as_the_vehicle():
    block = begin(SYSTEM).relative_covariance
    np.testing.assert_allclose(np.sqrt(np.diag(block)), [20.0, 20.0, 5.0, 0.2, 0.2, 0.2])


def test_a_look_knows_the_site_by_its_own_error_alone():
    navigation = find_site(UPRIGHT, begin(UPRIGHT), HIGH.position, TARGET, FixDraws(np.zeros(3), 0.0))
    slant = float(np.linalg.norm(HIGH.position - TARGET))
    deviation = SiteFixes().deviation(slant)
    np.testing.assert_allclose(np.sqrt(np.diag(navigation.relative_covariance))[:3], deviation, rtol=1e-6)
    np.testing.assert_allclose(navigation.site - navigation.position, TARGET - HIGH.position, atol=1e-9)
    np.testing.assert_allclose(
        np.diag(navigation.covariance)[10:13], np.array([400.0, 400.0, 25.0]) + deviation**2
    )


def test_a_tilt_moves_the_site_across_the_line_of_sight_by_range_times_angle():
    system = replace(SYSTEM, site=SiteFixes(noise_per_range=0.0, least_noise=1e-6))
    navigation = find_site(system, begin(system), HIGH.position, TARGET, FixDraws(np.zeros(3), 0.0))
    offset = TARGET - HIGH.position
    expected = 1e-6 * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    np.testing.assert_allclose(navigation.relative_covariance[:3, :3], expected, rtol=2e-2, atol=2e-2)


@given(seed=SEEDS)
def test_a_noiseless_fix_agrees_with_a_noiseless_find_whatever_the_errors(seed: int):
    """Equal draws from an equal place: nothing new, so that the innovation is zero."""
    errors = draw_sensor_errors(SYSTEM, np.random.default_rng(seed))
    start = begin_navigation(SYSTEM, HIGH, TARGET, errors)
    draws = draw_fix(np.random.default_rng(seed))
    found = find_site(SYSTEM, start, HIGH.position, TARGET, draws)
    tracked, square = track_site(SYSTEM, found, HIGH.position, TARGET, replace(draws, uniform=1.0))
    assert square == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(tracked.estimate, found.estimate, atol=1e-7)


def test_the_next_look_halves_the_variance_of_equal_noise():
    system = replace(UPRIGHT, site=SiteFixes(noise_per_range=0.0, least_noise=0.4))
    draws = FixDraws(np.zeros(3), 1.0)
    found = find_site(system, begin(system), HIGH.position, TARGET, draws)
    tracked, _ = track_site(system, found, HIGH.position, TARGET, draws)
    np.testing.assert_allclose(np.diag(found.relative_covariance)[:3], 0.16, rtol=1e-6)
    np.testing.assert_allclose(np.diag(tracked.relative_covariance)[:3], 0.08, rtol=1e-5)


@pytest.mark.parametrize(
    "system",
    [
        replace(SYSTEM, site=None),
        replace(SYSTEM, site=SiteFixes(floor=2000.0)),
        replace(SYSTEM, site=SiteFixes(dropout=1.0)),
    ],
)
def test_without_a_fix_nothing_changes(system: NavigationSystem):
    navigation = find_site(system, begin(system), HIGH.position, TARGET, FixDraws(np.zeros(3), 0.0))
    after, square = track_site(system, navigation, HIGH.position, TARGET, draw_fix(np.random.default_rng(1)))
    assert after is navigation
    assert np.isnan(square)


def test_a_site_on_the_same_map_keeps_the_error_of_the_old_one():
    found = find_site(UPRIGHT, begin(UPRIGHT), HIGH.position, TARGET, draw_fix(np.random.default_rng(2)))
    moved = choose_site(found, [30.0, -12.0, 0.5])
    np.testing.assert_allclose(moved.site - found.site, [30.0, -12.0, 0.5], atol=1e-9)
    np.testing.assert_array_equal(moved.covariance, found.covariance)


def test_a_wrong_offset_is_named():
    with pytest.raises(ValueError, match="offset"):
        choose_site(begin(SYSTEM), [1.0, np.nan, 0.0])
    with pytest.raises(ValueError, match="target"):
        begin_navigation(SYSTEM, HIGH, [1.0, 2.0], draw_sensor_errors(SYSTEM, np.random.default_rng(0)))


TURNING = replace(SYSTEM, gyroscope=Gyroscope())


@pytest.mark.parametrize("step", [find_site, track_site])
@pytest.mark.parametrize(("begun", "taken_on"), [(SYSTEM, TURNING), (TURNING, SYSTEM)])
def test_a_filter_of_a_system_with_other_rows_is_refused(
    step: Callable[..., object], begun: NavigationSystem, taken_on: NavigationSystem
):
    draws = draw_fix(np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"navigation must be of a system with(out)? a gyroscope"):
        step(taken_on, begin(begun), HIGH.position, TARGET, draws)


def test_a_filter_with_too_small_an_array_is_refused_by_its_shapes():
    small = replace(begin(SYSTEM), covariance=np.eye(13))
    with pytest.raises(ValueError, match=r"got \(\(13,\), \(13, 13\), \(4,\)\)"):
        find_site(SYSTEM, small, HIGH.position, TARGET, draw_fix(np.random.default_rng(0)))
