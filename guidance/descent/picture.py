"""Picture of a plan: path, thrust, mass, thrust direction and glide slope."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from guidance.descent.plan import Plan

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _limit(axes: Any, value: float | None, label: str) -> None:
    if value is not None:
        axes.axhline(value, color="tab:red", linestyle="--", linewidth=1.0, label=label)


def draw_plan(plan: Plan) -> Figure:
    """Draw a plan with its limits.

    Args:
        plan: a plan with a flight.

    Returns:
        A matplotlib figure; the caller saves and closes it.

    Raises:
        ValueError: the plan holds no flight.
    """
    if plan.nodes == 0:
        raise ValueError(f"a plan with status '{plan.status.value}' cannot be drawn")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 8.0), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 3)
    _draw_path(panels[0, 0], plan)
    _draw_speed(panels[0, 1], plan)
    _draw_thrust(panels[0, 2], plan)
    _draw_mass(panels[1, 0], plan)
    _draw_pointing(panels[1, 1], plan)
    _draw_glide_slope(panels[1, 2], plan)
    for axes in panels.ravel():
        axes.grid(alpha=0.3)
        if axes is not panels[0, 0]:
            axes.set_xlabel("time [s]")
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize="small")
    figure.suptitle(
        f"{plan.status.value}, {plan.method}: {plan.time_of_flight:.2f} s, {plan.propellant:.2f} kg burnt, "
        f"{plan.landing_error:.1f} m from the target"
    )
    return figure


def _draw_path(axes: Any, plan: Plan) -> None:
    offset = plan.position - plan.problem.target
    along = np.linalg.norm(offset[:, :2], axis=1)
    axes.plot(along, offset[:, 2], marker=".", markersize=3)
    axes.plot([0.0], [0.0], "x", color="black", label="target")
    axes.set_xlabel("horizontal distance to target [m]")
    axes.set_ylabel("altitude above target [m]")
    axes.set_title("path")


def _draw_speed(axes: Any, plan: Plan) -> None:
    axes.plot(plan.time, np.linalg.norm(plan.velocity[:, :2], axis=1), label="horizontal")
    axes.plot(plan.time, plan.velocity[:, 2], label="vertical (up)")
    _limit(axes, plan.problem.speed_limit, "speed limit")
    axes.set_ylabel("velocity [m/s]")
    axes.set_title("velocity")


def _draw_thrust(axes: Any, plan: Plan) -> None:
    times = np.linspace(0.0, plan.time_of_flight, 8 * plan.nodes)
    axes.plot(times, np.linalg.norm(plan.thrust_at(times), axis=1) / 1e3)
    _limit(axes, plan.problem.lander.max_thrust / 1e3, "maximum")
    _limit(axes, plan.problem.lander.min_thrust / 1e3, "minimum")
    axes.set_ylabel("thrust [kN]")
    axes.set_title("thrust")


def _draw_mass(axes: Any, plan: Plan) -> None:
    axes.plot(plan.time, plan.mass)
    _limit(axes, plan.problem.lander.dry_mass, "dry mass")
    axes.set_ylabel("mass [kg]")
    axes.set_title("mass")


def _draw_pointing(axes: Any, plan: Plan) -> None:
    size = np.linalg.norm(plan.thrust, axis=1)
    burning = size > 1e-2 * plan.problem.lander.max_thrust  # a coasting engine points nowhere
    angle = np.degrees(np.arctan2(np.linalg.norm(plan.thrust[:, :2], axis=1), plan.thrust[:, 2]))
    axes.plot(plan.time, np.where(burning, angle, np.nan), marker=".", markersize=3)
    limit = plan.problem.lander.pointing_limit
    _limit(axes, None if limit is None else np.degrees(limit), "pointing limit")
    axes.set_ylabel("thrust from the vertical [deg]")
    axes.set_title("pointing")


def _draw_glide_slope(axes: Any, plan: Plan) -> None:
    offset = plan.position[:-1] - plan.position[-1]
    angle = np.degrees(np.arctan2(np.linalg.norm(offset[:, :2], axis=1), offset[:, 2]))
    axes.plot(plan.time[:-1], angle, marker=".", markersize=3)
    limit = plan.problem.glide_slope_limit
    _limit(axes, None if limit is None else np.degrees(limit), "glide slope limit")
    axes.set_ylabel("vehicle from the vertical [deg]")
    axes.set_title("glide slope, seen from the landing point")


def save_plan_figure(plan: Plan, path: str | Path) -> None:
    """Draw a plan and save it; the suffix of `path` chooses the format.

    Raises:
        ValueError: the plan holds no flight, or matplotlib does not know the format.
        OSError: the file cannot be written.
    """
    draw_plan(plan).savefig(path, dpi=120)
