"""The table of the stability study: a line per pair of gains; the CSV files have every field."""

from __future__ import annotations

from collections.abc import Callable

from studies.columns import Column
from studies.stability.sweep import GainRow


def _column(heading: str, value: Callable[[GainRow], str], unit: str = "") -> Column[GainRow]:
    return Column(heading, heading, value, unit=unit)


def _powers(row: GainRow) -> str:
    if row.power_imaginary > 0.0:
        return f"{row.power_1_real:.2f}+-{row.power_imaginary:.2f}j"
    return f"{row.power_1_real:.2f}, {row.power_2_real:.2f}"


GAIN_COLUMNS: tuple[Column[GainRow], ...] = (
    _column("K_R", lambda r: f"{r.position_gain:g}"),
    _column("K_V", lambda r: f"{r.velocity_gain:g}"),
    _column("powers of t_go", _powers),
    _column("thrust", lambda r: "bounded" if r.thrust_bounded else "grows"),
    _column("phase margin", lambda r: f"{r.phase_margin_deg:.1f}", "deg"),
    _column("delay / t_go", lambda r: f"{r.delay_margin_over_time_to_go:.3f}"),
    _column("stable above", lambda r: f"{r.sampled_stable_above_s:.2f}", "s"),
    _column("margins above", lambda r: f"{r.margins_met_above_s:.2f}", "s"),
    _column(
        "residual speed", lambda r: f"{r.residual_speed_mps_median:.2f} / {r.residual_speed_mps_max:.2f}"
    ),
    _column(
        "frozen: stable", lambda r: f"{r.frozen_at_stable_mps_median:.2f} / {r.frozen_at_stable_mps_max:.2f}"
    ),
    _column(
        "frozen: margins",
        lambda r: f"{r.frozen_at_margins_mps_median:.2f} / {r.frozen_at_margins_mps_max:.2f}",
    ),
    _column("touchdown", lambda r: f"{r.touchdown_speed_mps_max:.1f}, {r.touchdown_time_to_go_s_max:.1f} s"),
)
"""The gains, as gains.md and the console show them."""
