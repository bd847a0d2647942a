"""The part of `python -m guidance.pdg` that plans for a body that must turn: `--six-dof`."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from guidance.lander import Lander
from guidance.rigid_body.body import DEFAULT_BODY, RigidBody
from guidance.rigid_body.state import RigidState
from guidance.state import State

if TYPE_CHECKING:
    from guidance.pdg.__main__ import PdgCommand
    from guidance.rigid_descent.plan import RigidPlan

_TAKEN = (
    "state",
    "target",
    "target_velocity",
    "dry_mass",
    "max_thrust",
    "min_thrust",
    "specific_impulse",
    "gravity",
    "glide_slope_limit_deg",
    "nodes",
    "method",
    "plot",
    "six_dof",
    "body",
)
_UNITS = {
    "landing_position": "m",
    "landing_velocity": "m/s",
    "landing_tilt": "rad",
    "landing_rates": "rad/s",
    "position": "m",
    "velocity": "m/s",
    "tilt": "rad",
    "rate": "rad/s",
    "altitude": "m",
}


@dataclass(frozen=True)
class BodyOptions:
    """The body, with --six-dof alone.

    Attributes:
        attitude: At the start: unit quaternion, scalar first, body to site frame.
        rates_deg: At the start, body frame [deg/s].
        thrust: At the start, body frame [N].
        inertia: Principal moments at the start mass [kg m^2].
        torque_limit: Greatest torque about each axis [N m].
        rate_limit_deg: Greatest rate of turn [deg/s].
        tilt_limit_deg: Greatest angle of the body from the vertical [deg].
        engine_lag: Time constant of the thrust [s].
        gimbal_limit_deg: Greatest angle of the thrust from the body's axis [deg].
        engine_arm: Of the gimbal below the mass centre [m].
    """

    attitude: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    rates_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    thrust: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia: tuple[float, float, float] = DEFAULT_BODY.inertia
    torque_limit: tuple[float, float, float] = DEFAULT_BODY.torque_limit
    rate_limit_deg: float = math.degrees(DEFAULT_BODY.rate_limit)
    tilt_limit_deg: float = math.degrees(DEFAULT_BODY.tilt_limit)
    engine_lag: float = DEFAULT_BODY.engine_lag
    gimbal_limit_deg: float = math.degrees(DEFAULT_BODY.gimbal_limit)
    engine_arm: float = DEFAULT_BODY.engine_arm

    def body_of(self, lander: Lander, mass: float) -> RigidBody:
        """The body of a lander that weighs so much [kg] at the start."""
        return RigidBody(
            lander,
            self.inertia,
            mass,
            torque_limit=self.torque_limit,
            rate_limit=math.radians(self.rate_limit_deg),
            tilt_limit=math.radians(self.tilt_limit_deg),
            engine_lag=self.engine_lag,
            gimbal_limit=math.radians(self.gimbal_limit_deg),
            engine_arm=self.engine_arm,
        )

    def state_of(self, point: State) -> RigidState:
        """The start at a position and velocity."""
        attitude, rates, thrust = np.array(self.attitude), np.radians(self.rates_deg), np.array(self.thrust)
        return RigidState(point.position, point.velocity, point.mass, attitude, rates, thrust)


def plan_body(command: PdgCommand) -> RigidPlan:
    """The plan that a command with --six-dof asks for.

    Raises:
        ValueError: an option is out of range, or is one of those that only a point mass takes.
        GuidanceError: there is no flight.
    """
    from guidance.successive import solve_pdg_6dof

    for each in fields(command):
        if each.name not in _TAKEN and getattr(command, each.name) != each.default:
            raise ValueError(f"{each.name}: --six-dof does not take it; leave it out")
    if command.method not in ("auto", "casadi"):
        raise ValueError(f"method: --six-dof takes auto or casadi, got {command.method!r}")
    point = State.parse(command.state)
    return solve_pdg_6dof(
        command.body.state_of(point),
        command.target,
        command.body.body_of(command.lander, point.mass),
        gravity=command.gravity,
        target_velocity=command.target_velocity,
        glide_slope_limit=command.limits.glide_slope,
        nodes=command.nodes,
        method="casadi" if command.method == "casadi" else "successive",
    )


def describe_body(plan: RigidPlan) -> str:
    """A plan in a few lines: what it costs, what turning costs, and what it misses when it is flown."""
    flown = [f"{name} {getattr(plan.residuals, name):.2g} {unit}" for name, unit in _UNITS.items()]
    return "\n".join(
        [
            f"status          {plan.status.value} ({plan.method})",
            f"time of flight  {plan.time_of_flight:.3f} s, {plan.nodes} nodes",
            f"propellant      {plan.propellant:.3f} kg, final mass {plan.mass[-1]:.3f} kg",
            f"relaxation gap  {plan.relaxation_gap:.3f} kg above a bound for a point mass that turns at once",
            "flown, it misses what was planned or allowed by",
            *(f"                {', '.join(flown[k : k + 3])}" for k in range(0, len(flown), 3)),
        ]
    )
