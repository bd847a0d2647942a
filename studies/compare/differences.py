"""Paired differences between the policies of a comparison, and their table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hda.flight.episode_row import MEASURES, RATIOS
from studies.campaign.score import MEASURE_COLUMNS, RATIO_COLUMNS, Score
from studies.columns import Column, Output, format_p, points_interval, write_csv
from studies.compare.scores import StudyScores
from studies.statistics.moments import mean_intervals
from studies.statistics.paired import holm_adjust, pair_count_interval
from studies.statistics.ratios import (
    Interval,
    mcnemar_count_p_value,
    scaled,
)


@dataclass(frozen=True)
class PairedDifference:
    """One policy less the reference, on the same episodes.

    Attributes:
        policy: name.
        reference: name of the policy that is subtracted.
        ratios: safe_site, success -> difference of the ratios with its interval, in [-1, 1].
        means: measure -> mean difference with Student's interval.
        means_by_tile: measure -> the same with the interval clustered by tile.
        mcnemar_p: exact McNemar test of `safe_site`.
        holm_p: the same, corrected for the number of policies in the study.
    """

    policy: str
    reference: str
    ratios: dict[str, Interval]
    means: dict[str, Interval]
    means_by_tile: dict[str, Interval]
    mcnemar_p: float
    holm_p: float


def compare_pairs(scores: StudyScores, policies: Sequence[str]) -> list[PairedDifference]:
    """Compare policies with the reference policy, which is left out itself."""
    others = [scores.policies[name] for name in policies if name != scores.reference]
    p_values = [mcnemar_count_p_value(score.pairs["safe_site"]) for score in others]
    adjusted = holm_adjust(p_values)
    found = []
    for index, score in enumerate(others):
        moments = score.differences.collect()
        means = {name: mean_intervals(moments, k) for k, name in enumerate(MEASURES)}
        found.append(
            PairedDifference(
                policy=score.policy,
                reference=scores.reference,
                ratios={name: pair_count_interval(score.pairs[name]) for name in RATIOS},
                means={name: plain for name, (plain, _) in means.items()},
                means_by_tile={name: by_tile for name, (_, by_tile) in means.items()},
                mcnemar_p=p_values[index],
                holm_p=float(adjusted[index]),
            )
        )
    return found


def _points_column(name: str, heading: str) -> Column[PairedDifference]:
    return points_interval(
        f"{name}_points",
        heading,
        lambda difference: scaled(difference.ratios[name], 100.0),
        between="-",
    )


def _mean_column(column: Column[Score]) -> Column[PairedDifference]:
    """The difference of a mean, under the same names and with the same digits."""
    name = column.key
    return Column(
        name,
        column.heading,
        lambda difference: difference.means[name],
        unit=column.unit,
        label=column.label,
        interval=True,
        by_tile=lambda difference: difference.means_by_tile[name],
        form=f"{{:+.{column.digits}f}}".format,
    )


DIFFERENCE_COLUMNS: tuple[Column[PairedDifference], ...] = (
    Column("policy", "policy", lambda difference: difference.policy, words=True),
    Column("reference", "reference", lambda difference: difference.reference, outputs=Output.FILE),
    *(_points_column(column.stem, column.heading) for column in RATIO_COLUMNS),
    Column("mcnemar_p", "p", lambda difference: difference.mcnemar_p, form=format_p),
    Column("holm_p", "p (Holm)", lambda difference: difference.holm_p, form=format_p),
    *(_mean_column(column) for column in MEASURE_COLUMNS),
)
"""The paired differences: ratios in percentage points, means in the units of their names."""


def write_paired(path: Path, differences: Sequence[PairedDifference]) -> None:
    """Write the differences as CSV."""
    write_csv(path, DIFFERENCE_COLUMNS, differences)
