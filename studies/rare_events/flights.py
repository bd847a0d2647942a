"""Flights as trees: an episode grown from its start, one look a step, and what is kept of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hda.flight.episode import Decide, Flight, Leg, begin_decisions, begin_flight, elevation_angle, fly_leg
from hda.flight.record import EpisodeRecord, join_legs
from hda.policies.entry import AnyPolicy
from hda.task.scenario import Scenario, branch_scenario, ground_point, sample_scenario
from studies.campaign.monte_carlo import Study
from studies.failures.causes import explain_failure, last_change
from studies.rare_events.level_values import LevelValues, Passage
from studies.rare_events.levels import find_level, nearest_safe_cell, safe_share
from studies.rare_events.splitting import NO_WINDOW, Ended, Tree, Window, grow_tree

_ROUND = 12  # [m] about a site, of which the safe share is told


@dataclass(frozen=True)
class LeafRow:
    """One flight, or the end of a branch of it.

    Attributes:
        weight: how many episodes it stands for, in expectation.
        failed: it was no success.
        ending: one word for the end.
        cause: why it failed; empty for a success.
        looks: how many it took.
        chosen: number of the look at which the last site was chosen.
        safe_site: the last site is truly safe.
        safe_share: truly safe share of the ground within 12 m of the last site, north and east.
        divert_m: from the first target to the last site.
        off_nadir_deg: greatest angle from the vertical under which the lander saw its target, the last look
            left out.
    """

    weight: float
    failed: bool
    ending: str
    cause: str
    looks: int
    chosen: int
    safe_site: bool
    safe_share: float
    divert_m: float
    off_nadir_deg: float


@dataclass(frozen=True)
class RootRow:
    """One episode and all that grew out of it.

    Attributes:
        episode: number.
        tile: number of the tile.
        steps: decision intervals flown.
        branches: how many flights were begun, the episode's own among them.
        nearest_safe_m: from the first target to the nearest truly safe cell.
        leaves: every flight that came to its end.
    """

    episode: int
    tile: int
    steps: int
    branches: int
    nearest_safe_m: float
    leaves: tuple[LeafRow, ...]

    @property
    def weight(self) -> float:
        """Weight of all that ended: 1 in expectation."""
        return sum(leaf.weight for leaf in self.leaves)

    @property
    def failing(self) -> float:
        """Weight of what failed: the episode's chance to fail, in expectation."""
        return sum(leaf.weight for leaf in self.leaves if leaf.failed)


@dataclass(frozen=True, eq=False)
class _Aloft:
    """A flight before a look, with its legs so far, the newest first."""

    flight: Flight
    memory: Any
    legs: tuple[Leg, Any] | None


def grow_episode(
    policy: AnyPolicy, scenario: Scenario, window: Callable[[Flight], Window]
) -> Tree[EpisodeRecord]:
    """Grow the tree of an episode; with windows that never split it is the flight of `hda.fly`, to the bit.

    A branch meets noise, engine and navigation errors of its own from the look on at which it is split off.
    Branches that were one share what a policy keeps in its memory, its random generator too: they may then be
    alike, but each is as likely as a flight by itself.

    Args:
        policy: which flies; one that is privileged is told the scenario.
        scenario: of the episode.
        window: of the weights of a flight before its next look.
    """
    decide, memory = begin_decisions(policy, scenario)

    def advance(aloft: _Aloft, branch: int) -> _Aloft | Ended[EpisodeRecord]:
        return _fly_on(policy.name, branch_scenario(scenario, branch), decide, aloft)

    start = _Aloft(begin_flight(scenario), memory, None)
    return grow_tree(start, advance, lambda aloft: window(aloft.flight), scenario.streams.roulette())


def _fly_on(
    name: str, scenario: Scenario, decide: Decide[Any], aloft: _Aloft
) -> _Aloft | Ended[EpisodeRecord]:
    leg, memory = fly_leg(scenario, aloft.flight, decide, aloft.memory)
    legs = (leg, aloft.legs)
    if leg.step.outcome is None:
        return _Aloft(leg.step.flight, memory, legs)
    flown, rest = [], legs
    while rest is not None:
        flown.append(rest[0])
        rest = rest[1]
    return Ended(join_legs(name, scenario, flown[::-1]))


def fly_root(study: Study, episode: int, values: LevelValues | None, effort: float) -> RootRow:
    """Fly an episode of a study as a tree.

    Args:
        study: of one policy.
        episode: number.
        values: of the levels; None for a whole flight.
        effort: whole flights that an episode may cost, in the mean.
    """
    scenario = sample_scenario(study.preset, study.study_seed, episode, study.split)

    def window(flight: Flight) -> Window:
        if values is None:
            return NO_WINDOW
        return values.window(flight.index, find_level(scenario, flight), effort)

    tree = grow_episode(study.make_policy(study.policies[0]), scenario, window)
    return RootRow(
        episode=episode,
        tile=scenario.tile.number,
        steps=tree.steps,
        branches=tree.branches,
        nearest_safe_m=_nearest_safe(scenario),
        leaves=tuple(describe_leaf(leaf.weight, leaf.end) for leaf in tree.leaves),
    )


def _nearest_safe(scenario: Scenario) -> float:
    """[m] from the first target's cell to the nearest truly safe one; nan without one on the tile."""
    target, safe = scenario.nominal_target, scenario.tile.deterministic
    row, column = int(target[1]), int(target[0])
    reach = 32
    while reach < 2 * max(safe.shape):
        found = nearest_safe_cell(safe, row, column, reach)
        if found is not None:
            return float(np.hypot(found[0] - row, found[1] - column))
        reach *= 2
    return float("nan")


def describe_leaf(weight: float, record: EpisodeRecord) -> LeafRow:
    """Reduce a flight to its row."""
    scenario, outcome = record.scenario, record.outcome
    site = ground_point(scenario, record.decisions[-1].site)
    row, column = int(np.floor(site[1])), int(np.floor(site[0]))
    failed = not outcome.success
    return LeafRow(
        weight=weight,
        failed=failed,
        ending=str(outcome.ending),
        cause=explain_failure(record).cause.value if failed else "",
        looks=len(record.decisions),
        chosen=last_change(record),
        safe_site=scenario.tile.is_safe(site),
        safe_share=safe_share(scenario.tile.deterministic, row, column, _ROUND),
        divert_m=float(np.hypot(*(site - scenario.nominal_target)[:2])),
        off_nadir_deg=_widest_view(record),
    )


def _widest_view(record: EpisodeRecord) -> float:
    looks = record.observations[:-1] or record.observations
    angles = [0.5 * np.pi - elevation_angle(look.state.position, look.target) for look in looks]
    return float(np.degrees(max(angles)))


def fly_passage(study: Study, episode: int) -> tuple[Passage, int]:
    """Fly an episode of a pilot whole; give its passage, and the decision intervals flown."""
    scenario = sample_scenario(study.preset, study.study_seed, episode, study.split)
    seen: list[int] = []

    def note(flight: Flight) -> Window:
        seen.append(find_level(scenario, flight))
        return NO_WINDOW

    tree = grow_episode(study.make_policy(study.policies[0]), scenario, note)
    (leaf,) = tree.leaves
    return Passage(tuple(seen), not leaf.end.outcome.success), tree.steps
