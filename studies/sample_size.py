"""How many episodes a comparison takes, before any is flown.

For two policies on the same episodes and the exact McNemar test: what matters is the share of episodes that
only one of them lands. If nothing is known of it, three cases are shown: the worse policy lands no episode
that the better one does not, both fail independently, and half way. Episodes are taken as independent: use
many tiles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from studies.campaign.command_line import one_line_errors
from studies.statistics.reliability import needed_episodes

_MOST_EPISODES = 50_000_000


@dataclass(frozen=True)
class SampleSize:
    """Command line of the planner.

    Attributes:
        difference: difference to be seen [percentage points], above 0.
        power: probability of seeing it.
        significance: false-alarm rate of the two-sided test.
        reference: ratio of the reference policy [%]; the other is better by the difference.
        discordant: share of episodes that only one of the two lands [%]; three cases by default.
    """

    difference: float = 1.0
    power: float = 0.9
    significance: float = 0.05
    reference: float = 90.0
    discordant: float | None = None


def mcnemar_power(episodes: int, discordant: float, difference: float, significance: float = 0.05) -> float:
    """Power of the exact two-sided McNemar test, summed over all numbers of discordant episodes.

    Args:
        episodes: at least 1.
        discordant: share of episodes that only one policy lands, in (0, 1].
        difference: difference of the ratios, from 0 to `discordant`; at 0 this is the true false-alarm rate.
        significance: in (0, 0.5].

    Raises:
        ValueError: an argument is out of range.
    """
    from scipy.special import bdtr
    from scipy.stats import binom

    count = int(finite_number("episodes", episodes, at_least=1))
    share = finite_number("discordant", discordant, above=0.0, at_most=1.0)
    gap = finite_number("difference", difference, at_least=0.0, at_most=share)
    alarm = finite_number("significance", significance, above=0.0, at_most=0.5)
    spread = 9.0 * math.sqrt(count * share * (1.0 - share)) + 9.0
    middle = count * share
    pairs = np.arange(max(0, int(middle - spread)), min(count, math.ceil(middle + spread)) + 1)
    # the test fails to reject above the greatest k with 2 P(K <= k) <= alarm
    limit = binom.ppf(0.5 * alarm, pairs, 0.5)
    limit = np.where(2.0 * binom.cdf(limit, pairs, 0.5) <= alarm, limit, limit - 1.0)
    better = 0.5 + 0.5 * gap / share
    tail = np.where(
        limit >= 0.0, _lower(bdtr, limit, pairs, better) + _lower(bdtr, limit, pairs, 1.0 - better), 0.0
    )
    return float(min(1.0, (binom.pmf(pairs, count, share) * tail).sum()))


def _lower(bdtr: np.ufunc, limit: np.ndarray, pairs: np.ndarray, chance: float) -> np.ndarray:
    return bdtr(np.maximum(limit, 0.0), pairs, chance)


def comparison_episodes(
    difference: float, power: float, discordant: float, significance: float = 0.05
) -> int:
    """Least number of episodes, to about a thousandth, at which the test has the power.

    Args:
        difference: difference of the ratios, above 0, at most `discordant`.
        power: in (0, 0.9999].
        discordant: share of episodes that only one policy lands, in (0, 1].
        significance: in (0, 0.5].

    Raises:
        ValueError: an argument is out of range, or it takes more than 50 million episodes.
    """
    wanted = finite_number("power", power, above=0.0, at_most=0.9999)
    finite_number("difference", difference, above=0.0, at_most=discordant)
    low, high = 1, 2
    while mcnemar_power(high, discordant, difference, significance) < wanted:
        low, high = high, 2 * high
        if high > _MOST_EPISODES:
            raise ValueError(f"difference: {difference:g} takes more than {_MOST_EPISODES} episodes")
    while high - low > max(1, high // 1000):
        middle = (low + high) // 2
        enough = mcnemar_power(middle, discordant, difference, significance) >= wanted
        low, high = (low, middle) if enough else (middle, high)
    return high


def independent_discordance(reference: float, difference: float) -> float:
    """Share of episodes that only one of two policies lands, if they fail independently of one another."""
    other = reference + difference
    return reference * (1.0 - other) + other * (1.0 - reference)


def plan_comparison(options: SampleSize) -> Table:
    """Check the options and make the plan.

    Raises:
        ValueError: an option is out of range.
    """
    gap = finite_number("difference", options.difference, above=0.0, at_most=100.0) / 100.0
    ratio = finite_number("reference", options.reference, at_least=0.0, at_most=100.0 - 100.0 * gap) / 100.0
    largest = min(independent_discordance(ratio, gap), 1.0)
    shares = sorted({gap, max(gap, 0.5 * (gap + largest)), max(gap, largest)})
    if options.discordant is not None:
        given = finite_number("discordant", options.discordant, at_least=options.difference, at_most=100.0)
        shares = [given / 100.0]
    table = Table(title=f"episodes to see {options.difference:g} points with a power of {options.power:g}")
    table.add_column("only one lands [%]", justify="right")
    table.add_column("episodes", justify="right")
    table.add_column("power reached", justify="right")
    for share in shares:
        count = comparison_episodes(gap, options.power, share, options.significance)
        reached = mcnemar_power(count, share, gap, options.significance)
        table.add_row(f"{100.0 * share:.2f}", str(count), f"{reached:.3f}")
    return table


def plan_demonstration() -> Table:
    """Episodes that show a reliability, by the failures that are allowed."""
    table = Table(title="episodes to show a reliability with 90 % confidence")
    table.add_column("reliability [%]", justify="right")
    for failures in range(4):
        table.add_column(f"{failures} failures", justify="right")
    for share in (0.95, 0.99, 0.9973, 0.99865):
        counts = (str(needed_episodes(share, 0.9, failures)) for failures in range(4))
        table.add_row(f"{100.0 * share:g}", *counts)
    return table


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    options = tyro.cli(SampleSize, description=__doc__)
    with one_line_errors():
        tables = (plan_comparison(options), plan_demonstration())
    for table in tables:
        Console().print(table)


if __name__ == "__main__":
    main()
