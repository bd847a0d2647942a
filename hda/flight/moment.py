"""A flight as it stands at one time: what guides it, where it is, and its picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from guidance.arrays import Array
from hda.flight.look_picture import draw_elevation, draw_truth, draw_verdict
from hda.flight.outcome import ENDINGS
from hda.flight.palette import COLORS
from hda.flight.picture import draw_field_of_view, draw_true_safety, shown_ground
from hda.flight.portrait.pose import LanderPose, find_pose
from hda.flight.portrait.view import FROM_ABOVE, draw_close, draw_reach, draw_sign, view_beside
from hda.flight.record import EpisodeRecord
from hda.task.scenario import ground_point

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 10.0
"""[inch] of the picture."""

_HEIGHT = 3.9  # [inch]
_MEASURED_HEIGHT = 7.4  # [inch] of the picture of a flight with measured looks, which has a second row

_SIGN = 0.3  # [inch] of the lander beside its path


@dataclass(frozen=True, eq=False)
class Moment:
    """A flight as it stands at one time.

    Attributes:
        record: the flight.
        time: [s] since the start.
        path: shape (n, 7), position [m], velocity [m/s] and mass [kg] up to now; the last row is now.
        look: number of the look that guides the flight now.
        thrust: [N] size of the thrust that is applied now; 0 once the flight is over.
        pose: how the lander stands.
    """

    record: EpisodeRecord
    time: float
    path: Array
    look: int
    thrust: float
    pose: LanderPose


def find_moment(record: EpisodeRecord, time: float) -> Moment:
    """Find what a flight is like at one time.

    Args:
        record: the flight.
        time: [s] since the start; a time outside the flight counts as its start or its end.
    """
    time = float(np.clip(time, record.time[0], record.time[-1]))
    flown = np.append(record.time[record.time < time], time)
    path = np.column_stack([np.interp(flown, record.time, column) for column in record.path.T])
    looks = [observation.time for observation in record.observations[: len(record.decisions)]]
    interval = int(np.searchsorted(record.time, time, side="right")) - 1
    over = interval >= len(record.thrust)
    thrust = 0.0 if over else float(np.linalg.norm(record.thrust[interval]))
    look = int(np.searchsorted(looks, time, side="right")) - 1
    return Moment(record, time, path, look, thrust, find_pose(record, time))


def draw_moment(moment: Moment) -> Figure:
    """Draw a moment: the ground with the flight so far, the look that guides it, its height.

    The lander is shown in its place, not to scale, as `hda.flight.portrait.pose` says. Of a measured look the
    heights that the lander saw, its verdict and the truth stand side by side, and the lander close by.

    Returns:
        The figure, not tied to any window.
    """
    from matplotlib.figure import Figure

    measured = moment.record.observations[moment.look].ground is not None
    figure = Figure(figsize=(WIDTH, _MEASURED_HEIGHT if measured else _HEIGHT), layout="constrained")
    if measured:
        axes = figure.subplot_mosaic([["ground", "lander", "height"], ["seen", "verdict", "truth"]])
        _draw_measured_look(axes["seen"], axes["verdict"], axes["truth"], moment)
        _draw_lander(axes["lander"], moment)
        ground, height = axes["ground"], axes["height"]
    else:
        ground, view, height = figure.subplots(1, 3)
        _draw_look(view, moment)
    _draw_ground(ground, moment)
    _draw_height(height, moment)
    figure.suptitle(_describe(moment), x=0.01, ha="left", family="monospace", fontsize="medium")
    return figure


def _draw_ground(axis: Axes, moment: Moment) -> None:
    record, path = moment.record, moment.path
    draw_true_safety(axis, record.scenario.tile)
    draw_field_of_view(axis, record.observations[moment.look], record.scenario)
    site = ground_point(record.scenario, record.decisions[moment.look].site)
    axis.plot(path[:, 0], path[:, 1], color=COLORS[1], label="flight")
    axis.plot(*site[:2], "o", color=COLORS[5], markersize=5, label="target")
    draw_reach(axis, moment.pose, record.scenario)
    draw_sign(axis, moment.pose, FROM_ABOVE, (path[-1, 0], path[-1, 1]), _SIGN)
    west, east, south, north = shown_ground(record)
    axis.set_xlim(west, east)
    axis.set_ylim(south, north)
    axis.set_title("true ground, light: safe", fontsize="medium")
    axis.legend(loc="upper left", fontsize="x-small", framealpha=0.9)


def _draw_look(axis: Axes, moment: Moment) -> None:
    observation = moment.record.observations[moment.look]
    half = observation.width / 2.0
    east, north = (float(value) for value in observation.target[:2])
    extent = (east - half, east + half, north - half, north + half)
    axis.imshow(observation.safety_map, origin="lower", extent=extent, cmap="gray", vmin=0.0, vmax=1.0)
    site = moment.record.decisions[moment.look].site
    axis.plot(
        *site[:2], "o", color=COLORS[5], markersize=8, fillstyle="none", markeredgewidth=2, label="target"
    )
    axis.set_xlim(extent[:2])
    axis.set_ylim(extent[2:])
    axis.set_xticks([])
    axis.set_yticks([])
    axis.set_xlabel(f"{observation.width:.3g} m wide, taken at {observation.time:.0f} s")
    axis.set_title(f"look {observation.index + 1}, light: looks safe", fontsize="medium")


def _draw_measured_look(seen: Axes, verdict: Axes, truth: Axes, moment: Moment) -> None:
    record = moment.record
    observation, site = record.observations[moment.look], record.decisions[moment.look].site
    draw_elevation(seen, observation, "gray")
    draw_verdict(verdict, observation)
    draw_truth(truth, observation, record.scenario)
    for axis, place in ((seen, site), (verdict, site), (truth, ground_point(record.scenario, site))):
        axis.plot(
            *place[:2],
            "o",
            color=COLORS[5],
            markersize=8,
            fillstyle="none",
            markeredgewidth=2,
            label="target",
        )
        axis.set_xticks([])
        axis.set_yticks([])
    seen.set_xlabel(f"{observation.width:.3g} m wide, taken at {observation.time:.0f} s")
    seen.set_title(f"look {observation.index + 1}: heights, orange: no echo", fontsize="medium")
    verdict.set_title("verdict on board, light: looks safe", fontsize="medium")
    truth.set_title("truth there, light: safe", fontsize="medium")


def _draw_lander(axis: Axes, moment: Moment) -> None:
    pose, record = moment.pose, moment.record
    draw_close(axis, pose, record.scenario, ground_point(record.scenario, record.decisions[moment.look].site))
    leans = "" if record.body_path is None else f"leans {np.degrees(pose.tilt):.0f} deg, "
    axis.set_title(f"lander: {leans}throttle {100.0 * pose.throttle:.0f} %", fontsize="medium")
    axis.legend(loc="upper left", fontsize="x-small", framealpha=0.9)


def _draw_height(axis: Axes, moment: Moment) -> None:
    record, path = moment.record, moment.path
    end = record.outcome.touchdown
    distance, height = np.linalg.norm(path[:, :2] - end[:2], axis=1), path[:, 2] - end[2]
    axis.plot(distance, height, color=COLORS[1], label="flight")
    draw_sign(axis, moment.pose, view_beside(record.scenario), (distance[-1], height[-1]), _SIGN)
    farthest = float(np.linalg.norm(record.position[:, :2] - end[:2], axis=1).max())
    axis.set_xlim(-0.1 * farthest - 1.0, 1.1 * farthest + 1.0)
    axis.set_ylim(0.0, 1.05 * float((record.position[:, 2] - end[2]).max()))
    axis.set_xlabel("distance to the touchdown [m]")
    axis.set_ylabel("height [m]")
    axis.set_title("height; flame: thrust", fontsize="medium")
    axis.grid(alpha=0.25)


def _describe(moment: Moment) -> str:
    record, now = moment.record, moment.path[-1]
    full = record.path[0, 6] - record.scenario.preset.lander.dry_mass
    burnt = 100.0 * (record.path[0, 6] - now[6]) / full
    first = f"{record.policy}   {moment.time:4.1f} s   {float(np.linalg.norm(now[3:6])):4.1f} m/s"
    second = f"{moment.thrust:5.0f} N   {burnt:4.1f} % of the propellant"
    ended = f"   {ENDINGS[record.outcome.ending]}" if moment.time >= record.time[-1] else ""
    return f"{first}   {second}{ended}"
