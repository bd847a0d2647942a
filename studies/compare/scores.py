"""What the table, the differences, the charts and the choice of flights need, from a stream of episodes.

Nothing is kept for each episode, so a million of them need no more memory than ten thousand: ratios are
counts for each tile, means are moments (`studies.statistics.moments`), tests are counts of pairs, times and
measures are counts in bins. Chunks must come in the order of their episodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from hda.flight.episode_row import MEASURES, RATIOS, EpisodeRow
from studies.campaign.monte_carlo import Chunk
from studies.campaign.score import RunningScore, measured
from studies.compare.histograms import DecisionTimes, MeasureHistograms
from studies.statistics.moments import TileMoments
from studies.statistics.ratios import PairCounts

FAILURES_KEPT = 12
"""First failures that are remembered for each kind of ending; more than a report shows."""


@dataclass
class PolicyScore:
    """Running score of one policy beside the reference policy's.

    Attributes:
        policy: name.
        running: its own score so far.
        differences: moments of MEASURES less the reference policy's.
        pairs: safe_site, success -> this policy against the reference.
        decision_time: how long decisions took.
        failures: ending -> how many episodes ended so without success, and the first of them.
    """

    policy: str
    running: RunningScore = field(default_factory=RunningScore)
    differences: TileMoments = field(default_factory=lambda: TileMoments(len(MEASURES)))
    pairs: dict[str, PairCounts] = field(
        default_factory=lambda: {name: PairCounts(0, 0, 0, 0) for name in RATIOS}
    )
    decision_time: DecisionTimes = field(default_factory=DecisionTimes)
    failures: dict[str, tuple[int, list[int]]] = field(default_factory=dict)

    def add(self, row: EpisodeRow, reference: EpisodeRow) -> None:
        """Add an episode, with the reference policy's row of the same episode."""
        self.running.add(row)
        self.differences.add(row.tile, measured(row) - measured(reference))
        for name in RATIOS:
            self.pairs[name] = add_pair(self.pairs[name], getattr(row, name), getattr(reference, name))
        if not row.success:
            count, first = self.failures.get(row.outcome, (0, []))
            kept = [*first, row.episode] if len(first) < FAILURES_KEPT else first
            self.failures[row.outcome] = count + 1, kept


def add_pair(pairs: PairCounts, first: bool, second: bool) -> PairCounts:
    """The counts with one episode more."""
    return PairCounts(
        pairs.both + (first and second),
        pairs.only_first + (first and not second),
        pairs.only_second + (second and not first),
        pairs.neither + (not first and not second),
    )


@dataclass
class StudyScores:
    """Running scores of a study.

    Attributes:
        reference: name of the policy that the others are compared with.
        policies: name -> score.
        histograms: distributions of the measures.
        shared: rows of the episodes that every policy shows (the hardest, and the first), policy -> row.
    """

    reference: str
    policies: dict[str, PolicyScore]
    histograms: MeasureHistograms
    shared: dict[int, dict[str, EpisodeRow]] = field(default_factory=dict)
    _hardest: tuple[bool, int, int] | None = None

    @property
    def hardest(self) -> int:
        """First episode that fewest policies land safely, but some do; else the first."""
        assert self._hardest is not None
        return self._hardest[2]

    def add(self, rows: dict[str, EpisodeRow], shown: Sequence[str]) -> None:
        """Add an episode: the rows of every policy, of which `shown` are in the study's tables."""
        reference = rows[self.reference]
        if {row.episode for row in rows.values()} != {reference.episode}:
            raise ValueError("every policy must have flown the same episodes")
        for name, row in rows.items():
            self.policies[name].add(row, reference)
        own = {name: rows[name] for name in shown}
        self.histograms.add(own)
        safe = sum(row.safe_site for row in own.values())
        rank = safe == 0, safe, reference.episode
        if self._hardest is None:
            self.shared[reference.episode] = own
            self._hardest = rank
        elif rank < self._hardest:
            first = min(self.shared)
            self.shared = {first: self.shared[first], reference.episode: own}
            self._hardest = rank


def score_study(policies: Sequence[str], reference: str, chunks: Iterable[Chunk]) -> StudyScores:
    """Score a study.

    Args:
        policies: policies of the study's tables; the charts and the choice of flights look at these alone.
        reference: name of the reference policy, whose rows the chunks must hold too.
        chunks: in the order of their episodes; one is held at a time.

    Raises:
        ValueError: policies flew other episodes than the reference, or none was flown.
    """
    names = dict.fromkeys((*policies, reference))
    scores = StudyScores(
        reference, {name: PolicyScore(name) for name in names}, MeasureHistograms(tuple(policies))
    )
    for chunk in chunks:
        for name in names:
            if len(chunk.rows[name]) != len(chunk.rows[reference]):
                raise ValueError(f"policy {name!r} and {reference!r} must have flown the same episodes")
            scores.policies[name].decision_time.add(chunk.decision_time[name])
        for k in range(len(chunk.rows[reference])):
            scores.add({name: chunk.rows[name][k] for name in names}, policies)
    if not scores.shared:
        raise ValueError("no episode was flown")
    scores.histograms.finish()
    return scores
