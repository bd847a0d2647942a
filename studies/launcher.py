"""`lunar-hda COMMAND`: every command of the packages under one name, each loaded when it is asked for.

`lunar-hda compare ...` is `python -m studies.compare ...`. `COMMANDS` lists them all.
"""

from __future__ import annotations

import importlib
import sys
from dataclasses import dataclass
from typing import Any

from guidance.console import tolerate_encoding

PROGRAM = "lunar-hda"
_COMPLETION = "--tyro-"


@dataclass(frozen=True)
class Command:
    """One command.

    Attributes:
        home: module with its `main` and its options.
        options: name of the options there, for the shell's completion.
        summary: what it does, in a few words.
    """

    home: str
    options: str
    summary: str


GROUPS: dict[str, dict[str, Command]] = {
    "Fly and plan": {
        "compare": Command(
            "studies.compare.command", "Comparison", "fly policies over the same episodes; the table"
        ),
        "plan": Command("guidance.pdg.__main__", "PdgCommand", "one least-propellant descent to a site"),
        "terrain": Command("hda.terrain.__main__", "show_terrain", "make a tile of ground, and draw it"),
        "film": Command("hda.flight.film", "film_flight", "fly an episode, and film it as an animated GIF"),
        "export-c": Command("guidance.export_c.__main__", "ExportCommand", "the planner as one C file"),
    },
    "Learn": {
        "train": Command("rl.train", "Command", "train an agent, and make its weights (extra `train`)"),
        "figures": Command("rl.figures.command", "Command", "pictures of trainings, gains and looks"),
        "dataset": Command("rl.dataset.command", "MakeDataset", "episodes for offline learning"),
        "model-cards": Command("rl.model_cards", "ModelCards", "the shipped weights as a page"),
        "training-speed": Command("rl.training_speed", "TrainingSpeed", "updates a second (extra `train`)"),
    },
    "Study": {
        "trade-off": Command("studies.trade_off.command", "TradeOff", "safety against propellant"),
        "robustness": Command(
            "studies.robustness.command", "Robustness", "one factor after the other is made worse"
        ),
        "faults": Command("studies.faults", "Faults", "each fault of the navigation sensors"),
        "realism": Command("studies.realism.command", "Realism", "what each layer of reality costs a policy"),
        "rare-events": Command(
            "studies.rare_events.command", "RareEvents", "how likely a policy fails, where failures are rare"
        ),
        "information-bound": Command(
            "studies.information_bound.command", "InformationBound", "how far from the best possible it is"
        ),
        "failures": Command("studies.failures.command", "Failures", "why episodes of a comparison failed"),
        "shortfall": Command(
            "studies.shortfall.command", "Shortfall", "what an agent saw of ground it failed on; moves' cost"
        ),
        "memory": Command("studies.memory.command", "MemoryStudy", "when memory helps an agent"),
        "stability": Command(
            "studies.stability.command", "Stability", "margins of ZEM/ZEV, and sampled flights"
        ),
        "closed-loop": Command("studies.closed_loop.command", "ClosedLoop", "guidance laws to a given site"),
        "rigid-plans": Command(
            "studies.rigid_plans.command", "RigidPlans", "plans for a body that must turn"
        ),
        "calibrate": Command(
            "studies.calibrate", "Calibration", "settings that give the paper's Single Divert"
        ),
        "belief-statistics": Command(
            "hda.belief_statistics", "BeliefStatistics", "what the prior belief knows"
        ),
        "looks": Command("studies.looks.command", "Looks", "what one measured look is worth"),
        "look-statistics": Command(
            "hda.look_statistics", "LookStatistics", "what the belief knows of measured looks"
        ),
        "verify": Command("studies.verify.command", "Verify", "check results: fly a share of them again"),
        "sample-size": Command("studies.sample_size", "SampleSize", "how many episodes a claim needs"),
    },
    "Measure": {
        "results": Command("studies.results.command", "MakeResults", "make the tables of docs/results again"),
        "timing": Command("studies.timing.command", "Timing", "planners against one another, by the clock"),
        "bench": Command("studies.bench.command", "Bench", "speed of the inner loops"),
        "scale": Command("studies.scale", "Scale", "episodes a second by the number of workers"),
    },
}
"""Heading -> command -> what it is."""

COMMANDS: dict[str, Command] = {name: command for group in GROUPS.values() for name, command in group.items()}


def explain() -> str:
    """What `lunar-hda --help` prints."""
    wide = max(map(len, COMMANDS))
    lines = [f"usage: {PROGRAM} COMMAND [options]", ""]
    lines += ["Landing on hazardous lunar ground: fly, plan, learn, compare.", ""]
    for heading, group in GROUPS.items():
        lines += [heading, *(f"  {name:{wide}}  {entry.summary}" for name, entry in group.items()), ""]
    lines.append(f"{PROGRAM} COMMAND --help explains its options.")
    lines.append(f"{PROGRAM} --tyro-print-completion bash (zsh, tcsh) prints a completion for your shell.")
    return "\n".join(lines) + "\n"


def complete(arguments: list[str]) -> None:
    """Let tyro print or write a completion for all commands; this alone loads every one of them."""
    import tyro

    kinds = {name: getattr(importlib.import_module(c.home), c.options) for name, c in COMMANDS.items()}
    callables = {name: kind if hasattr(kind, "__name__") else _choice(kind) for name, kind in kinds.items()}
    tyro.extras.subcommand_cli_from_dict(callables, prog=PROGRAM, args=arguments)


def _choice(kind: Any) -> Any:
    """A command that is a choice of commands, as something to call."""
    import tyro

    def choose(command: Any) -> None:
        del command

    choose.__annotations__ = {"command": tyro.conf.OmitSubcommandPrefixes[tyro.conf.OmitArgPrefixes[kind]]}
    return choose


def main() -> None:
    """Command line: run the command that the first word names."""
    tolerate_encoding()
    name, *rest = sys.argv[1:] or ["--help"]
    if name in ("-h", "--help"):
        sys.stdout.write(explain())
    elif name == "--version":
        from importlib.metadata import version

        sys.stdout.write(f"{PROGRAM} {version(PROGRAM)}\n")
    elif name.startswith(_COMPLETION):
        complete([name, *rest])
    elif name in COMMANDS:
        sys.argv = [f"{PROGRAM} {name}", *rest]  # what --help and provenance.json say
        importlib.import_module(COMMANDS[name].home).main()
    else:
        from guidance.validation import unknown_name

        sys.stderr.write(f"error: {unknown_name('command', name, COMMANDS)}\n")
        sys.exit(2)
