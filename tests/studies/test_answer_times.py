"""How long answers take: every start is answered, batches are kept, new processes are timed."""

import csv
from pathlib import Path

import numpy as np
import pytest

from guidance import PlanStatus, solve_pdg
from studies.campaign.claimed_folder import Existing
from studies.campaign.journal import open_journal
from studies.timing import answer_times
from studies.timing.answer_times import (
    KINDS,
    TARGET,
    AnswerBatch,
    measure_answers,
    sum_up,
    time_batch,
    time_new_processes,
)
from studies.timing.command import Timing, time_answers


def test_a_start_that_cannot_land_is_asked_for_the_nearest_point_too() -> None:
    batch = time_batch("harsh", 0, 40)
    assert len(batch.answers) == len(batch.seconds) > 40
    assert min(batch.seconds) > 0.0
    refused = [
        k for k, answer in enumerate(batch.answers) if answer.startswith("infeasible") and "," not in answer
    ]
    assert len(refused) > 5
    assert all(batch.answers[k + 1].endswith(", nearest asked for") for k in refused)
    assert time_batch("harsh", 0, 40).answers == batch.answers
    again = time_batch("harsh", 20, 20).answers
    assert batch.answers[-len(again) :] == again  # a start does not depend on the batch that it is in


@pytest.mark.parametrize("kind", KINDS)
def test_starts_are_what_their_kind_says(kind: str) -> None:
    rng = np.random.default_rng(0)
    landed = [
        solve_pdg(KINDS[kind](rng), TARGET, throw=False).status is PlanStatus.OPTIMAL for _ in range(60)
    ]
    assert (sum(landed) > 40) if kind == "dispersed" else (10 < sum(landed) < 50)


def test_quantiles_are_measured_values_and_no_less_than_they_say() -> None:
    row = sum_up("harsh", "optimal", [float(k) for k in range(1, 1001)])
    assert row.quantiles == (501.0, 901.0, 991.0, 1000.0)
    assert (row.count, row.greatest) == (1000, 1000.0)


def test_batches_that_are_kept_are_not_asked_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answer_times, "_BATCH", 6)
    asked: list[tuple[str, int]] = []

    def time_two(kind: str, first: int, count: int) -> AnswerBatch:
        if first < 18:  # beyond the starts it warms up
            asked.append((kind, first))
        if len(asked) == 5:
            raise KeyboardInterrupt
        return time_batch(kind, first, min(count, 2))

    monkeypatch.setattr(answer_times, "time_batch", time_two)
    batches = [(kind, first) for kind in KINDS for first in (0, 6, 12)]
    with (
        pytest.raises(KeyboardInterrupt),
        open_journal(tmp_path, AnswerBatch, (), {"processor": "mine"}, Existing.REFUSE) as journal,
    ):
        measure_answers(18, journal)
    assert asked == batches[:5]
    asked.clear()
    with open_journal(tmp_path, AnswerBatch, (), {"processor": "mine"}, Existing.RESUME) as journal:
        rows = measure_answers(18, journal)
    assert asked == batches[4:]
    assert sum(row.count for row in rows if "nearest" not in row.answer) == 12


def test_a_new_process_is_ready_once_the_planner_is_imported() -> None:
    loaded, first, second = time_new_processes(1)
    assert [row.answer for row in (loaded, first, second)] == [
        "import of solve_pdg",
        "first plan",
        "second plan",
    ]
    assert loaded.greatest > first.greatest > 0.0
    assert second.greatest > 0.0


def test_the_tables_hold_every_answer(tmp_path: Path) -> None:
    options = Timing(answers=10, processes=1, out=tmp_path)
    rows = time_answers(options, {"processor": "mine"})
    with (tmp_path / "answers" / "answers.csv").open() as stream:
        told = list(csv.DictReader(stream))
    assert [(row["starts"], row["answer"], int(row["count"])) for row in told] == [
        (row.starts, row.answer, row.count) for row in rows
    ]
    assert {row.starts for row in rows} == {"new process", *KINDS}
