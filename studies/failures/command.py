"""The failed episodes of a study one by one: a picture of each, and its cause in words.

Reads the folder of a comparison (or of a point of another study), flies the failures again, and writes
failures.md, failures.csv and one PNG per failure. Causes are computed from the record and the true map, and
from flying the same episode with a noiseless map or an exact engine (`studies.failures.causes`).
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.progress import track

from guidance.console import tolerate_encoding
from guidance.validation import finite_number, unknown_name
from hda.flight.episode import fly
from hda.task.presets import PRESETS, Preset
from hda.task.scenario import sample_scenario
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.journal import Journal, open_journal
from studies.campaign.monte_carlo import Study
from studies.campaign.provenance import describe_run, identify_run, restore_study, write_provenance
from studies.campaign.run_options import KeepingOptions
from studies.campaign.shards import read_shard, write_durably
from studies.columns import write_csv
from studies.failures.causes import Failure, count_causes, explain_failure, find_remedies
from studies.failures.table import COLUMNS, describe_failure, picture_name, write_markdown

_PRODUCTS = (
    "failures.csv",
    "failures.md",
    "provenance.json",
    "*-[0-9][0-9][0-9][0-9][0-9][0-9].png",
    ".*.png.*",
)


@dataclass(frozen=True)
class Failures(KeepingOptions):
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
        study = restore_study(held["study"], find_held_preset(held["preset"]))
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


def show_failures(options: Failures) -> dict[str, list[Failure]]:
    """Explain and draw the failures of a study.

    Raises:
        ValueError: the folder holds no study that can be flown again, a policy is not in it, or the folder
            for results holds other failures.
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
    with open_journal(out, Failure, _PRODUCTS, identify_failures(study), options.existing) as journal:
        for name, episode in track(pairs, "failures", transient=True):
            picture = out / picture_name(name, episode) if options.figures else None
            explained[name].append(show_failure(study, name, episode, journal, picture))
        rows = [(name, failure) for name, failures in explained.items() for failure in failures]
        write_csv(out / "failures.csv", COLUMNS, rows)
        flown = {name: len(failed[name]) for name in chosen}
        write_markdown(out / "failures.md", study, explained, flown, options.figures)
        write_provenance(out / "provenance.json", {**describe_run(options), "work": journal.describe()})
    return explained


def identify_failures(study: Study) -> dict[str, Any]:
    """All that decides what a failed episode is: how many of them there are does not."""
    decided = {
        "preset": study.preset.name,
        "study_seed": study.study_seed,
        "split": study.split,
        "paths": list(study.paths),
    }
    return identify_run(Path(__file__).parent, decided, study.paths)


def show_failure(
    study: Study, policy: str, episode: int, journal: Journal[Failure], picture: Path | None
) -> Failure:
    """Explain a failed episode and draw it, as far as that is not done; it is flown again for either.

    Args:
        study: what was flown.
        policy: its name.
        episode: number.
        journal: of explained failures; the explanation goes there at once.
        picture: file of the picture, drawn where it is missing; None for none.
    """
    key, lacks_picture = (policy, episode), picture is not None and not picture.exists()
    found = journal.find(key)
    if found is not None and not lacks_picture:
        return found
    scenario = sample_scenario(study.preset, study.study_seed, episode, study.split)
    record = fly(study.make_policy(policy), scenario)

    def explain() -> Failure:
        return replace(explain_failure(record), remedies=find_remedies(study, policy, record))

    failure = journal.finish(key, explain)
    if picture is not None and lacks_picture:
        from studies.failures.picture import draw_failure

        drawn = BytesIO()
        draw_failure(record, describe_failure(failure)).savefig(drawn, dpi=75)
        write_durably(picture, drawn.getvalue())
    return failure


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        options = tyro.cli(Failures, description=__doc__)
        explained = show_failures(options)
        console = Console()
        for policy, failures in explained.items():
            words = "; ".join(count_causes(failures)) or "none"
            console.print(f"{policy}: {words}", highlight=False, markup=False)
        console.print(f"pictures and causes in {options.out or options.study / 'failures'}", markup=False)
