"""The unrelaxed problem by CasADi: true mass, true thrust bounds, no slack, free time in one solve.

    minimise    -ln m(T)
    subject to  r' = v,  v' = u + g,  (ln m)' = -|u| / c      u linear between nodes
                T_min <= m |u| <= T_max  (nonconvex)          and the limits of `guidance.descent.problem`

The burnt mass is integrated by Simpson's rule on |u| itself. |u| is smoothed near zero, where its derivative
has a kink. A local method: where it fails, nothing is said about feasibility.

fatrop solves it where nothing but the full thrust and the altitude limits the flight, IPOPT elsewhere and
what fatrop gives up (`guidance.reference.nonlinear_program`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.descent.limits import Cone
from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory
from guidance.flight_time.time_window import TimeWindow, forbidden_by, guess_time, time_window
from guidance.reference.nonlinear_program import NonlinearSolver, Structure, nonlinear_program
from guidance.reference.trajectory_guess import (
    is_vertical,
    least_energy_flight,
    rest_of_flight,
    swing_sideways,
)
from guidance.reference.units import Units

METHOD = "casadi"
_SMOOTHING = 2e-5  # of full thrust; an engine that cannot stop needs none of it
_LONG = 2e4  # [m] way beyond which the smoothing is finer
_COARSE_SMOOTHING = 1e-2  # of full thrust, for a flight to start from
_GREATEST_LEAST = 1.0 - 5e-4  # of full thrust: an interior-point method needs room between two bounds
_GREATEST_MIDWAY = 0.98  # of full thrust: an engine without throttle may turn by 23 degrees an interval


def _parameters(
    problem: LandingProblem, units: Units, times: TimeWindow, smoothing: float
) -> dict[str, ArrayLike]:
    """Every number of a case by its name, scaled; a limit that is not set is not read."""
    lander, final = problem.lander, problem.limits.final_thrust_direction or Cone(math.pi)
    sight = problem.limits.line_of_sight or Cone(math.pi / 2)
    least = lander.min_thrust / lander.max_thrust
    return {
        "position": problem.offset / units.length,
        "velocity": problem.state.velocity / units.speed,
        "target_velocity": problem.target_velocity / units.speed,
        "gravity": problem.pull_at_target / units.acceleration,
        "spin": problem.angular_velocity * units.time,
        "flow": units.speed / lander.exhaust_velocity,
        "least_thrust": min(least, _GREATEST_LEAST),
        "least_midway": min(least, _GREATEST_MIDWAY),
        "dry": -problem.log_mass_ratio,
        "smoothing": 1e-8 if lander.min_thrust > 0.0 else smoothing,
        "pointing": math.cos(lander.pointing_limit or math.pi),
        "glide": problem.glide_slope_limit or 0.0,
        "speed": (problem.speed_bound or 0.0) / units.speed,
        "low": times.low / units.time,
        "high": times.high / units.time,
        "final_axis": final.axis,
        "final_cosine": math.cos(final.angle),
        "sight_axis": sight.axis,
        "sight_angle": sight.angle,
        "rate": (problem.limits.thrust_rate or 0.0) / lander.max_thrust * units.time,
    }


def _pack(units: Units, problem: LandingProblem, flight: Trajectory, free_time: bool) -> Array:
    """Decision vector of a trajectory in SI."""
    mass = flight.mass
    acceleration = flight.acceleration / units.acceleration
    columns = [
        (flight.position - problem.target) / units.length,
        flight.velocity / units.speed,
        np.log(mass / problem.state.mass)[:, None],
        acceleration,
    ]
    if free_time:
        columns.append(np.full((mass.size, 1), flight.duration / units.time))
    states = np.hstack(columns)
    return np.concatenate([np.hstack([states[:-1], acceleration[1:]]).ravel(), states[-1]])


def _unpack(
    units: Units, problem: LandingProblem, decision: Array, nodes: int, time_of_flight: float | None
) -> Trajectory:
    stages = np.append(decision, np.zeros(3)).reshape(nodes, -1)
    time = stages[0, 10] * units.time if time_of_flight is None else time_of_flight
    mass = problem.state.mass * np.exp(stages[:, 6])
    return Trajectory(
        np.linspace(0.0, float(time), nodes),
        stages[:, :3] * units.length + problem.target,
        stages[:, 3:6] * units.speed,
        mass,
        stages[:, 7:10] * units.acceleration * mass[:, None],
        problem.lander.exhaust_velocity,
    )


def plan_casadi(
    problem: LandingProblem,
    nodes: int,
    time_of_flight: float | None = None,
    guess: Plan | None = None,
    solver: NonlinearSolver | None = None,
) -> Plan:
    """Least propellant to the target on the unrelaxed problem.

    Args:
        problem: what to solve.
        nodes: N.
        time_of_flight: [s] or None to leave it free.
        guess: an earlier plan to start from; None for the flight of least energy.
        solver: the only one to ask; None asks fatrop where it is reliable, IPOPT elsewhere and where fatrop
            fails.

    Returns:
        A plan that is OPTIMAL (a local optimum); or LIMIT_REACHED or SOLVER_FAILED, without a flight;
        INFEASIBLE only where closed-form bounds leave no time of flight, or not the one asked for. Its
        message names the solver, and what fatrop said where IPOPT took over; both count as solves.
    """
    window = time_window(problem)
    cause = window.cause if time_of_flight is None else forbidden_by(problem, time_of_flight)
    if cause:
        return Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=cause)
    structure = Structure.of(problem, nodes, time_of_flight is None)
    if guess is not None and guess.nodes:
        start = rest_of_flight(problem, guess.trajectory, nodes)
    else:
        start = least_energy_flight(problem, nodes, time_of_flight or guess_time(problem, window))
    times = window if time_of_flight is None else TimeWindow(time_of_flight, time_of_flight)
    question = _Question(problem, structure, swing_sideways(problem, start), times)
    chosen = solver or structure.solver
    plan = question.answer(chosen)
    if plan.status.has_flight or solver is not None or chosen == "ipopt":
        return plan
    again = question.answer("ipopt")
    return replace(again, message=f"{again.message}; after {plan.message}", solves=plan.solves + again.solves)


@dataclass(frozen=True, eq=False)
class _Question:
    """One problem with its first guess and the times of flight that are admitted."""

    problem: LandingProblem
    structure: Structure
    start: Trajectory
    times: TimeWindow

    def answer(self, solver: NonlinearSolver) -> Plan:
        """Solve it by one solver.

        A coasting engine on a vertical flight stands on the kink of |u| in every direction at once: there the
        flight of a coarsely smoothed |u| comes first, and the answer starts from it.
        """
        if self.problem.lander.min_thrust > 0.0 or not is_vertical(self.problem):
            return self._ask(solver, self._smoothing)
        coarse = self._ask(solver, _COARSE_SMOOTHING)
        if not coarse.status.has_flight:
            return coarse
        start = rest_of_flight(self.problem, coarse.trajectory, coarse.nodes)
        fine = replace(self, start=swing_sideways(self.problem, start))._ask(solver, self._smoothing)
        return replace(fine, solves=coarse.solves + fine.solves)

    @property
    def _smoothing(self) -> float:
        """It hides propellant all along a flight, and so metres at the end of a long one."""
        return _SMOOTHING * min(1.0, _LONG / Units.of(self.problem).length)

    def _ask(self, solver: NonlinearSolver, smoothing: float) -> Plan:
        problem, structure, units = self.problem, self.structure, Units.of(self.problem)
        program = nonlinear_program(structure, solver)
        failed = Plan(PlanStatus.SOLVER_FAILED, problem, METHOD, solves=1)
        numbers = _parameters(problem, units, self.times, smoothing)
        try:
            answer = program.solver(
                x0=_pack(units, problem, self.start, structure.free_time),
                p=np.concatenate([np.ravel(numbers[name]) for name in program.parameters]),
                lbg=program.lower,
                ubg=program.upper,
            )
        except RuntimeError as error:
            return replace(failed, message=f"{solver}: {error}")
        stats = program.solver.stats()
        if not stats["success"]:
            limited = stats["unified_return_status"] == "SOLVER_RET_LIMITED"
            status = PlanStatus.LIMIT_REACHED if limited else PlanStatus.SOLVER_FAILED
            return replace(failed, status=status, message=f"{solver}: {stats['return_status']}")
        time = None if structure.free_time else self.times.low
        flight = _unpack(units, problem, np.array(answer["x"]).ravel(), structure.nodes, time)
        plan = Plan.of_flight(PlanStatus.OPTIMAL, problem, METHOD, flight, solves=1)
        return replace(plan, message=f"{plan.message} ({solver})")
