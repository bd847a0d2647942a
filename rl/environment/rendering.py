"""A picture of an episode under way: true safety map, path, lander with its sensor, current field of view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hda.flight.episode import Step
from hda.flight.look_picture import draw_elevation
from hda.flight.palette import COLORS
from hda.flight.picture import draw_field_of_view, draw_true_safety
from hda.flight.portrait.pose import end_pose
from hda.flight.portrait.view import FROM_ABOVE, draw_close, draw_reach, draw_sign
from hda.task.observation import Observation
from hda.task.scenario import Scenario, ground_point

_SIDE = 5.0  # [inch] of a panel
_DPI = 64
_SIGN = 0.5  # [inch] of the lander over the ground
_CLOSE = (0.66, 0.02, 0.32, 0.32)  # of the panel: where the lander is shown close by
_HALF_SIDE = 270.0  # [m] of the ground around the first target: every start of the paper's lies in it


def render_flight(
    scenario: Scenario, steps: Sequence[Step], look: Observation, now: Observation
) -> NDArray[np.uint8]:
    """Draw the flight so far.

    Args:
        scenario: what is flown.
        steps: what has been flown.
        look: the last one.
        now: what is known at this instant; the look, if it was taken now.

    Returns:
        RGB picture, shape (320, 640, 3): the ground around the path on the left, the look on the right; of a
        ranging LIDAR, shape (320, 960, 3), with the heights that it measured beside. The lander is shown from
        above and in the corner from the side (`hda.flight.portrait`), not to scale; the broken line is the
        edge of what its sensor can see.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    start = scenario.initial_state.position[None]
    path = np.concatenate([start, *(step.segment.path[1:, :3] for step in steps)])
    panels = 2 if look.ground is None else 3
    figure = Figure((panels * _SIDE, _SIDE), dpi=_DPI, layout="compressed")
    canvas = FigureCanvasAgg(figure)
    axes = figure.subplots(1, panels)
    ground, seen = axes[:2]
    draw_true_safety(ground, scenario.tile)
    draw_field_of_view(ground, look, scenario)
    ground.plot(path[:, 0], path[:, 1], color=COLORS[1])
    target = ground_point(scenario, now.target)
    ground.plot(*target[:2], "+", color=COLORS[0], markersize=10)
    pose = end_pose(scenario, steps)
    draw_reach(ground, pose, scenario)
    draw_sign(ground, pose, FROM_ABOVE, (path[-1, 0], path[-1, 1]), _SIGN)
    draw_close(ground.inset_axes(_CLOSE), pose, scenario, target)
    half = 0.5 * look.width
    middle = scenario.nominal_target
    ground.set_xlim(middle[0] - _HALF_SIDE, middle[0] + _HALF_SIDE)
    ground.set_ylim(middle[1] - _HALF_SIDE, middle[1] + _HALF_SIDE)
    height = path[-1, 2] - now.target[2]
    ground.set_title(f"true safety; t = {now.time:g} s, {height:.0f} m above the target")
    seen.imshow(
        look.safety_map, cmap="gray", origin="lower", vmin=0, vmax=1, extent=(-half, half, -half, half)
    )
    seen.plot(*(now.target - look.target)[:2], "+", color=COLORS[0], markersize=10)
    seen.set_title("look: observed safety about the target [m]")
    if look.ground is not None:
        draw_elevation(axes[2], look)
        axes[2].set_title("measured heights; orange: holes")
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
