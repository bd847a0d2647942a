"""Failures as files: failures.csv, and failures.md with the causes counted and every failure in words."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from hda.flight.outcome import ENDINGS
from studies.campaign.monte_carlo import Study
from studies.columns import Column, field_columns
from studies.failures.causes import Cause, Failure, count_causes


def describe_failure(failure: Failure) -> str:
    """The cause in a sentence or two."""
    words = f"{ENDINGS[failure.ending].capitalize()} ({failure.touchdown_speed_mps:.2f} m/s)."
    words += f" {failure.cause.value[0].upper()}{failure.cause.value[1:]}."
    if failure.cause in (Cause.MISREAD, Cause.KNOWN_HAZARD, Cause.BETWEEN_PIXELS):
        words += f" It read {failure.last_reading:.2f}, {failure.last_reading_s:.1f} s before touchdown."
    if failure.safe_cells_seen:
        words += (
            f" Looks had shown {failure.safe_cells_seen} safe cells,"
            f" {failure.safe_cells_in_reach} of them within reach."
        )
    words += f" The site last changed {failure.last_change_s:.1f} s before touchdown."
    if failure.faults:
        words += f" At the touchdown failed: {', '.join(failure.faults)}."
    if failure.remedies:
        words += f" A success with {' or with '.join(failure.remedies)}."
    return words


def picture_name(policy: str, episode: int) -> str:
    """File name of a failure's picture."""
    return f"{policy}-{episode:06d}.png"


_LISTS = ("remedies", "faults")

COLUMNS: tuple[Column[tuple[str, Failure]], ...] = (
    Column("policy", "policy", lambda row: row[0]),
    *(column.through(lambda row: row[1]) for column in field_columns(Failure) if column.key not in _LISTS),
    *(Column(key, key, lambda row, key=key: "; ".join(getattr(row[1], key))) for key in _LISTS),
)
"""failures.csv: policy and failure, a field a column."""


def write_markdown(
    path: Path, study: Study, explained: dict[str, list[Failure]], failed: dict[str, int], figures: bool
) -> None:
    """Write the causes counted, then every failure."""
    lines = [
        f"Failed episodes, preset {study.preset.name}, split {study.split}, study seed {study.study_seed}"
    ]
    for policy, failures in explained.items():
        shown = f"the first {len(failures)}" if len(failures) < failed[policy] else "all"
        lines += ["", f"## {policy}: {failed[policy]} failed, {shown} shown", ""]
        lines += [f"- {counted}" for counted in count_causes(failures)]
        faults = Counter(fault for failure in failures for fault in failure.faults)
        if faults:
            told = ", ".join(f"{count} x {fault}" for fault, count in faults.most_common())
            lines += ["", f"What failed at the touchdowns (one may fail by several): {told}."]
        lines += ["", "| episode | tile | ending | why |", "|---:|---:|---|---|"]
        for failure in failures:
            number = str(failure.episode)
            link = f"[{number}]({picture_name(policy, failure.episode)})" if figures else number
            lines.append(f"| {link} | {failure.tile} | {failure.ending} | {describe_failure(failure)} |")
    path.write_text("\n".join(lines) + "\n")
