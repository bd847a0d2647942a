"""Flights that keep a lander's limits, made without a planner: random thrust, flown to wherever it leads."""

import math
from dataclasses import dataclass

import numpy as np

from guidance import Lander, State
from guidance.descent.problem import LandingProblem

_STEPS = 400  # of the integration, per flight


@dataclass(frozen=True, eq=False)
class AdmissibleFlight:
    """What was flown, as a landing problem whose target is where it ended.

    Attributes:
        problem: from the start to the end, with the velocity there.
        time: [s] flown.
        spent: [m/s] velocity change.
        slope: [rad] greatest angle from the vertical, seen from the end.
    """

    problem: LandingProblem
    time: float
    spent: float
    slope: float


def random_lander(rng: np.random.Generator) -> Lander:
    most = rng.uniform(4e3, 4e4)
    least = most * rng.uniform(0.1, 0.9) if rng.random() < 0.6 else 0.0
    limit = rng.uniform(0.1, 2.5) if rng.random() < 0.6 else None
    return Lander(rng.uniform(300.0, 1000.0), most, rng.uniform(150.0, 450.0), least, limit)


def _directions(lander: Lander, count: int, rng: np.random.Generator) -> np.ndarray:
    """Unit vectors within the pointing limit, shape (count, 3)."""
    limit = math.pi if lander.pointing_limit is None else lander.pointing_limit
    lean, turn = limit * rng.random(count) ** 0.5, rng.uniform(0.0, 2.0 * math.pi, count)
    across = np.sin(lean)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), np.cos(lean)])


def random_flight(rng: np.random.Generator) -> AdmissibleFlight:
    """A few arcs of steady thrust, full, least or between, on a random world; it ends at its lowest place."""
    while True:
        flight = _flight(rng)
        if flight is not None:
            return flight


def _flight(rng: np.random.Generator) -> AdmissibleFlight | None:
    lander, gravity = random_lander(rng), np.array([0.0, 0.0, -rng.uniform(0.3, 12.0)])
    mass = start_mass = lander.dry_mass * rng.uniform(1.2, 2.0)
    arcs = int(rng.integers(1, 5))
    throttle = rng.choice([0.0, 1.0, rng.random()], arcs)
    thrusts = lander.min_thrust + throttle * (lander.max_thrust - lander.min_thrust)
    durations = rng.uniform(0.5, 12.0, arcs)
    affordable = 0.9 * (mass - lander.dry_mass) * lander.exhaust_velocity / max(thrusts @ durations, 1e-9)
    durations *= min(1.0, affordable)
    position, velocity = np.zeros(3), rng.normal([0.0, 0.0, -30.0], 30.0)
    start_velocity, path = velocity.copy(), [position]
    for thrust, duration, direction in zip(thrusts, durations, _directions(lander, arcs, rng), strict=True):
        flow = thrust / lander.exhaust_velocity
        step = duration / _STEPS
        for _ in range(_STEPS):  # exact velocity; position by Simpson's rule
            gained = [
                -lander.exhaust_velocity * math.log1p(-flow * part * step / mass) for part in (0.5, 1.0)
            ]
            middle = velocity + gained[0] * direction + 0.5 * step * gravity
            after = velocity + gained[1] * direction + step * gravity
            position = position + step / 6.0 * (velocity + 4.0 * middle + after)
            velocity, mass = after, mass - flow * step
            path.append(position)
    seen = np.array(path) - position
    if seen[:, 2].min() < 0.0 or mass == start_mass:  # it would have flown below a landing problem's target
        return None
    slope = float(np.arctan2(np.hypot(seen[:-1, 0], seen[:-1, 1]), seen[:-1, 2]).max())
    start = State(np.zeros(3), start_velocity, start_mass)
    problem = LandingProblem(start, position, lander, gravity, target_velocity=velocity)
    spent = lander.exhaust_velocity * math.log(start_mass / mass)
    return AdmissibleFlight(problem, float(durations.sum()), spent, slope)
