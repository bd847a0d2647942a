"""Where a flight's propellant goes: to the way to its last site, to each move of the site, to its guidance.

An episode is flown again by convex guidance with the last site known from the start, then with the flight's
own first site and the last one from the second look on, and so on. What one flight of this row burns more
than the one before it is the price of not aiming at the last site over one interval. What the flight itself
burns more than the last of the row is its guidance's: nothing where it flew the same law, `AdjustedDescent`,
as agents with convex guidance do. Rules fly `PlannedDescent`, which plans anew for every site.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from hda.flight.episode import fly
from hda.flight.record import EpisodeRecord
from hda.policies.adjusted_descent import AdjustedDescent
from hda.policies.composition import ComposedPolicy
from hda.site_selection import Site
from hda.task.observation import Observation, ScenarioView


@dataclass(frozen=True, eq=False)
class ForeseenSite:
    """The sites of a flight, the last one known from some look on.

    Attributes:
        sites: [m] each of shape (3,), of each decision.
        known_from: number of the decision from which the last one is aimed at.
    """

    sites: tuple[Array, ...]
    known_from: int

    def begin(self, view: ScenarioView) -> None:
        """Nothing to remember."""

    def select(self, observation: Observation, memory: None) -> tuple[Site, None]:
        """The flight's own site before the last one is known; it may take more looks than that flight."""
        k = observation.index
        return self.sites[k if k < min(self.known_from, len(self.sites)) else -1], None


@dataclass(frozen=True)
class Move:
    """One decision of a flight; it costs nothing from the one on that chose the last site.

    Attributes:
        height: [m] of the lander above the target.
        length: [m] by which the decision moved the target.
        cost: [%] of the propellant, of not aiming at the last site until the next look.
    """

    height: float
    length: float
    cost: float


@dataclass(frozen=True)
class PropellantParts:
    """What a flight burnt, in percent of what it had at the start; the parts add up to the whole.

    Attributes:
        whole: by the flight itself.
        direct: by convex guidance with the last site known from the start.
        moves: of the decisions, in order.
        guidance: what is left: flown by another law than the one that asks here.
        offset: [m] from the first target to the last site.
        time: [s] of the flight.
    """

    whole: float
    direct: float
    moves: tuple[Move, ...]
    guidance: float
    offset: float
    time: float


def part_propellant(record: EpisodeRecord) -> PropellantParts:
    """Fly an episode again with the last site known ever later, and tell the parts of its propellant."""
    sites = tuple(decision.site for decision in record.decisions)
    before = direct = _burn(record, sites, 0)
    moves = []
    for k, (observation, site) in enumerate(zip(record.observations, sites, strict=True)):
        after = before if np.array_equal(site, sites[-1]) else _burn(record, sites, k + 1)
        height = float(observation.state.position[2] - observation.target[2])
        length = float(np.linalg.norm(site[:2] - observation.target[:2]))
        moves.append(Move(height, length, after - before))
        before = after
    whole = 100.0 * record.outcome.propellant_fraction
    offset = float(np.linalg.norm(sites[-1][:2] - record.scenario.view.nominal_target[:2]))
    return PropellantParts(whole, direct, tuple(moves), whole - before, offset, float(record.time[-1]))


def _burn(record: EpisodeRecord, sites: tuple[Array, ...], known_from: int) -> float:
    pilot = ComposedPolicy("foreseen", ForeseenSite(sites, known_from), AdjustedDescent())
    return 100.0 * fly(pilot, record.scenario).outcome.propellant_fraction
