"""The nonlinear programme of a descent, assembled by CasADi in the order that a stage-wise solver needs.

The state of a stage is (r, v, ln m, u), with the time of flight T where that is free; its control is u at the
next node. fatrop reads this structure from the order of variables and constraints: each stage states the
motion to the next one first, as x_next - f(x, control). IPOPT takes any order.

`python -m studies.timing`: IPOPT takes 2.7 times as long as fatrop at free time and 2.3 times at fixed time;
fatrop alone solves 45 of 47 cases, IPOPT all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem

NonlinearSolver = Literal["fatrop", "ipopt"]
_GREATEST_TURN = math.cos(math.radians(45.0))  # in one interval, for an engine that cannot stop
_SERIES = 9  # second derivatives in the power series of an interval: exact to 1e-12 where it turns by 0.3 rad
_GLIDE_SMOOTHING = 1e-6  # of the unit of length
_MOST_ITERATIONS: dict[NonlinearSolver, int] = {"fatrop": 200, "ipopt": 500}


def fatrop_present() -> bool:
    """Whether this build of CasADi holds fatrop; the wheels of 3.7 and later do."""
    import casadi as ca

    return bool(ca.has_nlpsol("fatrop"))


@dataclass(frozen=True)
class Structure:
    """What decides the structure of the programme.

    Attributes:
        nodes: N.
        free_time: whether the time of flight is a variable.
        min_thrust: whether the engine has a lower bound.
        pointing: whether the thrust direction is limited.
        glide_slope: whether there is a glide slope limit below the horizon.
        speed: whether the speed is limited.
        final_thrust: whether the last thrust's direction is limited.
        sight: whether the vehicle must stay within a cone from the target.
        rate: whether the change of the thrust is limited.
        rotates: whether the frame turns.
    """

    nodes: int
    free_time: bool
    min_thrust: bool
    pointing: bool
    glide_slope: bool
    speed: bool
    final_thrust: bool
    sight: bool
    rate: bool
    rotates: bool

    @classmethod
    def of(cls, problem: LandingProblem, nodes: int, free_time: bool) -> Structure:
        """That of `problem`."""
        lander = problem.lander
        return cls(
            nodes,
            free_time,
            lander.min_thrust > 0.0,
            lander.pointing_limit is not None,
            problem.has_glide_slope,
            problem.speed_limit is not None,
            problem.limits.final_thrust_direction is not None,
            problem.limits.line_of_sight is not None,
            problem.limits.thrust_rate is not None,
            problem.rotates,
        )

    @property
    def solver(self) -> NonlinearSolver:
        """The faster of those that are reliable.

        It is fatrop where nothing but the full thrust and the altitude limits the flight. With further limits
        fatrop fails too often: on half of the descents with a least thrust, on most with a glide slope limit
        of 20 degrees.
        """
        limited = self.min_thrust or self.pointing or self.glide_slope or self.speed
        limited = limited or self.final_thrust or self.sight or self.rate or self.rotates
        return "ipopt" if limited or not fatrop_present() else "fatrop"


@dataclass(frozen=True, eq=False)
class NonlinearProgram:
    """The assembled programme: `solver` (a CasADi function), its parameters, its constraints' bounds."""

    solver: Any
    parameters: tuple[str, ...]
    lower: Array
    upper: Array


