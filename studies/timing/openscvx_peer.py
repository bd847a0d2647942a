"""The package OpenSCvx (successive convexification, JAX) asked the same landing problem, in its own process.

It runs in an interpreter that has it (`studies.timing.openscvx_worker`) and stays alive, as it compiles for
each mesh and set of limits. Its processor time is that of its process; its answers are checked here as those
of every other planner.
"""

from __future__ import annotations

import json
import math
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory
from studies.timing.first_time import first_time

OPENSCVX_PACKAGE = "openscvx"
OPENSCVX_METHOD = "OpenSCvx"
FIRST_ORDER_HOLD = (
    "Version 0.5.2 blends its controls between nodes up to n/(n - 1) in place of 1 (its issue 584), so that "
    "what it integrates is not the thrust that it gives at the nodes."
)
"""Why its plans miss when they are flown."""
_VERSION = f"from importlib.metadata import version; print(version({OPENSCVX_PACKAGE!r}))"
_SERVE = (
    f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); "
    "import openscvx_worker; del sys.path[0]; openscvx_worker.serve()"
)
_WIDTHS = {"time": (), "position": (3,), "velocity": (3,), "mass": (), "thrust": (3,)}


def openscvx_version(python: Path) -> str | None:
    """Version of the package that an interpreter has; None if it has none.

    Raises:
        OSError: there is no such interpreter.
    """
    asked = subprocess.run([str(python), "-c", _VERSION], capture_output=True, text=True, timeout=60)
    return asked.stdout.strip() if asked.returncode == 0 else None


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
    """Plans by the package in a process of its own, begun when the first is asked for (`open_openscvx`).

    Attributes:
        python: interpreter that has the package.
        worker: what runs there.
        said: file of what the process prints beside its answers.
        processor: [s] processor time of all answers so far.
    """

    python: Path
    worker: str
    said: IO[str]
    processor: float = 0.0
    _process: subprocess.Popen[str] | None = None

    def clock(self) -> float:
        """[s] processor time of all answers so far."""
        return self.processor

    def plan(self, problem: LandingProblem, nodes: int, time_of_flight: float | None = None) -> Plan:
        """Least propellant to the target; a worker that died is a plan without a flight, and begun anew."""
        line = self._exchange(write_case(problem, nodes, time_of_flight))
        if not line:
            self.close()
            self.said.seek(0)
            return _failed(problem, f"the worker ended: {self.said.read().strip()[-300:]}")
        plan, processor = read_answer(line, problem, nodes)
        self.processor += processor
        return plan

    def _exchange(self, case: str) -> str:
        """Send a line and wait for one; empty if the worker ended."""
        if self._process is None:
            self._process = subprocess.Popen(
                [str(self.python), "-c", self.worker],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self.said,
                text=True,
            )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(case + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            return ""
        return self._process.stdout.readline()

    def close(self) -> None:
        """End the process, if there is one."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
        self._process = None


@contextmanager
def open_openscvx(python: Path, worker: str = _SERVE) -> Iterator[OpenscvxPlanner]:
    """A planner whose process ends with the block.

    Args:
        python: interpreter that has the package.
        worker: Python that answers lines of cases there.
    """
    with tempfile.TemporaryFile("w+") as said:
        planner = OpenscvxPlanner(python, worker, said)
        try:
            yield planner
        finally:
            planner.close()
