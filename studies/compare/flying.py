"""Flying a comparison before its user's eyes: code is compiled, episodes fly, the table grows.

Nothing that is shown here is written anywhere: the products are made from the folder once all is flown.
"""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial

from rich.console import Console
from rich.table import Table

from studies.campaign.executor import OpenExecutor
from studies.campaign.monte_carlo import Chunk, prepare_study
from studies.campaign.points import describe_left_out, describe_retry, find_missing, fly_missing
from studies.campaign.score import MEASURE_COLUMNS, RATIO_COLUMNS, RunningScore
from studies.campaign.study_folder import StudyFolder
from studies.columns import document_cell
from studies.compare.display import Phase, show_phase
from studies.compare.rehearsal import LOADING_SECONDS, is_compiled, rehearse
from studies.statistics.ratios import wilson_interval

_FEW_CHUNKS = 2  # so few fly sooner than they are rehearsed
_COLUMNS = [
    replace(column, by_tile=None)
    for column in (*RATIO_COLUMNS, *MEASURE_COLUMNS)
    if column.key in ("safe_site_percent", "success_percent", "propellant_percent", "touchdown_speed_mps")
]


def fly_comparison(folder: StudyFolder, open_executor: OpenExecutor, here: bool, workers: int) -> None:
    """Fly what a folder's study still lacks; every chunk goes to the folder at once.

    Args:
        folder: open folder of the study.
        open_executor: makes what flies the episodes.
        here: it is this machine: terrain and compiled code are made ready first. The workers of a cluster
            make what they meet.
        workers: processes.

    Raises:
        ValueError: a policy or a worker failed.
    """
    console, study, missing = Console(), folder.study, find_missing(folder)
    if not missing:
        return
    seconds = None
    if here:
        ready = is_compiled(study)
        if ready:
            prepare_study(study, workers)
        if len(missing) > _FEW_CHUNKS or not ready:
            seconds = rehearse(study, console, workers)
        if not ready:
            prepare_study(study, workers)  # the rehearsal has compiled its kernels too, in one process
    lacking = sum(last - first for first, last in missing)
    kept = study.episodes - lacking
    at_once = min(workers, os.cpu_count() or 1)
    expected = None if seconds is None else seconds * lacking / at_once + LOADING_SECONDS * (workers > 1)
    with show_phase(
        console, Phase("episodes", study.episodes, expected, completed=kept, kept=kept)
    ) as display:
        wilson_interval(0, 1)  # loads scipy.stats, 1 s: not later, while workers wait for their next chunks
        scores = {name: RunningScore() for name in study.policies}
        named: set[int] = set()

        def tell(chunk: Chunk) -> None:
            for name, rows in chunk.rows.items():
                for row in rows:
                    scores[name].add(row)
            display.advance(
                chunk.last - chunk.first, partial(_table_so_far, scores), partial(_ratios_so_far, scores)
            )
            for words in (describe_retry(chunk), describe_left_out(chunk, study, named)):
                if words:
                    display.print(words)

        fly_missing(folder, missing, open_executor, workers, tell)


def _table_so_far(running: dict[str, RunningScore]) -> Table:
    """A line for each policy, over the episodes that this run has flown."""
    flown = next(iter(running.values())).episodes
    table = Table(title=f"after {flown} episodes (95 % intervals)", title_justify="left")
    table.add_column("policy", no_wrap=True)
    for column in _COLUMNS:
        table.add_column(column.title, justify="right", no_wrap=True)
    for name, one in running.items():
        score = one.collect()
        table.add_row(name, *(document_cell(column, score) for column in _COLUMNS))
    return table


def _ratios_so_far(running: dict[str, RunningScore]) -> str:
    """The same in a line, shorter."""
    ratio = _COLUMNS[0]
    cells = (f"{name} {ratio.text(one.collect())}" for name, one in running.items())
    return f"{ratio.title}: {', '.join(cells)}"
