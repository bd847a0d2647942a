"""The motion between nodes in a frame that turns: it takes the place of `constraints.motion`."""

from __future__ import annotations

import numpy as np

from guidance.arrays import Array
from guidance.convex.constraints import Rows
from guidance.convex.layout import Layout
from guidance.convex.scaling import ScaledProblem
from guidance.descent.rotating_frame import Transition, transition_and_rate


def rotating_motion(layout: Layout, scaled: ScaledProblem) -> Rows:
    """Exact motion between nodes under a thrust acceleration linear in time, and the burnt log-mass."""
    intervals = layout.nodes - 1
    h = 1.0 / intervals
    step, rate = transition_and_rate(scaled.rotation, h)
    value, moving = _block(step, h), np.zeros((7, 22))
    moving[:6, 7:] = _block(rate, h)[:6, 7:]  # nothing else depends on the time of flight
    power = np.divide(moving, value, out=np.zeros_like(value), where=value != 0.0)
    columns = np.hstack(
        [
            np.hstack([layout.position[1:], layout.velocity[1:], layout.log_mass[1:, None]]),
            np.hstack([layout.position[:-1], layout.velocity[:-1], layout.log_mass[:-1, None]]),
            np.hstack([layout.acceleration[:-1], layout.acceleration[1:]]),
            np.hstack([layout.slack[:-1, None], layout.slack[1:, None]]),
        ]
    )
    row, entry = np.nonzero(_stored())
    rows = (7 * np.arange(intervals)[:, None] + row).ravel()
    fall = np.append((step.first + step.last) @ scaled.gravity, 0.0)
    change = np.append((rate.first + rate.last) @ scaled.gravity, 0.0)
    return Rows(
        "motion",
        "zero",
        7,
        rows,
        columns[:, entry].ravel(),
        np.tile(value[row, entry], intervals),
        np.tile(fall, intervals),
        value_power=np.tile(power[row, entry], intervals),
        bound_rate=np.tile(change, intervals),
    )


def _block(step: Transition, h: float) -> Array:
    """Rows of A of one interval, shape (7, 22): state after (7) and before (7), thrusts (6), slacks (2)."""
    out = np.zeros((7, 22))
    out[:7, :7] = np.eye(7)
    out[:6, 7:13], out[6, 13] = -step.state, -1.0
    out[:6, 14:17], out[:6, 17:20] = -step.first, -step.last
    out[6, 20:] = 0.5 * h
    return out


def _stored() -> Array:
    """Which of them are stored, shape (7, 22): every one that may ever be other than zero."""
    out = np.eye(7, 22)
    out[:6, 7:13] = out[:6, 14:20] = 1.0
    out[6, 13] = out[6, 20] = out[6, 21] = 1.0
    return out
