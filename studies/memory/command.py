"""When does memory help? Trained agents with and without memory, several seeds each, on several presets.

python -m studies.memory --train list       # the commands of the runs that are missing
python -m studies.memory --train run        # train them one after the other; hours each
python -m studies.memory                    # the table and the picture
python -m studies.memory --runs runs/a runs/b rl/weights/td3.json

Each run's chosen actor flies over the validation tiles; where an agent has no runs here, the card of its
shipped weights tells how those of its seeds flew.

A run's actor is chosen on the tuning tiles, as `python -m rl.train export` does. Per preset and agent the
table gives the interquartile mean over seeds, the probability that a run with memory beats one without, and
the difference of the means with Welch's interval, by which the answer goes: three seeds of each method can
never show an improvement by its probability alone, whose interval then reaches down to 0.29.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro
from rich.console import Console

from guidance.console import tolerate_encoding
from guidance.validation import finite_number, unknown_name
from hda.task.presets import find_preset
from rl.policies.actor import shipped, weights_name
from rl.recipes import RECIPES
from rl.training.candidates import Choice
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.provenance import describe_run, write_provenance
from studies.columns import write_csv
from studies.memory.answer import GroupRow, compare_groups, conclude
from studies.memory.report import COLUMNS, draw_memory, markdown
from studies.memory.scores import collect_scores, read_progress


@dataclass(frozen=True)
class MemoryStudy:
    """Compare agents with memory to one without, over training seeds.

    Attributes:
        runs: run folders, and cards (.json) of exported weights; by default the runs of the plan under
            `root`, and for an agent that has none there the card of its shipped weights.
        agents: recipes of `python -m rl.train`; the first is the one without memory.
        presets: that they are trained on and fly.
        seeds: training seeds 0 to seeds - 1 of each agent on each preset.
        root: folder of the runs of the plan, AGENT-PRESET-SEED.
        train: list the commands of missing and unfinished runs, or run them first.
        validation_episodes: that each run's actor flies over the validation tiles.
        choice: how a run's actor is chosen on the tuning tiles.
        workers: processes that fly the candidates of a run.
        out: folder of the results.
    """

    runs: tuple[Path, ...] = ()
    agents: tuple[str, ...] = ("td3", "td3-lstm", "td3-lstm-plus")
    presets: tuple[str, ...] = ("paper", "partial")
    seeds: int = 3
    root: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("runs")
    train: Literal["no", "list", "run"] = "no"
    validation_episodes: int = 1000
    choice: Annotated[Choice, tyro.conf.arg(name="")] = field(default_factory=Choice)
    workers: int = 2
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("results/memory")


@dataclass(frozen=True)
class PlannedRun:
    """One run of the plan.

    Attributes:
        agent: recipe.
        preset: setting.
        seed: of the training.
        folder: of the run.
    """

    agent: str
    preset: str
    seed: int
    folder: Path

    @property
    def finished(self) -> bool:
        """The run is there, with its last validation."""
        if not (self.folder / "run.json").exists():
            return False
        trained, planned = read_progress(self.folder)
        return trained >= planned

    @property
    def command(self) -> list[str]:
        """What trains it, or goes on with it."""
        words = ["python", "-m", "rl.train", self.agent, "--seed", str(self.seed), "--preset", self.preset]
        words += ["--out", str(self.folder)]
        return [*words, "--resume"] if (self.folder / "run.json").exists() else words


def planned_runs(options: MemoryStudy) -> tuple[PlannedRun, ...]:
    """Every run that the study asks for."""
    return tuple(
        PlannedRun(agent, preset, seed, options.root / f"{agent}-{preset}-{seed}")
        for preset in options.presets
        for agent in options.agents
        for seed in range(options.seeds)
    )


def find_sources(options: MemoryStudy) -> tuple[Path, ...]:
    """Run folders of the plan that are there; for an agent without any on a preset, its shipped card."""
    runs: dict[tuple[str, str], list[Path]] = {}
    for run in planned_runs(options):
        there = runs.setdefault((run.agent, run.preset), [])
        if (run.folder / "run.json").exists():
            there.append(run.folder)
    cards = {key: shipped(weights_name(*key)).with_suffix(".json") for key in runs}
    return tuple(
        source
        for key, there in runs.items()
        for source in there or ([cards[key]] if cards[key].exists() else [])
    )


def _check(options: MemoryStudy) -> None:
    finite_number("seeds", options.seeds, at_least=1)
    finite_number("validation_episodes", options.validation_episodes, at_least=1)
    finite_number("workers", options.workers, at_least=1)
    for name in options.agents:
        if name not in RECIPES:
            raise ValueError(unknown_name("agent", name, RECIPES))
    if len(options.agents) < 2:
        raise ValueError("agents must name the one without memory and at least one more")
    for name in options.presets:
        find_preset(name)


def train_missing(options: MemoryStudy, console: Console) -> None:
    """List, or run, the commands of the runs of the plan that are missing or unfinished.

    Raises:
        ValueError: a training failed.
    """
    missing = [run for run in planned_runs(options) if not run.finished]
    for run in missing:
        console.print(shlex.join(run.command), markup=False, highlight=False, soft_wrap=True)
        if options.train == "run":
            done = subprocess.run([sys.executable, *run.command[1:]], check=False)
            if done.returncode:
                raise ValueError(f"the training of {run.folder} ended with exit code {done.returncode}")
    if not missing:
        console.print("every run of the plan is there")


def study_memory(options: MemoryStudy) -> tuple[GroupRow, ...]:
    """Score, compare, write scores.csv, memory.csv, memory.md and memory.png, and print the answer.

    Raises:
        ValueError: an option is out of range, there is no run, or the runs do not belong together.
        OSError: the folder cannot be written.
    """
    _check(options)
    console = Console()
    if options.train != "no":
        train_missing(options, console)
        if options.train == "list":
            return ()
    sources = options.runs or find_sources(options)
    if not sources:
        raise ValueError(
            f"no run of the plan under {options.root}, no shipped weights; --train list gives the commands"
        )
    out = open_folder(options.out)
    kept, episodes = out / "scores.csv", options.validation_episodes
    scores = collect_scores(sources, kept, episodes, options.choice, options.workers)
    reference = options.agents[0]
    rows = compare_groups(scores, reference, np.random.default_rng(0))
    sentences = conclude(rows, reference)
    sentences += [
        f"{score.source} is unfinished: {score.trained_steps} of {score.planned_steps} steps."
        for score in scores
        if score.unfinished
    ]
    found = Counter((score.preset, score.agent) for score in scores)
    sentences += [
        f"{agent} on {preset} has {found[preset, agent]} of {options.seeds} seeds."
        for preset in options.presets
        for agent in options.agents
        if found[preset, agent] < options.seeds
    ]
    write_csv(out / "memory.csv", COLUMNS, rows)
    text = markdown(rows, sentences)
    (out / "memory.md").write_text(text)
    draw_memory(rows, scores).savefig(out / "memory.png", dpi=110)
    sources_told = {"sources": [str(source) for source in sources]}
    write_provenance(out / "provenance.json", describe_run(options) | sources_told)
    console.print(text, markup=False, highlight=False, soft_wrap=True)
    console.print(f"results in {out}")
    return rows


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable("the same command goes on"):
        study_memory(tyro.cli(MemoryStudy, description=__doc__))
