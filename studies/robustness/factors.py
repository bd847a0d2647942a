"""What the robustness sweep varies: each factor is one number of a preset, all else left as it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from guidance.validation import unknown_name
from hda.sensing.lidar import Lidar
from hda.sensing.ranging import RangingLidar
from hda.task.presets import Preset
from hda.task.rules import Range, Rules
from hda.terrain.generator import TerrainParameters
from hda.terrain.islands import IslandField
from studies.robustness.factor import Factor
from studies.robustness.navigation_factors import NAVIGATION_FACTORS


def _rules(preset: Preset, **changes: float | int) -> Preset:
    return replace(preset, rules=replace(preset.rules, **changes))


def _constant_errors(preset: Preset) -> Rules:
    if preset.navigation is not None:
        raise ValueError(f"preset {preset.name!r} has a filter: it has no constant errors to vary")
    return preset.rules


def _lidar(preset: Preset, **changes: float | int) -> Preset:
    return replace(preset, lidar=replace(preset.lidar, **changes))


def _map_lidar(preset: Preset) -> Lidar:
    if not isinstance(preset.lidar, Lidar):
        raise ValueError(f"preset {preset.name!r} measures ranges: it has no noise of a map to vary")
    return preset.lidar


def _ranging_lidar(preset: Preset) -> RangingLidar:
    if not isinstance(preset.lidar, RangingLidar):
        raise ValueError(f"preset {preset.name!r} measures no ranges: fly the factor on `lidar`")
    return preset.lidar


def _ranging_factor(
    name: str, label: str, field: str, levels: tuple[float, ...], unit: float = 1.0
) -> Factor:
    """A factor that is one field of a ranging LIDAR; `unit` of the label in SI units."""

    def vary(preset: Preset, value: float) -> Preset:
        kind = type(getattr(_ranging_lidar(preset), field))
        return _lidar(preset, **{field: kind(unit * value)})

    return Factor(
        name,
        label,
        lambda preset: getattr(_ranging_lidar(preset), field) / unit,
        levels,
        vary,
        lambda preset: isinstance(preset.lidar, RangingLidar),
    )


def _interval(preset: Preset, seconds: float) -> Preset:
    """Looks further apart, and as much time for the whole flight as before."""
    rules = preset.rules
    most = math.ceil(rules.max_decisions * rules.decision_interval / seconds)
    return _rules(preset, decision_interval=seconds, max_decisions=most)


def _islands(preset: Preset) -> tuple[TerrainParameters, IslandField]:
    terrain = preset.terrain
    islands = getattr(terrain, "islands", None)
    if not isinstance(terrain, TerrainParameters) or islands is None:
        raise ValueError(f"hazard-share: preset {preset.name!r} has no islands of clear ground to vary")
    return terrain, islands


def _hazard_share(preset: Preset) -> float:
    """Share of the ground off the islands: Phi(-threshold)."""
    return 0.5 * math.erfc(_islands(preset)[1].threshold / math.sqrt(2.0))


def _with_hazard_share(preset: Preset, share: float) -> Preset:
    from scipy.special import ndtri

    terrain, islands = _islands(preset)
    moved = replace(islands, threshold=float(ndtri(1.0 - share)))
    return replace(preset, terrain=replace(terrain, islands=moved))


def _middle(span: Range) -> float:
    return 0.5 * (span.low + span.high)


def _moved(span: Range, middle: float) -> Range:
    half = 0.5 * (span.high - span.low)
    return Range(middle - half, middle + half)


def _speed(preset: Preset, factor: float) -> Preset:
    start = preset.start
    faster = {
        name: Range(factor * getattr(start, name).low, factor * getattr(start, name).high)
        for name in ("descent_speed", "horizontal_speed")
    }
    return replace(preset, start=replace(start, **faster))


FACTORS: dict[str, Factor] = {
    factor.name: factor
    for factor in (
        Factor(
            "thrust-error",
            "bound of the relative thrust error",
            lambda preset: preset.rules.thrust_error,
            (0.3, 0.15, 0.1, 0.0, 0.2),
            lambda preset, value: _rules(preset, thrust_error=value),
        ),
        Factor(
            "map-noise",
            "noise of the map at 500 m (1 sigma)",
            lambda preset: _map_lidar(preset).noise,
            (0.3, 0.15, 0.1, 0.0, 0.2),
            lambda preset, value: _lidar(preset, noise=value),
            lambda preset: isinstance(preset.lidar, Lidar),
        ),
        Factor(
            "map-dropout",
            "share of the looks without a map",
            lambda preset: _map_lidar(preset).dropout,
            (0.6, 0.4, 0.2, 0.0, 0.8),
            lambda preset, value: _lidar(preset, dropout=value),
            lambda preset: isinstance(preset.lidar, Lidar),
        ),
        _ranging_factor("rays", "rays along each side of a scan", "rays", (64, 32, 96, 256, 192)),
        _ranging_factor(
            "range-noise", "noise of a range at 500 m (1 sigma) [cm]", "range_noise", (10, 5, 0, 3, 20), 0.01
        ),
        _ranging_factor("range-bias", "bias of a scan (1 sigma) [m]", "range_bias", (1.0, 0.2, 0.0, 3.0)),
        _ranging_factor(
            "ray-dropout", "share of the rays without an echo", "ray_dropout", (0.1, 0.01, 0.03, 0.001)
        ),
        _ranging_factor(
            "pointing-error",
            "error of a scan's attitude (1 sigma) [mrad]",
            "pointing_error",
            (5, 2, 0, 10),
            1e-3,
        ),
        _ranging_factor("scan-time", "duration of a scan [s]", "scan_duration", (5.0, 0.0, 1.0, 10.0)),
        Factor(
            "slant-limit",
            "sensor's limit off the vertical [deg]",
            lambda preset: math.degrees(preset.lidar.off_nadir_limit),
            (10.0, 14.0, 6.0, 17.0, 30.0),
            lambda preset, value: _lidar(preset, off_nadir_limit=math.radians(value)),
        ),
        Factor(
            "observation-interval",
            "time between looks [s]",
            lambda preset: preset.rules.decision_interval,
            (10.0, 7.5, 2.5),
            _interval,
        ),
        Factor(
            "field-of-view",
            "field of view [deg]",
            lambda preset: math.degrees(preset.lidar.field_of_view),
            (4.0, 7.0, 16.0, 2.0),
            lambda preset, value: _lidar(preset, field_of_view=math.radians(value)),
        ),
        Factor(
            "hazard-share",
            "share of the ground without islands of clear ground",
            _hazard_share,
            (0.97, 0.9, 0.7, 0.94, 0.85),
            _with_hazard_share,
        ),
        Factor(
            "position-error",
            "error of the estimated position, per axis (1 sigma) [m]",
            lambda preset: _constant_errors(preset).navigation_position_error,
            (5.0, 1.0, 0.0, 2.0, 10.0),
            lambda preset, value: _rules(preset, navigation_position_error=value),
            lambda preset: preset.navigation is None,
        ),
        Factor(
            "velocity-error",
            "error of the estimated velocity, per axis (1 sigma) [m/s]",
            lambda preset: _constant_errors(preset).navigation_velocity_error,
            (0.5, 0.2, 0.0, 0.1, 1.0),
            lambda preset, value: _rules(preset, navigation_velocity_error=value),
            lambda preset: preset.navigation is None,
        ),
        Factor(
            "altitude",
            "middle of the initial altitudes [m]",
            lambda preset: _middle(preset.start.altitude),
            (600.0, 750.0, 1200.0, 500.0),
            lambda preset, value: replace(
                preset, start=replace(preset.start, altitude=_moved(preset.start.altitude, value))
            ),
        ),
        Factor(
            "speed",
            "initial speed, a factor",
            lambda preset: 1.0,
            (2.0, 1.5, 0.5, 2.5),
            _speed,
        ),
        Factor(
            "mass",
            "middle of the initial masses [kg]",
            lambda preset: _middle(preset.start.mass),
            (1180.0, 1190.0, 1170.0, 1210.0),
            lambda preset, value: replace(
                preset, start=replace(preset.start, mass=_moved(preset.start.mass, value))
            ),
        ),
        *NAVIGATION_FACTORS,
    )
}


_GROUPS = ("all", "navigation")


def choose_factors(wanted: Sequence[str], preset: Preset) -> tuple[Factor, ...]:
    """Factors of the given names, in the table's order, each once.

    `all` is every one that the preset has, `navigation` every sensor of its filter, and the start; a preset
    without a filter refuses these when they are flown.

    Raises:
        ValueError: there is no such factor, or none was given.
    """
    if not wanted:
        raise ValueError("factors must name at least one factor")
    for name in wanted:
        if name not in (*_GROUPS, *FACTORS):
            raise ValueError(unknown_name("factor", name, (*_GROUPS, *FACTORS)))
    sensors = [f for f in NAVIGATION_FACTORS if f.applies(preset) or preset.navigation is None]
    return tuple(
        factor
        for factor in FACTORS.values()
        if factor.name in wanted
        or ("all" in wanted and factor.applies(preset))
        or ("navigation" in wanted and factor in sensors)
    )
