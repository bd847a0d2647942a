"""The nonlinear programme of a rigid body's descent, assembled by CasADi: Gauss-Legendre collocation.

A node holds (r, v, q, w, m) and the controls (thrust, torque), which are linear in time between nodes; three
collocation points hold the state within each interval, where the motion is kept exactly. The order of the
end of an interval is six. Nodes and controls are placed as those of `guidance.successive`; what lies between
them is not. Ends and simple limits are bounds on the variables, so that one programme serves every start of a
body.

Source: Biegler, Nonlinear Programming, 2010, chapter 10 (direct collocation).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from guidance.arrays import Array, Index

STATE, CONTROL = 14, 6
"""Numbers of a state and of a control."""
POINTS = 3
"""Collocation points of an interval."""
_MOST_ITERATIONS = 400
_SMOOTHING = 1e-6  # of full thrust, under the root of a gimballed thrust's size
_TORQUE_PRICE = 1e-7  # of the torques' mean square: it chooses between answers that burn the same


@dataclass(frozen=True)
class RigidStructure:
    """What decides the structure of the programme.

    Attributes:
        nodes: N.
        gimballed: whether the thrust may lean from the body's z axis.
        tilt: whether the body's tilt is limited.
        glide_slope: whether there is a glide slope limit below the horizon.
        free_attitude: whether the attitude at the start is free.
        shortest: whether the time of flight is minimised in place of the propellant.
    """

    nodes: int
    gimballed: bool
    tilt: bool
    glide_slope: bool
    free_attitude: bool
    shortest: bool


@dataclass(frozen=True)
class RigidLayout:
    """Where each number stands among the variables: states, controls, states within, time of flight."""

    nodes: int

    @property
    def state(self) -> Index:
        """Shape (N, 14)."""
        return np.arange(self.nodes * STATE).reshape(self.nodes, STATE)

    @property
    def control(self) -> Index:
        """Shape (N, 6)."""
        return self.nodes * STATE + np.arange(self.nodes * CONTROL).reshape(self.nodes, CONTROL)

    @property
    def within(self) -> Index:
        """Shape (N - 1, 3, 14), at the collocation points."""
        first, count = self.nodes * (STATE + CONTROL), (self.nodes - 1) * POINTS * STATE
        return first + np.arange(count).reshape(self.nodes - 1, POINTS, STATE)

    @property
    def duration(self) -> int:
        """One number."""
        return self.size - 1

    @property
    def size(self) -> int:
        """How many numbers."""
        return self.nodes * (STATE + CONTROL) + (self.nodes - 1) * POINTS * STATE + 1


@dataclass(frozen=True, eq=False)
class RigidProgram:
    """The assembled programme.

    Attributes:
        solver: a CasADi function.
        parameters: their names, in order; `_Assembly` lists them.
        lower: shape (rows,), least values of the constraints.
        upper: shape (rows,), greatest.
        points: shape (3,), places of the collocation points as shares of an interval.
    """

    solver: Any
    parameters: tuple[str, ...]
    lower: Array
    upper: Array
    points: Array


class _Assembly:
    """Variables, parameters and constraints, symbol by symbol."""

    def __init__(self, ca: Any, structure: RigidStructure) -> None:
        """State every row.

        Args:
            ca: the module casadi.
            structure: of the programme.
        """
        self._ca, self._structure = ca, structure
        self.layout = RigidLayout(structure.nodes)
        self.variables = ca.SX.sym("x", self.layout.size)
        sizes = {
            "gravity": 3,
            "inertia": 3,
            "arm": 1,
            "inertia_mass": 1,
            "inertia_exponent": 1,
            "flow": 1,
            "lag": 1,
            "least": 1,
            "most": 1,
            "gimbal": 1,
            "tilt": 1,
            "rate": 1,
            "glide": 1,
        }
        self.numbers = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
        self.rows: list[tuple[Any, float, float]] = []
        self._nodes = [self._at(columns) for columns in self.layout.state]
        self._controls = [self._at(columns) for columns in self.layout.control]
        self._step = self.variables[self.layout.duration] / (structure.nodes - 1)
        self.points = np.array(ca.collocation_points(POINTS, "legendre"))
        for k in range(structure.nodes - 1):
            self._motion(k)
            self._commands(k)
        for k in range(1, structure.nodes - 1):
            self._path(self._nodes[k])

    def _at(self, columns: Index) -> Any:
        return self.variables[int(columns[0]) : int(columns[-1]) + 1]

    def _add(self, expression: Any, lower: float, upper: float) -> None:
        self.rows.append((expression, lower, upper))

    def _rate_of_change(self, x: Any, u: Any) -> Any:
        """The motion, written with the matrix of the attitude and Euler's equations."""
        ca, p = self._ca, self.numbers
        q, w, mass, force, couple = x[6:10], x[10:13], x[13], u[:3], u[3:]
        scalar, vector = q[0], q[1:]
        cross = ca.skew(vector)
        turn = ca.SX.eye(3) + 2.0 * scalar * cross + 2.0 * cross @ cross  # of a unit quaternion
        inertia = p["inertia"] * (mass / p["inertia_mass"]) ** p["inertia_exponent"]
        engine = p["arm"] * ca.vertcat(force[1], -force[0], 0.0)
        spin = (couple + engine - ca.cross(w, inertia * w)) / inertia
        attitude = 0.5 * ca.vertcat(-ca.dot(vector, w), scalar * w + ca.cross(vector, w))
        return ca.vertcat(
            x[3:6], turn @ force / mass + p["gravity"], attitude, spin, -p["flow"] * self._size(force)
        )

    def _size(self, force: Any) -> Any:
        """|F|; of an engine that cannot lean, its one component."""
        if not self._structure.gimballed:
            return force[2]
        return self._ca.sqrt(self._ca.sumsqr(force) + _SMOOTHING**2)

    def _motion(self, k: int) -> None:
        """The motion at the collocation points of an interval, and its end."""
        ca = self._ca
        slope, _, weight = (np.array(each) for each in ca.collocation_coeff(self.points.tolist()))
        weight = weight.ravel()
        inner = [self._at(columns) for columns in self.layout.within[k]]
        states = ca.horzcat(self._nodes[k], *inner)
        end = self._nodes[k]
        for point, share in enumerate(self.points):
            control = (1.0 - share) * self._controls[k] + share * self._controls[k + 1]
            moved = self._step * self._rate_of_change(inner[point], control)
            self._add(states @ slope[:, point] - moved, 0.0, 0.0)
            end = end + float(weight[point]) * moved
            self._add(self.numbers["rate"] ** 2 - ca.sumsqr(inner[point][10:13]), 0.0, math.inf)
        self._add(self._nodes[k + 1] - end, 0.0, 0.0)

    def _commands(self, k: int) -> None:
        """Limits of the commanded thrust F + lag F' at both ends of an interval, times its duration."""
        ca, p = self._ca, self.numbers
        before, after = self._controls[k][:3], self._controls[k + 1][:3]
        for force in (before, after):
            command = self._step * force + p["lag"] * (after - before)
            if not self._structure.gimballed:
                self._add(command[2] - p["least"] * self._step, 0.0, math.inf)
                self._add(p["most"] * self._step - command[2], 0.0, math.inf)
                continue
            square = ca.sumsqr(command)  # squares have no kink where the engine is off
            self._add(square - (p["least"] * self._step) ** 2, 0.0, math.inf)
            self._add((p["most"] * self._step) ** 2 - square, 0.0, math.inf)
            self._add((ca.tan(p["gimbal"]) * command[2]) ** 2 - ca.sumsqr(command[:2]), 0.0, math.inf)
            self._add(command[2], 0.0, math.inf)

    def _path(self, x: Any) -> None:
        """Limits at a node on the way."""
        ca, p = self._ca, self.numbers
        self._add(p["rate"] ** 2 - ca.sumsqr(x[10:13]), 0.0, math.inf)
        if self._structure.tilt:
            self._add(ca.sin(0.5 * p["tilt"]) ** 2 - ca.sumsqr(x[7:9]), 0.0, math.inf)
        if self._structure.glide_slope:
            self._add((ca.tan(p["glide"]) * x[2]) ** 2 - ca.sumsqr(x[:2]), 0.0, math.inf)

    @property
    def cost(self) -> Any:
        """Minus the final mass, or the time of flight; and next to nothing for the torques."""
        torques = self._ca.vertcat(*(control[3:] for control in self._controls))
        duration = self.variables[self.layout.duration]
        aim = duration if self._structure.shortest else -self._nodes[-1][13]
        return aim + _TORQUE_PRICE * self._ca.sumsqr(torques) / self._structure.nodes


