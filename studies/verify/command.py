"""Check a results folder, and fly a random share of its episodes again: are they equal to the byte?

The folder is one of `studies.compare`, or a point of another study. First it must agree with itself: the
checksums, the rows of every episode, the tables that follow from them. Then it must be of this software:
versions, preset, sources, weights. Then episodes that are drawn now fly again with every policy of the
folder. A policy named by a path `package.module:Name` is imported and run. Exit code 1: refused.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console

from guidance.console import tolerate_encoding
from studies.campaign.command_line import resumable
from studies.verify.flights import chance_of_notice
from studies.verify.verification import Verification, verify_results

LEADERBOARD_HEADINGS = (
    "policy",
    "preset",
    "episodes",
    "tiles' split",
    "success at least, over tiles %",
    "success %",
    "safe site %",
    "propellant %",
    "commit",
    "episodes.csv, SHA-256",
    "verified",
)
"""Columns of docs/leaderboard.md."""


@dataclass(frozen=True)
class Verify:
    """Command line.

    Attributes:
        results: the folder.
        share: of the episodes that fly again, 0 to 1.
        least: so many episodes fly again at least, as far as there are.
        seed: of the draw; one that nobody can know by default. It is printed.
        workers: processes; changes nothing but the time.
        entry: print the lines for docs/leaderboard.md if the folder is accepted.
    """

    results: Annotated[Path, tyro.conf.Positional]
    share: float = 0.02
    least: int = 20
    seed: int | None = None
    workers: int = 2
    entry: bool = False


def show_verification(options: Verify) -> Verification:
    """Verify the folder and print what was found.

    Raises:
        ValueError: an option is out of range, or a policy raised something.
    """
    seed = np.random.SeedSequence().entropy if options.seed is None else options.seed
    found = verify_results(
        options.results,
        np.random.default_rng(seed),
        share=options.share,
        least=options.least,
        workers=options.workers,
    )
    console = Console(soft_wrap=True, highlight=False, markup=False)
    for finding in found.findings:
        console.print(f"{'ok' if finding.passed else 'REFUSED':8}{finding.check}: {finding.words}")
    if found.results is not None and found.flown:
        episodes = found.results.study.episodes
        altered = max(1, episodes // 100)
        chance = chance_of_notice(altered, episodes, len(found.flown))
        console.print(
            f"flown again (seed {seed}): {', '.join(map(str, found.flown))}\n"
            f"had {altered} of {episodes} episodes been altered, one of them would be among these with"
            f" probability {chance:.2f}; --share asks for more"
        )
    console.print(f"{options.results} is {'verified' if found.accepted else 'refused'}")
    if options.entry and found.accepted:
        console.print("\n".join(leaderboard_lines(found)))
    return found


def leaderboard_lines(found: Verification) -> list[str]:
    """A line in Markdown for each policy of an accepted folder, most landings first."""
    results = found.results
    assert results is not None
    commit = str(results.provenance.get("git_commit") or "")[:7]
    ranked = sorted(found.summaries, key=lambda one: (-one.success_at_least_by_tile, one.policy))
    return [
        "| "
        + " | ".join(
            (
                one.policy + (" *" if one.privileged else ""),
                one.preset,
                str(one.episodes),
                results.study.split,
                f"{100.0 * one.success_at_least_by_tile:.2f}",
                f"{100.0 * one.success.estimate:.1f}",
                f"{100.0 * one.safe_site.estimate:.1f}",
                f"{one.means['propellant_percent'].estimate:.2f}",
                commit,
                found.digest[:16],
                f"{len(found.flown)} episodes, {datetime.now(UTC).date().isoformat()}",
            )
        )
        + " |"
        for one in ranked
    ]


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2, a refused folder exit code 1."""
    tolerate_encoding()
    with resumable("nothing was written"):
        found = show_verification(tyro.cli(Verify, description=__doc__))
        sys.exit(0 if found.accepted else 1)
