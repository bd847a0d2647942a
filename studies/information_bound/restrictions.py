"""What no flight of an episode undercuts, for one restriction of policies after the other.

Whoever flies is told the whole map and every error of the engine in advance, and so loses no more than any
policy: the bound is an information relaxation. A failure counts as a whole tank.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from guidance.arrays import Array
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
        arrival: how a landing may end, before the terminal phase.
        clearance: [m] of safe ground around the site.
        gate: [m] height at which the terminal phase begins; 0 without one.
        terminal: [m/s] that the terminal phase spends.
    """

    name: str
    thrust: float
    arrival: Arrival
    clearance: float = 0.0
    gate: float = 0.0
    terminal: float = 0.0


def list_restrictions(preset: Preset) -> tuple[Restriction, ...]:
    """From every policy to those that fly as `oracle-fuel` does; each also asks what those before it ask.

    Raises:
        ValueError: flights of the preset do not end on the target plane, or it has a rigid body.
    """
    if preset.stance is not None:
        raise ValueError(f"preset: flights must end on the target plane; those of {preset.name!r} do not")
    soft, strong = preset.rules.soft_speed, 1.0 + preset.rules.thrust_error
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
        Restriction("every policy", strong, moving),
        Restriction("touchdown at rest", strong, anywhere),
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
    floors = tuple(float(losses.min(initial=FAILURE)) for _, losses in found)
    penalised, odds = math.nan, math.nan
    if can_recognise(scenario):
        penalised, odds = penalise(scenario, *found[0])
    places, losses = found[-1]
    in_view = bool(losses.size and lies_in_view(scenario, places[int(losses.argmin())]))
    return FloorRow(scenario.tile.number, floors, in_view, penalised, odds)


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


def bound_losses(scenario: Scenario, restriction: Restriction) -> tuple[Array, Array]:
    """Places that a class may land on [m], shape (n, 2), and the loss [%] that none to each undercuts."""
    places = safe_places(scenario, restriction)
    preset, state = scenario.preset, scenario.initial_state
    if len(places) == 0:
        return places, np.empty(0)
    lander = replace(preset.lander, max_thrust=preset.lander.max_thrust * restriction.thrust)
    height = float(scenario.nominal_target[2]) + restriction.gate
    spent = bound_cheapest(state, places, lander, np.array(preset.gravity), height, restriction.arrival)
    burnt = state.mass * -np.expm1(-(spent + restriction.terminal) / lander.exhaust_velocity)
    return places, np.clip(100.0 * burnt / (state.mass - lander.dry_mass), 0.0, FAILURE)


def penalise(scenario: Scenario, places: Array, losses: Array) -> tuple[float, float]:
    """The least loss [%] with the penalty for knowing the tile, and the log-odds of the true tile."""
    candidates = candidate_tiles(scenario)
    tiles = candidates.tiles
    truth = [tile.number for tile in tiles].index(scenario.tile.number)
    likelihood = log_likelihoods(scenario, candidates)
    weights, odds = weigh_tiles(likelihood), log_odds(likelihood, truth)
    least = float(losses.min(initial=FAILURE))
    near = np.flatnonzero(losses <= least + _NEARLY)
    elsewhere = min(least + _NEARLY, FAILURE * float(weights[truth]))  # other safe cells, and unsafe ones
    if near.size == 0:
        return elsewhere, odds
    row, column = (places[near][:, axis].astype(int) for axis in (1, 0))
    unsafe = np.array([~tile.deterministic[row, column] for tile in tiles])
    value = losses[near] + FAILURE * unsafe
    return min(penalised_loss(value, weights, truth, value), elsewhere), odds
