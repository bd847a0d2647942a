"""Command line of `python -m guidance.pdg`."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from guidance.console import one_line_errors, tolerate_encoding
from guidance.descent.limits import Cone, Limits
from guidance.descent.plan import GuidanceError, Plan
from guidance.descent.residuals import RESIDUAL_UNITS
from guidance.lander import Lander
from guidance.pdg.body_command import BodyOptions, describe_body, plan_body
from guidance.pdg.solve import DEFAULT_NODES, PlanningMethod, solve_pdg


@dataclass(frozen=True)
class PdgCommand:
    """Plan a powered descent with the least propellant, print it, and draw it.

    Attributes:
        state: Start: x y z [m], vx vy vz [m/s], mass [kg]; x east, y north, z up.
        target: Landing point x y z [m].
        target_velocity: Velocity x y z at the landing point [m/s].
        dry_mass: Mass with an empty tank [kg].
        max_thrust: Greatest thrust [N].
        min_thrust: Least thrust [N].
        specific_impulse: [s], referred to 9.80665 m/s^2.
        gravity: Gravity x y z [m/s^2].
        angular_velocity: Angular velocity x y z of the site [rad/s].
        pointing_limit_deg: Greatest angle of thrust from the vertical [deg].
        glide_slope_limit_deg: Greatest angle of the vehicle from the vertical, seen from the landing point
            [deg].
        speed_limit: Greatest speed [m/s].
        final_thrust_limit_deg: Greatest angle of the last thrust from its axis [deg].
        final_thrust_axis: That axis x y z.
        line_of_sight_limit_deg: Greatest angle of the vehicle from an axis, seen from the target [deg].
        line_of_sight_axis: That axis x y z.
        thrust_rate_limit: Greatest change of the thrust vector [N/s].
        time_of_flight: [s]; searched for unless given.
        nodes: Nodes of the plan.
        method: auto takes indirect where no limit binds, else convex; cvxpy and casadi are independent
            references.
        unreachable: Fail, or land at the reachable point nearest to the target.
        landing_error_weight: Minimise propellant plus this [kg/m] times the landing error.
        plot: File to draw the plan into, such as plan.png.
        six_dof: Plan for a rigid body that must turn to thrust elsewhere.
        body: That body, and how it stands at the start.
    """

    state: tuple[float, float, float, float, float, float, float]
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    target_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    dry_mass: float = 1150.0
    max_thrust: float = 12000.0
    min_thrust: float = 0.0
    specific_impulse: float = 325.0
    gravity: tuple[float, float, float] = (0.0, 0.0, -1.62)
    angular_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pointing_limit_deg: float | None = None
    glide_slope_limit_deg: float | None = None
    speed_limit: float | None = None
    final_thrust_limit_deg: float | None = None
    final_thrust_axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    line_of_sight_limit_deg: float | None = None
    line_of_sight_axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    thrust_rate_limit: float | None = None
    time_of_flight: float | None = None
    nodes: int = DEFAULT_NODES
    method: PlanningMethod = "auto"
    unreachable: Literal["raise", "nearest"] = "raise"
    landing_error_weight: float | None = None
    plot: Path | None = None
    six_dof: bool = False
    body: BodyOptions = field(default_factory=BodyOptions)

    @property
    def limits(self) -> Limits:
        """What the path has to keep."""
        glide = self.glide_slope_limit_deg
        return Limits(
            glide_slope=None if glide is None else math.radians(glide),
            speed=self.speed_limit,
            final_thrust_direction=_cone(self.final_thrust_limit_deg, self.final_thrust_axis),
            line_of_sight=_cone(self.line_of_sight_limit_deg, self.line_of_sight_axis),
            thrust_rate=self.thrust_rate_limit,
        )

    @property
    def lander(self) -> Lander:
        """Engine and tank."""
        pointing = self.pointing_limit_deg
        return Lander(
            dry_mass=self.dry_mass,
            max_thrust=self.max_thrust,
            specific_impulse=self.specific_impulse,
            min_thrust=self.min_thrust,
            pointing_limit=None if pointing is None else math.radians(pointing),
        )

    def solve(self) -> Plan:
        """The plan of a point mass that the command asks for; raises what `solve_pdg` raises."""
        if self.body != BodyOptions():
            raise ValueError("body is for a rigid body: give --six-dof too")
        return solve_pdg(
            self.state,
            self.target,
            lander=self.lander,
            gravity=self.gravity,
            angular_velocity=self.angular_velocity,
            limits=self.limits,
            time_of_flight=self.time_of_flight,
            nodes=self.nodes,
            method=self.method,
            unreachable=self.unreachable,
            landing_error_weight=self.landing_error_weight,
            target_velocity=self.target_velocity,
        )


def _cone(angle_deg: float | None, axis: tuple[float, float, float]) -> Cone | None:
    return None if angle_deg is None else Cone(math.radians(angle_deg), axis)


def describe(plan: Plan) -> str:
    """A plan in a few lines: what it costs, and what it misses when flown through the true motion."""
    bound = []
    if plan.certificate is not None and not math.isnan(plan.optimality_gap):
        bound.append(f"optimality gap  {1e3 * plan.optimality_gap:.1f} g, {plan.certificate.scope}")
    flown = [f"{name} {getattr(plan.residuals, name):.2g} {unit}" for name, unit in RESIDUAL_UNITS.items()]
    return "\n".join(
        [
            f"status          {plan.status.value} ({plan.method})",
            f"time of flight  {plan.time_of_flight:.3f} s, {plan.nodes} nodes",
            f"propellant      {plan.propellant:.3f} kg, final mass {plan.mass[-1]:.3f} kg",
            *bound,
            f"landing error   {plan.landing_error:.2f} m",
            "flown, it misses what was planned or allowed by",
            *(f"                {', '.join(flown[k : k + 3])}" for k in range(0, len(flown), 3)),
        ]
    )


def _run(command: PdgCommand) -> str:
    """Plan, draw, and say what was planned."""
    plan = command.solve()
    if command.plot is not None:
        from guidance.descent.picture import save_plan_figure

        save_plan_figure(plan, command.plot)
    return describe(plan)


def _run_body(command: PdgCommand) -> str:
    """The same for a body that must turn."""
    plan = plan_body(command)
    if command.plot is not None:
        from guidance.rigid_descent.picture import save_rigid_figure

        save_rigid_figure(plan, command.plot)
    return describe_body(plan)


def main(arguments: list[str] | None = None) -> None:
    """Run the command; exit status 1 without a flight, 2 for a wrong argument."""
    import tyro

    tolerate_encoding()
    command = tyro.cli(PdgCommand, args=arguments)
    try:
        with one_line_errors():
            words = _run_body(command) if command.six_dof else _run(command)
    except GuidanceError as error:
        scope = "" if error.plan.certificate is None else f"\nproof: {error.plan.certificate.scope}"
        sys.stderr.write(f"no flight: {error}{scope}\n")
        raise SystemExit(1) from None
    sys.stdout.write(words + "\n")
    if command.plot is not None:
        sys.stdout.write(f"picture         {command.plot}\n")


if __name__ == "__main__":
    sys.argv[0] = "python -m guidance.pdg"  # what --help says
    main()