class _Stages:
    """The programme's variables and constraints, stage by stage; every number of a case is a parameter."""

    def __init__(self, ca: Any, structure: Structure) -> None:
        """State every stage."""
        self._ca, self._structure = ca, structure
        names = ("position", "velocity", "target_velocity", "gravity", "final_axis", "sight_axis", "spin")
        vectors = dict.fromkeys(names, 3)
        scalars = ("flow", "least_thrust", "least_midway", "dry", "smoothing", "pointing", "glide", "speed")
        scalars += ("low", "high", "final_cosine", "sight_angle", "rate")
        sizes = vectors | dict.fromkeys(scalars, 1)
        self.numbers = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
        width = 11 if structure.free_time else 10
        self.states = [ca.SX.sym(f"x{k}", width) for k in range(structure.nodes)]
        self.controls = [ca.SX.sym(f"u{k}", 3) for k in range(1, structure.nodes)]
        self.rows: list[tuple[Any, float, float]] = []
        for k in range(structure.nodes):
            self._state_stage(k)

    def _size(self, u: Any, smoothing: Any = None) -> Any:
        smoothing = self.numbers["smoothing"] if smoothing is None else smoothing
        return self._ca.sqrt(self._ca.sumsqr(u) + smoothing**2) - smoothing

    def _state_stage(self, k: int) -> None:
        """Constraints of one stage; fatrop wants those to the next one first, as x_next - f(x, u)."""
        x, p, last = self.states[k], self.numbers, self._structure.nodes - 1
        r, v, z = x[:3], x[3:6], x[6]
        if k < last:
            self._state_interval(k)
        if k == 0:
            self._add(self._ca.vertcat(r - p["position"], v - p["velocity"], z), 0.0, 0.0)
            if self._structure.free_time:
                self._add(self._ca.vertcat(x[10] - p["low"], p["high"] - x[10]))
        if k == last:
            self._add(self._ca.vertcat(r, v - p["target_velocity"]), 0.0, 0.0)
            self._add(z - p["dry"])
        self._state_limits(k)

    def _state_interval(self, k: int) -> None:
        """Motion and burnt mass from stage k to the next; least thrust midway, against chattering."""
        x, w, p, ca = self.states[k], self.controls[k], self.numbers, self._ca
        r, v, z, u = x[:3], x[3:6], x[6], x[7:10]
        time = x[10] if self._structure.free_time else p["low"]
        h = time / (self._structure.nodes - 1)
        middle = self._size(0.5 * (u + w))
        burnt = p["flow"] * h * (self._size(u) + 4.0 * middle + self._size(w)) / 6.0
        if self._structure.rotates:
            there = [*self._turn(x, w, h), z - burnt, w]
        else:
            travelled = h * v + h**2 * (u / 3.0 + w / 6.0 + p["gravity"] / 2.0)
            there = [r + travelled, v + h * ((u + w) / 2.0 + p["gravity"]), z - burnt, w]
        if self._structure.free_time:
            there.append(time)
        self._add(self.states[k + 1] - ca.vertcat(*there), 0.0, 0.0)
        self._add(ca.exp(z - 0.5 * burnt) * middle - p["least_midway"])
        if self._structure.min_thrust:  # midway alone lets a strong thrust turn round into a weak one
            self._add(ca.dot(u, w) - _GREATEST_TURN * self._size(u) * self._size(w))

        if self._structure.rate:
            self._add((p["rate"] * h) ** 2 - ca.sumsqr(ca.exp(z - burnt) * w - ca.exp(z) * u))

    def _turn(self, x: Any, w: Any, h: Any) -> tuple[Any, Any]:
        """Position and velocity after an interval in a frame that turns: their power series in time."""
        ca, p = self._ca, self.numbers
        pull, rise = x[7:10] + p["gravity"], (w - x[7:10]) / h
        terms = [x[:3], x[3:6]]  # derivatives of the position
        for k in range(_SERIES):
            apparent = ca.cross(p["spin"], 2.0 * terms[k + 1] + ca.cross(p["spin"], terms[k]))
            terms.append((pull if k == 0 else rise if k == 1 else 0.0) - apparent)
        weights = [h**k / math.factorial(k) for k in range(_SERIES + 2)]
        place = sum(weights[k] * terms[k] for k in range(_SERIES + 2))
        speed = sum(weights[k] * terms[k + 1] for k in range(_SERIES + 1))
        return place, speed

    def _state_limits(self, k: int) -> None:
        x, p, ca, last = self.states[k], self.numbers, self._ca, self._structure.nodes - 1
        r, v, u = x[:3], x[3:6], x[7:10]
        size = self._size(u)
        thrust = ca.exp(x[6]) * size
        self._add(
            ca.vertcat(1.0 - thrust, thrust - p["least_thrust"])
        )  # the lower one keeps |u| off its kink
        if 0 < k < last:
            self._add(r[2])
        if self._structure.pointing:
            self._add(u[2] - p["pointing"] * size)
        if self._structure.final_thrust and k == last:
            self._add(ca.dot(u, p["final_axis"]) - p["final_cosine"] * size)
        if self._structure.glide_slope and k < last:
            across = self._size(r[:2], _GLIDE_SMOOTHING)
            self._add(ca.sin(p["glide"]) * r[2] - ca.cos(p["glide"]) * across)
        if self._structure.sight and k < last:
            along = ca.dot(r, p["sight_axis"])
            across = self._size(r - along * p["sight_axis"], _GLIDE_SMOOTHING)
            self._add(ca.sin(p["sight_angle"]) * along - ca.cos(p["sight_angle"]) * across)
        if self._structure.speed:
            self._add(p["speed"] ** 2 - ca.sumsqr(v))

    def _add(self, expression: Any, lower: float = 0.0, upper: float = math.inf) -> None:
        self.rows.append((expression, lower, upper))

    @property
    def decision(self) -> Any:
        """All variables: state, control, state, ... state."""
        inner = [part for pair in zip(self.states, self.controls, strict=False) for part in pair]
        return self._ca.vertcat(*inner, self.states[-1])


@lru_cache(maxsize=16)
def nonlinear_program(structure: Structure, solver: NonlinearSolver) -> NonlinearProgram:
    """Assemble for a mesh and a set of limits; kept, since every number of a case is a parameter.

    Its parameters have names, and are scaled; `_Stages` lists them.
    """
    import casadi as ca

    stages = _Stages(ca, structure)
    sizes = [part.numel() for part, _, _ in stages.rows]
    lower, upper = (np.repeat([row[side] for row in stages.rows], sizes) for side in (1, 2))
    options: dict[str, Any] = {"print_time": 0, "expand": True, "show_eval_warnings": False}
    options |= {f"{solver}.print_level": 0, f"{solver}.max_iter": _MOST_ITERATIONS[solver]}
    if solver == "fatrop":
        options |= {"structure_detection": "auto", "equality": [bool(e) for e in lower == upper]}
    else:
        # monotone takes half the iterations, and does not converge along a glide slope
        strategy = "adaptive" if structure.glide_slope or structure.sight else "monotone"
        options |= {"ipopt.sb": "yes", "ipopt.mu_strategy": strategy}
    problem = {
        "x": stages.decision,
        "p": ca.vertcat(*stages.numbers.values()),
        "f": -stages.states[-1][6],
        "g": ca.vertcat(*(part for part, _, _ in stages.rows)),
    }
    return NonlinearProgram(
        ca.nlpsol("descent", solver, problem, options), tuple(stages.numbers), lower, upper
    )
