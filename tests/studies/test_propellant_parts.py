"""Parts of the propellant: flights by hand, one for each interval in which the last site was not aimed at."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from hda.flight.episode import fly
from hda.flight.record import EpisodeRecord
from hda.policies.adjusted_descent import AdjustedDescent
from hda.policies.composition import ComposedPolicy
from hda.registry import make_policy
from hda.task.observation import Observation, ScenarioView
from hda.task.scenario import sample_scenario
from studies.shortfall.propellant_parts import ForeseenSite, part_propellant


@pytest.fixture(scope="module")
def planned() -> EpisodeRecord:
    """A flight by guidance that plans anew for every site."""
    return fly(make_policy("nearest-safe+convex"), sample_scenario("paper", 0, 3))


def test_a_site_is_foreseen_from_its_look_on_and_beyond_the_flight(planned: EpisodeRecord) -> None:
    sites = tuple(decision.site for decision in planned.decisions)
    for known in (0, 2, len(sites) + 3):
        selection = ForeseenSite(sites, known)
        for k in range(len(sites) + 2):
            site, memory = selection.select(replace(planned.observations[0], index=k), None)
            assert memory is None
            assert site is (sites[k] if k < min(known, len(sites)) else sites[-1])


@dataclass(frozen=True, eq=False)
class Aim:
    """Sites by look, the last one ever after."""

    sites: tuple[NDArray[np.float64], ...]

    def begin(self, view: ScenarioView) -> None:
        """Nothing to remember."""

    def select(self, observation: Observation, memory: None) -> tuple[NDArray[np.float64], None]:
        """The site of the look."""
        return self.sites[min(observation.index, len(self.sites) - 1)], None


def test_the_parts_are_those_of_flights_by_hand(planned: EpisodeRecord) -> None:
    """Two sites are two flights; with a third between them, each interval has its own."""
    scenario = planned.scenario
    target = scenario.view.nominal_target
    west, south, east = (target + np.array(by) for by in ([-40.0, 0, 0], [0, -30.0, 0], [40.0, 0, 0]))

    def flown(*sites: NDArray[np.float64]) -> EpisodeRecord:
        return fly(ComposedPolicy("by hand", Aim(sites), AdjustedDescent()), scenario)

    def burn(*sites: NDArray[np.float64]) -> float:
        return 100.0 * flown(*sites).outcome.propellant_fraction

    two = part_propellant(flown(west, east))
    assert (two.direct, two.whole, two.guidance) == (burn(east), burn(west, east), 0.0)
    assert [move.cost for move in two.moves][1:] == [0.0] * (len(two.moves) - 1)
    assert two.moves[0].cost == burn(west, east) - burn(east) > 0.0
    assert [round(move.length, 6) for move in two.moves] == [40.0, 80.0, *[0.0] * (len(two.moves) - 2)]
    assert (two.offset, two.direct + two.moves[0].cost) == pytest.approx((40.0, two.whole))
    three = part_propellant(flown(west, south, east))
    assert [move.cost for move in three.moves[:3]] == [
        burn(west, east) - burn(east),
        burn(west, south, east) - burn(west, east),
        0.0,
    ]


def test_another_law_is_the_guidances_part(planned: EpisodeRecord) -> None:
    parts = part_propellant(planned)
    sites = tuple(decision.site for decision in planned.decisions)
    same = fly(ComposedPolicy("by hand", Aim(sites), AdjustedDescent()), planned.scenario)
    again = 100.0 * same.outcome.propellant_fraction
    assert parts.guidance == pytest.approx(parts.whole - again, abs=1e-9)
    adjusted = fly(make_policy("td3+convex"), planned.scenario)
    assert part_propellant(adjusted).guidance == pytest.approx(0.0, abs=1e-9)
