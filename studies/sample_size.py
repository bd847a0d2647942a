"""How many episodes a comparison takes, before any is flown.

For two policies on the same episodes and the exact McNemar test: what matters is the ratio of episodes that
only one of them lands. If nothing is known of it, three cases are shown: the worse policy lands no episode
that the better one does not, both fail independently, and half way. Episodes are taken as independent: use
many tiles.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from rich.console import Console

from guidance.console import one_line_errors, tolerate_encoding
from guidance.validation import finite_number
from studies.campaign.command_line import open_folder
from studies.campaign.provenance import describe_run, write_provenance
from studies.columns import Column, console_table, write_csv
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
        discordant: ratio of episodes that only one of the two lands [%]; three cases by default.
        out: folder for results.
    """

    difference: float = 1.0
    power: float = 0.9
    significance: float = 0.05
    reference: float = 90.0
    discordant: float | None = None
    out: Path = Path("results/sample_size")


def mcnemar_power(episodes: int, discordant: float, difference: float, significance: float = 0.05) -> float:
    """Power of the exact two-sided McNemar test, summed over all numbers of discordant episodes.

    Args:
        episodes: at least 1.
        discordant: ratio of episodes that only one policy lands, in (0, 1].
        difference: difference of the ratios, from 0 to `discordant`; at 0 this is the true false-alarm rate.
        significance: in (0, 0.5].

    Raises:
        ValueError: an argument is out of range.
    """
    from scipy.special import bdtr
    from scipy.stats import binom

    count = int(finite_number("episodes", episodes, at_least=1))
    ratio = finite_number("discordant", discordant, above=0.0, at_most=1.0)
    gap = finite_number("difference", difference, at_least=0.0, at_most=ratio)
    alarm = finite_number("significance", significance, above=0.0, at_most=0.5)
    spread = 9.0 * math.sqrt(count * ratio * (1.0 - ratio)) + 9.0
    middle = count * ratio
    pairs = np.arange(max(0, int(middle - spread)), min(count, math.ceil(middle + spread)) + 1)
    # the test fails to reject above the greatest k with 2 P(K <= k) <= alarm
    limit = binom.ppf(0.5 * alarm, pairs, 0.5)
    limit = np.where(2.0 * binom.cdf(limit, pairs, 0.5) <= alarm, limit, limit - 1.0)
    better = 0.5 + 0.5 * gap / ratio
    tail = np.where(
        limit >= 0.0, _lower(bdtr, limit, pairs, better) + _lower(bdtr, limit, pairs, 1.0 - better), 0.0
    )
    return float(min(1.0, (binom.pmf(pairs, count, ratio) * tail).sum()))


def _lower(bdtr: np.ufunc, limit: np.ndarray, pairs: np.ndarray, chance: float) -> np.ndarray:
    return bdtr(np.maximum(limit, 0.0), pairs, chance)


