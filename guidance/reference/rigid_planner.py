"""The least-propellant descent of a rigid body by CasADi and IPOPT: an independent reference.

The code of the motion, its discretisation (collocation in place of multiple shooting), the search (an
interior-point method on the whole problem in place of programmes about the last flight) and the units are not
those of `guidance.successive`. The first guess and the check of the answer are shared; nodes at equal
intervals, controls linear between them and the range of the time of flight about the first guess's are chosen
alike, so that both look for the same optimum. A local method: where it fails, nothing is said about
feasibility.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.descent.plan import PlanStatus
from guidance.reference.rigid_program import (
    STATE,
    RigidLayout,
    RigidProgram,
    RigidStructure,
    rigid_program,
)
from guidance.reference.units import Units
from guidance.rigid_descent.flight import RigidFlight
from guidance.rigid_descent.plan import RigidPlan
from guidance.rigid_descent.problem import RigidLandingProblem

METHOD = "casadi"
_SHORTEST, _LONGEST = 0.2, 5.0  # time of flight over that of the first guess
_FREE = 2.0  # of a number of an attitude: beyond what a unit quaternion holds


@dataclass(frozen=True)
class _Scales:
    """What one is: units of length and acceleration, the start mass, the greatest torque."""

    units: Units
    mass: float
    torque: float

    @classmethod
    def of(cls, problem: RigidLandingProblem) -> _Scales:
        """Those of a problem."""
        units = Units.of(problem.point_mass)
        return cls(units, problem.state.mass, max(problem.body.torque_limit) or 1.0)

    @property
    def state(self) -> Array:
        """Shape (14,): unit of each number of a state."""
        units = self.units
        each = [units.length, units.speed, 1.0, 1.0 / units.time, self.mass]
        return np.repeat(each, [3, 3, 4, 3, 1])

    @property
    def control(self) -> Array:
        """Shape (6,): unit of thrust and torque."""
        return np.repeat([self.mass * self.units.acceleration, self.torque], 3)

    def parameters(self, problem: RigidLandingProblem) -> dict[str, ArrayLike]:
        """Every number of a case by its name, scaled; a limit that is not set is not read."""
        body, lander, units = problem.body, problem.body.lander, self.units
        force = self.mass * units.acceleration
        return {
            "gravity": problem.gravity / units.acceleration,
            "inertia": np.array(body.inertia) / (self.torque * units.time**2),
            "arm": body.engine_arm * force / self.torque,
            "inertia_mass": body.inertia_mass / self.mass,
            "inertia_exponent": body.inertia_exponent,
            "flow": units.speed / lander.exhaust_velocity,
            "lag": body.engine_lag / units.time,
            "least": lander.min_thrust / force,
            "most": lander.max_thrust / force,
            "gimbal": body.gimbal_limit,
            "tilt": body.tilt_limit,
            "rate": body.rate_limit * units.time,
            "glide": problem.glide_slope or 0.0,
        }


def plan_rigid_casadi(problem: RigidLandingProblem, guess: RigidFlight) -> RigidPlan:
    """Least propellant, or the shortest time, on the nodes of a first guess.

    Args:
        problem: what to solve.
        guess: N nodes at equal intervals; it need not keep the motion.

    Returns:
        A plan that is OPTIMAL (a local optimum that was flown and keeps its limits); or LIMIT_REACHED or
        SOLVER_FAILED, without a flight.
    """
    scales = _Scales.of(problem)
    structure = RigidStructure(
        guess.nodes,
        problem.body.gimbal_limit > 0.0,
        problem.body.tilt_limit < math.pi,
        problem.glide_slope is not None and problem.glide_slope < 0.5 * math.pi,
        problem.free_attitude,
        problem.objective == "time",
    )
    program, layout = rigid_program(structure), RigidLayout(guess.nodes)
    start = _pack(problem, guess, scales, layout, program)
    lower, upper = _bounds(problem, scales, layout, start[layout.duration])
    numbers = scales.parameters(problem)

    def without_flight(status: PlanStatus, words: str) -> RigidPlan:
        return RigidPlan(status, problem, METHOD, message=f"ipopt: {words}", solves=1)

    try:
        answer = program.solver(
            x0=np.clip(start, lower, upper),
            p=np.concatenate([np.ravel(numbers[name]) for name in program.parameters]),
            lbx=lower,
            ubx=upper,
            lbg=program.lower,
            ubg=program.upper,
        )
    except RuntimeError as error:
        return without_flight(PlanStatus.SOLVER_FAILED, str(error))
    stats = program.solver.stats()
    if not stats["success"]:
        limited = stats["unified_return_status"] == "SOLVER_RET_LIMITED"
        status = PlanStatus.LIMIT_REACHED if limited else PlanStatus.SOLVER_FAILED
        return without_flight(status, stats["return_status"])
    flight = _unpack(problem, np.array(answer["x"]).ravel(), scales, layout)
    return RigidPlan(PlanStatus.OPTIMAL, problem, METHOD, flight, "optimal", solves=1).checked()


def _pack(
    problem: RigidLandingProblem,
    flight: RigidFlight,
    scales: _Scales,
    layout: RigidLayout,
    program: RigidProgram,
) -> Array:
    """Variables of a flight; within its intervals they lie on straight lines."""
    states, out = flight.states, np.empty(layout.size)
    states[:, :3] -= problem.target
    states /= scales.state
    out[layout.state] = states
    out[layout.control] = np.column_stack([flight.thrust, flight.torque]) / scales.control
    share = program.points[None, :, None]
    out[layout.within] = (1.0 - share) * states[:-1, None, :] + share * states[1:, None, :]
    out[layout.duration] = float(flight.time[-1]) / scales.units.time
    return out


def _bounds(
    problem: RigidLandingProblem, scales: _Scales, layout: RigidLayout, duration: float
) -> tuple[Array, Array]:
    """Least and greatest values of the variables: both ends, mass, altitude, controls, time of flight."""
    body, state, control = problem.body, layout.state, layout.control
    lower, upper = np.full(layout.size, -math.inf), np.full(layout.size, math.inf)

    def hold(columns: object, values: ArrayLike) -> None:
        lower[columns], upper[columns] = values, values  # type: ignore[index]

    for block in (state, layout.within):
        lower[block[..., 2]], lower[block[..., 13]] = 0.0, body.lander.dry_mass / scales.mass
        lower[block[..., 6:10]], upper[block[..., 6:10]] = -_FREE, _FREE
    start = problem.state.as_array()
    start[:3] -= problem.target
    fixed = np.r_[0:6, 10:14] if problem.free_attitude else np.arange(STATE)
    hold(state[0, fixed], (start[:STATE] / scales.state)[fixed])
    hold(state[-1, [0, 1, 2, 7, 8, 10, 11, 12]], 0.0)
    hold(state[-1, 3:6], problem.target_velocity / scales.units.speed)
    torque = np.array(body.torque_limit) / scales.torque
    lower[control[:, 3:]], upper[control[:, 3:]] = -torque, torque
    if body.gimbal_limit == 0.0:
        hold(control[:, :2], 0.0)
        lower[control[:, 2]] = 0.0
    if not problem.free_thrust:
        hold(control[0, :3], problem.state.thrust / scales.control[:3])
    lower[layout.duration], upper[layout.duration] = _SHORTEST * duration, _LONGEST * duration
    return lower, upper


def _unpack(problem: RigidLandingProblem, values: Array, scales: _Scales, layout: RigidLayout) -> RigidFlight:
    states, controls = values[layout.state] * scales.state, values[layout.control] * scales.control
    attitude = states[:, 6:10] / np.linalg.norm(states[:, 6:10], axis=1)[:, None]
    return RigidFlight(
        np.linspace(0.0, float(values[layout.duration]) * scales.units.time, layout.nodes),
        states[:, :3] + problem.target,
        states[:, 3:6],
        attitude,
        states[:, 10:13],
        states[:, 13],
        controls[:, :3],
        controls[:, 3:],
    )
