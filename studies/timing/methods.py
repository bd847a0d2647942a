"""What `studies.timing` measures: landing problems, and the planners that are asked to solve them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np

from guidance import InfeasibleError, Lander, Limits, Plan, SolverFailedError, State, solve_pdg
from guidance.descent.problem import LandingProblem
from guidance.pdg.solve import DEFAULT_NODES, METHODS, PlanningMethod
from guidance.reference.casadi_planner import plan_casadi
from guidance.reference.nonlinear_program import NonlinearSolver, fatrop_present
from hda.task.scenario import sample_scenario
from studies.peers.openscvx_process import OPENSCVX_METHOD
from studies.timing.gfold_peer import PEER_METHOD, gfold_present, plan_gfold
from studies.timing.openscvx_peer import OpenscvxPlanner
from studies.timing.qoco_peer import (
    CLARABEL_METHOD,
    QOCO_METHOD,
    QocoPlanner,
    plan_clarabel,
    qoco_present,
)

AUTO, _, CONVEX, CASADI, CVXPY = METHODS

PEER_NODES = 30
_TIGHT_NODES = 201
OWN_METHOD = "solve_pdg"
DPP_METHOD = f"{CVXPY}, DPP"
REBUILT_METHOD = f"{CVXPY}, rebuilt"
IPOPT_METHOD = f"{CASADI}, IPOPT alone"
FATROP_METHOD = f"{CASADI}, fatrop alone"


@dataclass(frozen=True, eq=False)
class Case:
    """A landing problem to time.

    Attributes:
        name: in tables.
        problem: what is asked.
        feasible: whether a flight exists.
        propellant: [kg] the tight optimum; nan where infeasible.
        time_of_flight: [s] its time of flight; what the fixed-time methods are asked for.
        drawn: whether it is a start drawn from a preset.
    """

    name: str
    problem: LandingProblem
    feasible: bool
    propellant: float
    time_of_flight: float
    drawn: bool = False

    @property
    def limits(self) -> tuple[bool, ...]:
        """Which limits are set: planners that compile do so once for each set."""
        lander, problem = self.problem.lander, self.problem
        return (
            lander.min_thrust > 0.0,
            lander.pointing_limit is not None,
            problem.glide_slope_limit is not None,
            problem.speed_limit is not None,
        )


def ask(
    problem: LandingProblem, nodes: int, time_of_flight: float | None, method: PlanningMethod = AUTO
) -> Plan:
    """Call `solve_pdg` on a problem; a plan without a flight is returned, not raised."""
    try:
        return solve_pdg(
            problem.state,
            problem.target,
            lander=problem.lander,
            gravity=problem.gravity,
            angular_velocity=problem.angular_velocity,
            limits=problem.limits,
            target_velocity=problem.target_velocity,
            time_of_flight=time_of_flight,
            nodes=nodes,
            method=method,
        )
    except (InfeasibleError, SolverFailedError) as error:
        return error.plan


def make_case(name: str, problem: LandingProblem, drawn: bool = False) -> Case:
    """Find the tight optimum by the convex solver on a fine mesh."""
    plan = ask(problem, _TIGHT_NODES, None)
    return Case(name, problem, plan.status.has_flight, plan.propellant, plan.time_of_flight, drawn)


def paper_cases(starts: int, preset: str = "paper", study_seed: int = 0) -> list[Case]:
    """Starts of the preset's first episodes on the tuning tiles, each to its first target."""
    cases = []
    for episode in range(starts):
        scenario = sample_scenario(preset, study_seed, episode, "tuning")
        problem = LandingProblem(
            scenario.initial_state,
            scenario.nominal_target,
            scenario.preset.lander,
            np.array(scenario.preset.gravity),
        )
        cases.append(make_case(f"{preset}-{episode}", problem, drawn=True))
    return cases


def reference_cases(path: Path) -> list[Case]:
    """Cases of a JSON file in the format of studies/timing/cases.

    Raises:
        OSError: the file cannot be read.
        ValueError: it lacks a field.
    """
    try:
        listed = json.loads(path.read_text())["cases"]
        return [make_case(case["name"], _problem(case)) for case in listed]
    except KeyError as error:
        raise ValueError(f"cases: {path} lacks the field {error}") from error


