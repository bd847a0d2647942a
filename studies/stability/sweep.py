"""Rows of the stability study: each pair of gains at each time to go, and over a whole flight."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.state import State
from guidance.zem_zev import time_to_go
from hda.task.presets import Preset
from studies.stability.held_loop import (
    Gains,
    closed_margins,
    least_safe_time,
    margins_by_control,
    sampled_margins,
    sampled_margins_by_control,
    stable_above,
)
from studies.stability.sampled_flight import (
    Clock,
    error_growth,
    flight_powers,
    fly_sampled,
    speed_vanishes,
    thrust_bounded,
    touch_down,
)

POSITION_GAINS = (5.0, 7.0)
VELOCITY_GAINS = (1.0, 3.0)
"""The agent's gain box (paper, table of actions)."""
_PHASES = np.linspace(0.55, 1.5, 20)


@dataclass(frozen=True)
class Requirement:
    """Margins that a safe loop keeps.

    Attributes:
        phase_margin: [rad].
        gain_margin: a factor.
    """

    phase_margin: float
    gain_margin: float


@dataclass(frozen=True)
class MarginRow:
    """One pair of gains at one time to go, held for the margins.

    The last three fields fly a velocity error from there (within half a period) to cut-off; worst over the
    clock's phase.
    """

    position_gain: float
    velocity_gain: float
    time_to_go_s: float
    crossover_radps: float
    phase_margin_deg: float
    phase_margin_closed_form_deg: float
    delay_margin_s: float
    delay_margin_closed_form_s: float
    gain_margin: float
    sampled_phase_margin_deg: float
    sampled_phase_margin_closed_form_deg: float
    sampled_gain_margin: float
    sampled_stable: bool
    margins_met: bool
    error_position_m_per_mps: float
    error_velocity_left: float
    error_thrust_growth: float


@dataclass(frozen=True)
class GainRow:
    """One pair of gains over the mean descent of the preset, median and worst over the clock's phase.

    `residual_speed` is left at cut-off, `frozen` with the gains held below the time to go at which stability
    or the required margins end; all three pass through the plane. Touchdown is where the plane is first
    met, and the time to go that is left there.
    """

    position_gain: float
    velocity_gain: float
    power_1_real: float
    power_2_real: float
    power_imaginary: float
    speed_vanishes: bool
    thrust_bounded: bool
    phase_margin_deg: float
    delay_margin_over_time_to_go: float
    sampled_stable_above_s: float
    margins_met_above_s: float
    residual_speed_mps_median: float
    residual_speed_mps_max: float
    frozen_at_stable_mps_median: float
    frozen_at_stable_mps_max: float
    frozen_at_margins_mps_median: float
    frozen_at_margins_mps_max: float
    touchdown_speed_mps_max: float
    touchdown_time_to_go_s_max: float
    maximum_thrust_n: float
    maximum_thrust_frozen_n: float


def gain_box(points: int) -> list[Gains]:
    """Pairs of gains over the agent's box, K_V outer."""
    return [
        Gains(float(position), float(velocity))
        for velocity in np.linspace(*VELOCITY_GAINS, points)
        for position in np.linspace(*POSITION_GAINS, points)
    ]


def margin_row(gains: Gains, time: float, period: float, required: Requirement) -> MarginRow:
    """Every margin at one time to go, and what a velocity error there becomes by cut-off."""
    loop, exact = margins_by_control(gains, time), closed_margins(gains, time)
    sampled, sampled_exact = (
        sampled_margins_by_control(gains, time, period),
        sampled_margins(gains, time, period),
    )
    first = max(round(time / period), 1)
    growth = error_growth(gains, Clock(period, first, _PHASES))
    return MarginRow(
        gains.position,
        gains.velocity,
        time,
        loop.crossover,
        math.degrees(loop.phase_margin),
        math.degrees(exact.phase_margin),
        loop.delay_margin,
        exact.delay_margin,
        loop.gain_margin,
        math.degrees(sampled.phase_margin),
        math.degrees(sampled_exact.phase_margin),
        sampled.gain_margin,
        time > stable_above(gains, period) * (1.0 + 1e-12),
        sampled_exact.meet(required.phase_margin, required.gain_margin),
        growth.position,
        growth.velocity,
        growth.thrust,
    )


def mean_descent(preset: Preset) -> tuple[np.ndarray, np.ndarray, float]:
    """Middle of the preset's starts: position [m] from the target, velocity [m/s], time to go [s]."""

    def middle(name: str) -> float:
        drawn = getattr(preset.start, name)
        return 0.5 * (drawn.low + drawn.high)

    height = middle("altitude") - preset.terrain.maximum_elevation
    position = np.array([-middle("distance"), 0.0, height])
    velocity = np.array([middle("horizontal_speed"), 0.0, -middle("descent_speed")])
    state = State(position, velocity, middle("mass"))
    return position, velocity, time_to_go(state, np.zeros(3), preset.gravity)


@dataclass(frozen=True, eq=False)
class Descent:
    """The mean descent at every phase of the clock; no thrust limit.

    Attributes:
        residual: [m/s] speed at cut-off, wherever that is, shape (phases,).
        touchdown: [m/s] speed where the plane is first met, shape (phases,).
        time_left: [s] time to go there, negative after cut-off, shape (phases,).
        thrust: [N] the largest.
    """

    residual: np.ndarray
    touchdown: np.ndarray
    time_left: np.ndarray
    thrust: float


def descend(gains: Gains, preset: Preset, frozen_below: float) -> Descent:
    """Fly the mean descent of a preset, the gains held once less than `frozen_below` [s] is left."""
    position, velocity, time = mean_descent(preset)
    period = preset.rules.control_period
    gravity = np.array(preset.gravity)
    clock = Clock(period, round(time / period), _PHASES, frozen_below)
    flight = fly_sampled(gains, clock, position, velocity, gravity)
    touchdown, flown = touch_down(flight, period, gravity)
    return Descent(
        np.linalg.norm(flight.velocity[-1], axis=-1),
        touchdown,
        clock.times_to_go[0] - flown,
        float(np.linalg.norm(flight.acceleration, axis=-1).max()) * preset.start.mass.high,
    )


def gain_row(gains: Gains, preset: Preset, required: Requirement) -> GainRow:
    """The exact powers, the times to go that are safe, and the mean descent with and without frozen gains."""
    period = preset.rules.control_period
    first, second = flight_powers(gains)
    loop = closed_margins(gains, 1.0)
    stable = stable_above(gains, period)
    safe = least_safe_time(gains, period, required.phase_margin, required.gain_margin)
    free = descend(gains, preset, 0.0)
    at_stable = descend(gains, preset, stable)
    at_margins = descend(gains, preset, safe)
    return GainRow(
        gains.position,
        gains.velocity,
        float(first.real),
        float(second.real),
        float(second.imag),
        speed_vanishes(gains),
        thrust_bounded(gains),
        math.degrees(loop.phase_margin),
        loop.delay_margin,
        stable,
        safe,
        float(np.median(free.residual)),
        float(np.max(free.residual)),
        float(np.median(at_stable.residual)),
        float(np.max(at_stable.residual)),
        float(np.median(at_margins.residual)),
        float(np.max(at_margins.residual)),
        float(np.max(free.touchdown)),
        float(np.max(free.time_left)),
        free.thrust,
        at_stable.thrust,
    )
