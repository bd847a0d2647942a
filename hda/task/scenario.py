"""The task: its rules, its starts, its presets; and one episode's scenario drawn from them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.rigid_body.body import RigidBody
from guidance.state import State
from hda.ground.library import FRESH_SPLIT, Ground, load_tile, tile_numbers
from hda.ground.tile import Tile
from hda.navigation.sensor_errors import SensorErrors, draw_sensor_errors
from hda.safety.touchdown_stance import Footing, make_footing
from hda.task.first_target import describe_lack, draw_target, offers_targets
from hda.task.observation import ScenarioView
from hda.task.presets import Preset, find_preset
from hda.task.random_streams import EpisodeStreams
from hda.task.rules import StartConditions


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
        left_out: numbers of tiles that were drawn before this one, and over which no episode begins, for want
            of hazard around a first target.
    """

    preset: Preset
    split: str
    streams: EpisodeStreams
    tile: Tile
    initial_state: State
    nominal_target: Array
    left_out: tuple[int, ...] = ()

    @cached_property
    def sensor_errors(self) -> SensorErrors | None:
        """What errs for the whole episode in the navigation sensors; None on a preset without a filter."""
        system = self.preset.navigation
        return None if system is None else draw_sensor_errors(system, self.streams.navigation())

    @cached_property
    def navigation_error(self) -> Array:
        """Estimated minus true position [m] and velocity [m/s], shape (6,), as far as it is constant.

        With a filter it is how far the frame of the policies is off the map, and no velocity: horizontally
        the error of the first estimate, vertically too where heights are measured.
        """
        errors, rules = self.sensor_errors, self.preset.rules
        sigmas = rules.navigation_position_error, rules.navigation_velocity_error
        found = np.zeros(6)
        if errors is not None:
            known = 2 if self.preset.stance is None else 3
            found[:known] = errors.position[:known]
        elif any(sigmas):
            found = self.streams.navigation_error(*sigmas)
        found.flags.writeable = False
        return found

    @property
    def view(self) -> ScenarioView:
        """What a policy may know of it."""
        return view_of_preset(self.preset, self.nominal_target)

    @cached_property
    def footing(self) -> Footing | None:
        """The lander over the true ground; None where flights end on the plane."""
        stance = self.preset.stance
        if stance is None:
            return None
        return make_footing(self.tile.elevation, stance, float(self.nominal_target[2]))


def view_of_preset(preset: Preset, nominal_target: Array) -> ScenarioView:
    """What a policy may know of an episode on a preset, with its first target [m], shape (3,)."""
    vehicle = preset.vehicle
    return ScenarioView(
        lander=preset.guided_lander,
        gravity=np.array(preset.gravity),
        nominal_target=nominal_target.copy(),
        rules=preset.rules,
        lidar=preset.lidar,
        criteria=preset.criteria,
        body=vehicle if isinstance(vehicle, RigidBody) else None,
    )


def branch_scenario(scenario: Scenario, branch: int) -> Scenario:
    """The same episode for a branch of its flight: what chance does from here on is the branch's own.

    Ground, start, and what errs for the whole episode stay.

    Args:
        scenario: of the episode.
        branch: number of the branch; 0 is the flight itself.

    Raises:
        ValueError: the number is negative, or none.
    """
    return replace(scenario, streams=replace(scenario.streams, branch=branch))


def ground_point(scenario: Scenario, site: Array) -> Array:
    """[m] shape (3,), where a site in the frame of the estimated position really lies.

    The lander points and places its looks relative to itself, so what it takes to be at `site` is off by the
    error of its own position: by the horizontal one where the height is the plane's, by all of it where the
    height was measured.
    """
    error = scenario.navigation_error
    vertical = 0.0 if scenario.preset.stance is None else error[2]
    return site - np.array([error[0], error[1], vertical])


def frame_point(scenario: Scenario, point: Array) -> Array:
    """[m] shape (3,), a true point in the frame of the estimated position: the inverse of `ground_point`."""
    return point - ground_point(scenario, np.zeros(3))


def true_heights(scenario: Scenario, rows: NDArray[np.int_], columns: NDArray[np.int_]) -> Array:
    """[m] shape (n,), where a landing on each cell ends: on the target plane, or on the true ground."""
    if scenario.preset.stance is None:
        return np.full(rows.size, float(scenario.nominal_target[2]))
    return scenario.tile.elevation[rows, columns].astype(np.float64)


def draw_state(target: Array, start: StartConditions, rng: np.random.Generator) -> State:
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
    """Draw a scenario on one of the given tiles that have first targets.

    A tile that has too few of them is passed over: another is drawn from the rest, by the same stream.

    Args:
        preset: the setting.
        streams: the episode's random streams; only the scenario stream is used here.
        split: name of the split that the tiles are from; on `fresh` the episode's number chooses the tile.
        tile_numbers: at least one.
        load: gives the tile of a number.

    Raises:
        ValueError: none of the tiles has enough first targets.
    """
    rng, waiting, left_out = streams.scenario(), list(tile_numbers), []
    place = int(rng.integers(len(waiting)))
    if split == FRESH_SPLIT:  # each episode has ground of its own
        place = streams.episode % len(waiting)
    tile = load(waiting.pop(place))
    while not offers_targets(tile, preset.start):
        left_out.append(tile.number)
        if not waiting:
            raise ValueError(
                f"{preset.name}: no tile of split {split!r} has enough {describe_lack(preset.start)};"
                " a smaller start.hazard_share allows safer ground"
            )
        tile = load(waiting.pop(int(rng.integers(len(waiting)))))
    plane = preset.terrain.maximum_elevation
    target = draw_target(tile, preset.start, plane, rng)
    target.flags.writeable = False
    state = draw_state(target, preset.start, rng)
    return Scenario(preset, split, streams, tile, state, target, tuple(left_out))


def sample_scenario(
    preset: str | Preset = "paper", study_seed: int = 0, episode: int = 0, split: str = "validation"
) -> Scenario:
    """Draw episode `episode` of the study `study_seed`: always the same, whatever else is drawn.

    Args:
        preset: name of a preset, or a Preset.
        study_seed: seed of the study, at least zero.
        episode: number of the episode, at least zero.
        split: train, tuning, validation or fresh; evaluation belongs on the last two. `own` on a preset
            from `place_preset`.

    Returns:
        The scenario. Its tile is built on first use and cached.

    Raises:
        ValueError: unknown preset or split, a negative seed or episode, or no tile has enough first targets.
    """
    setting = find_preset(preset)
    ground = Ground(setting.terrain, setting.criteria)
    return draw_scenario(
        setting,
        EpisodeStreams(study_seed, episode),
        split,
        tile_numbers(split, ground),
        lambda number: load_tile(ground, number, split),
    )
