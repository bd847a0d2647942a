"""Starts that cannot stop above the ground: full thrust straight up from the start, in closed form.

No flight is higher or rises faster at any time than a vehicle that pushes straight up with all its thrust
from the start, for its mass is never less than what that burn leaves. With the exhaust velocity c and
tau = m_0 over the greatest mass flow,

    v(t) = v_0 + g t - c ln(1 - t/tau),    z(t) = z_0 + v_0 t + g t^2/2 + c (t + (tau - t) ln(1 - t/tau)).

Where that path meets the target's altitude while it sinks, every flight has met it by then, at least as fast.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from guidance.descent.problem import LandingProblem

_MOST_STEPS = 80  # of Newton's method, which comes from one side and halves the way at least


@dataclass(frozen=True)
class GroundContact:
    """Where full thrust straight up meets the target's altitude.

    Attributes:
        time: [s].
        sink: [m/s] speed there, downward.
    """

    time: float
    sink: float


@dataclass(frozen=True)
class _Climb:
    """The path of full thrust straight up, until the tank is empty."""

    height: float
    rate: float
    gravity: float
    exhaust: float
    tau: float

    def velocity(self, time: float) -> float:
        return self.rate + self.gravity * time - self.exhaust * math.log1p(-time / self.tau)

    def place(self, time: float) -> float:
        left = self.tau - time
        lifted = self.exhaust * (time + left * math.log1p(-time / self.tau))
        return self.height + (self.rate + 0.5 * self.gravity * time) * time + lifted

    def acceleration(self, time: float) -> float:
        return self.gravity + self.exhaust / (self.tau - time)

    def stop(self, empty: float) -> float:
        """[s] when it no longer sinks; `empty` where the tank is empty before."""
        time = empty
        if self.velocity(time) <= 0.0:
            return empty
        for _ in range(_MOST_STEPS):  # the velocity is convex: from above, never past the root
            step = self.velocity(time) / self.acceleration(time)
            if not step > 1e-15 * time:
                break
            time -= step
        return max(time, 0.0)

    def contact(self) -> float:
        """[s] when it meets the altitude; it must do so while it sinks."""
        time = 0.0
        for _ in range(_MOST_STEPS):  # the place is convex and falls: from the left, never past the root
            place, velocity = self.place(time), self.velocity(time)
            if not (place > 1e-12 * max(self.height, 1.0) and velocity < 0.0):
                break
            time -= place / velocity
        return time


def find_ground_contact(problem: LandingProblem) -> GroundContact | None:
    """Where a start that is too fast to stop meets the target's altitude; None where it can stop above it."""
    lander, mass = problem.lander, problem.state.mass
    gravity, rate = float(problem.gravity[2]), float(problem.state.velocity[2])
    if problem.rotates:  # what pulls at it is not gravity alone
        return None
    if not -rate > problem.speed_rounding or lander.max_thrust / mass + gravity <= 0.0:
        return None
    tau = mass / lander.max_mass_flow
    climb = _Climb(float(problem.offset[2]), rate, gravity, lander.exhaust_velocity, tau)
    stop = climb.stop(tau * (1.0 - lander.dry_mass / mass))
    if climb.place(stop) >= 0.0:
        return None
    time = climb.contact()
    return GroundContact(time, -climb.velocity(time))
