"""What no flight of an episode undercuts, for one restriction of policies after the other.

Whoever flies is told the whole map and every error of the engine in advance, and so loses no more than any
policy: the bound is an information relaxation. A failure counts as a whole tank.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from guidance.arrays import Array
from guidance.lander import Lander
from hda.policies.planned_descent import PlannedDescent
from hda.policies.privileged.oracle import safe_clearance
from hda.task.presets import Preset
from hda.task.scenario import Scenario, ground_point, sample_scenario, view_of_preset
from studies.campaign.monte_carlo import Study
from studies.information_bound.cheapest_landing import Arrival, bound_cheapest
from studies.information_bound.recognition import (
    can_recognise,
    candidate_tiles,
    log_likelihoods,
    log_odds,
    penalised_loss,
    weigh_tiles,
)

FAILURE = 100.0
"""[%] that a failure costs: a whole tank."""
_CLEARANCE = 2.0  # [m] of `oracle-fuel`
_NEARLY = 1.0  # [%] above the cheapest: places that the penalty is applied to one by one


@dataclass(frozen=True)
class Restriction:
    """A class of policies.

    Attributes:
        name: what is asked of them, in words.
        thrust: greatest share of the greatest thrust that the engine gives.
        least_thrust: least share of the least thrust that it gives.
        arrival: how a landing may end, before the terminal phase.
        clearance: [m] of safe ground around the site.
        gate: [m] height at which the terminal phase begins; 0 without one.
        terminal: [m/s] that the terminal phase spends.
    """

    name: str
    thrust: float
    arrival: Arrival
    least_thrust: float = 1.0
    clearance: float = 0.0
    gate: float = 0.0
    terminal: float = 0.0

    def engine(self, lander: Lander) -> Lander:
        """The vehicle with the thrusts that the class may come to have."""
        greatest = lander.max_thrust * self.thrust
        least = min(lander.min_thrust * self.least_thrust, greatest)
        return replace(lander, max_thrust=greatest, min_thrust=least)


@dataclass(frozen=True, eq=False)
class PlaceLosses:
    """What no landing of a class undercuts, for every place that it may land on.

    Attributes:
        places: [m] shape (n, 2).
        losses: [%] of the propellant, shape (n,).
    """

    places: Array
    losses: Array

    @property
    def least(self) -> float:
        """[%] least of all; a whole tank where there is no place."""
        return float(self.losses.min(initial=FAILURE))


@dataclass(frozen=True)
class PenalisedBound:
    """The first bound, penalised by what knowing the tile is worth.

    Attributes:
        loss: [%] the least, with the penalty.
        log_odds: of the true tile after the first look, natural logarithm.
    """

    loss: float
    log_odds: float


def list_restrictions(preset: Preset) -> tuple[Restriction, ...]:
    """From every policy to those that fly as `oracle-fuel` does; each also asks what those before it ask.

    Raises:
        ValueError: flights of the preset do not end on the target plane, or it has a rigid body.
    """
    if preset.stance is not None:
        raise ValueError(f"preset: flights must end on the target plane; those of {preset.name!r} do not")
    if preset.body is not None:
        raise ValueError(f"preset: a point mass must fly; on {preset.name!r} a rigid body does")
    soft, error = preset.rules.soft_speed, preset.rules.thrust_error
    strong = 1.0 + error
    anywhere = Arrival(half_cell=0.5)
    moving = replace(anywhere, most_descent=soft, most_drift=soft)
    options = PlannedDescent().options_for(view_of_preset(preset, np.zeros(3)))
    seconds = options.terminal_periods * preset.rules.control_period
    sinking = options.terminal_deceleration * seconds
    gravity = float(np.linalg.norm(preset.gravity))
    weak = 1.0 - options.thrust_margin
    gently = Restriction(
        "last seconds slowly",
        weak,
        replace(anywhere, least_descent=sinking, most_descent=sinking),
        gate=0.5 * sinking * seconds,
        terminal=(gravity + options.terminal_deceleration) * seconds,
    )
    return (
        Restriction("every policy", strong, moving, 1.0 - error),
        Restriction("touchdown at rest", strong, anywhere, 1.0 - error),
        Restriction("the engine as specified", 1.0, anywhere),
        Restriction("a margin of thrust", weak, anywhere),
        gently,
        replace(
            gently,
            name="2 m of safe ground about",
            clearance=_CLEARANCE,
            arrival=replace(gently.arrival, half_cell=0.0),
        ),
    )


@dataclass(frozen=True)
class FloorRow:
    """The bounds of one episode.

    Attributes:
        tile: number of its ground.
        floors: [%] of the propellant, for each restriction; a whole tank where nothing safe is reached.
        in_view: the first look shows the cheapest ground of those that fly as `oracle-fuel` does.
        penalised: [%] the first one for policies that settle their cell by the first look, penalised by what
            knowing the tile is worth; nan where the posterior of the tiles is not computed.
        log_odds: of the true tile after the first look, natural logarithm; nan as before.
    """

    tile: int
    floors: tuple[float, ...]
    in_view: bool
    penalised: float
    log_odds: float


def bound_episode(study: Study, episode: int) -> FloorRow:
    """The bounds of an episode."""
    scenario = sample_scenario(study.preset, study.study_seed, episode, study.split)
    restrictions = list_restrictions(study.preset)
    found = [bound_losses(scenario, each) for each in restrictions]
    penalised = PenalisedBound(math.nan, math.nan)
    if can_recognise(scenario):
        penalised = penalise(scenario, found[0])
    last = found[-1]
    in_view = bool(last.losses.size) and lies_in_view(scenario, last.places[int(last.losses.argmin())])
    floors = tuple(each.least for each in found)
    return FloorRow(scenario.tile.number, floors, in_view, penalised.loss, penalised.log_odds)


def safe_places(scenario: Scenario, restriction: Restriction) -> Array:
    """[m] shape (n, 2): middles of the truly safe cells that a class may land on.

    Where no cell has as much safe ground around as it asks for, those with the most count.
    """
    room = safe_clearance(scenario.tile)
    wanted = min(restriction.clearance, float(room.max()))
    row, column = np.nonzero(scenario.tile.deterministic & (room >= wanted))
    return np.column_stack([column, row]).astype(np.float64) + 0.5


def lies_in_view(scenario: Scenario, place: Array) -> bool:
    """Whether a place [m], shape (2,), lies in the first look: in its square, near enough to the vertical."""
    lidar, position = scenario.preset.lidar, scenario.initial_state.position
    target = ground_point(scenario, scenario.nominal_target)
    inside = float(np.abs(place - target[:2]).max()) <= 0.5 * lidar.width(position, target)
    reach = math.tan(lidar.off_nadir_limit) * float(position[2] - target[2])
    return inside and math.hypot(*(place - position[:2])) <= reach


def bound_losses(scenario: Scenario, restriction: Restriction) -> PlaceLosses:
    """What no landing of a class undercuts, place by place."""
    places = safe_places(scenario, restriction)
    preset, state = scenario.preset, scenario.initial_state
    if len(places) == 0:
        return PlaceLosses(places, np.empty(0))
    lander = restriction.engine(preset.lander)
    height = float(scenario.nominal_target[2]) + restriction.gate
    spent = bound_cheapest(state, places, lander, np.array(preset.gravity), height, restriction.arrival)
    burnt = state.mass * -np.expm1(-(spent + restriction.terminal) / lander.exhaust_velocity)
    losses = np.clip(100.0 * burnt / (state.mass - lander.dry_mass), 0.0, FAILURE)
    return PlaceLosses(places, losses)


def penalise(scenario: Scenario, bounded: PlaceLosses) -> PenalisedBound:
    """The least loss with the penalty for knowing the tile, of a class that is bounded place by place."""
    candidates = candidate_tiles(scenario)
    tiles = candidates.tiles
    truth = [tile.number for tile in tiles].index(scenario.tile.number)
    likelihood = log_likelihoods(scenario, candidates)
    weights, odds = weigh_tiles(likelihood), log_odds(likelihood, truth)
    losses, least = bounded.losses, bounded.least
    near = np.flatnonzero(losses <= least + _NEARLY)
    elsewhere = min(least + _NEARLY, FAILURE * float(weights[truth]))  # other safe cells, and unsafe ones
    if near.size == 0:
        return PenalisedBound(elsewhere, odds)
    row, column = (bounded.places[near][:, axis].astype(int) for axis in (1, 0))
    unsafe = np.array([~tile.deterministic[row, column] for tile in tiles])
    value = losses[near] + FAILURE * unsafe
    return PenalisedBound(min(penalised_loss(value, weights, truth, value), elsewhere), odds)
