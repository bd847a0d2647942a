"""Fly policies, and write what they saw, did and were paid for as a dataset for offline learning.

python -m rl.dataset --policies td3 td3-lstm-plus random --episodes 10000
python -m rl.dataset --policies td3 random --episodes 10000 --out results/dataset --resume

Writes into the folder `dataset.npz` (plain arrays), `minari/` (HDF5 in Minari's form; needs the extra
`offline`: pip install 'lunar-hda[offline]'), `card.json` and `README.md`, the data card.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from guidance.console import one_line_errors, tolerate_encoding
from guidance.validation import finite_number

if TYPE_CHECKING:
    from rich.progress import Progress

    from rl.dataset.data_card import DatasetIdentity
    from rl.dataset.flights import Block
    from rl.dataset.plain_file import Dataset

BLOCK_EPISODES = 200


@dataclass(frozen=True)
class MakeDataset:
    """Fly policies, and write a dataset for offline learning.

    Attributes:
        policies: agents that move gains, clock and target, and `random`, uniform actions. Each flies the same
            episodes.
        episodes: of each policy.
        preset: setting to fly.
        split: tile split. By default the one that agents learn on: what has learnt from evaluation tiles
            cannot be judged on them.
        study_seed: of the study whose episodes are flown.
        out: folder.
        workers: processes; the numbers do not depend on them.
        minari: also write Minari's file.
        resume: go on with what is in the folder.
    """

    policies: tuple[str, ...] = ("td3", "td3-lstm-plus", "random")
    episodes: int = 10_000
    preset: str = "paper"
    split: str = "train"
    study_seed: int = 0
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = field(default=Path("results/dataset"))
    workers: int = 2
    minari: bool = True
    resume: bool = False


def run_dataset(options: MakeDataset, command: str) -> None:
    """Run the command.

    Args:
        options: what is asked for.
        command: the line that asked, for the card.

    Raises:
        ValueError: an option is out of range, or the folder holds another dataset.
        OfflineLibrariesError: Minari's file is asked for and its libraries are not installed.
    """
    from rich.console import Console
    from rich.progress import Progress

    from rl.dataset.data_card import describe_dataset, identify_dataset
    from rl.dataset.minari_file import write_minari
    from rl.dataset.plain_file import write_dataset

    _check(options)
    _prepare_ground(options)
    identity = identify_dataset(options.preset, options.split, options.study_seed, options.policies)
    dataset, folder = _find_finished(options, identity), options.out / "minari"
    with Progress() as progress:
        if dataset is None:
            parts = _open_parts(options, identity)
            dataset = _fly_dataset(options, {**identity.json, "command": command}, parts, progress)
            rmtree(folder, ignore_errors=True)  # of another dataset, if there is one
            write_dataset(options.out / "dataset.npz", dataset)
        data = dataset.transitions
        if options.minari and not folder.exists():
            bar = progress.add_task("Minari's file", total=data.length.size)
            write_minari(folder, dataset, partial(progress.advance, bar))
    (options.out / "card.json").write_text(json.dumps(dataset.card, indent=1, sort_keys=True) + "\n")
    (options.out / "README.md").write_text(describe_dataset(dataset.card), encoding="utf-8")
    rmtree(options.out / "parts", ignore_errors=True)
    Console().print(f"wrote {options.out}: {data.length.size} episodes, {len(data.actions)} steps")


def _find_finished(options: MakeDataset, identity: DatasetIdentity) -> Dataset | None:
    """What an earlier call has flown to the end; None where none has. Nothing is written.

    Raises:
        ValueError: it is another dataset, or `resume` is not set.
    """
    from rl.dataset.plain_file import read_dataset

    file, asked = options.out / "dataset.npz", {**identity.json, "episodes": options.episodes}
    if not file.exists():
        return None
    _ask_for_resume(options)
    found = read_dataset(file, most_bytes=sys.maxsize)  # a file of this command's own
    if {name: found.card.get(name) for name in asked} != asked:
        raise ValueError(f"{options.out} holds another dataset: pass another --out")
    return found


def _ask_for_resume(options: MakeDataset) -> None:
    """Refuse to go on with a folder unasked."""
    if not options.resume:
        raise ValueError(
            f"{options.out} already holds a dataset: pass --resume to go on with it, or another --out"
        )


def _fly_dataset(options: MakeDataset, card: dict[str, Any], parts: Path, progress: Progress) -> Dataset:
    """Fly what is missing of all episodes, and join them.

    Raises:
        OSError: a file of episodes is gone again.
    """
    from rl.dataset.data_card import score_policies
    from rl.dataset.flights import read_block
    from rl.dataset.plain_file import Dataset
    from rl.dataset.transitions import join_transitions

    blocks = _fly_blocks(options, parts, progress)
    kept = [part for block in blocks if (part := read_block(block)) is not None]
    if len(kept) != len(blocks):
        raise OSError(f"{parts} has lost files as episodes were flown: pass --resume to fly them again")
    data = join_transitions(kept)
    scores = [asdict(score) for score in score_policies(data, options.policies)]
    return Dataset({**card, "episodes": options.episodes, "scores": scores}, data)


def _check(options: MakeDataset) -> None:
    """Refuse what cannot be flown or written.

    Raises:
        ValueError: an option is out of range.
        OfflineLibrariesError: as of `run_dataset`.
    """
    from rl.dataset.behaviours import find_behaviour
    from rl.dataset.minari_file import require_offline_libraries

    for name, least in (("episodes", 1), ("workers", 1), ("study_seed", 0)):
        finite_number(name, getattr(options, name), at_least=least)
    if not options.policies or len(set(options.policies)) != len(options.policies):
        raise ValueError(f"policies must name each one once, got {' '.join(options.policies)}")
    for name in options.policies:
        find_behaviour(name)
    if options.minari:
        require_offline_libraries()


def _prepare_ground(options: MakeDataset) -> None:
    """Build the tiles, before processes share them.

    Raises:
        ValueError: there is no such preset or split.
    """
    from hda.ground.library import Ground, prepare_tiles, tile_numbers
    from hda.task.presets import find_preset

    preset = find_preset(options.preset)
    ground = Ground(preset.terrain, preset.criteria)
    tile_numbers(options.split, ground)
    prepare_tiles(ground, options.split)


def _open_parts(options: MakeDataset, identity: DatasetIdentity) -> Path:
    """Where the finished blocks are kept. Without a readable record of whose they are they are flown anew.

    Raises:
        ValueError: there are some and `resume` is not set, or they are of other data.
    """
    parts = options.out / "parts"
    record = parts / "identity.json"
    if record.exists():
        _ask_for_resume(options)
    begun = _read_record(record)
    if begun is None:
        rmtree(parts, ignore_errors=True)
    elif begun != identity.json:
        raise ValueError(
            f"{options.out} was begun with other policies, ground, seed or software: pass another --out"
        )
    parts.mkdir(parents=True, exist_ok=True)
    draft = record.with_suffix(".draft")
    draft.write_text(json.dumps(identity.json, sort_keys=True))
    draft.replace(record)
    return parts


def _read_record(record: Path) -> Any:
    """What the blocks beside a record are of; None where none can be read."""
    try:
        return json.loads(record.read_text())
    except (OSError, ValueError, RecursionError):
        return None


def _fly_blocks(options: MakeDataset, parts: Path, progress: Progress) -> list[Block]:
    """Fly the blocks that are not there yet; give all of them, in order."""
    from hda.worker_pool import map_in_processes
    from rl.dataset.flights import Block, fly_block, read_block

    whole = Block(options.preset, options.split, options.study_seed, "", 0, 0, 0, parts)
    blocks = [
        replace(
            whole,
            policy=name,
            place=place,
            first=first,
            last=min(first + BLOCK_EPISODES, options.episodes),
            file=parts / f"{name}-{first:08d}.npz",
        )
        for place, name in enumerate(options.policies)
        for first in range(0, options.episodes, BLOCK_EPISODES)
    ]
    missing = [block for block in blocks if read_block(block) is None]
    bar = progress.add_task("blocks of episodes", total=len(blocks), completed=len(blocks) - len(missing))
    map_in_processes(fly_block, missing, options.workers, on_done=partial(progress.advance, bar))
    return blocks


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    options = tyro.cli(MakeDataset, description=__doc__)
    with one_line_errors():
        run_dataset(options, " ".join(["python -m rl.dataset", *sys.argv[1:]]))
