"""What a results folder says, against itself and against this software; no episode is flown here."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from io import StringIO
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from hda.flight.episode_row import ROW_COLUMNS, EpisodeRow
from studies.campaign.claimed_folder import name_differences
from studies.campaign.episode_files import episode_line
from studies.campaign.monte_carlo import Chunk
from studies.campaign.provenance import CHECKSUMS, digest_file, identify_study, list_products
from studies.compare.command import summarize_study
from studies.compare.differences import compare_pairs, write_paired
from studies.compare.scores import StudyScores, score_study
from studies.compare.table import REFERENCE_POLICY, PolicySummary, write_markdown, write_table
from studies.verify.held_results import EPISODES, PROVENANCE, HeldResults

_RELATIVE_TOLERANCE, _TOLERANCE = 1e-6, 1e-5
"""`episodes.csv` holds nine digits of what the tables were worked out from: of a thrust, 5e-6 N."""
_OF_THE_REFERENCE = ("mcnemar_p",)
"""Columns of `table.csv` that need the rows of the reference policy."""
_SHOWN = 4


@dataclass(frozen=True)
class Finding:
    """What one check found.

    Attributes:
        check: name.
        passed: nothing speaks against the folder.
        words: what was compared, or what differs.
    """

    check: str
    passed: bool
    words: str


def check_checksums(folder: Path) -> Finding:
    """Whether every product is as the folder's list of checksums says, and on it."""
    try:
        lines = (folder / CHECKSUMS).read_text().splitlines()
        listed = {name: digest for digest, name in (line.split("  ", 1) for line in lines)}
    except FileNotFoundError:
        return Finding("checksums", False, f"{CHECKSUMS} is missing")
    except ValueError:
        return Finding("checksums", False, f"{CHECKSUMS} is damaged")
    present = set(list_products(folder))
    lacking = [name for name in listed if name not in present and not name.startswith("shards/")]
    wrong = [name for name in sorted(present & {*listed}) if digest_file(folder / name) != listed[name]]
    faults = [f"{name} is missing" for name in lacking]
    faults += [f"{name} was changed" for name in wrong]
    faults += [f"{name} is not listed" for name in sorted(present - {*listed})]
    return _judge("checksums", faults, f"{len(present)} files are as they were written")


def check_software(results: HeldResults) -> Finding:
    """Whether this software, the preset and the policies' sources are those that flew the study."""
    try:
        here = json.loads(json.dumps(identify_study(results.study), default=str))
    except ImportError as error:
        return Finding("software", False, f"something of the study is not installed here: {error}")
    there = {name: results.provenance.get(name) for name in here}
    faults = list(name_differences(there, here))
    finding = _judge("software", faults, "versions, preset, sources and weights are the same")
    if finding.passed:
        return finding
    if all(fault.startswith("preset.") for fault in faults):
        advice = "the study varied the preset, and such a point cannot be verified"
    else:
        advice = f"it was flown at commit {results.provenance.get('git_commit')}: verify it there"
    return Finding("software", False, f"{finding.words}; {advice}")


def check_policies(results: HeldResults) -> Finding:
    """Whether every policy of the study can be made here."""
    faults = []
    for name in results.policies:
        try:
            results.study.make_policy(name)
        except (ImportError, ValueError) as error:
            faults.append(f"{name}: {error}")
    return _judge("policies", faults, f"{len(results.policies)} policies can fly here")


def check_parquet(results: HeldResults) -> Finding | None:
    """Whether the Parquet file holds the episodes of the CSV file; None where there is none."""
    path = results.folder / "episodes.parquet"
    if not path.exists():
        return None
    import pyarrow as pa
    from pyarrow import parquet

    try:
        held = parquet.read_table(path, columns=list(ROW_COLUMNS)).to_pylist()
        lines = [episode_line(EpisodeRow(**row)) for row in held]
    except (pa.ArrowException, OSError, TypeError, ValueError) as error:
        return Finding("parquet", False, f"episodes.parquet is damaged: {str(error).splitlines()[0]}")
    pairs = zip(lines, results.lines.values(), strict=False)
    differing = sum(there != here for there, here in pairs) + abs(len(lines) - len(results.lines))
    faults = [f"episodes.parquet differs from {EPISODES} in {differing} episodes"] if differing else []
    return _judge("parquet", faults, f"episodes.parquet holds the {len(lines)} rows of {EPISODES}")


