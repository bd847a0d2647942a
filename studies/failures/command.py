"""The failed episodes of a study one by one: a picture of each, and its cause in words.

Reads the folder of a comparison (or of a point of another study), flies the failures again, and writes
failures.md, failures.csv and one PNG per failure. Causes are computed from the record and the true map, and
from flying the same episode with a noiseless map or an exact engine (`studies.failures.causes`).
"""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import track

from guidance.console import tolerate_encoding
from guidance.validation import finite_number, unknown_name
from hda.flight.episode import fly
from hda.flight.outcome import ENDINGS
from hda.task.presets import PRESETS, Preset
from hda.task.scenario import sample_scenario
from studies.campaign.command_line import one_line_errors, open_folder
from studies.campaign.monte_carlo import Study
from studies.campaign.provenance import describe_run, write_provenance
from studies.campaign.shards import read_shard
from studies.columns import Column, field_columns, write_csv
from studies.failures.causes import Cause, Failure, explain_failure, find_remedies


@dataclass(frozen=True)
class Failures:
    """Command line.

    Attributes:
        study: folder of a study of a named preset.
        policies: names of policies in it; all of them by default.
        most: failures shown of each policy, the first ones.
        out: folder for results; DIR/failures by default.
        figures: draw the pictures.
    """

    study: Path
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ()
    most: int = 40
    out: Path | None = None
    figures: bool = True

    def __post_init__(self) -> None:
        """Check every number."""
        finite_number("most", self.most, at_least=1)


def read_study(folder: Path) -> tuple[Study, dict[str, list[int]]]:
    """The study in a folder, and the failed episodes of each of its policies that have been flown.

    Raises:
        ValueError: the folder holds no study, or one of a preset that is not a named one as it is today.
    """
    path = folder / "shards" / "study.json"
    try:
        held = json.loads(path.read_text())
        told = held["study"]
        preset = find_held_preset(held["preset"])
        study = Study(
            preset,
            tuple(told["policies"]),
            int(told["episodes"]),
            int(told["study_seed"]),
            told["split"],
            tuple(told["paths"]),
        )
    except FileNotFoundError:
        raise ValueError(f"study {folder} holds no study: there is no {path}") from None
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise ValueError(f"study {folder} is damaged: {type(error).__name__}: {error}") from error
    failed: dict[str, list[int]] = {name: [] for name in study.policies}
    for shard in sorted((folder / "shards").glob("episodes-*.jsonl")):
        for name, rows in read_shard(shard)[0].rows.items():
            failed[name] += [row.episode for row in rows if not row.success]
    return study, failed


def find_held_preset(held: dict[str, object]) -> Preset:
    """The named preset that a study was flown with.

    Raises:
        ValueError: there is no such preset, or it has other numbers today.
    """
    name = str(held["name"])
    if name not in PRESETS:
        raise ValueError(unknown_name("preset", name, PRESETS))
    today = json.loads(json.dumps(asdict(PRESETS[name]), default=str))
    changed = _changed(held, today)
    if changed:
        raise ValueError(f"preset {name!r} has other numbers today, so it cannot fly again: {changed}")
    return PRESETS[name]


def _changed(held: object, today: object, name: str = "preset") -> str:
    """Name of the first number of a held preset that is another today; what is new today does not count."""
    if isinstance(held, dict) and isinstance(today, dict):
        return next(filter(None, (_changed(held[key], today.get(key), f"{name}.{key}") for key in held)), "")
    return "" if held == today else name


def describe_failure(failure: Failure) -> str:
    """The cause in a sentence or two."""
    words = f"{ENDINGS[failure.ending].capitalize()} ({failure.touchdown_speed_mps:.2f} m/s)."
    words += f" {failure.cause.value[0].upper()}{failure.cause.value[1:]}."
    if failure.cause in (Cause.MISREAD, Cause.KNOWN_HAZARD, Cause.BETWEEN_PIXELS):
        words += f" It read {failure.last_reading:.2f}, {failure.last_reading_s:.1f} s before touchdown."
    if failure.safe_cells_seen:
        words += (
            f" Looks had shown {failure.safe_cells_seen} safe cells,"
            f" {failure.safe_cells_in_reach} of them within reach."
        )
    words += f" The site last changed {failure.last_change_s:.1f} s before touchdown."
    if failure.remedies:
        words += f" A success with {' or with '.join(failure.remedies)}."
    return words


