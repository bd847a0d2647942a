"""What the stability study's numbers mean, in words that are computed from them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from hda.task.presets import Preset
from studies.stability.held_loop import Gains, stable_above
from studies.stability.sampled_flight import thrust_bounded
from studies.stability.sweep import (
    POSITION_GAINS,
    VELOCITY_GAINS,
    GainRow,
    MarginRow,
    Requirement,
    mean_descent,
)

_FINE = 201


def conclude(
    margins: Sequence[MarginRow], gains: Sequence[GainRow], preset: Preset, required: Requirement
) -> list[str]:
    """Sentences about the whole box, each from the rows."""
    return [
        _agreement(margins),
        _exact(gains, preset),
        _thrust(gains),
        _held(gains, preset),
        _sampled(gains, preset, required),
        _descent(gains, preset),
        _freezing(gains, preset),
        _overshoot(gains, preset),
    ]


def _pairs(rows: Sequence[GainRow]) -> str:
    return ", ".join(f"{r.position_gain:g}/{r.velocity_gain:g}" for r in rows) or "none"


def _range(rows: Sequence[GainRow], value: Callable[[GainRow], float], form: str) -> str:
    values = [value(row) for row in rows]
    return f"{min(values):{form}} to {max(values):{form}}"


def _agreement(rows: Sequence[MarginRow]) -> str:
    phase = max(abs(r.phase_margin_deg - r.phase_margin_closed_form_deg) for r in rows)
    sampled = np.array([r.sampled_phase_margin_deg - r.sampled_phase_margin_closed_form_deg for r in rows])
    return (
        f"python-control and the closed forms agree on the phase margin to {phase:.1e} deg (continuous) and "
        f"{np.nanmax(np.abs(sampled)):.1e} deg (sampled, by interpolation); the continuous gain margin is "
        "infinite everywhere."
    )


def _exact(rows: Sequence[GainRow], preset: Preset) -> str:
    vanishing = sum(r.speed_vanishes for r in rows)
    slow = min(rows, key=lambda r: r.power_1_real)
    start = mean_descent(preset)[2]
    kept = (0.5 * preset.rules.control_period / start) ** (slow.power_1_real - 1.0)
    return (
        f"Exact continuous loop: the speed vanishes at touchdown for {vanishing} of {len(rows)} pairs, but "
        f"as t_go^{slow.power_1_real - 1.0:.2f} at {_pairs([slow])}: cut off at half a period, its slow "
        f"solution keeps {100.0 * kept:.0f} % of the speed it had at {start:.0f} s. Small K_V "
        "leaves a residual speed."
    )


def _thrust(rows: Sequence[GainRow]) -> str:
    grid = [
        thrust_bounded(Gains(float(p), float(v)))
        for p in np.linspace(*POSITION_GAINS, _FINE)
        for v in np.linspace(*VELOCITY_GAINS, _FINE)
    ]
    return (
        f"Thrust stays bounded on {100.0 * np.mean(grid):.0f} % of the box, K_V + 3 <= K_R <= 2 K_V + 2; "
        f"elsewhere it grows without limit as the time to go vanishes. Bounded in the table: "
        f"{_pairs([r for r in rows if r.thrust_bounded])}."
    )


def _held(rows: Sequence[GainRow], preset: Preset) -> str:
    delay = 0.5 * preset.rules.control_period
    return (
        f"Time to go held: phase margins {_range(rows, lambda r: r.phase_margin_deg, '.1f')} deg at every "
        f"time to go; delay margins {_range(rows, lambda r: r.delay_margin_over_time_to_go, '.3f')} of the "
        f"time to go, so the mean delay of the hold ({delay:g} s) alone uses them up at "
        f"{_range(rows, lambda r: delay / r.delay_margin_over_time_to_go, '.2f')} s."
    )


def _sampled(rows: Sequence[GainRow], preset: Preset, required: Requirement) -> str:
    return (
        f"Sampled every {preset.rules.control_period:g} s the loop is stable only above a time to go of "
        f"h max(D/2, K_R/2D), D = K_R - K_V: {_range(rows, lambda r: r.sampled_stable_above_s, '.2f')} s "
        f"({stable_above(Gains(6.0, 2.0), preset.rules.control_period):.2f} s for 6/2), and keeps "
        f"{math.degrees(required.phase_margin):g} deg and a factor {required.gain_margin:g} above "
        f"{_range(rows, lambda r: r.margins_met_above_s, '.2f')} s. Every pair of the box is safe with more "
        f"time left than {max(r.margins_met_above_s for r in rows):.2f} s."
    )


def _descent(rows: Sequence[GainRow], preset: Preset) -> str:
    soft = preset.rules.soft_speed
    gentle = [r for r in rows if r.residual_speed_mps_max <= soft]
    return (
        f"Mean descent of preset {preset.name}, gains in force to the last command, no thrust limit, worst "
        f"clock phase: at most {soft:g} m/s are left at cut-off for {_pairs(gentle)}."
    )


def _overshoot(rows: Sequence[GainRow], preset: Preset) -> str:
    late = 1.5 * preset.rules.control_period
    early = [r for r in rows if r.touchdown_time_to_go_s_max > late]
    gentle = [r for r in rows if r.touchdown_speed_mps_max <= preset.rules.soft_speed]
    text = f"Touchdown within {preset.rules.soft_speed:g} m/s on that descent: {_pairs(gentle)}."
    if not early:
        return text
    complex_powers = sum(r.power_imaginary > 0.0 for r in early)
    return text + (
        f" {len(early)} pairs, {complex_powers} of them with complex powers, swing through the plane before "
        f"the last command, at {_range(early, lambda r: r.touchdown_speed_mps_max, '.1f')} m/s with "
        f"{_range(early, lambda r: r.touchdown_time_to_go_s_max, '.1f')} s to go: {_pairs(early)}. "
        "Complex powers swing about zero: such gains cannot be held for a whole flight, frozen at its end or "
        "not."
    )


def _freezing(rows: Sequence[GainRow], preset: Preset) -> str:
    soft = preset.rules.soft_speed
    oscillating = [r for r in rows if r.power_imaginary > 0.0]
    slow = [r for r in rows if r.power_imaginary == 0.0]
    saved = [r for r in rows if r.frozen_at_margins_mps_max <= soft < r.residual_speed_mps_max]
    lost = [r for r in rows if r.residual_speed_mps_max <= soft < r.frozen_at_margins_mps_max]

    def helped(group: Sequence[GainRow], name: str) -> str:
        count = sum(getattr(r, name) < r.residual_speed_mps_max for r in group)
        return f"{count} of {len(group)}"

    text = (
        "Gains frozen lower the worst speed at cut-off of the pairs with complex powers in "
        f"{helped(oscillating, 'frozen_at_margins_mps_max')} cases (frozen where the margins end) and "
        f"{helped(oscillating, 'frozen_at_stable_mps_max')} (frozen where stability ends), of the pairs with "
        f"real powers in {helped(slow, 'frozen_at_margins_mps_max')} and "
        f"{helped(slow, 'frozen_at_stable_mps_max')}. Frozen where the margins end, these come down to "
        f"{soft:g} m/s: {_pairs(saved)}; these leave it: {_pairs(lost)}."
    )
    standard = [r for r in rows if (r.position_gain, r.velocity_gain) == (6.0, 2.0)]
    for r in standard:
        text += (
            f" For 6/2: {r.residual_speed_mps_max:.2f} m/s unfrozen, {r.frozen_at_stable_mps_max:.2f} "
            f"frozen below {r.sampled_stable_above_s:.2f} s, {r.frozen_at_margins_mps_max:.2f} below "
            f"{r.margins_met_above_s:.2f} s."
        )
    return text
