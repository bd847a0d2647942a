"""What the attitude loop is worth: its margins, and its answer to a step, flown by the true motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.rigid_body.attitude_loop import AttitudeLoop, torque_into
from guidance.rigid_body.body import RigidBody
from guidance.rigid_body.motion import fly_into
from guidance.rigid_body.quaternion import error_into
from guidance.rigid_body.state import RigidState
from guidance.validation import finite_number, finite_vector


@dataclass(frozen=True)
class LoopMargins:
    """Stability margins of one axis, torque within its limit.

    Attributes:
        gain: factor by which the loop gain may grow.
        phase: [rad] further lag at the crossover that it stands.
        crossover: [rad/s] frequency at which the loop gain is one.
    """

    gain: float
    phase: float
    crossover: float

    @property
    def delay(self) -> float:
        """[s] further delay that the loop stands."""
        return self.phase / self.crossover


def loop_margins(loop: AttitudeLoop) -> LoopMargins:
    """Margins of the loop as the vehicle flies it: torque held over a period h, angle and rate measured.

    Scaled by inertia every axis is a double integrator under PD. With z = (1 + s)/(1 - s) its open loop is

        L = (a + b s)(1 - s) / (2 s^2),     a = (wn h)^2 / 2,     b = 2 zeta wn h,

    which has size one where v = |s| = tan(w h / 2) solves (4 - b^2) v^4 - (a^2 + b^2) v^2 - a^2 = 0. There
    its phase is pi - atan(b v / a) + atan(v) behind. Its gain margin is 2/b, at z = -1.

    Args:
        loop: the gains.
    """
    step = loop.natural_frequency * loop.period
    a, b = 0.5 * step**2, 2.0 * loop.damping * step
    total, lead = a**2 + b**2, 4.0 - b**2
    v = math.sqrt((total + math.sqrt(total**2 + 4.0 * a**2 * lead)) / (2.0 * lead))
    crossover = 2.0 * math.atan(v) / loop.period
    return LoopMargins(2.0 / b, math.atan2(b * v, a) - math.atan(v), crossover)


@dataclass(frozen=True, eq=False)
class StepResponse:
    """A turn, flown.

    Attributes:
        time: [s] shape (n,).
        angle: [rad] shape (n,): what is left of the turn.
        rate: [rad/s] shape (n,): size of the body rates.
        torque: [N m] shape (n - 1, 3), body frame: held over each period.
    """

    time: Array
    angle: Array
    rate: Array
    torque: Array

    def settling_time(self, within: float) -> float:
        """[s] from when on the error stays within an angle [rad]; inf if it does not."""
        outside = np.flatnonzero(self.angle > within)
        if outside.size == 0:
            return 0.0
        return float(self.time[outside[-1] + 1]) if outside[-1] + 1 < self.time.size else math.inf


def fly_turn(turn: Array, mass: float, duration: float, body: RigidBody, loop: AttitudeLoop) -> StepResponse:
    """Turn from rest by a rotation vector, the engine off.

    Args:
        turn: [rad] shape (3,), of length below pi: axis times angle.
        mass: [kg].
        duration: [s].
        body: the vehicle.
        loop: the gains.

    Raises:
        ValueError: an argument is not finite, of the wrong shape or out of range.
    """
    vector = finite_vector("turn", turn, 3)
    angle = finite_number("turn", float(np.linalg.norm(vector)), at_least=0.0, at_most=math.pi)
    periods = math.ceil(finite_number("duration", duration, above=0.0) / loop.period)
    axis = vector / angle if angle > 0.0 else vector
    wanted = np.concatenate([[math.cos(0.5 * angle)], math.sin(0.5 * angle) * axis])
    state = RigidState(np.zeros(3), np.zeros(3), mass).as_array()
    numbers, still = body.numbers(np.zeros(3)), np.zeros((2, 3))
    torque, error = np.empty((periods, 3)), np.empty(3)
    angles, rates = np.empty(periods + 1), np.zeros(periods + 1)
    angles[0] = angle
    for k in range(periods):
        torque_into(state, wanted, numbers, loop.numbers, torque[k])
        fly_into(state, still, np.array([torque[k], torque[k]]), loop.period, numbers)
        error_into(state[6:10], wanted, error)
        angles[k + 1], rates[k + 1] = np.linalg.norm(error), np.linalg.norm(state[10:13])
    return StepResponse(loop.period * np.arange(periods + 1), angles, rates, torque)
