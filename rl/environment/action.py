"""The agent's action: five numbers in [-1, 1] for gains, a rate of time and a shift of the target."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.validation import finite_number
from hda.policy import Decision, ZemZevCommand
from hda.task.observation import Observation
from hda.task.rules import Range

ACTION_NAMES = ("position_gain", "velocity_gain", "time_to_go_step", "shift_x", "shift_y")
"""What each element of the action moves, in order."""
CONTROLS = ACTION_NAMES.index("shift_x")
"""So many elements move the gains and the clock, the rest the target."""


@dataclass(frozen=True)
class ActionRanges:
    """What -1 and 1 mean for each element of the action (paper, table of actions); linear between.

    Attributes:
        position_gain: K_R.
        velocity_gain: K_V.
        time_to_go_step: [s] by how much the time to go falls over one decision interval of 5 s.
        shift: alpha_x and alpha_y lie in [-shift, shift]: the target moves by that share of the look's width.
            The paper says 0.25 in its text and 0.5 in its table.
        nominal_interval: [s] the interval that `time_to_go_step` refers to.
    """

    position_gain: Range = field(default_factory=lambda: Range(5.0, 7.0))
    velocity_gain: Range = field(default_factory=lambda: Range(1.0, 3.0))
    time_to_go_step: Range = field(default_factory=lambda: Range(4.25, 5.75))
    shift: float = 0.25
    nominal_interval: float = 5.0

    def __post_init__(self) -> None:
        """Refuse ranges that cannot be flown."""
        finite_number("shift", self.shift, at_least=0.0, at_most=0.5)
        finite_number("nominal_interval", self.nominal_interval, above=0.0)
        finite_number("time_to_go_step", self.time_to_go_step.low, above=0.0)


PAPER_ACTIONS = ActionRanges()


class ScaledActions(NamedTuple):
    """What actions mean, each an array of the shape of the leading axes.

    Attributes:
        position_gain: K_R.
        velocity_gain: K_V.
        time_to_go_rate: by how much the time to go falls in a second.
        shift_x: [m] by which the target moves east.
        shift_y: [m] by which the target moves north.
    """

    position_gain: Array
    velocity_gain: Array
    time_to_go_rate: Array
    shift_x: Array
    shift_y: Array


def scale_actions(
    actions: NDArray[np.floating], widths: Array, ranges: ActionRanges = PAPER_ACTIONS
) -> ScaledActions:
    """What actions mean.

    Args:
        actions: shape (..., 5), in the order of `ACTION_NAMES`; values outside [-1, 1] are clipped.
        widths: [m] shape (...), of the looks: the target moves by a share of them.
        ranges: what -1 and 1 mean.

    Raises:
        ValueError: the actions have another shape or are not finite.
    """
    values = clip_actions(actions, (*np.shape(widths), 5))
    position_gain, velocity_gain, step, shift_x, shift_y = np.moveaxis(values, -1, 0)
    greatest = ranges.shift * widths
    return ScaledActions(
        _between(ranges.position_gain, position_gain),
        _between(ranges.velocity_gain, velocity_gain),
        _between(ranges.time_to_go_step, step) / ranges.nominal_interval,
        shift_x * greatest,
        shift_y * greatest,
    )


def clip_actions(actions: NDArray[np.floating], shape: tuple[int, ...]) -> Array:
    """Actions within [-1, 1], each one row.

    Raises:
        ValueError: they have another shape or are not finite.
    """
    values = np.asarray(actions, dtype=np.float64)
    if values.shape != shape:
        raise ValueError(f"action must have shape {shape}, got {values.shape}")
    if not np.isfinite(values).all():
        first = tuple(np.argwhere(~np.isfinite(values).all(axis=-1))[0].tolist())
        where = f" in row {', '.join(map(str, first))}" if first else ""
        raise ValueError(f"action must be finite, got {values[first].tolist()}{where}")
    return np.clip(values, -1.0, 1.0)


def decide_action(
    action: NDArray[np.floating], observation: Observation, ranges: ActionRanges = PAPER_ACTIONS
) -> Decision:
    """Turn an action into the decision that the vehicle flies.

    Args:
        action: shape (5,), in the order of `ACTION_NAMES`; values outside [-1, 1] are clipped.
        observation: what was seen; the target moves by a share of its width, x_f(t) = x_f(t-1) + alpha_x w,
            and on measured ground takes the height that is measured there.
        ranges: what -1 and 1 mean.

    Raises:
        ValueError: the action has another shape or is not finite.
    """
    scaled = scale_actions(action, np.asarray(observation.width), ranges)
    shift = np.array([scaled.shift_x, scaled.shift_y, 0.0])
    command = ZemZevCommand(
        position_gain=float(scaled.position_gain),
        velocity_gain=float(scaled.velocity_gain),
        time_to_go=observation.time_to_go,
        time_to_go_rate=float(scaled.time_to_go_rate),
    )
    return Decision(observation.settled(observation.target + shift), command)


def _between(bounds: Range, values: Array) -> Array:
    """Map [-1, 1] on the range."""
    return bounds.low + 0.5 * (values + 1.0) * (bounds.high - bounds.low)