def _problem(case: dict) -> LandingProblem:
    return LandingProblem(
        State.parse([*case["position"], *case["velocity"], case["mass"]]),
        np.array(case["target"], dtype=np.float64),
        Lander(pointing_limit=case["pointing_limit"], **case["lander"]),
        np.array(case["gravity"], dtype=np.float64),
        Limits(glide_slope=case["glide_slope_limit"]),
    )


@dataclass(frozen=True)
class Method:
    """A planner on a mesh, with free or fixed time of flight.

    Attributes:
        name: in tables.
        nodes: N.
        free: whether it searches the time of flight.
        plan: (problem, nodes, time of flight or None) -> Plan.
        prepare: what must be undone before each call, outside the clock; None for nothing.
        clock: [s] processor time of what solves; of this process by default.
    """

    name: str
    nodes: int
    free: bool
    plan: Callable[[LandingProblem, int, float | None], Plan]
    prepare: Callable[[], None] | None = None
    clock: Callable[[], float] = process_time

    @property
    def label(self) -> str:
        """Name, time and nodes in one."""
        return f"{self.name}, {'free' if self.free else 'fixed'}, {self.nodes}"

    def run(self, case: Case) -> Plan:
        """Plan one case; an infeasible one, which has no best time, always with a free time."""
        fixed = case.feasible and not self.free
        return self.plan(case.problem, self.nodes, case.time_of_flight if fixed else None)


def _by_method(method: PlanningMethod) -> Callable[[LandingProblem, int, float | None], Plan]:
    return partial(ask, method=method)


def _by_one_solver(solver: NonlinearSolver) -> Callable[[LandingProblem, int, float | None], Plan]:
    def plan(problem: LandingProblem, nodes: int, time_of_flight: float | None) -> Plan:
        return plan_casadi(problem, nodes, time_of_flight, solver=solver)

    return plan


def _forget_cvxpy_model() -> None:
    """Drop the compiled models, so that the next call states and compiles its problem anew."""
    from guidance.reference import cvxpy_planner

    cvxpy_planner.forget_models()


def timed_methods(openscvx: OpenscvxPlanner | None = None) -> list[Method]:
    """Every method that is installed; the first of them is solve_pdg as users call it.

    Args:
        openscvx: who asks that package; None where it is not installed.
    """
    cvxpy, casadi, both = _by_method(CVXPY), _by_method(CASADI), (True, False)
    methods = [Method(OWN_METHOD, nodes, free, ask) for nodes in (DEFAULT_NODES, 31) for free in both]
    methods += [Method(CONVEX, DEFAULT_NODES, free, _by_method(CONVEX)) for free in both]
    methods += [Method(DPP_METHOD, DEFAULT_NODES, free, cvxpy) for free in both]
    methods.append(Method(REBUILT_METHOD, DEFAULT_NODES, False, cvxpy, _forget_cvxpy_model))
    methods += [Method(CASADI, DEFAULT_NODES, free, casadi) for free in both]
    methods += [Method(IPOPT_METHOD, DEFAULT_NODES, free, _by_one_solver("ipopt")) for free in both]
    if fatrop_present():
        alone = _by_one_solver("fatrop")
        methods += [Method(FATROP_METHOD, DEFAULT_NODES, free, alone) for free in both]
    if gfold_present():
        methods += [Method(PEER_METHOD, PEER_NODES, free, plan_gfold) for free in both]
        methods.append(Method(PEER_METHOD, DEFAULT_NODES, True, plan_gfold))
    if qoco_present():
        qoco = QocoPlanner()
        for free in both:
            methods.append(Method(CLARABEL_METHOD, DEFAULT_NODES, free, plan_clarabel))
            methods.append(Method(QOCO_METHOD, DEFAULT_NODES, free, qoco.plan))
    if openscvx is not None:
        methods += [
            Method(OPENSCVX_METHOD, PEER_NODES, free, openscvx.plan, clock=openscvx.clock) for free in both
        ]
    return methods
