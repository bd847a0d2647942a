"""The task: its rules, its starts, its presets; and one episode's scenario drawn from them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from guidance.constants import MOON_GRAVITY
from guidance.lander import PAPER_LANDER, Lander
from guidance.state import State
from guidance.validation import finite_number, finite_vector
from hda.sensing.lidar import Lidar
from hda.task.observation import ScenarioView
from hda.ground.own_terrain import OwnTerrain
from hda.task.random_streams import EpisodeStreams
from hda.safety.safety_map import SafetyCriteria
from hda.terrain.generator import TerrainParameters
from hda.ground.tile import Tile

_TARGET_DRAWS = 10_000


@dataclass(frozen=True)
class Rules:
    """How an episode runs and how it is judged.

    Attributes:
        decision_interval: [s] time between looks (paper: 5 s, the processing time of ALHAT).
        control_period: [s] time over which a thrust is held; the decision interval over a whole number.
        max_decisions: an episode still in flight after so many is truncated.
        thrust_error: bound of the relative thrust error, uniform, one draw per decision interval (paper:
            0.05).
        navigation_position_error: [m] 1 sigma of the error of the estimated position along each axis, one
            draw for the episode. Looks are taken and placed relative to the lander, so a horizontal error
            moves the first target and little else; a vertical one ends the flight above or into the ground.
        navigation_velocity_error: [m/s] 1 sigma of the error of the estimated velocity along each axis, one
            draw for the episode. ZEM/ZEV turns an error b into (K_R - K_V) / K_V b at touchdown: 2 b at 6/2.
        crash_speed: [m/s] a faster touchdown is a crash.
        soft_speed: [m/s] `success` asks for a touchdown no faster, vertically and horizontally.

    Raises:
        ValueError: a field is out of range, or the control period does not divide the decision interval.
    """

    decision_interval: float = 5.0
    control_period: float = 0.5
    max_decisions: int = 20
    thrust_error: float = 0.05
    navigation_position_error: float = 0.0
    navigation_velocity_error: float = 0.0
    crash_speed: float = 5.0
    soft_speed: float = 2.0

    def __post_init__(self) -> None:
        """Check every field."""
        finite_number("decision_interval", self.decision_interval, above=0.0)
        finite_number("control_period", self.control_period, above=0.0, at_most=self.decision_interval)
        finite_number("thrust_error", self.thrust_error, at_least=0.0, at_most=0.9)
        finite_number("navigation_position_error", self.navigation_position_error, at_least=0.0)
        finite_number("navigation_velocity_error", self.navigation_velocity_error, at_least=0.0)
        finite_number("crash_speed", self.crash_speed, above=0.0)
        finite_number("soft_speed", self.soft_speed, above=0.0)
        if self.max_decisions < 1:
            raise ValueError(f"max_decisions must be at least 1, got {self.max_decisions}")
        ratio = self.decision_interval / self.control_period
        if abs(ratio - round(ratio)) > 1e-9 * ratio:
            raise ValueError(
                f"control_period must be decision_interval over a whole number, got {self.control_period:g} s"
                f" for {self.decision_interval:g} s"
            )

    @property
    def control_periods(self) -> int:
        """Control periods in one decision interval."""
        return round(self.decision_interval / self.control_period)


@dataclass(frozen=True)
class Range:
    """A uniform draw between two bounds.

    Attributes:
        low: least value.
        high: greatest value; equal to `low` for a fixed value.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        """Refuse an empty range."""
        finite_number("low", self.low)
        finite_number("high", self.high, at_least=self.low)

    def draw(self, rng: np.random.Generator) -> float:
        """One uniform draw."""
        return float(rng.uniform(self.low, self.high))


@dataclass(frozen=True)
class StartConditions:
    """Where and how an episode starts (paper, table of simulation conditions).

    Attributes:
        altitude: [m] above the map datum.
        distance: [m] horizontal distance to the first target.
        descent_speed: [m/s] downward.
        horizontal_speed: [m/s].
        approach_spread: [rad] the horizontal velocity points toward the target within this angle on either
            side.
        mass: [kg].
        target_area: [m] x and y of the first target lie in this range.
        hazard_radius: [m] radius around the first target within which ...
        hazard_share: ... at least this share of the ground is unsafe.

    Raises:
        ValueError: a field is out of range.
    """

    altitude: Range = Range(900.0, 1000.0)
    distance: Range = Range(200.0, 250.0)
    descent_speed: Range = Range(20.0, 35.0)
    horizontal_speed: Range = Range(5.0, 10.0)
    approach_spread: float = math.radians(30.0)
    mass: Range = Range(1200.0, 1200.0)
    target_area: Range = Range(250.0, 750.0)
    hazard_radius: float = 100.0
    hazard_share: float = 0.8

    def __post_init__(self) -> None:
        """Refuse starts that mean nothing."""
        for name in ("distance", "descent_speed", "horizontal_speed"):
            finite_number(f"{name}.low", getattr(self, name).low, at_least=0.0)
        finite_number("approach_spread", self.approach_spread, at_least=0.0, at_most=math.pi)
        finite_number("hazard_radius", self.hazard_radius, above=0.0)
        finite_number("hazard_share", self.hazard_share, at_least=0.0, at_most=1.0)


