"""What a report opens with: six policies in the distributions, and a flight that tells something."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hda.flight.outcome import Ending
from studies.compare.flights import FlightPicture
from studies.compare.quick import QUICK_POLICIES
from studies.compare.table import REFERENCE_POLICY, PolicySummary

SHOWN_AT_FIRST = 6


@dataclass(frozen=True)
class Opening:
    """The flight that is shown first, and the one beside it.

    Attributes:
        policy: whose flight.
        episode: which.
        beside: policy whose flight of the same episode is drawn with it; empty for none.
    """

    policy: str
    episode: int
    beside: str = ""


def choose_curves(policies: Sequence[str]) -> tuple[str, ...]:
    """At most six policies, in the order of the study: the reference, then the quick ones, then the first."""
    ranked = dict.fromkeys((REFERENCE_POLICY, *QUICK_POLICIES, *policies))
    chosen = [name for name in ranked if name in policies][:SHOWN_AT_FIRST]
    return tuple(name for name in policies if name in chosen)


def choose_opening(flights: Sequence[FlightPicture], summaries: Sequence[PolicySummary]) -> Opening | None:
    """A failure beside a success in the same episode, each by the best policy that has one; else the first.

    The best is the one with most successes, then with least propellant; one that sees the true map is taken
    where no other will do. None where there is no flight.
    """
    if not flights:
        return None
    best = sorted(summaries, key=lambda s: (s.privileged, -s.success.estimate, s.propellant.estimate))
    rank = {summary.policy: place for place, summary in enumerate(best)}
    pairs = [
        (rank[landed.policy], rank[failed.policy], failed.episode, failed, landed)
        for failed in flights
        for landed in flights
        if failed.episode == landed.episode
        and failed.ending != Ending.SUCCESS
        and landed.ending == Ending.SUCCESS
    ]
    if not pairs:
        return Opening(flights[0].policy, flights[0].episode)
    *_, failed, landed = min(pairs, key=lambda pair: pair[:3])
    return Opening(failed.policy, failed.episode, landed.policy)
