"""One decision interval under ZEM/ZEV, integrated by scipy with events; nothing is shared with `hda`."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

STANDARD_GRAVITY = 9.80665


class Vehicle(NamedTuple):
    dry_mass: float
    max_thrust: float
    specific_impulse: float
    min_thrust: float
    gravity: tuple[float, float, float]


class Task(NamedTuple):
    site: NDArray[np.float64]
    gains: tuple[float, float]
    time_to_go: float
    rate: float
    period: float
    periods: int
    thrust_error: float


class Flown(NamedTuple):
    time: list[float]
    path: list[NDArray[np.float64]]
    commanded: list[NDArray[np.float64]]
    status: str


def command(y: NDArray[np.float64], task: Task, time_to_go: float, vehicle: Vehicle) -> NDArray[np.float64]:
    """Saturated thrust [N] of the paper's ZEM/ZEV law."""
    gravity = np.array(vehicle.gravity)
    zem = task.site - y[:3] - y[3:6] * time_to_go - gravity * time_to_go**2 / 2
    zev = -y[3:6] - gravity * time_to_go
    thrust = y[6] * (task.gains[0] / time_to_go**2 * zem - task.gains[1] / time_to_go * zev)
    size = float(np.linalg.norm(thrust))
    return thrust * (min(max(size, vehicle.min_thrust), vehicle.max_thrust) / size)


def integrate(
    y: NDArray[np.float64], thrust: NDArray[np.float64], duration: float, plane: float, vehicle: Vehicle
) -> tuple[float, NDArray[np.float64], str]:
    """Hold a thrust until the time is over, the plane is crossed downwards or the tank is dry."""
    flow = float(np.linalg.norm(thrust)) / (STANDARD_GRAVITY * vehicle.specific_impulse)

    def rate(_, y):
        return [*y[3:6], *(thrust / y[6] + np.array(vehicle.gravity)), -flow]

    def height(_, y):
        return y[2] - plane

    def propellant(_, y):
        return y[6] - vehicle.dry_mass

    for event in (height, propellant):
        event.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
        event.direction = -1  # pyright: ignore[reportFunctionMemberAccess]
    events = [height, propellant] if flow > 0.0 else [height]  # an empty tank does not run dry again
    leg = solve_ivp(rate, (0.0, duration), y, "DOP853", events=events, rtol=1e-12, atol=1e-10, max_step=0.1)
    for word, times, states in zip(("touchdown", "dry"), leg.t_events, leg.y_events, strict=False):
        if len(times):
            return float(times[0]), states[0], word
    return duration, leg.y[:, -1], "over"


def fly(y: NDArray[np.float64], task: Task, vehicle: Vehicle) -> Flown:
    """Fly until the next look, or to the plane."""
    plane = float(task.site[2])
    flown = Flown([0.0], [y], [], "")
    for k in range(task.periods + 1):
        time_to_go = task.time_to_go - task.rate * task.period * k
        cut_off = time_to_go <= task.period / 2
        if k == task.periods and not cut_off:
            return flown._replace(status="flying")
        thrust = np.zeros(3) if cut_off else command(flown.path[-1], task, time_to_go, vehicle)
        applied = thrust * (1.0 + task.thrust_error)
        spent, y, word = integrate(
            flown.path[-1], applied, math.inf if cut_off else task.period, plane, vehicle
        )
        if word == "dry":
            fall, y, _ = integrate(y, np.zeros(3), math.inf, plane, vehicle)
            spent += fall
        flown.commanded.append(thrust)
        flown.time.append(flown.time[-1] + spent)
        flown.path.append(y)
        if word != "over":
            return flown._replace(status={"dry": "tank-empty"}.get(word, word))
    raise AssertionError("the last pass ends the flight")
