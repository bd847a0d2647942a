"""What chance does to an episode, each part with a name and a switch."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, fields, replace

from guidance.validation import finite_number
from hda.sensing.lidar import Lidar
from hda.sensing.ranging import RangingLidar
from hda.task.presets import Preset
from hda.task.rules import Range

_START_RANGES = ("altitude", "distance", "descent_speed", "horizontal_speed", "mass", "target_area")


@dataclass(frozen=True)
class Dispersions:
    """Factors on the preset's own dispersions: 1 as in the preset, 0 off (the middle of a range).

    Attributes:
        altitude: spread of the initial altitude.
        distance: spread of the initial horizontal distance to the first target.
        descent_speed: spread of the initial descent speed.
        horizontal_speed: spread of the initial horizontal speed.
        approach_spread: spread of the horizontal velocity's direction about that of the target.
        mass: spread of the initial mass (none in the paper's setting).
        target_area: spread of the first target over the tile; 0 may find no target that is hazardous enough.
        map_noise: noise of the observed safety map; of the ranges, where the sensor gives these.
        thrust_error: relative error of the applied thrust.
        map_dropout: probability of a look without a map, or of a ray without an echo (none in the paper's
            setting); at most 1 results.
        navigation_position: error of the estimated position (none in the paper's setting).
        navigation_velocity: error of the estimated velocity (none in the paper's setting).

    Raises:
        ValueError: a factor is negative or not finite.
    """

    altitude: float = 1.0
    distance: float = 1.0
    descent_speed: float = 1.0
    horizontal_speed: float = 1.0
    approach_spread: float = 1.0
    mass: float = 1.0
    target_area: float = 1.0
    map_noise: float = 1.0
    thrust_error: float = 1.0
    map_dropout: float = 1.0
    navigation_position: float = 1.0
    navigation_velocity: float = 1.0

    def __post_init__(self) -> None:
        """Check every factor."""
        for field in fields(self):
            finite_number(field.name, getattr(self, field.name), at_least=0.0)

    def applied(self, preset: Preset) -> Preset:
        """The preset with its dispersions scaled by these factors; itself if all are 1."""
        if self == Dispersions():
            return preset
        start = preset.start
        ranges = {name: _scaled(getattr(start, name), getattr(self, name)) for name in _START_RANGES}
        spread = start.approach_spread * self.approach_spread
        rules = preset.rules
        return replace(
            preset,
            start=replace(start, **ranges, approach_spread=spread),
            lidar=self._disperse(preset.lidar),
            rules=replace(
                rules,
                thrust_error=rules.thrust_error * self.thrust_error,
                navigation_position_error=rules.navigation_position_error * self.navigation_position,
                navigation_velocity_error=rules.navigation_velocity_error * self.navigation_velocity,
            ),
        )

    def _disperse(self, lidar: Lidar | RangingLidar) -> Lidar | RangingLidar:
        """The sensor with its noise and its dropout scaled: of the map, or of the ranges."""
        if isinstance(lidar, RangingLidar):
            lost = min(1.0, lidar.ray_dropout * self.map_dropout)
            return replace(lidar, range_noise=lidar.range_noise * self.map_noise, ray_dropout=lost)
        dropout = min(1.0, lidar.dropout * self.map_dropout)
        return replace(lidar, noise=lidar.noise * self.map_noise, dropout=dropout)


def _scaled(bounds: Range, factor: float) -> Range:
    if factor == 1.0:
        return bounds
    middle = 0.5 * (bounds.low + bounds.high)
    half = 0.5 * factor * (bounds.high - bounds.low)
    return Range(middle - half, middle + half)


DISPERSION_NAMES = tuple(entry.name for entry in fields(Dispersions))


def refuse_unknown_options(options: Collection[str], known: tuple[str, ...]) -> None:
    """Raise ValueError where an option of `reset` is not known."""
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise ValueError(f"options must be among {', '.join(known)}, got {', '.join(unknown)}")
