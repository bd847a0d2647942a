"""Check a results folder, and fly a random share of its episodes again: are they equal to the byte?

The folder is one of `studies.compare`, or a point of another study on a preset as it stands. First it must
agree with itself: the checksums, the rows of every episode, the tables that follow from them. Then it must be
of this software: versions, preset, sources, weights. Then episodes that are drawn now fly again with every
policy of the folder. A policy named by a path `package.module:Name` is imported and run. Exit code 1:
refused, or no entry for the leaderboard.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console

from guidance.console import tolerate_encoding
from studies.campaign.command_line import resumable
from studies.verify.checks import list_unchecked
from studies.verify.entries import entry_faults, leaderboard_lines
from studies.verify.flights import chance_of_notice
from studies.verify.verification import verify_results


@dataclass(frozen=True)
class Verify:
    """Command line.

    Attributes:
        results: the folder.
        share: of the episodes that fly again, 0 to 1.
        least: so many episodes fly again at least, as far as there are.
        seed: of the draw; one that nobody can know by default. It is printed.
        workers: processes; changes nothing but the time.
        entry: fly every episode again, and print the lines for docs/leaderboard.md if the folder is accepted
            and may stand there: validation or fresh tiles, study seed 0, 1000 episodes at least, a commit
            without changes, which is checked out here.
    """

    results: Annotated[Path, tyro.conf.Positional]
    share: float = 0.02
    least: int = 20
    seed: int | None = None
    workers: int = 2
    entry: bool = False


def show_verification(options: Verify) -> bool:
    """Verify the folder and print what was found.

    Returns:
        Whether it is accepted, and has an entry for the leaderboard if that was asked for.

    Raises:
        ValueError: an option is out of range.
    """
    seed = np.random.SeedSequence().entropy if options.seed is None else options.seed
    found = verify_results(
        options.results,
        np.random.default_rng(seed),
        share=1.0 if options.entry else options.share,
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
            f"not checked, but for its checksum: {', '.join(list_unchecked(options.results)) or 'nothing'}\n"
            f"flown again: {len(found.flown)} of {episodes} episodes, drawn by seed {seed}\n"
            f"had {altered} of {episodes} episodes been altered, one of them would be among these with"
            f" probability {chance:.2f}; --share asks for more"
        )
    console.print(f"{options.results} is {'verified' if found.accepted else 'refused'}")
    if not (options.entry and found.accepted):
        return found.accepted
    faults = entry_faults(found)
    lines = [f"no entry for the leaderboard: {'; '.join(faults)}"] if faults else leaderboard_lines(found)
    console.print("\n".join(lines))
    return not faults


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2, a refused one exit code 1."""
    tolerate_encoding()
    with resumable("nothing was written"):
        sys.exit(0 if show_verification(tyro.cli(Verify, description=__doc__)) else 1)
