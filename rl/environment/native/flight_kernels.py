"""Many flights, and looks with their noise, by the kernels of `hda.flight` and `hda.sensing`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array, Index
from guidance.kernel import compile_kernel
from hda.flight.interval import enter_zem_zev
from hda.sensing.lidar import look_into
from hda.task.look_noise import Words, draw_symmetric, fill_normals
from rl.inference.arrays import Array32


class Flights(NamedTuple):
    """Flights under way, for the kernel, which takes each one decision further.

    Attributes:
        state: shape (n, 7): true position [m], velocity [m/s] and mass [kg]; changed in place.
        site: [m] shape (n, 3), decided on.
        command: shape (n, 4): K_R, K_V, time to go [s] and its rate; the time to go is changed in place.
        navigation_error: shape (n, 6), estimated minus true position [m] and velocity [m/s].
        thrust_seed: shape (n, k), of the thrust error of this interval (`EpisodeStreams.thrust_seed`).
        thrust_bound: shape (n,), of the relative thrust error.
        status: shape (n,), `hda.flight.vehicle.FlightStatus` at the end; written.
        limited: shape (n,), control periods in which the pointing limit acted; added to.
    """

    state: Array
    site: Array
    command: Array
    navigation_error: Array
    thrust_seed: Words
    thrust_bound: Array
    status: Index
    limited: Index


class Vehicle(NamedTuple):
    """What all flights share.

    Attributes:
        period: [s] over which a thrust is held.
        periods: control periods between two looks.
        gravity: [m/s^2] shape (3,).
        limits: as `hda.flight.held_thrust.VehicleLimits`.
    """

    period: float
    periods: int
    gravity: Array
    limits: tuple[float, float, float, float, float]


@compile_kernel
def fly_decisions(first: int, last: int, flights: Flights, vehicle: Vehicle) -> None:
    """Fly the decisions of flights `first` to `last` - 1 until the next look or the target plane."""
    periods = vehicle.periods
    log = (np.empty(periods + 2), np.empty((periods + 2, 7)), np.empty((periods + 1, 3)))
    for k in range(first, last):
        error = draw_symmetric(flights.thrust_seed[k], flights.thrust_bound[k])
        believed, command = flights.navigation_error[k], flights.command[k]
        site = flights.site[k]
        conditions = (vehicle.period, site[2], vehicle.gravity, vehicle.limits, error, believed, None, None)
        asked = (command[0], command[1], command[2], command[3])
        nodes, status, limited = enter_zem_zev(flights.state[k], site, asked, conditions, None, log)
        for number in range(7):
            flights.state[k, number] = log[1][nodes - 1, number]
        command[2] -= command[3] * log[0][nodes - 1]
        flights.status[k] = status
        flights.limited[k] += limited


@compile_kernel
def take_look(
    seed: Words,
    position: Array,
    aim: Array,
    probability: NDArray[np.float32],
    sensor: tuple[float, float, float],
    out: Array32,
) -> None:
    """Fill `out` with the observed map, its noise drawn from `EpisodeStreams.look_seed`.

    The other arguments are those of `hda.sensing.lidar.look_into`.
    """
    noise = np.empty(out.shape, dtype=np.float32)
    fill_normals(seed, noise.reshape(-1))
    look_into(position, aim, probability, noise, sensor, out)