@dataclass(frozen=True)
class Preset:
    """A whole benchmark setting, frozen with the figures that its calibration gave.

    Attributes:
        name: name in tables.
        terrain: generator parameters, or a user's own terrain.
        criteria: Algorithm 1's limits and lander size.
        start: initial conditions.
        lidar: sensor model.
        rules: timing, dispersions, judgement.
        lander: the vehicle.
        gravity: [m/s^2] site frame, pointing down.

    Raises:
        ValueError: gravity does not point down, or a start has no propellant or lies below the target plane.
    """

    name: str
    terrain: TerrainParameters | OwnTerrain = field(default_factory=TerrainParameters)
    criteria: SafetyCriteria = field(default_factory=SafetyCriteria)
    start: StartConditions = field(default_factory=StartConditions)
    lidar: Lidar = field(default_factory=Lidar)
    rules: Rules = field(default_factory=Rules)
    lander: Lander = PAPER_LANDER
    gravity: tuple[float, float, float] = MOON_GRAVITY

    def __post_init__(self) -> None:
        """The ground must be below, and the tank must hold something."""
        if finite_vector("gravity", self.gravity, 3)[2] >= 0.0:
            raise ValueError(f"gravity must point down (z below zero), got {self.gravity}")
        finite_number("start.mass", self.start.mass.low, above=self.lander.dry_mass)
        finite_number("start.altitude", self.start.altitude.low, above=self.terrain.maximum_elevation)


@dataclass(frozen=True, eq=False)
class Scenario:
    """One episode before it is flown: all that chance decides ahead of the first look.

    Attributes:
        preset: the setting it was drawn from.
        split: tile split it was drawn from.
        streams: the episode's random streams (study seed and number).
        tile: the ground, with the true safety map.
        initial_state: state at t = 0.
        nominal_target: [m] shape (3,), first target, on the target plane.
    """

    preset: Preset
    split: str
    streams: EpisodeStreams
    tile: Tile
    initial_state: State
    nominal_target: NDArray[np.float64]

    @property
    def navigation_error(self) -> NDArray[np.float64]:
        """Estimated minus true position [m] and velocity [m/s], shape (6,)."""
        rules = self.preset.rules
        sigmas = rules.navigation_position_error, rules.navigation_velocity_error
        return self.streams.navigation_error(*sigmas) if any(sigmas) else np.zeros(6)

    @property
    def view(self) -> ScenarioView:
        """What a policy may know of it."""
        return ScenarioView(
            lander=self.preset.lander,
            gravity=np.array(self.preset.gravity),
            nominal_target=self.nominal_target.copy(),
            decision_interval=self.preset.rules.decision_interval,
            control_period=self.preset.rules.control_period,
            field_of_view=self.preset.lidar.field_of_view,
            off_nadir_limit=self.preset.lidar.off_nadir_limit,
            lidar=self.preset.lidar,
        )


def draw_target(
    tile: Tile, start: StartConditions, plane: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Draw the first target: uniform over the target area, where enough of the ground around is unsafe.

    Raises:
        ValueError: no such place was found on the tile in 10 000 draws; the message says what the best was.
    """
    area, best = start.target_area, 0.0
    for _ in range(_TARGET_DRAWS):
        target = np.array([area.draw(rng), area.draw(rng), plane])
        share = tile.hazard_share(target, start.hazard_radius)
        if share >= start.hazard_share:
            return target
        best = max(best, share)
    raise ValueError(
        f"tile {tile.number}: no target with at least {start.hazard_share:.0%} hazard"
        f" within {start.hazard_radius:g} m found in {_TARGET_DRAWS} draws (the most was {best:.1%});"
        " a smaller start.hazard_share allows safer ground"
    )


def draw_state(target: NDArray[np.float64], start: StartConditions, rng: np.random.Generator) -> State:
    """Draw the initial state around `target`."""
    altitude = start.altitude.draw(rng)
    distance = start.distance.draw(rng)
    azimuth = rng.uniform(0.0, 2.0 * math.pi)
    descent = start.descent_speed.draw(rng)
    speed = start.horizontal_speed.draw(rng)
    heading = azimuth + math.pi + rng.uniform(-start.approach_spread, start.approach_spread)
    position = (
        target[0] + distance * math.cos(azimuth),
        target[1] + distance * math.sin(azimuth),
        altitude,
    )
    velocity = (speed * math.cos(heading), speed * math.sin(heading), -descent)
    return State(np.array(position), np.array(velocity), start.mass.draw(rng))


def draw_scenario(
    preset: Preset,
    streams: EpisodeStreams,
    split: str,
    tile_numbers: Sequence[int],
    load: Callable[[int], Tile],
) -> Scenario:
    """Draw a scenario on one of the given tiles.

    Args:
        preset: the setting.
        streams: the episode's random streams; only the scenario stream is used here.
        split: name of the split that the tiles are from, for the record.
        tile_numbers: at least one.
        load: gives the tile of a number.
    """
    rng = streams.scenario()
    tile = load(tile_numbers[int(rng.integers(len(tile_numbers)))])
    plane = preset.terrain.maximum_elevation
    target = draw_target(tile, preset.start, plane, rng)
    target.flags.writeable = False
    return Scenario(preset, split, streams, tile, draw_state(target, preset.start, rng), target)
