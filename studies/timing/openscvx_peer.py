"""The package OpenSCvx (successive convexification, JAX) asked the same landing problem, in its own process.

It runs in an interpreter that has it (`studies.timing.openscvx_worker`) and stays alive, as it compiles for
each mesh and set of limits. Its processor time is that of its process; its answers are checked here as those
of every other planner.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory
from studies.peers.openscvx_process import OPENSCVX_METHOD, WorkerProcess, open_worker, serving_code
from studies.timing.first_time import first_time

_SERVE = serving_code(Path(__file__).with_name("openscvx_worker.py"))
_WIDTHS = {"time": (), "position": (3,), "velocity": (3,), "mass": (), "thrust": (3,)}


def write_case(problem: LandingProblem, nodes: int, time_of_flight: float | None) -> str:
    """A problem as the worker reads it: a line of JSON, in SI, positions from the target."""
    lander, glide = problem.lander, problem.glide_slope_limit
    pointing = lander.pointing_limit
    case = {
        "nodes": nodes,
        "free": time_of_flight is None,
        "time_of_flight": first_time(problem) if time_of_flight is None else time_of_flight,
        "position": problem.offset.tolist(),
        "velocity": problem.state.velocity.tolist(),
        "target_velocity": problem.target_velocity.tolist(),
        "mass": problem.state.mass,
        "dry_mass": lander.dry_mass,
        "max_thrust": lander.max_thrust,
        "exhaust_velocity": lander.exhaust_velocity,
        "gravity": problem.gravity.tolist(),
        "least_thrust": lander.min_thrust if lander.min_thrust > 0.0 else None,
        "pointing_cosine": None if pointing is None else math.cos(pointing),
        "glide_slope": math.tan(glide) if glide is not None and problem.has_glide_slope else None,
        "speed_limit": problem.speed_limit,
    }
    return json.dumps(case)


def read_answer(line: str, problem: LandingProblem, nodes: int) -> tuple[Plan, float]:
    """The plan that the worker's line holds, and the processor time [s] that it took.

    Returns:
        A plan that is OPTIMAL where the package says that it converged, LIMIT_REACHED where not, and
        SOLVER_FAILED where it raised something or the flight is none.
    """
    try:
        told = json.loads(line)
        processor = float(told["processor"])
        if "error" in told:
            return _failed(problem, str(told["error"])), processor
        solves = int(told["iterations"])
        if not told["converged"]:
            words = f"not converged after {solves} iterations"
            return Plan(
                PlanStatus.LIMIT_REACHED, problem, OPENSCVX_METHOD, message=words, solves=solves
            ), processor
        arrays = {name: np.array(told[name], dtype=np.float64) for name in _WIDTHS}
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        return _failed(problem, f"no answer of the worker: {type(error).__name__}: {error}"), math.nan
    for name, width in _WIDTHS.items():
        if arrays[name].shape != (nodes, *width) or not np.isfinite(arrays[name]).all():
            return _failed(problem, f"{name} is no part of a flight on {nodes} nodes"), processor
    flight = Trajectory(
        arrays["time"],
        arrays["position"] + problem.target,
        arrays["velocity"],
        arrays["mass"],
        arrays["thrust"],
        problem.lander.exhaust_velocity,
    )
    return Plan.of_flight(PlanStatus.OPTIMAL, problem, OPENSCVX_METHOD, flight, solves), processor


def _failed(problem: LandingProblem, words: str) -> Plan:
    return Plan(PlanStatus.SOLVER_FAILED, problem, OPENSCVX_METHOD, message=words)


@dataclass(eq=False)
class OpenscvxPlanner:
    """Plans by the package in a process of its own (`open_openscvx`).

    Attributes:
        worker: the process.
        processor: [s] processor time of all answers so far.
    """

    worker: WorkerProcess
    processor: float = 0.0

    def clock(self) -> float:
        """[s] processor time of all answers so far."""
        return self.processor

    def plan(self, problem: LandingProblem, nodes: int, time_of_flight: float | None = None) -> Plan:
        """Least propellant to the target; a worker that died is a plan without a flight, and begun anew."""
        line = self.worker.ask(write_case(problem, nodes, time_of_flight))
        if not line:
            return _failed(problem, f"the worker ended: {self.worker.last_words()}")
        plan, processor = read_answer(line, problem, nodes)
        self.processor += processor
        return plan


@contextmanager
def open_openscvx(python: Path, code: str = _SERVE) -> Iterator[OpenscvxPlanner]:
    """A planner whose process ends with the block.

    Args:
        python: interpreter that has the package.
        code: Python that answers lines of cases there.
    """
    with open_worker(python, code) as worker:
        yield OpenscvxPlanner(worker)
