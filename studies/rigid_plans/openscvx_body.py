"""OpenSCvx asked the landing of a body: cases as its worker reads them, flights as it tells them.

Controls are held over each interval, or linear between nodes. The answers are checked by the true motion, as
those of every planner.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from guidance.arrays import Array
from guidance.rigid_body.quaternion import tilt_angle
from studies.peers.openscvx_process import WorkerProcess, serving_code
from studies.rigid_plans.commanded_flight import CommandedFlight
from studies.rigid_plans.peer_problems import PeerProblem

SERVE_BODY = serving_code(Path(__file__).with_name("openscvx_body_worker.py"))
"""Python that answers cases in the other interpreter."""
NEAR = 1e-5
"""Share of the boxes of positions and velocities, of a radian of lean and of the rate limit by which a flight
may start or end elsewhere than it was asked; further off it answers another case."""
_WIDTHS = {
    "time": (),
    "mass": (),
    "position": (3,),
    "velocity": (3,),
    "attitude": (4,),
    "rates": (3,),
    "thrust": (3,),
    "torque": (3,),
}


@dataclass(frozen=True)
class Weights:
    """Of the package's penalised trust region, under its names.

    Attributes:
        lam_cost: of the cost.
        lam_vc: of virtual control.
        lam_prox: of the distance from the last iterate.
        ep_tr: distance from the last iterate at which it counts as converged.
        ep_vc: the same of virtual control.
    """

    lam_cost: float
    lam_vc: float
    lam_prox: float
    ep_tr: float
    ep_vc: float = 1e-6


@dataclass(frozen=True)
class OpenscvxSettings:
    """How the package is asked.

    Attributes:
        name: in tables.
        nodes: N.
        hold: 'FOH' for controls that are linear between nodes, 'ZOH' for held ones.
        steps: Runge-Kutta steps in an interval.
        weights: of its penalties.
        tuner: what changes them on the way.
    """

    name: str
    nodes: int
    hold: Literal["FOH", "ZOH"]
    steps: int
    weights: Weights
    tuner: str = "ConstantProximalWeight"


@dataclass(frozen=True, eq=False)
class OpenscvxAnswer:
    """What the worker told.

    Attributes:
        status: 'converged', 'not converged', or what failed.
        processor: [s] that it took.
        iterations: programmes solved.
        flight: None where there is none.
    """

    status: str
    processor: float
    iterations: int
    flight: CommandedFlight | None


def write_body_case(peer: PeerProblem, settings: OpenscvxSettings) -> str:
    """A problem as the worker reads it: a line of JSON, in the peer's units, positions from the target.

    Raises:
        ValueError: the body has a gimbal beside torque or an engine lag, which the worker does not state.
    """
    problem, body, state = peer.problem, peer.problem.body, peer.problem.state
    if body.gimbal_limit > 0.0 and (body.engine_lag > 0.0 or max(body.torque_limit) > 0.0):
        raise ValueError("body: OpenSCvx is asked a gimbal only without torque_limit and engine_lag")
    lander, around = body.lander, peer.surroundings
    length, time, mass = peer.length, peer.duration, peer.mass
    speed, acceleration = length / time, length / time**2
    force, inertia = mass * acceleration, mass * length**2
    glide, free = problem.glide_slope, problem.free_attitude
    case = {
        **{name: value for name, value in asdict(settings).items() if name != "name"},
        "position": ((state.position - problem.target) / length).tolist(),
        "velocity": (state.velocity / speed).tolist(),
        "attitude": state.attitude.tolist(),
        "free_attitude": free,
        "rates": (state.rates * time).tolist(),
        "thrust": float(state.thrust[2]) / force,
        "mass": state.mass / mass,
        "target_velocity": (problem.target_velocity / speed).tolist(),
        "gravity": (problem.gravity / acceleration).tolist(),
        "dry_mass": lander.dry_mass / mass,
        "midway_mass": peer.midway_mass / mass,
        "max_thrust": lander.max_thrust / force,
        "min_thrust": lander.min_thrust / force,
        "exhaust_velocity": lander.exhaust_velocity / speed,
        "inertia": [moment / inertia for moment in body.inertia],
        "inertia_mass": body.inertia_mass / mass,
        "inertia_exponent": body.inertia_exponent,
        "torque_limit": [torque / (force * length) for torque in body.torque_limit],
        "rate_limit": body.rate_limit * time,
        "tilt_cosine": math.cos(body.tilt_limit),
        "engine_lag": body.engine_lag / time,
        "engine_arm": body.engine_arm / length,
        "gimbal_cosine": math.cos(body.gimbal_limit) if body.gimbal_limit > 0.0 else None,
        "glide_slope": None if glide is None else math.tan(glide),
        "speed_limit": None if peer.speed_limit is None else peer.speed_limit / speed,
        "looseness": peer.looseness,
        "farthest": peer.farthest / length,
        "lowest": peer.lowest / length,
        "fastest": peer.fastest / speed,
        "first_time": peer.first_time / time,
        "longest_time": peer.longest_time / time,
        "drag": None if around is None else [each * length / mass for each in around.drag],
        "pressure_arm": 0.0 if around is None else around.pressure_arm / length,
        "leak": 0.0 if around is None else around.leak * time / mass,
    }
    return json.dumps(case)


def read_body_answer(line: str, peer: PeerProblem, settings: OpenscvxSettings) -> OpenscvxAnswer:
    """What the worker's line holds; a line that is no answer is one that says so."""
    try:
        told = json.loads(line)
        processor = float(told["processor"])
        if "error" in told:
            return OpenscvxAnswer(f"failed: {told['error']}", processor, 0, None)
        iterations = int(told["iterations"])
        if not told["converged"]:
            return OpenscvxAnswer("not converged", processor, iterations, None)
        arrays = {name: np.array(told[name], dtype=np.float64) for name in _WIDTHS}
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        words = f"failed: no answer of the worker: {type(error).__name__}: {error}"
        return OpenscvxAnswer(words, math.nan, 0, None)
    for name, width in _WIDTHS.items():
        if arrays[name].shape != (settings.nodes, *width) or not np.isfinite(arrays[name]).all():
            return OpenscvxAnswer(f"failed: {name} is no part of a flight", processor, iterations, None)
    if np.diff(arrays["time"]).min() <= 0.0:
        return OpenscvxAnswer("failed: time does not grow", processor, iterations, None)
    flight = _flight(arrays, peer, settings)
    misplaced = _misplaced(flight.states, peer)
    if misplaced:
        return OpenscvxAnswer(f"failed: the flight {misplaced}", processor, iterations, None)
    return OpenscvxAnswer("converged", processor, iterations, flight)