@lru_cache(maxsize=8)
def rigid_program(structure: RigidStructure) -> RigidProgram:
    """Assemble for a mesh and a set of limits; kept: every number of a case is a parameter or a bound."""
    import casadi as ca

    assembly = _Assembly(ca, structure)
    if structure.free_attitude:
        first = assembly.variables[6:10]
        assembly.rows.append((ca.sumsqr(first), 1.0, 1.0))
    sizes = [part.numel() for part, _, _ in assembly.rows]
    lower, upper = (np.repeat([row[side] for row in assembly.rows], sizes) for side in (1, 2))
    problem = {
        "x": assembly.variables,
        "p": ca.vertcat(*assembly.numbers.values()),
        "f": assembly.cost,
        "g": ca.vertcat(*(part for part, _, _ in assembly.rows)),
    }
    options = {
        "print_time": 0,
        "show_eval_warnings": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.max_iter": _MOST_ITERATIONS,
        "ipopt.mu_strategy": "monotone",  # of Szmuk's case, along a glide slope, adaptive finds no end
        "ipopt.fixed_variable_treatment": "make_parameter",
    }
    solver = ca.nlpsol("rigid_descent", "ipopt", problem, options)
    return RigidProgram(solver, tuple(assembly.numbers), lower, upper, assembly.points)
