"""Flying a comparison before its user's eyes: code is compiled, episodes fly, the table grows.

Nothing that is shown here is written anywhere: the products are made from the folder once all is flown.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter

from rich.console import Console
from rich.table import Table

from guidance.kernel import kernel_folder
from studies.campaign.executor import OpenExecutor
from studies.campaign.monte_carlo import Chunk, Study, fly_chunk, prepare_study
from studies.campaign.points import describe_left_out, describe_retry, find_missing, fly_missing
from studies.campaign.policy_parts import compile_parts, list_parts, quick_policies
from studies.campaign.score import MEASURE_COLUMNS, RATIO_COLUMNS, RunningScore
from studies.campaign.study_folder import StudyFolder
from studies.columns import document_cell
from studies.compare.display import Phase, show_phase
from studies.statistics.ratios import wilson_interval

COMPILING_SECONDS = 25.0
"""[s] about what compiling takes, once for a version of the code; for the display alone."""
LOADING_SECONDS = 5.0
"""[s] about what loading compiled code takes."""
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


def rehearse(study: Study, console: Console, workers: int = 1) -> float:
    """Fly the first episode twice with each policy in this process, so that all code is compiled.

    Slow policies are left out. Where nothing is compiled yet and there are several workers, they compile the
    parts of the policies before. Workers of the flights then load what was compiled here, each kernel once.

    Args:
        study: what is going to be flown.
        console: where it is shown.
        workers: processes.

    Returns:
        [s] about what an episode of all policies takes, compiled.

    Raises:
        PolicyError: a policy raised something.
    """
    ready, names = is_compiled(study), quick_policies(study)
    at_once = min(workers, os.cpu_count() or 1)
    parts = [] if ready or at_once == 1 else list_parts(study)
    title = "loading compiled code" if ready else "compiling, once for this version of the code"
    expected = LOADING_SECONDS if ready else COMPILING_SECONDS
    seconds = 0.0
    phase = Phase(title, len(parts) + len(names), expected, steady=False)
    with show_phase(console, phase) as display:
        if parts:
            compile_parts(study, parts, at_once, partial(display.advance, 1))
        for name in names:
            alone = replace(study, policies=(name,))
            fly_chunk(alone, 0, 1)
            began = perf_counter()
            fly_chunk(alone, 0, 1)
            seconds += perf_counter() - began
            display.advance(1)
    with suppress(OSError, UnicodeError):  # nowhere to write, or a name of odd bytes: it is rehearsed again
        kernel_folder().mkdir(parents=True, exist_ok=True)
        flown = sorted(_read_flown() | _lines_of(study))
        _flown_before().write_text("".join(f"{line}\n" for line in flown), encoding="utf-8")
    return seconds


def is_compiled(study: Study) -> bool:
    """Whether each policy has flown on the preset at these sources on this machine: its code loads."""
    return _lines_of(study) <= _read_flown()


def _flown_before() -> Path:
    """What a rehearsal flew, a preset and a policy a line, beside the code that it compiled."""
    return kernel_folder() / "rehearsed.txt"


def _lines_of(study: Study) -> set[str]:
    """The preset's name and that of each policy: a preset decides what of a policy is compiled."""
    return {f"{study.preset.name} {name}" for name in quick_policies(study)}


def _read_flown() -> set[str]:
    try:
        return set(_flown_before().read_text(encoding="utf-8").splitlines())
    except (OSError, UnicodeError):
        return set()


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