def _misplaced(states: Array, peer: PeerProblem) -> str:
    """Where planned states, shape (K + 1, 14), do not begin or end as asked; empty if they do."""
    problem = peer.problem
    asked = problem.state.as_array()[:14]
    landed = np.concatenate([problem.target, problem.target_velocity, [1.0], np.zeros(6), states[-1, 13:]])
    for words, state, wanted in (("starts", states[0], asked), ("ends", states[-1], landed)):
        gap = np.abs(state - wanted)
        lean = abs(tilt_angle(state[6:10]) - tilt_angle(wanted[6:10]))
        shares = {
            "position": gap[:3].max() / peer.farthest,
            "velocity": gap[3:6].max() / peer.fastest,
            "lean": 0.0 if words == "starts" and problem.free_attitude else lean,
            "rates": gap[10:13].max() / problem.body.rate_limit,
            "mass": gap[13] / problem.state.mass,
        }
        for name, share in shares.items():
            if share > NEAR:
                return f"{words} elsewhere: {name} {share:.1e} off"
    return ""


def _flight(arrays: dict[str, Array], peer: PeerProblem, settings: OpenscvxSettings) -> CommandedFlight:
    length, time, mass = peer.length, peer.duration, peer.mass
    force = mass * length / time**2
    states = np.column_stack(
        [
            arrays["position"] * length + peer.problem.target,
            arrays["velocity"] * length / time,
            arrays["attitude"],
            arrays["rates"] / time,
            arrays["mass"] * mass,
        ]
    )

    def commands(values: Array) -> Array:
        return np.stack([values[:-1], values[1:] if settings.hold == "FOH" else values[:-1]], axis=1)

    return CommandedFlight(
        arrays["time"] * time,
        states,
        commands(arrays["thrust"] * force),
        commands(arrays["torque"] * force * length),
    )


def ask_openscvx(worker: WorkerProcess, peer: PeerProblem, settings: OpenscvxSettings) -> OpenscvxAnswer:
    """Ask the process; one that died is told, and begun anew at the next question."""
    line = worker.ask(write_body_case(peer, settings))
    if not line:
        return OpenscvxAnswer(f"failed: the worker ended: {worker.last_words()}", math.nan, 0, None)
    return read_body_answer(line, peer, settings)
