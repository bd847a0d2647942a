"""The lander's navigation filter along a flight: one value in, the next one out.

A dual-state filter, of the vehicle and of the landing site together (Crain and Bishop, NTRS 20170009198), in
three dimensions of translation; with a gyroscope of the attitude too. `hda.navigation.layout` says what it
estimates and what it only considers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.validation import finite_vector
from hda.navigation.control_period import TurningPath, navigate_path, range_down
from hda.navigation.layout import GYRO_COLUMNS
from hda.navigation.navigation_state import NavigationState, check_begun
from hda.navigation.sensor_errors import ReadingDraws, SensorErrors
from hda.navigation.system import NavigationSystem


@dataclass(frozen=True, eq=False)
class NavigationLog:
    """The filter after each of n control periods.

    Attributes:
        estimate: shape (n, 13); with a gyroscope (n, 23).
        covariance: shape (n, 20, 20); with a gyroscope (n, 23, 23).
        innovation_square: shape (n, 3), of altimeter (1 degree of freedom), velocimeter (3) and terrain fix
            (3), in units of its predicted covariance; NaN where there was no reading.
        tilt: [rad] shape (n, 3), true minus believed attitude, about the site's axes.
    """

    estimate: Array
    covariance: Array
    innovation_square: Array
    tilt: Array


@dataclass(frozen=True, eq=False)
class FlownPath:
    """A path at n control instants, one control period apart; the last may come at another time.

    Attributes:
        time: [s] shape (n,), n at least 2.
        states: shape (n, 7), true (x y z vx vy vz m) [m], [m/s], [kg], site frame.
        ranges: [m] shape (n - 1,), down to the ground at the instants after the first, NaN where there is
            none (`hda.navigation.measure_ranges`).
        attitudes: shape (n, 4), true unit quaternions, scalar first, that turn body vectors into the site
            frame; for a gyroscope alone.

    Raises:
        ValueError: the shapes do not fit together.
    """

    time: Array
    states: Array
    ranges: Array
    attitudes: Array | None = None

    def __post_init__(self) -> None:
        """Refuse shapes that do not fit together: the kernels would reach beyond the arrays."""
        time, states, ranges, nodes = self.time.shape, self.states.shape, self.ranges.shape, self.time.size
        if nodes < 2 or time != (nodes,) or states != (nodes, 7) or ranges != (nodes - 1,):
            raise ValueError(f"flown path: shapes {time}, {states} and {ranges} do not fit together")
        if self.attitudes is not None and self.attitudes.shape != (nodes, 4):
            raise ValueError(
                f"flown path: attitudes must have shape {(nodes, 4)}, got {self.attitudes.shape}"
            )

    @property
    def periods(self) -> int:
        """How many control periods were flown."""
        return self.time.size - 1


def measure_ranges(elevation: NDArray[np.float32], path: Array, errors: SensorErrors) -> Array:
    """[m] true ranges down to the ground, NaN where none is known.

    Args:
        elevation: [m] shape (rows, columns), the true ground at 1 m a cell; row 0 is the south edge.
        path: shape (n, 7) or (n, 3), true positions first.
        errors: the tilt turns the beam.

    Returns:
        Shape (n,).
    """
    top, tilt = float(np.nanmax(elevation)), errors.tilt.copy()
    return np.array([range_down(elevation, row[:3].copy(), tilt, top) for row in path])


def navigate(
    system: NavigationSystem,
    navigation: NavigationState,
    flown: FlownPath,
    draws: ReadingDraws,
    gravity: ArrayLike = MOON_GRAVITY,
    control_period: float | None = None,
) -> tuple[NavigationState, NavigationLog]:
    """Take the filter along a flown path.

    Args:
        system: sensors and filter.
        navigation: the filter at the path's first node, begun by a system with a gyroscope as this has one.
        flown: the path, of n nodes, with attitudes where the system has a gyroscope.
        draws: for at least n - 1 periods.
        gravity: [m/s^2] shape (3,).
        control_period: [s]; the path's first interval if left out.

    Returns:
        The filter at the path's last node, and what it went through.

    Raises:
        ValueError: the filter was begun without the system's gyroscope or with one that it lacks, there are
            too few draws, the intervals but the last are not the control period, a sensor is not read at a
            whole number of periods, or attitudes are lacking where there is a gyroscope.
    """
    check_begun(system, navigation)
    periods, time = flown.periods, flown.time
    if draws.normal.shape[0] < periods:
        raise ValueError(f"draws must be for {periods} periods, got {draws.normal.shape[0]}")
    period = float(time[1] - time[0]) if control_period is None else control_period
    if np.abs(np.diff(time)[:-1] - period).max(initial=0.0) > 1e-6 * period:
        raise ValueError(f"flown: all intervals but the last must be of one control period, {period:g} s")
    memory, errors = navigation.memory(), navigation.errors.true_errors()
    size = memory.mean.size, *memory.covariance.shape
    log = NavigationLog(
        np.empty((periods, size[0])),
        np.empty((periods, *size[1:])),
        np.empty((periods, 3)),
        np.empty((periods, 3)),
    )
    turning = _turning_path(system, flown, draws, period)
    navigate_path(
        memory,
        (time, flown.states, flown.ranges, navigation.instant, turning),
        finite_vector("gravity", gravity, 3),
        errors,
        (draws.normal, draws.uniform),
        system.numbers(period),
        (log.estimate, log.covariance, log.innovation_square, log.tilt),
    )
    after = navigation.errors.moved_on(errors)
    return NavigationState(*memory, after, navigation.instant + periods), log


def _turning_path(
    system: NavigationSystem, flown: FlownPath, draws: ReadingDraws, period: float
) -> TurningPath | None:
    """How the body turned along a path; None without a gyroscope."""
    if system.gyroscope is None:
        return None
    if flown.attitudes is None or draws.gyro is None:
        raise ValueError(
            "flown must have attitudes, and draws must be for a gyroscope, as the system has one"
        )
    periods, found = flown.periods, draws.gyro.shape
    if len(found) != 2 or found[0] < periods or found[1] != GYRO_COLUMNS:
        raise ValueError(
            f"draws: gyro must have shape (n, {GYRO_COLUMNS}), n at least {periods}, got {found}"
        )
    return TurningPath(flown.attitudes, draws.gyro, system.gyroscope.numbers, period)
