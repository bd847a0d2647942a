"""Programmes of OpenSCvx for the landing of a body that must turn, in the interpreter that has the package.

It needs nothing of these packages (`studies.peers.openscvx_serving` brings the cases). Numbers have no units;
the body's z axis is along the thrust, quaternions are scalar first. A programme is compiled for all of a case
but its start. Limits that depend on states hold on the whole flight (`ctcs`), as in the package's example.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

_MOST_SECONDS = 120.0  # of wall time, after which the package stops a case
_START = ("position", "velocity")
_SHORTEST, _LONGEST = 0.2, 2.0  # of an interval, over its share of the first guess


class BodyProgramme:
    """A compiled programme."""

    def __init__(self, case: dict[str, Any]) -> None:
        """Compile it for a case and all that differ from it in their start alone."""
        ox = importlib.import_module("openscvx")
        jax, diffrax = importlib.import_module("jax"), importlib.import_module("diffrax")
        jax.config.update("jax_enable_x64", True)  # before the steps below are rounded to single precision
        self._ox, self._nodes = ox, case["nodes"]
        self._declare(case)
        self._set_ends(case)
        self._set_start(case)
        first = case["first_time"]
        steps = np.linspace(0.0, 1.0 / (self._nodes - 1), case["steps"] + 1)
        self.problem = ox.Problem(
            dynamics=self._state_motion(case),
            constraints=self._state_limits(case),
            states=self._states,
            controls=self._controls,
            N=self._nodes,
            time=ox.Time(
                initial=0.0,
                final=ox.Free(first),
                min=0.0,
                max=case["longest_time"],
                time_dilation_min=_SHORTEST * first,
                time_dilation_max=_LONGEST * first,
            ),
            algorithm={**case["weights"], "autotuner": case["tuner"], "t_max": _MOST_SECONDS},
            discretizer={
                "dis_type": case["hold"],
                "diffrax_kwargs": {"stepsize_controller": diffrax.StepTo(steps)},
            },
            float_dtype="float64",
        )
        self.problem.settings.dev.printing = False
        self.problem.initialize()

    def _declare(self, case: dict[str, Any]) -> None:
        """States and controls; bounds scale them."""
        ox, most, rate = self._ox, case["max_thrust"], case["rate_limit"]
        far, fast = case["farthest"], case["fastest"]
        self._mass = _bounded(ox.State("mass", shape=(1,)), [case["dry_mass"]], [case["mass"]])
        self._position = _bounded(ox.State("position", shape=(3,)), [-far, -far, case["lowest"]], [far] * 3)
        self._velocity = _bounded(ox.State("velocity", shape=(3,)), [-fast] * 3, [fast] * 3)
        self._attitude = _bounded(ox.State("attitude", shape=(4,)), [-1.0] * 4, [1.0] * 4)
        self._rates = _bounded(ox.State("rates", shape=(3,)), [-rate] * 3, [rate] * 3)
        self._states = [self._mass, self._position, self._velocity, self._attitude, self._rates]
        self._gimballed, self._lag = case["gimbal_cosine"] is not None, case["engine_lag"]
        if self._gimballed:
            self._thrust = _bounded(ox.Control("thrust", shape=(3,)), [-most] * 3, [most] * 3)
            self._controls = [self._thrust]
            return
        self._thrust = _bounded(ox.Control("thrust", shape=(1,)), [case["min_thrust"]], [most])
        torque = case["torque_limit"]
        self._torque = _bounded(ox.Control("torque", shape=(3,)), [-each for each in torque], torque)
        self._controls = [self._thrust, self._torque]
        self._torque.guess = np.zeros((self._nodes, 3))
        if self._lag > 0.0:
            self._engine = _bounded(ox.State("engine", shape=(1,)), [0.0], [most])
            self._states.append(self._engine)

    def _state_motion(self, case: dict[str, Any]) -> dict[str, Any]:
        """Rates of change, as `guidance.rigid_body.motion` has them, with air and a leak."""
        ox, mass, rates = self._ox, self._mass[0], self._rates
        w, x, y, z = (self._attitude[k] for k in range(4))
        a, b, c = (rates[k] for k in range(3))
        turned = ox.Block(
            [
                [w**2 + x**2 - y**2 - z**2, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                [2.0 * (x * y + w * z), w**2 - x**2 + y**2 - z**2, 2.0 * (y * z - w * x)],
                [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w**2 - x**2 - y**2 + z**2],
            ]
        )
        motion: dict[str, Any] = {}
        if self._gimballed:
            force, size = self._thrust, ox.linalg.Norm(self._thrust)
            arm = case["engine_arm"]
            moment = [arm * force[1], -arm * force[0], 0.0]
        else:
            size = self._engine[0] if self._lag > 0.0 else self._thrust[0]
            force = ox.Concat(0.0, 0.0, size)
            moment = [self._torque[k] for k in range(3)]
            if self._lag > 0.0:
                motion["engine"] = (self._thrust - self._engine) / self._lag
        total = force
        if case["drag"] is not None:
            wind = turned.T @ self._velocity
            air = -1.0 * ox.linalg.Norm(self._velocity) * ox.Diag(ox.Constant(np.array(case["drag"]))) @ wind
            lever = case["pressure_arm"]
            moment = [moment[0] - lever * air[1], moment[1] + lever * air[0], moment[2]]
            total = force + air
        inertia, exponent = case["inertia"], case["inertia_exponent"]
        scale = 1.0 if exponent == 0.0 else (mass / case["inertia_mass"]) ** exponent
        crossed = [(b * c, 1, 2), (c * a, 2, 0), (a * b, 0, 1)]
        return {
            **motion,
            "mass": -size / case["exhaust_velocity"] - case["leak"],
            "position": self._velocity,
            "velocity": turned @ total / mass + ox.Constant(np.array(case["gravity"])),
            "attitude": 0.5
            * ox.Concat(
                -x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a
            ),
            "rates": ox.Concat(
                *[
                    (moment[k] / scale + (inertia[p] - inertia[q]) * product) / inertia[k]
                    for k, (product, p, q) in enumerate(crossed)
                ]
            ),
        }

    def _state_limits(self, case: dict[str, Any]) -> list[Any]:
        ox, norm, loose = self._ox, self._ox.linalg.Norm, case["looseness"]
        kept = [bound for state in self._states for bound in (state <= state.max, state.min <= state)]
        leaning = self._attitude[1] ** 2 + self._attitude[2] ** 2
        turning = sum((self._rates[k] ** 2 for k in range(1, 3)), self._rates[0] ** 2)
        kept.append(case["tilt_cosine"] - 1.0 + 2.0 * leaning <= 0.0)
        kept.append(turning - case["rate_limit"] ** 2 <= 0.0)
        if case["glide_slope"] is not None:
            width = norm(self._position[:2])
            kept.append(loose * width - case["glide_slope"] * self._position[2] <= 0.0)
        if case["speed_limit"] is not None:
            kept.append(loose * norm(self._velocity) ** 2 - case["speed_limit"] ** 2 <= 0.0)
        if self._gimballed:
            size = norm(self._thrust)
            kept.append(loose * size - self._thrust[2] / case["gimbal_cosine"] <= 0.0)
            kept.append(loose * size**2 - case["max_thrust"] ** 2 <= 0.0)
            kept.append(loose * case["min_thrust"] ** 2 - size**2 <= 0.0)
        return [ox.ctcs(limit) for limit in kept]

    def _set_ends(self, case: dict[str, Any]) -> None:
        """All but the start's position and velocity, and the guesses that do not depend on it."""
        ox, nodes = self._ox, self._nodes
        upright = [1.0, 0.0, 0.0, 0.0]
        self._mass.initial, self._mass.final = [case["mass"]], [ox.Maximize(case["midway_mass"])]
        self._mass.guess = np.linspace([case["mass"]], [case["midway_mass"]], nodes)
        free = [ox.Free(value) for value in upright]
        self._attitude.initial = free if case["free_attitude"] else case["attitude"]
        self._attitude.final, self._attitude.guess = upright, np.tile(upright, (nodes, 1))
        self._rates.initial, self._rates.final = case["rates"], [0.0] * 3
        self._rates.guess = np.linspace(case["rates"], [0.0] * 3, nodes)
        self._position.final, self._velocity.final = [0.0] * 3, case["target_velocity"]
        weight = -case["gravity"][2] * np.linspace([case["mass"]], [case["dry_mass"]], nodes)
        self._thrust.guess = weight * np.array([[0.0, 0.0, 1.0]]) if self._gimballed else weight
        if self._lag > 0.0:
            self._engine.initial, self._engine.final = [case["thrust"]], [ox.Free(float(weight[-1, 0]))]
            self._engine.guess = weight

    def _set_start(self, case: dict[str, Any]) -> None:
        self._position.initial, self._velocity.initial = case["position"], case["velocity"]
        self._position.guess = np.linspace(case["position"], [0.0] * 3, self._nodes)
        self._velocity.guess = np.linspace(case["velocity"], case["target_velocity"], self._nodes)

    def solve(self, case: dict[str, Any]) -> dict[str, Any]:
        """Solve a case from the first guess."""
        self._set_ends(case)
        self._set_start(case)
        self.problem.reset()
        found = self.problem.solve()
        nodes = found.nodes
        names = ["time", "mass", "position", "velocity", "attitude", "rates", "thrust"]
        told = {name: np.asarray(nodes[name], dtype=float) for name in names}
        if self._gimballed:
            told["torque"] = np.zeros((self._nodes, 3))
        else:
            told["torque"] = np.asarray(nodes["torque"], dtype=float)
            told["thrust"] = told["thrust"].reshape(-1, 1) * np.array([[0.0, 0.0, 1.0]])
        told["time"], told["mass"] = np.ravel(told["time"]), np.ravel(told["mass"])
        return {
            "converged": bool(found.converged),
            "iterations": int(self.problem.state.k),
            **{name: values.tolist() for name, values in told.items()},
        }


def _bounded(variable: Any, low: Sequence[float], high: Sequence[float]) -> Any:
    variable.min, variable.max = np.array(low), np.array(high)
    return variable


def name_programme(case: dict[str, Any]) -> str:
    """All of a case but its start."""
    return json.dumps({name: value for name, value in case.items() if name not in _START}, sort_keys=True)


def build_programme(case: dict[str, Any]) -> BodyProgramme:
    """The programme that serves a case."""
    return BodyProgramme(case)