def comparison_episodes(
    difference: float, power: float, discordant: float, significance: float = 0.05
) -> int:
    """Least number of episodes, to about a thousandth, at which the test has the power.

    Args:
        difference: difference of the ratios, above 0, at most `discordant`.
        power: in (0, 0.9999].
        discordant: ratio of episodes that only one policy lands, in (0, 1].
        significance: in (0, 0.5].

    Raises:
        ValueError: an argument is out of range, or it takes more than 50 million episodes.
    """
    wanted = finite_number("power", power, above=0.0, at_most=0.9999)
    finite_number("difference", difference, above=0.0, at_most=discordant)
    high = 2
    while mcnemar_power(high, discordant, difference, significance) < wanted:
        high *= 2
        if high > _MOST_EPISODES:
            raise ValueError(f"difference: {difference:g} takes more than {_MOST_EPISODES} episodes")
    counts = range(high // 2, high + 1, max(1, high // 1000))

    def reaches(episodes: int) -> bool:
        return mcnemar_power(episodes, discordant, difference, significance) >= wanted

    return [*counts, high][bisect_left(counts, True, key=reaches)]


def independent_discordance(reference: float, difference: float) -> float:
    """Ratio of episodes that only one of two policies lands, if they fail independently of one another."""
    other = reference + difference
    return reference * (1.0 - other) + other * (1.0 - reference)


@dataclass(frozen=True)
class ComparisonPlan:
    """Episodes that see a difference of two policies.

    Attributes:
        discordant: ratio of episodes that only one of them lands.
        episodes: so many of them.
        power: probability of seeing the difference.
    """

    discordant: float
    episodes: int
    power: float


@dataclass(frozen=True)
class DemonstrationPlan:
    """Episodes that show a reliability.

    Attributes:
        reliability: ratio of flights that succeed.
        episodes: so many of them, for 0, 1, 2 and 3 failures.
    """

    reliability: float
    episodes: tuple[int, ...]


_FAILURES = range(4)


def _failures_column(failures: int) -> Column[DemonstrationPlan]:
    return Column(f"failures_{failures}", f"{failures} failures", lambda plan: plan.episodes[failures])


COMPARISON_COLUMNS: tuple[Column[ComparisonPlan], ...] = (
    Column("discordant_percent", "only one lands", lambda p: 100.0 * p.discordant, digits=2, unit="%"),
    Column("episodes", "episodes", lambda p: p.episodes),
    Column("power", "power reached", lambda p: p.power, digits=3),
)
"""The plan of a comparison."""

DEMONSTRATION_COLUMNS: tuple[Column[DemonstrationPlan], ...] = (
    Column(
        "reliability_percent", "reliability", lambda p: 100.0 * p.reliability, form="{:g}".format, unit="%"
    ),
    *(_failures_column(failures) for failures in _FAILURES),
)
"""The plan of a demonstration."""


def plan_comparison(options: SampleSize) -> list[ComparisonPlan]:
    """Check the options and make the plan: one line for each case.

    Raises:
        ValueError: an option is out of range.
    """
    gap = finite_number("difference", options.difference, above=0.0, at_most=100.0) / 100.0
    ratio = finite_number("reference", options.reference, at_least=0.0, at_most=100.0 - 100.0 * gap) / 100.0
    largest = min(independent_discordance(ratio, gap), 1.0)
    cases = sorted({gap, max(gap, 0.5 * (gap + largest)), max(gap, largest)})
    if options.discordant is not None:
        given = finite_number("discordant", options.discordant, at_least=options.difference, at_most=100.0)
        cases = [given / 100.0]
    plans = []
    for discordant in cases:
        count = comparison_episodes(gap, options.power, discordant, options.significance)
        reached = mcnemar_power(count, discordant, gap, options.significance)
        plans.append(ComparisonPlan(discordant, count, reached))
    return plans


def plan_demonstration() -> list[DemonstrationPlan]:
    """Episodes that show a reliability with 90 % confidence, by the failures that are allowed."""
    return [
        DemonstrationPlan(ratio, tuple(needed_episodes(ratio, 0.9, failures) for failures in _FAILURES))
        for ratio in (0.95, 0.99, 0.9973, 0.99865)
    ]


def plan_sample_size(options: SampleSize) -> tuple[list[ComparisonPlan], list[DemonstrationPlan]]:
    """Make both plans, write comparison.csv, demonstration.csv and provenance.json, and print them.

    Raises:
        ValueError: an option is out of range.
        OSError: the folder cannot be written.
    """
    comparison, demonstration = plan_comparison(options), plan_demonstration()
    out, console = open_folder(options.out), Console()
    write_csv(out / "comparison.csv", COMPARISON_COLUMNS, comparison)
    write_csv(out / "demonstration.csv", DEMONSTRATION_COLUMNS, demonstration)
    write_provenance(out / "provenance.json", describe_run(options))
    title = f"episodes to see {options.difference:g} points with a power of {options.power:g}"
    console.print(console_table(COMPARISON_COLUMNS, comparison, title))
    title = "episodes to show a reliability with 90 % confidence"
    console.print(console_table(DEMONSTRATION_COLUMNS, demonstration, title))
    console.print(f"results in {out}")
    return comparison, demonstration


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    options = tyro.cli(SampleSize, description=__doc__)
    with one_line_errors():
        plan_sample_size(options)


if __name__ == "__main__":
    main()
