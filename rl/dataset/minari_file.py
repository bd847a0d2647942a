"""The dataset in Minari's form: HDF5, which d3rlpy, TorchRL and others read.

It is written from buffers of arrays, which asks for no JAX. It is never read here: Minari's
`recover_environment` makes whatever a file names as its environment, which may be any code.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from shutil import rmtree
from typing import Any
from warnings import catch_warnings, simplefilter

import gymnasium

from rl.dataset.plain_file import Dataset

OFFLINE_LIBRARIES = ("minari", "h5py")
"""Modules of the extra `offline`."""
_FOLDER = "MINARI_DATASETS_PATH"


class OfflineLibrariesError(ImportError, ValueError):
    """A file of Minari's was asked for without the libraries that write it."""


def require_offline_libraries() -> None:
    """Refuse where a library is missing; none is imported.

    Raises:
        OfflineLibrariesError: names what is missing, and the line that installs it.
    """
    missing = [name for name in OFFLINE_LIBRARIES if find_spec(name) is None]
    if missing:
        raise OfflineLibrariesError(
            f"Minari's file needs {', '.join(missing)}; install the extra with:"
            " pip install 'lunar-hda[offline]', or pass --no-minari"
        )


def minari_name(preset: str) -> str:
    """The dataset's id, by which `minari.load_dataset` finds it."""
    return f"lunar-hda/{preset}-v0"


def write_minari(folder: Path, dataset: Dataset, on_done: Callable[[], None] = lambda: None) -> Path:
    """Write the dataset below a folder, which `MINARI_DATASETS_PATH` then names; what was there is replaced.

    Args:
        folder: root of Minari's datasets.
        dataset: with the card that `rl.dataset.data_card.identify_dataset` begins.
        on_done: called after each episode.

    Returns:
        The folder of the dataset itself.

    Raises:
        OfflineLibrariesError: Minari or h5py is not installed.
    """
    require_offline_libraries()
    buffers, draft = import_module("minari.data_collector").EpisodeBuffer, folder.with_name(f".{folder.name}")
    rmtree(draft, ignore_errors=True)
    card, data = dataset.card, dataset.transitions
    name = minari_name(card["preset"])

    def episodes() -> Iterator[Any]:
        for number in range(data.length.size):
            flown = data.one(number)
            yield buffers(
                observations=flown.observations,  # type: ignore[arg-type] - arrays do as well as lists
                actions=flown.actions,
                rewards=flown.rewards,
                terminations=flown.terminated,
                truncations=flown.truncated,
            )
            on_done()

    with _minari_folder(draft), catch_warnings():
        simplefilter("ignore", UserWarning)  # asks for an author and a link, which only the user could give
        written = import_module("minari").create_dataset_from_buffers(
            name,
            episodes(),
            env=_specification(card["preset"], card["split"]),
            algorithm_name=", ".join(policy["name"] for policy in card["policies"]),
            description=f"{card['command']}; what else is known of it stands in card.json beside it",
            requirements=["lunar-hda"],
            jpeg_encoding=False,
        )
        written.storage.update_episode_metadata(_describe_episodes(dataset))
    rmtree(folder, ignore_errors=True)
    draft.replace(folder)
    return folder / name


def _specification(preset: str, split: str) -> Any:
    """Of the environment that was flown, whose strings are JSON."""
    env = gymnasium.make("rl:LunarHDA-v0", preset=preset, split=split)
    env.close()
    return env.spec


def _describe_episodes(dataset: Dataset) -> Iterator[dict[str, Any]]:
    card, data = dataset.card, dataset.transitions
    names = [policy["name"] for policy in card["policies"]]
    columns = zip(*(getattr(data, name).tolist() for name in _KEPT), strict=True)
    for policy, *numbers in columns:
        beside = dict(zip(_KEPT[1:], numbers, strict=True))
        yield {"policy": names[policy], "study_seed": card["study_seed"], **beside}


_KEPT = ("policy", "episode", "tile", "ending", "safe_site")


@contextmanager
def _minari_folder(folder: Path) -> Iterator[None]:
    """Where Minari writes meanwhile."""
    before = os.environ.get(_FOLDER)
    folder.mkdir(parents=True, exist_ok=True)
    os.environ[_FOLDER] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[_FOLDER]
        else:
            os.environ[_FOLDER] = before
