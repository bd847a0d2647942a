"""Lines of docs/leaderboard.md: who may stand there, and what is said of them."""

from __future__ import annotations

from datetime import UTC, datetime

from studies.campaign.provenance import git_commit
from studies.verify.verification import Verification

LEADERBOARD_HEADINGS = (
    "policy",
    "preset",
    "episodes",
    "success % (by tile)",
    "safe site %",
    "propellant %",
    "commit",
    "episodes.csv, SHA-256",
    "verified",
)
"""Columns of docs/leaderboard.md."""
ENTRY_SPLITS = ("validation", "fresh")
LEAST_ENTRY_EPISODES = 1000
_DIGITS = 16


def entry_faults(found: Verification) -> list[str]:
    """Why an accepted folder may not stand on the leaderboard; empty where it may."""
    results = found.results
    assert results is not None
    study, commit, here = results.study, results.provenance.get("git_commit"), git_commit()
    told = {
        f"it was flown on {study.split} tiles": study.split in ENTRY_SPLITS,
        f"its study seed is {study.study_seed}, not 0": study.study_seed == 0,
        f"it has fewer than {LEAST_ENTRY_EPISODES} episodes": study.episodes >= LEAST_ENTRY_EPISODES,
        f"{len(found.flown)} of its episodes were flown again, not all": len(found.flown) == study.episodes,
        f"it was flown at commit {commit}, and here is {here}": commit == here and here is not None,
        "its commit has changes that nobody else has": not str(commit).endswith("+changes"),
    }
    return [fault for fault, holds in told.items() if not holds]


def leaderboard_lines(found: Verification) -> list[str]:
    """A line in Markdown for each policy of an accepted folder.

    The first is that whose success is surest: by the lower end of its interval clustered by tile.
    """
    results = found.results
    assert results is not None
    ranked = sorted(found.summaries, key=lambda one: (-one.success_by_tile.low, one.policy))
    cells = [
        (
            one.policy + (" *" if one.privileged else ""),
            one.preset,
            f"{one.episodes} {results.study.split}",
            f"{100.0 * one.success.estimate:.1f} [{100.0 * one.success_by_tile.low:.1f}-"
            f"{100.0 * one.success_by_tile.high:.1f}]",
            f"{100.0 * one.safe_site.estimate:.1f}",
            f"{one.means['propellant_percent'].estimate:.2f}",
            str(results.provenance["git_commit"])[:7],
            found.digest[:_DIGITS],
            datetime.now(UTC).date().isoformat(),
        )
        for one in ranked
    ]
    return [f"| {' | '.join(line)} |" for line in cells]
