"""What a report opens with."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hda.flight.episode_row import EpisodeRow
from studies.campaign.monte_carlo import Chunk
from studies.compare.flights import FlightPicture
from studies.compare.opening import Opening, choose_curves, choose_opening
from studies.compare.quick import QUICK_POLICIES
from studies.compare.scores import score_study
from studies.compare.table import PolicySummary, summarize_policy

SUCCESSES = {"single-divert": 5, "agent": 8, "best": 9, "seer": 10}


@pytest.fixture(scope="module")
def summaries() -> list[PolicySummary]:
    """Policies that landed so many of ten; `seer` sees the true map."""
    rows = {
        name: [
            EpisodeRow(
                name, k, 1000, "success" if k < count else "crash", k < count, k < count,
                0.0, 0.1, 60.0, 71.0, 4500.0, 0.5, 45.0, 9, 0, 500.0, 500.0,
            )
            for k in range(10)
        ]
        for name, count in SUCCESSES.items()
    }  # fmt: skip
    scores = score_study(tuple(rows), "single-divert", [Chunk(0, 10, rows, dict.fromkeys(rows, np.ones(1)))])
    return [
        summarize_policy(score, "paper", name == "seer", name == "single-divert")
        for name, score in scores.policies.items()
    ]


def flight(policy: str, episode: int, ending: str) -> FlightPicture:
    data: dict[str, Any] = {}
    return FlightPicture(policy, episode, ending, f"{policy} {ending}", data)


def test_the_best_that_failed_stands_beside_the_best_that_landed(summaries: list[PolicySummary]) -> None:
    flights = [
        flight("single-divert", 3, "unsafe-site"),
        flight("agent", 3, "crash"),
        flight("best", 3, "success"),
        flight("seer", 3, "success"),
        flight("best", 7, "crash"),  # nobody landed that one
    ]
    assert choose_opening(flights, summaries) == Opening("agent", 3, "best")


def test_one_that_sees_the_map_stands_there_where_no_other_landed(summaries: list[PolicySummary]) -> None:
    flights = [flight("best", 7, "crash"), flight("agent", 7, "unsafe-site"), flight("seer", 7, "success")]
    assert choose_opening(flights, summaries) == Opening("best", 7, "seer")


def test_without_such_a_pair_the_first_flight_is_shown_alone(summaries: list[PolicySummary]) -> None:
    flights = [flight("agent", 0, "success"), flight("best", 0, "success"), flight("agent", 4, "crash")]
    assert choose_opening(flights, summaries) == Opening("agent", 0)
    assert choose_opening([], summaries) is None


def test_less_propellant_decides_between_equals(summaries: list[PolicySummary]) -> None:
    best = next(s for s in summaries if s.policy == "best")
    twin = replace(best, policy="thrifty", means={**best.means, "propellant_percent": replace_estimate(best)})
    flights = [flight("agent", 3, "crash"), flight("best", 3, "success"), flight("thrifty", 3, "success")]
    assert choose_opening(flights, [*summaries, twin]) == Opening("agent", 3, "thrifty")


def replace_estimate(summary: PolicySummary) -> Any:
    return replace(summary.propellant, estimate=50.0)


def test_six_curves_at_most_the_reference_among_them() -> None:
    assert choose_curves(("a", "single-divert", "b")) == ("a", "single-divert", "b")
    many = (*"abcdefgh", *QUICK_POLICIES)
    assert choose_curves(many) == QUICK_POLICIES
    few = ("oracle", "td3", *"abcdefgh", "single-divert")
    assert choose_curves(few) == ("oracle", "td3", "a", "b", "c", "single-divert")
