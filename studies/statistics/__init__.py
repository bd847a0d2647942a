"""Honest statistics: intervals, paired tests, gates and reliability, on counts and moments.

Plain mathematics: nothing of episodes or policies is known here. Every study imports it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.statistics.ratios import Interval, clustered_interval, least_passing, wilson_interval
    from studies.statistics.reliability import exact_lower_bound, needed_episodes
    from studies.statistics.seeds import interquartile_mean, probability_of_improvement

_HOMES = {
    "studies.statistics.ratios": (
        "Interval",
        "clustered_interval",
        "least_passing",
        "wilson_interval",
    ),
    "studies.statistics.reliability": (
        "exact_lower_bound",
        "needed_episodes",
    ),
    "studies.statistics.seeds": (
        "interquartile_mean",
        "probability_of_improvement",
    ),
}

__all__ = [
    "Interval",
    "clustered_interval",
    "exact_lower_bound",
    "interquartile_mean",
    "least_passing",
    "needed_episodes",
    "probability_of_improvement",
    "wilson_interval",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