def show_failures(options: Failures) -> dict[str, list[Failure]]:
    """Explain and draw the failures of a study.

    Raises:
        ValueError: the folder holds no study that can be flown again, or a policy is not in it.
        OSError: the folder cannot be written.
    """
    study, failed = read_study(options.study)
    for name in options.policies:
        if name not in failed:
            raise ValueError(unknown_name("policy", name, failed))
    chosen = options.policies or study.policies
    out = open_folder(options.out or options.study / "failures")
    explained: dict[str, list[Failure]] = {name: [] for name in chosen}
    pairs = [(name, episode) for name in chosen for episode in failed[name][: options.most]]
    for name, episode in track(pairs, "failures", transient=True):
        record = fly(
            study.make_policy(name), sample_scenario(study.preset, study.study_seed, episode, study.split)
        )
        failure = explain_failure(record)
        failure = replace(failure, remedies=find_remedies(study, name, record))
        explained[name].append(failure)
        if options.figures:
            from studies.failures.picture import draw_failure

            figure = draw_failure(record, describe_failure(failure))
            figure.savefig(out / picture_name(name, episode), dpi=75)
    rows = [(name, failure) for name, failures in explained.items() for failure in failures]
    write_csv(out / "failures.csv", COLUMNS, rows)
    flown = {name: len(failed[name]) for name in chosen}
    write_markdown(out / "failures.md", study, explained, flown, options.figures)
    write_provenance(out / "provenance.json", describe_run(options))
    return explained


def picture_name(policy: str, episode: int) -> str:
    """File name of a failure's picture."""
    return f"{policy}-{episode:06d}.png"


COLUMNS: tuple[Column[tuple[str, Failure]], ...] = (
    Column("policy", "policy", lambda row: row[0]),
    *(column.through(lambda row: row[1]) for column in field_columns(Failure) if column.key != "remedies"),
    Column("remedies", "remedies", lambda row: "; ".join(row[1].remedies)),
)
"""failures.csv: policy and failure, a field a column."""


def write_markdown(
    path: Path, study: Study, explained: dict[str, list[Failure]], failed: dict[str, int], figures: bool
) -> None:
    """Write the causes counted, then every failure."""
    lines = [
        f"Failed episodes, preset {study.preset.name}, split {study.split}, study seed {study.study_seed}"
    ]
    for policy, failures in explained.items():
        shown = f"the first {len(failures)}" if len(failures) < failed[policy] else "all"
        lines += ["", f"## {policy}: {failed[policy]} failed, {shown} shown", ""]
        counts = Counter(failure.cause.value for failure in failures)
        lines += [f"- {count} x {cause}" for cause, count in counts.most_common()]
        lines += ["", "| episode | tile | ending | why |", "|---:|---:|---|---|"]
        for failure in failures:
            number = str(failure.episode)
            link = f"[{number}]({picture_name(policy, failure.episode)})" if figures else number
            lines.append(f"| {link} | {failure.tile} | {failure.ending} | {describe_failure(failure)} |")
    path.write_text("\n".join(lines) + "\n")


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with one_line_errors():
        options = tyro.cli(Failures, description=__doc__)
        explained = show_failures(options)
        console = Console()
        for policy, failures in explained.items():
            counts = Counter(failure.cause.value for failure in failures)
            words = "; ".join(f"{count} x {cause}" for cause, count in counts.most_common()) or "none"
            console.print(f"{policy}: {words}", highlight=False, markup=False)
        console.print(f"pictures and causes in {options.out or options.study / 'failures'}", markup=False)
