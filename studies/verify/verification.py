"""Verifying a results folder: what it says is checked first, then episodes fly again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from guidance.validation import finite_number
from studies.campaign.provenance import digest_file
from studies.compare.table import PolicySummary
from studies.verify.checks import (
    Finding,
    check_checksums,
    check_parquet,
    check_policies,
    check_software,
    check_tables,
    score_results,
    summarize_results,
)
from studies.verify.flights import check_flights, choose_episodes
from studies.verify.held_results import EPISODES, HeldResults, HeldResultsError, read_results


@dataclass(frozen=True)
class Verification:
    """What became of a folder.

    Attributes:
        findings: of every check, in order.
        flown: episodes that were flown again, ascending; none where an earlier check failed.
        results: what the folder holds; None where it cannot be read.
        summaries: the table's lines, worked out from its episodes.
    """

    findings: tuple[Finding, ...]
    flown: tuple[int, ...] = ()
    results: HeldResults | None = None
    summaries: tuple[PolicySummary, ...] = ()

    @property
    def accepted(self) -> bool:
        """Whether every check passed and episodes were flown again."""
        return bool(self.flown) and all(finding.passed for finding in self.findings)

    @property
    def digest(self) -> str:
        """SHA-256 of the folder's episodes: equal digests are equal results."""
        assert self.results is not None
        return digest_file(self.results.folder / EPISODES)


def verify_results(
    folder: Path, rng: np.random.Generator, *, share: float = 0.02, least: int = 20, workers: int = 1
) -> Verification:
    """Check a results folder, and fly a random share of its episodes again.

    A policy that the study names by a path `package.module:Name` is imported and run.

    Args:
        folder: of `studies.compare`, or of a point of another study.
        rng: draws the episodes. Whoever made the folder must not know the draw.
        share: of the episodes, 0 to 1.
        least: so many episodes at least, as far as there are.
        workers: processes.

    Returns:
        What was found. Nothing flies where the folder contradicts itself or was flown by other software.

    Raises:
        ValueError: an argument is out of range.
    """
    finite_number("share", share, at_least=0.0, at_most=1.0)
    finite_number("least", least, at_least=1)
    finite_number("workers", workers, at_least=1)
    findings = [check_checksums(folder)]
    if not findings[-1].passed:
        return Verification(tuple(findings))
    try:
        results = read_results(folder)
    except HeldResultsError as error:
        return Verification((*findings, Finding("contents", False, str(error))))
    for check in (check_software, check_policies):
        findings.append(check(results))
        if not findings[-1].passed:
            return Verification(tuple(findings), results=results)
    scores = score_results(results)
    summaries = tuple(summarize_results(results, scores))
    findings += filter(None, [check_parquet(results)])
    findings += check_tables(results, scores, summaries)
    if not all(finding.passed for finding in findings):
        return Verification(tuple(findings), results=results, summaries=summaries)
    episodes = choose_episodes(results.study.episodes, share, least, rng)
    findings.append(check_flights(results, episodes, workers))
    return Verification(tuple(findings), tuple(episodes), results, summaries)
