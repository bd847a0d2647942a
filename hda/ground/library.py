"""The tiles of terrain that studies fly over: seeded, split, built on demand, cached per user.

A tile's number is its seed. The splits never mix: training ground, ground to tune on, ground to evaluate on,
and fresh ground for reliability runs. Every parameter of the terrain and of its assessment, and the format
version, go into the cache key, so a change of any of them builds anew. A terrain of a user's own
(`hda.ground.own_terrain`) is kept here too, under the hash of its file; its split is `own`. Fresh tiles are
many and each is flown over once: they are built in memory and dropped.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import zlib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from guidance.kernel import cache_folder
from hda.ground.own_terrain import OWN_SPLIT, OwnTerrain, add_detail, cut_tile
from hda.ground.tile import Tile, make_tile
from hda.safety.criteria import SafetyCriteria
from hda.terrain.generator import TerrainParameters, generate_terrain
from hda.worker_pool import map_in_processes

FORMAT_VERSION = 1
SPLITS: dict[str, range] = {
    "train": range(70),
    "tuning": range(2000, 2060),
    "validation": range(1000, 1018),
    "fresh": range(10_000, 15_000),
}
"""Tile numbers: `train` for learning, `tuning` for every choice, `validation` and `fresh` for evaluation
only."""

FRESH_SPLIT = "fresh"
"""Episode k of a study flies over the k-th of its tiles, so that up to 5000 episodes are independent, but for
those whose tile has no first target and is passed over for another's."""

_LAYERS = {
    "elevation": np.float32,
    "probability": np.float32,
    "deterministic": np.bool_,
    "added": np.uint8,  # where something was
}
_verified: set[Path] = set()


@dataclass(frozen=True)
class Ground:
    """What decides how a tile of a given number looks: the terrain's and the assessment's parameters."""

    terrain: TerrainParameters | OwnTerrain
    criteria: SafetyCriteria

    @property
    def key(self) -> str:
        """Cache key: a hash over every parameter and the format version."""
        return hashlib.sha256(self.description().encode()).hexdigest()[:20]

    def description(self) -> str:
        """Every parameter as JSON, sorted."""
        terrain = self.terrain.identity() if isinstance(self.terrain, OwnTerrain) else asdict(self.terrain)
        parts = {"format": FORMAT_VERSION, "terrain": terrain, "criteria": asdict(self.criteria)}
        return json.dumps(parts, sort_keys=True, indent=1, default=str)

    def folder(self) -> Path:
        """Where this ground's tiles are kept."""
        return cache_folder() / "terrain" / self.key


def tile_numbers(split: str, ground: Ground | None = None) -> Sequence[int]:
    """Tile numbers of a split; a terrain of a user's own has one split, `own`, and no other ground has it.

    Raises:
        ValueError: there is no such split, or the ground does not have it.
    """
    if ground is not None and isinstance(ground.terrain, OwnTerrain):
        if split != OWN_SPLIT:
            raise ValueError(f"split must be {OWN_SPLIT!r} for a terrain of your own, got {split!r}")
        return ground.terrain.flown_tiles
    if split == OWN_SPLIT:
        raise ValueError(f"split {OWN_SPLIT!r} needs a terrain of your own")
    if split not in SPLITS:
        raise ValueError(f"split must be one of {', '.join(SPLITS)}, got {split!r}")
    return SPLITS[split]


def check_split(number: int, split: str, ground: Ground | None = None) -> None:
    """Raise ValueError if tile `number` does not belong to `split`, so that splits never mix."""
    numbers = tile_numbers(split, ground)
    if number not in numbers:
        shown = numbers if isinstance(numbers, range) else f"{len(numbers)} tiles"
        raise ValueError(f"tile {number} does not belong to split {split!r} ({shown})")


def build_tile(ground: Ground, number: int) -> Tile:
    """Generate, or cut from the user's file, and assess one tile, without the cache."""
    terrain, kinds = ground.terrain, None
    if isinstance(terrain, OwnTerrain):
        dem = cut_tile(terrain, number)
        if terrain.detail is not None:
            added = add_detail(terrain, terrain.detail, number)
            dem, kinds = dem + added.relief, added.kinds
    else:
        dem = generate_terrain(terrain, np.random.default_rng(number))
    tile = make_tile(dem, ground.criteria, number, terrain.maximum_elevation)
    return tile if kinds is None else replace(tile, added=kinds)


