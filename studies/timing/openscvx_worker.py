"""Programmes of OpenSCvx for the landing of a point mass, in the interpreter that has the package.

It needs nothing of these packages (`studies.peers.openscvx_serving` brings the cases). A case is stated in
units of its own (the distance, the start mass, the full thrust), so that one compiled programme serves every
case with the same limits: numbers are parameters.
The thrust has its size as a control of its own, which bounds it (lossless convexification); the share of the
propellant that is burnt stands in place of the mass. Controls are linear between equally spaced nodes.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

WEIGHTS = {"lam_cost": 1.0, "lam_vc": 100.0, "lam_prox": 1e-3}
"""Of the cost, of virtual control and of the distance from the last iterate; the tuner is the package's own.

With its default weights (0.01, 1, 0.1) it calls flights converged that burn kilograms too much.
"""
_MOST_SECONDS = 120.0  # of wall time, after which the package stops a case
_BOX = 4.0  # greatest scaled speed; twice the greatest scaled distance
_LONGEST = 12.0  # scaled time of flight
_LOOSE = {"least_thrust": [0.0], "pointing_cosine": [-1.0], "glide_slope": [10.0], "speed_limit": [10.0]}
"""Limits of a case, and values of them with which a programme is compiled: no flight breaks them."""


class Programme:
    """A compiled programme of one mesh and one set of limits."""

    def __init__(self, nodes: int, free: bool, limits: Sequence[str]) -> None:
        """Compile it.

        Args:
            nodes: N.
            free: whether the time of flight is.
            limits: those of `_LOOSE` that are set.
        """
        ox = importlib.import_module("openscvx")
        self._ox, self._nodes, self._free = ox, nodes, free
        first = {"gravity": [0.0, 0.0, -0.1], "share": [0.04], "flow": [0.1]} | {k: _LOOSE[k] for k in limits}
        numbers = {
            name: ox.Parameter(name, shape=(len(value),), value=np.array(value))
            for name, value in first.items()
        }
        half = 0.5 * _BOX
        self._position = _bounded(ox.State("position", shape=(3,)), [-half, -half, 0.0], [half] * 3)
        self._velocity = _bounded(ox.State("velocity", shape=(3,)), [-_BOX] * 3, [_BOX] * 3)
        self._burnt = _bounded(ox.State("burnt", shape=(1,)), [0.0], [1.0])
        self._thrust = _bounded(ox.Control("thrust", shape=(3,)), [-1.0] * 3, [1.0] * 3)
        self._size = _bounded(ox.Control("size", shape=(1,)), [0.0], [1.0])
        self._burnt.initial, self._burnt.final = np.zeros(1), [ox.Minimize(0.5)]
        down = np.array([0.0, 0.0, -0.1])
        self._guess(np.array([0.2, 0.1, 0.9]), 3.0 * down, np.zeros(3), down)
        self._time = ox.Time(initial=0.0, final=self._end(3.0), min=0.0, max=_LONGEST, uniform_time_grid=True)
        norm, size = ox.linalg.Norm, self._size[0]
        on_the_way = list(range(nodes - 1))  # at the end glide slope and speed hold with equality
        kept = {
            "least_thrust": lambda bound: (bound <= size).convex(),
            "pointing_cosine": lambda bound: (bound * size <= self._thrust[2]).convex(),
            "glide_slope": lambda bound: (
                (norm(self._position[:2]) <= bound * self._position[2]).convex().at(on_the_way)
            ),
            "speed_limit": lambda bound: (norm(self._velocity) <= bound).convex().at(on_the_way),
        }
        constraints = [(norm(self._thrust) <= size).convex()]
        constraints += [kept[name](numbers[name][0]) for name in limits]
        mass = 1.0 - numbers["share"][0] * self._burnt[0]
        self.problem = ox.Problem(
            dynamics={
                "position": self._velocity,
                "velocity": self._thrust / mass + numbers["gravity"],
                "burnt": numbers["flow"][0] * self._size / numbers["share"][0],
            },
            constraints=constraints,
            states=[self._position, self._velocity, self._burnt],
            controls=[self._thrust, self._size],
            N=nodes,
            time=self._time,
            algorithm={**WEIGHTS, "t_max": _MOST_SECONDS},
            float_dtype="float64",
        )
        self.problem.settings.dev.printing = False
        self.problem.settings.prp.dt = 0.1
        self.problem.initialize()

    def _end(self, time_of_flight: float) -> Any:
        return self._ox.Free(time_of_flight) if self._free else time_of_flight

    def _guess(self, position: Any, velocity: Any, last_velocity: Any, gravity: Any) -> None:
        """Set start and end, and guess a straight way at a thrust that a little more than hovers."""
        nodes, hover = self._nodes, -1.3 * gravity
        self._position.initial, self._position.final = position, np.zeros(3)
        self._velocity.initial, self._velocity.final = velocity, last_velocity
        self._position.guess = np.linspace(position, np.zeros(3), nodes)
        self._velocity.guess = np.linspace(velocity, last_velocity, nodes)
        self._burnt.guess = np.linspace(0.0, 0.6, nodes)[:, None]
        self._thrust.guess = np.tile(hover, (nodes, 1))
        self._size.guess = np.full((nodes, 1), float(np.linalg.norm(hover)))

    def solve(self, case: dict[str, Any]) -> dict[str, Any]:
        """Solve a case; numbers in and out are in SI, positions from the target."""
        offset, gravity = np.array(case["position"]), np.array(case["gravity"])
        mass, acceleration = case["mass"], case["max_thrust"] / case["mass"]
        length = float(np.linalg.norm(offset))
        unit = math.sqrt(length / acceleration)
        share = 1.0 - case["dry_mass"] / mass
        speed = length / unit
        told = {
            "gravity": gravity / acceleration,
            "share": [share],
            "flow": [acceleration * unit / case["exhaust_velocity"]],
            "least_thrust": [(case["least_thrust"] or 0.0) / case["max_thrust"]],
            "pointing_cosine": [case["pointing_cosine"]],
            "glide_slope": [case["glide_slope"]],
            "speed_limit": [(case["speed_limit"] or 0.0) / speed],
        }
        parameters = self.problem.parameters
        parameters.update({k: np.array(v, dtype=float) for k, v in told.items() if k in parameters})
        velocity, last = np.array(case["velocity"]) / speed, np.array(case["target_velocity"]) / speed
        self._guess(offset / length, velocity, last, gravity / acceleration)
        self._time.final = self._end(case["time_of_flight"] / unit)
        self._time.guess = np.linspace(0.0, case["time_of_flight"] / unit, self._nodes)[:, None]
        self.problem.reset()
        found = self.problem.solve()
        nodes = found.nodes
        return {
            "converged": bool(found.converged),
            "iterations": int(self.problem.state.k),
            "time": (np.ravel(nodes["time"]) * unit).tolist(),
            "position": (nodes["position"] * length).tolist(),
            "velocity": (nodes["velocity"] * speed).tolist(),
            "mass": (mass * (1.0 - share * np.ravel(nodes["burnt"]))).tolist(),
            "thrust": (nodes["thrust"] * case["max_thrust"]).tolist(),
        }


def _bounded(variable: Any, low: Sequence[float], high: Sequence[float]) -> Any:
    variable.min, variable.max = np.array(low), np.array(high)
    return variable


def name_programme(case: dict[str, Any]) -> tuple[int, bool, tuple[str, ...]]:
    """Mesh, whether the time of flight is free, and the limits that are set: the rest are numbers."""
    return case["nodes"], case["free"], tuple(name for name in _LOOSE if case[name] is not None)


def build_programme(case: dict[str, Any]) -> Programme:
    """The programme that serves a case."""
    return Programme(*name_programme(case))
