"""Where the lander believes it is in an episode: by its filter, or off by one constant error.

Policies and guidance work in the frame that the first look makes: the landing site stands where it was put,
and the lander's place is estimated from it. That frame is off the map by the error of the first estimate,
for the whole episode; it is of no account for a landing. What counts is the error in it, position less site.
"""

from __future__ import annotations

import numpy as np

from guidance.arrays import Array
from guidance.state import State
from hda.navigation.attitude import err_rates_into
from hda.navigation.navigation_state import NavigationState, begin_navigation
from hda.navigation.site_tracking import find_site, move_site, track_site
from hda.navigation.steering import GyroSensing, Sensing
from hda.task.scenario import Scenario, ground_point

_ABOVE = 1.0  # [m] over the target plane, which is the highest ground: beyond all rounding


def begin_estimate(scenario: Scenario) -> NavigationState | None:
    """The filter at the first look, which finds the site; None on a preset without a filter."""
    system, errors = scenario.preset.navigation, scenario.sensor_errors
    if system is None or errors is None:
        return None
    state, target = scenario.initial_state, scenario.nominal_target
    navigation = begin_navigation(system, state, target, errors)
    really = ground_point(scenario, target)
    return find_site(system, navigation, state.position, really, scenario.streams.site_fix(0))


def estimation_error(
    scenario: Scenario, navigation: NavigationState | None, state: State, target: Array
) -> Array:
    """Estimated minus true position [m] and velocity [m/s], shape (6,), in the frame of the policies.

    Args:
        scenario: the episode.
        navigation: its filter, which holds `target` as its site; or None.
        state: the true state.
        target: [m] shape (3,), in the frame of the policies.
    """
    if navigation is None:
        return scenario.navigation_error
    place = navigation.position - navigation.site + target
    return np.concatenate([place - state.position, navigation.velocity - state.velocity])


def attitude_error(navigation: NavigationState | None) -> Array:
    """[rad] shape (3,), true minus believed attitude, a small rotation about the site's axes.

    With a gyroscope it drifts and is corrected, else it is one tilt for the episode; none without a filter.
    """
    return np.zeros(3) if navigation is None else navigation.errors.tilt.copy()


def rate_error(scenario: Scenario, navigation: NavigationState | None, look: int) -> Array:
    """[rad/s] shape (3,), believed minus true rates at a look, body frame; none without a gyroscope.

    It is that of the first control period after the look.
    """
    system, error = scenario.preset.navigation, np.zeros(3)
    if system is None or system.gyroscope is None or navigation is None:
        return error
    period, errors = scenario.preset.rules.control_period, navigation.errors.true_errors()
    draws = scenario.streams.readings(look, scenario.preset.rules.control_periods, gyroscope=True).gyro
    assert draws is not None
    err_rates_into(navigation.memory(), errors, draws[0], period, system.gyroscope.numbers, error)
    return error


def displaced(state: State, error: Array) -> State:
    """The state as the lander estimates it: the true one plus the error, shape (6,)."""
    return State(state.position + error[:3], state.velocity + error[3:], state.mass)


def look_aim(scenario: Scenario, target: Array, error: Array) -> Array:
    """[m] shape (3,), where a look at `target` really points: relative to where the lander believes to be.

    Where flights end on the plane its height is known.
    """
    vertical = 0.0 if scenario.preset.stance is None else error[2]
    return target - np.array([error[0], error[1], vertical])


def open_sensing(
    scenario: Scenario, navigation: NavigationState | None, target: Array, site: Array, look: int
) -> Sensing | None:
    """The filter made ready for the interval after a look; None without one.

    Args:
        scenario: the episode.
        navigation: its filter, which holds `target` as its site.
        target: [m] shape (3,), the site before the decision, in the frame of the policies.
        site: [m] shape (3,), the site that was decided on.
        look: number of the look.
    """
    numbers, system = scenario.preset.filter_numbers, scenario.preset.navigation
    if numbers is None or system is None or navigation is None:
        return None
    gyroscope, periods = system.gyroscope, scenario.preset.rules.control_periods
    draws = scenario.streams.readings(look, periods, gyroscope is not None)
    gyro = None if gyroscope is None or draws.gyro is None else GyroSensing(draws.gyro, gyroscope.numbers)
    return Sensing(
        move_site(navigation, site - target),
        navigation.errors.true_errors(),
        draws.normal,
        draws.uniform,
        numbers,
        scenario.tile.elevation,
        float(scenario.nominal_target[2]) + _ABOVE,
        site.copy(),
        navigation.instant,
        gyro,
    )


def next_estimate(
    scenario: Scenario,
    navigation: NavigationState | None,
    sensing: Sensing | None,
    state: State,
    site: Array,
    look: int,
) -> NavigationState | None:
    """The filter at the next look: as the flown interval left it, with the fix that the look brings.

    Args:
        scenario: the episode.
        navigation: its filter at the look before; None without one.
        sensing: what the vehicle's loop made of it.
        state: the true state.
        site: [m] shape (3,), the site flown to, in the frame of the policies.
        look: number of the next look.
    """
    system = scenario.preset.navigation
    if system is None or navigation is None or sensing is None:
        return None
    errors = navigation.errors.moved_on(sensing.errors)
    instant = navigation.instant + scenario.preset.rules.control_periods
    flown = NavigationState(*sensing.memory, errors, instant)
    really, draws = ground_point(scenario, site), scenario.streams.site_fix(look)
    return track_site(system, flown, state.position, really, draws)[0]
