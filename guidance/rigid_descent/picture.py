"""Picture of a rigid body's plan: path with the body's axis, tilt, rates, thrust, torque and mass."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from guidance.arrays import Array
from guidance.rigid_body.quaternion import rotate, tilt_angle
from guidance.rigid_descent.plan import RigidPlan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BODY = 0.06  # of the path's extent: length of the line that stands for the body
_AXES = ("about x", "about y", "about z")


def draw_rigid_plan(plan: RigidPlan) -> Figure:
    """Draw a plan with its limits.

    Args:
        plan: a plan with a flight.

    Returns:
        A matplotlib figure, not tied to any window.

    Raises:
        ValueError: the plan holds no flight.
    """
    if plan.nodes == 0:
        raise ValueError(f"a plan with status '{plan.status.value}' cannot be drawn")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 8.0), layout="constrained")
    panels = figure.subplots(2, 3)
    body = plan.problem.body
    _draw_path(panels[0, 0], plan)
    tilt = np.degrees([tilt_angle(attitude) for attitude in plan.attitude])
    _draw(panels[0, 1], plan, tilt, "body from the vertical [deg]", np.degrees(body.tilt_limit))
    rates = np.degrees(plan.rates)
    _draw(panels[0, 2], plan, rates, "rates [deg/s]", np.degrees(body.rate_limit), both=True)
    thrust = np.linalg.norm(plan.thrust, axis=1) / 1e3
    _draw(panels[1, 0], plan, thrust, "thrust [kN]", body.lander.max_thrust / 1e3)
    _draw(panels[1, 1], plan, plan.torque, "torque [N m]", body.torque_limit, both=True)
    _draw(panels[1, 2], plan, plan.mass, "mass [kg]", body.lander.dry_mass)
    gap = plan.relaxation_gap
    above = "" if np.isnan(gap) else f", {gap:.2f} kg above the bound of a point mass"
    figure.suptitle(
        f"{plan.status.value}, {plan.method}: {plan.time_of_flight:.2f} s, "
        f"{plan.propellant:.2f} kg burnt{above}"
    )
    return figure


def _draw_path(axes: Any, plan: RigidPlan) -> None:
    """Height over the way along the first offset from the target, and where the body's axis points."""
    offset = plan.position - plan.problem.target
    along = _towards_start(offset)
    axis = np.array([rotate(attitude, [0.0, 0.0, 1.0]) for attitude in plan.attitude])
    way, lean = offset[:, :2] @ along, axis[:, :2] @ along
    size = _BODY * max(float(np.ptp(way)), float(np.ptp(offset[:, 2])))
    axes.plot(way, offset[:, 2], linewidth=1.0)
    axes.plot([way, way + size * lean], [offset[:, 2], offset[:, 2] + size * axis[:, 2]], color="tab:orange")
    axes.plot([0.0], [0.0], "x", color="black", label="target")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("way from the target towards the start [m]")
    axes.set_ylabel("altitude above target [m]")
    axes.set_title("path; orange: the body's axis")
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")


def _towards_start(offset: Array) -> Array:
    """Horizontal unit vector, shape (2,), from the target to the start; east where it lies above."""
    first = offset[0, :2]
    size = float(np.linalg.norm(first))
    return first / size if size > 1e-6 else np.array([1.0, 0.0])


def _draw(
    axes: Any,
    plan: RigidPlan,
    values: Array,
    label: str,
    limit: float | tuple[float, float, float],
    both: bool = False,
) -> None:
    """One quantity over time, or one line for each body axis, with its limit; unequal ones in its colour."""
    lines = axes.plot(plan.time, values, marker=".", markersize=3)
    for line, name in zip(lines, _AXES if values.ndim > 1 else (), strict=False):
        line.set_label(name)
    limits = np.atleast_1d(limit)
    colors = ["tab:red"] if (limits == limits[0]).all() else [line.get_color() for line in lines]
    for each, color in zip(limits, colors, strict=False):
        for sign in (1.0, -1.0) if both else (1.0,):
            axes.axhline(sign * each, color=color, linestyle="--", linewidth=1.0)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)
    if values.ndim > 1:
        axes.legend(fontsize="small")


def save_rigid_figure(plan: RigidPlan, path: str | Path) -> None:
    """Draw a plan and save it; the suffix of `path` chooses the format.

    Raises:
        ValueError: the plan holds no flight, or matplotlib does not know the format.
        OSError: the file cannot be written.
    """
    draw_rigid_plan(plan).savefig(path, dpi=120)
