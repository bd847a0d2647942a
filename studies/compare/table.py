"""The table of a study: one line per policy, every figure with its interval."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from studies.campaign.rows import MEASURES, RATIOS, ROW_COLUMNS, EpisodeRow
from studies.compare.histograms import DecisionTimes
from studies.compare.scores import PolicyScore
from studies.paper import PAPER_ROWS
from studies.statistics.moments import mean_intervals
from studies.statistics.ratios import (
    Interval,
    clustered_count_interval,
    mcnemar_count_p_value,
    wilson_interval,
)
from studies.statistics.reliability import exact_lower_bound

REFERENCE_POLICY = "single-divert"
"""Every policy is compared with this one, on the same episodes."""

AT_LEAST_CONFIDENCE = 0.9
"""Confidence of "success in at least x %", as requirements of guidance are verified."""

_ROWS_AT_ONCE = 5000  # rows of a group of the Parquet file


@dataclass(frozen=True)
class PolicySummary:
    """One line of the table.

    Attributes:
        policy: name.
        preset: name of the setting.
        episodes: number of episodes.
        safe_site: ratio of safe touchdown cells with Wilson's interval.
        safe_site_by_tile: the same ratio with the interval clustered by tile.
        success: ratio of successes with Wilson's interval.
        success_by_tile: the same ratio with the interval clustered by tile.
        mcnemar_p: exact McNemar test of `safe_site` against the reference policy; nan for itself.
        success_at_least: exact one-sided lower bound of `success` at AT_LEAST_CONFIDENCE.
        means: measure -> mean with Student's interval.
        means_by_tile: measure -> the same mean with the interval clustered by tile.
        fallbacks: decisions in which the policy's own law gave no answer.
        privileged: it sees the true map.
    """

    policy: str
    preset: str
    episodes: int
    safe_site: Interval
    safe_site_by_tile: Interval
    success: Interval
    success_by_tile: Interval
    success_at_least: float
    mcnemar_p: float
    means: dict[str, Interval]
    means_by_tile: dict[str, Interval]
    fallbacks: int
    privileged: bool


def summarize_policy(score: PolicyScore, preset: str, privileged: bool, is_reference: bool) -> PolicySummary:
    """The line of one policy."""
    ratios, by_tile = {}, {}
    for name in RATIOS:
        successes, flown = score.count_successes(name)
        ratios[name] = wilson_interval(int(successes.sum()), score.episodes)
        by_tile[name] = clustered_count_interval(successes, flown)
    moments = score.means.collect()
    means = {name: mean_intervals(moments, k) for k, name in enumerate(MEASURES)}
    successes = int(score.count_successes("success")[0].sum())
    return PolicySummary(
        policy=score.policy,
        preset=preset,
        episodes=score.episodes,
        safe_site=ratios["safe_site"],
        safe_site_by_tile=by_tile["safe_site"],
        success=ratios["success"],
        success_by_tile=by_tile["success"],
        success_at_least=exact_lower_bound(successes, score.episodes, AT_LEAST_CONFIDENCE),
        mcnemar_p=float("nan") if is_reference else mcnemar_count_p_value(score.pairs["safe_site"]),
        means={name: plain for name, (plain, _) in means.items()},
        means_by_tile={name: tiled for name, (_, tiled) in means.items()},
        fallbacks=score.fallbacks,
        privileged=privileged,
    )


def _number(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.9g}"


def _percent(interval: Interval) -> list[str]:
    return [_number(100.0 * value) for value in (interval.estimate, interval.low, interval.high)]


def write_table(path: Path, summaries: Sequence[PolicySummary]) -> None:
    """Write the table as CSV; equal summaries give equal bytes."""
    header = ["policy", "preset", "episodes"]
    header += ["safe_site_percent", "safe_site_low", "safe_site_high"]
    header += ["success_percent", "success_low", "success_high", "mcnemar_p"]
    header += [f"{name}{end}" for name in MEASURES for end in ("", "_low", "_high")]
    header += ["fallbacks", "privileged"]
    header += [f"{name}_tile_{end}" for name in (*RATIOS, *MEASURES) for end in ("low", "high")]
    header.append("success_at_least")
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for s in summaries:
            cells = [s.policy, s.preset, s.episodes, *_percent(s.safe_site), *_percent(s.success)]
            cells.append(_number(s.mcnemar_p))
            for name in MEASURES:
                mean = s.means[name]
                cells += [_number(value) for value in (mean.estimate, mean.low, mean.high)]
            cells += [s.fallbacks, s.privileged]
            cells += _percent(s.safe_site_by_tile)[1:] + _percent(s.success_by_tile)[1:]
            for name in MEASURES:
                cells += [_number(s.means_by_tile[name].low), _number(s.means_by_tile[name].high)]
            writer.writerow([*cells, _number(100.0 * s.success_at_least)])


def write_episodes(folder: Path, rows: Iterable[EpisodeRow]) -> None:
    """Write rows as they come as episodes.csv and episodes.parquet; equal rows give equal CSV bytes."""
    import pyarrow as pa
    from pyarrow import parquet

    kinds = {"str": pa.string(), "int": pa.int64(), "bool": pa.bool_(), "float": pa.float64()}
    schema = pa.schema([(name, kinds[EpisodeRow.__annotations__[name]]) for name in ROW_COLUMNS])
    with (
        (folder / "episodes.csv").open("w", newline="") as stream,
        parquet.ParquetWriter(folder / "episodes.parquet", schema) as tables,
    ):
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(ROW_COLUMNS)
        remaining = iter(rows)
        while group := list(islice(remaining, _ROWS_AT_ONCE)):
            for row in group:
                values = (getattr(row, name) for name in ROW_COLUMNS)
                writer.writerow([_number(v) if isinstance(v, float) else v for v in values])
            columns = {name: [getattr(row, name) for row in group] for name in ROW_COLUMNS}
            tables.write_table(pa.table(columns, schema=schema))


def write_timings(path: Path, decision_time: dict[str, DecisionTimes]) -> None:
    """Write how long decisions took; the only table that is not reproducible."""
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["policy", *(f"decision_time_ms_{q}" for q in ("p50", "p99", "max"))])
        for policy, times in decision_time.items():
            quantiles = [1000.0 * times.quantile(share) for share in (0.5, 0.99, 1.0)]
            writer.writerow([policy, *(f"{value:.4g}" for value in quantiles)])


def write_markdown(path: Path, summaries: Sequence[PolicySummary]) -> None:
    """Write the table for a document: ratios with their intervals, means without."""
    headings = (
        "policy",
        "safe site %",
        "success %",
        "at least %",
        "miss m",
        "speed m/s",
        "propellant %",
        "slant deg",
    )
    lines = ["| " + " | ".join((*headings, "thrust N", "fallbacks")) + " |"]
    lines.append("|---|" + "---:|" * (len(headings) + 1))
    shown = [name for name in MEASURES if name != "reward"]
    for s in summaries:
        name = s.policy + (" *" if s.privileged else "")
        cells = [name, _ratio(s.safe_site, s.safe_site_by_tile), _ratio(s.success, s.success_by_tile)]
        cells.append(f"{100.0 * s.success_at_least:.2f}")
        cells += [f"{s.means[name].estimate:.{_digits(name)}f}" for name in shown]
        lines.append("| " + " | ".join([*cells, str(s.fallbacks)]) + " |")
    for name, row in PAPER_ROWS.items():
        cells = [f"*the paper: {name}*", f"{row['safe_site_percent']:.1f}", "", ""]
        cells += [f"{row[measure]:.{_digits(measure)}f}" for measure in shown]
        lines.append("| " + " | ".join([*cells, ""]) + " |")
    path.write_text("\n".join(lines) + "\n")


def _ratio(plain: Interval, tiled: Interval) -> str:
    ends = [100.0 * value for value in (plain.estimate, plain.low, plain.high, tiled.low, tiled.high)]
    return "{:.1f} ({:.1f}-{:.1f}) [{:.1f}-{:.1f}]".format(*ends)


def _digits(measure: str) -> int:
    return {"maximum_thrust_n": 0, "miss_distance_m": 3}.get(measure, 2)


def print_table(summaries: Sequence[PolicySummary]) -> None:
    """Print the table, with the paper's rows below ours."""
    from rich.console import Console
    from rich.table import Table

    first = summaries[0]
    title = f"preset {first.preset}, {first.episodes} episodes (mean, 95 % interval; [] clustered by tile)"
    caption = (
        "* sees the true map; p: exact McNemar against single-divert;"
        f" at least: success, exact bound at {AT_LEAST_CONFIDENCE:.0%}"
    )
    table = Table(title=title, caption=caption)
    table.add_column("policy", no_wrap=True)
    headings = (
        "safe site %",
        "success %",
        "at least",
        "p",
        "miss m",
        "speed m/s",
        "prop. %",
        "slant deg",
        "thrust N",
    )
    for heading in (*headings, "reward", "fallb."):
        table.add_column(heading, justify="right")
    for s in summaries:
        table.add_row(*_printed_cells(s))
    table.add_section()
    for name, row in PAPER_ROWS.items():
        cells = [f"{row[m]:.4g}" if m in row else "" for m in MEASURES]
        table.add_row(
            f"paper: {name}", f"{row['safe_site_percent']:.1f}", "", "", "", *cells, "", style="dim"
        )
    Console(width=max(Console().width, 156)).print(table)


def _printed_cells(summary: PolicySummary) -> list[str]:
    def ratio(plain: Interval, tiled: Interval) -> str:
        return _ratio(plain, tiled).replace(" (", "\n").replace(") [", "\n\\[")

    p = summary.mcnemar_p
    cells = [
        summary.policy + (" *" if summary.privileged else ""),
        ratio(summary.safe_site, summary.safe_site_by_tile),
        ratio(summary.success, summary.success_by_tile),
        f"{100.0 * summary.success_at_least:.2f}",
        "" if np.isnan(p) else ("<1e-4" if p < 1e-4 else f"{p:.2g}"),
    ]
    for name in MEASURES:
        mean = summary.means[name]
        digits = _digits(name)
        cells.append(f"{mean.estimate:.{digits}f}\n{mean.low:.{digits}f}-{mean.high:.{digits}f}")
    return [*cells, str(summary.fallbacks)]