def score_results(results: HeldResults) -> StudyScores:
    """Score the rows of `episodes.csv` anew, against the first policy where the reference's are not there."""
    policies = results.policies
    rows = {
        name: [results.rows[name, episode] for episode in range(results.study.episodes)] for name in policies
    }
    times = {name: np.zeros(0) for name in policies}
    reference = REFERENCE_POLICY if REFERENCE_POLICY in policies else policies[0]
    return score_study(policies, reference, [Chunk(0, results.study.episodes, rows, times)])


def check_tables(
    results: HeldResults, scores: StudyScores, summaries: Sequence[PolicySummary]
) -> Iterator[Finding]:
    """Whether the tables in the folder follow from its episodes; nothing where it has none."""
    with TemporaryDirectory() as drawn:
        worked_out = Path(drawn)
        write_table(worked_out / "table.csv", summaries)
        write_paired(worked_out / "paired.csv", compare_pairs(scores, results.policies))
        unpaired = scores.reference != REFERENCE_POLICY
        write_markdown(worked_out / "table.md", summaries)
        names = ["table.csv", "table.md"] if unpaired else ["table.csv", "paired.csv", "table.md"]
        for name in (name for name in names if (results.folder / name).exists()):
            places = (results.folder, worked_out)
            there, here = ((place / name).read_text("utf-8", "replace") for place in places)
            if name == "table.md":
                faults = _differing_lines(there, here)
            else:
                faults = _differing_cells(there, here, _OF_THE_REFERENCE if unpaired else ())
            yield _judge(name, list(faults), f"follows from {EPISODES}")


def list_unchecked(folder: Path) -> list[str]:
    """Products that no check reads, but for their checksums."""
    checked = {EPISODES, PROVENANCE, "episodes.parquet", "paired.csv", "table.csv", "table.md"}
    return [name for name in list_products(folder) if name not in checked and not name.startswith("shards/")]


def summarize_results(results: HeldResults, scores: StudyScores) -> list[PolicySummary]:
    """The table's line of every policy in the folder, from its episodes."""
    return summarize_study(replace(results.study, policies=results.policies), scores)


def _differing_lines(there: str, here: str) -> Iterator[str]:
    """Name the lines in which two documents differ."""
    for number, (held, found) in enumerate(zip_longest(there.splitlines(), here.splitlines()), start=1):
        if held != found:
            yield f"line {number} is {held!r} for {found!r}"


def _differing_cells(there: str, here: str, unknown: Sequence[str]) -> Iterator[str]:
    """Name the cells in which two tables differ by more than what nine digits leave open."""
    head, *held = list(csv.reader(StringIO(there))) or [[]]
    head_here, *found = list(csv.reader(StringIO(here)))
    if head != head_here or [row[:1] for row in held] != [row[:1] for row in found]:
        yield "it has other lines or columns"
        return
    for row, expected in zip(held, found, strict=True):
        for column, cell, wanted in zip(head, row, expected, strict=False):
            if column not in unknown and not _agree(cell, wanted):
                yield f"{row[0]}, {column}: {cell or 'empty'} for {wanted or 'empty'}"


def _agree(cell: str, wanted: str) -> bool:
    if cell == wanted:
        return True
    try:
        return math.isclose(float(cell), float(wanted), rel_tol=_RELATIVE_TOLERANCE, abs_tol=_TOLERANCE)
    except ValueError:
        return False


def _judge(check: str, faults: Sequence[str], praise: str) -> Finding:
    if not faults:
        return Finding(check, True, praise)
    more = f"; and {len(faults) - _SHOWN} more" if len(faults) > _SHOWN else ""
    return Finding(check, False, "; ".join(faults[:_SHOWN]) + more)