def load_tile(ground: Ground, number: int, split: str) -> Tile:
    """Give one tile, memory-mapped from the cache; it is built, or built anew if corrupt, on demand.

    A fresh tile is built in memory and leaves nothing on the disk.

    Raises:
        ValueError: the tile does not belong to the split.
    """
    check_split(number, split, ground)
    return _build_in_memory(ground, number) if split == FRESH_SPLIT else _open_or_build(ground, number)


def prepare_tiles(ground: Ground, split: str, workers: int = 2, numbers: Iterable[int] | None = None) -> None:
    """Build the missing tiles of a split in parallel, with a progress bar; nothing for fresh ones.

    Args:
        ground: generator's and assessment's parameters.
        split: name of the split.
        workers: processes.
        numbers: only these tiles of the split; all of it by default.

    Raises:
        ValueError: a number does not belong to the split.
    """
    wanted = list(tile_numbers(split, ground) if numbers is None else numbers)
    for number in wanted:
        check_split(number, split, ground)
    missing = [number for number in wanted if not _tile_folder(ground, number).exists()]
    if not missing or split == FRESH_SPLIT:
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns) as progress:
        task = progress.add_task(f"building {split} terrain", total=len(missing))
        map_in_processes(
            partial(_prepare, ground),
            missing,
            workers,
            initializer=_use_one_thread,
            on_done=partial(progress.advance, task),
        )


def remove_tiles(ground: Ground) -> None:
    """Remove every cached tile of a ground; they are built again on demand."""
    _open_or_build.cache_clear()
    _build_in_memory.cache_clear()
    _verified.clear()
    shutil.rmtree(ground.folder(), ignore_errors=True)


def _use_one_thread() -> None:
    import numba

    numba.set_num_threads(1)


def _tile_folder(ground: Ground, number: int) -> Path:
    return ground.folder() / f"tile-{number:05d}"


def _prepare(ground: Ground, number: int) -> None:
    _open_or_build(ground, number)


@lru_cache(maxsize=2)
def _build_in_memory(ground: Ground, number: int) -> Tile:
    return build_tile(ground, number)


@lru_cache(maxsize=96)
def _open_or_build(ground: Ground, number: int) -> Tile:
    folder = _tile_folder(ground, number)
    tile = _read(folder, ground, number)
    if tile is not None:
        return tile
    shutil.rmtree(folder, ignore_errors=True)
    built = build_tile(ground, number)
    _store(ground, built)
    return _read(folder, ground, number) or built


def _store(ground: Ground, tile: Tile) -> None:
    """Write a tile under a temporary name and move it into place, so that no reader sees half of it."""
    folder = _tile_folder(ground, tile.number)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        (folder.parent / "parameters.json").write_text(ground.description())
        draft = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    except OSError:
        return  # no place to keep it: the tile lives in memory
    try:
        _write(draft, tile)
        os.replace(draft, folder)
    except OSError:
        shutil.rmtree(draft, ignore_errors=True)  # another process was first, or the disk is full


def _write(folder: Path, tile: Tile) -> None:
    sums: dict[str, int] = {}
    for name in _LAYERS:
        layer = getattr(tile, name)
        if layer is None:
            continue
        np.save(folder / f"{name}.npy", layer, allow_pickle=False)
        sums[name] = zlib.crc32(np.ascontiguousarray(layer).tobytes())
    (folder / "checksums.json").write_text(json.dumps(sums, sort_keys=True))


def _layers(ground: Ground) -> set[str]:
    """Names of the layers that a tile of this ground has."""
    bare = not isinstance(ground.terrain, OwnTerrain) or ground.terrain.detail is None
    return set(_LAYERS) - {"added"} if bare else set(_LAYERS)


def _read(folder: Path, ground: Ground, number: int) -> Tile | None:
    """Map a stored tile; None where there is none, a layer lacks or is damaged.

    Checksums are tested once per process.
    """
    layers = {}
    with suppress(Exception):  # a damaged header makes numpy raise errors of many kinds (EOF, token, syntax)
        sums = json.loads((folder / "checksums.json").read_text())
        if set(sums) != _layers(ground):
            return None
        for name in sums:
            kind = _LAYERS[name]
            layer = np.load(folder / f"{name}.npy", mmap_mode="r", allow_pickle=False).view(np.ndarray)
            if layer.dtype != kind or layer.ndim != 2:  # the checksum covers the content, not the header
                return None
            if folder not in _verified and zlib.crc32(layer) != sums[name]:
                return None
            layers[name] = layer
        tile = Tile(number=number, **layers)
        _verified.add(folder)
        return tile
    return None
