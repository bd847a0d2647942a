"""The tile cache: splits, keys, damage, races, and places where nothing can be written."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hda.safety.safety_map
import hda.terrain.generator
from guidance.kernel import cache_folder
from hda.ground import library as dtm_library
from hda.ground.library import (
    SPLITS,
    Ground,
    build_tile,
    check_split,
    load_tile,
    prepare_tiles,
    remove_tiles,
    tile_numbers,
)
from hda.ground.tile import Tile
from hda.safety.criteria import SafetyCriteria
from hda.terrain.base_surface import BaseSurface
from hda.terrain.craters import CraterPopulation, DepthLaw
from hda.terrain.generator import TerrainParameters
from hda.terrain.islands import IslandField
from hda.terrain.rocks import RockPopulation

SMALL_TERRAIN = TerrainParameters(
    size=100, craters=CraterPopulation(minimum_diameter=5.0, maximum_diameter=40.0)
)
SMALL = Ground(SMALL_TERRAIN, SafetyCriteria())
LAYERS = ("elevation", "probability", "deterministic")


def forget() -> None:
    """What a new process does not know."""
    dtm_library._open_or_build.cache_clear()
    dtm_library._verified.clear()


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """An empty cache of terrain, with the kernels that are compiled already."""
    kernels = cache_folder() / "kernels"
    kernels.mkdir(parents=True, exist_ok=True)
    place = tmp_path / "cache"
    place.mkdir()
    (place / "kernels").symlink_to(kernels.resolve(), target_is_directory=True)
    monkeypatch.setenv("LUNAR_HDA_CACHE", str(place))
    forget()
    yield place
    forget()


def folder_of(number: int, ground: Ground = SMALL) -> Path:
    return ground.folder() / f"tile-{number:05d}"


def assert_equal(first: Tile, second: Tile) -> None:
    assert first.number == second.number
    for name in LAYERS:
        layer, other = getattr(first, name), getattr(second, name)
        assert layer.dtype == other.dtype
        np.testing.assert_array_equal(layer, other)


def is_mapped(array: np.ndarray) -> bool:
    base: object = array
    while isinstance(base, np.ndarray) and not isinstance(base, np.memmap):
        base = base.base
    return isinstance(base, np.memmap) or type(base).__name__ == "mmap"


# Splits


def test_the_splits_never_meet_and_have_their_sizes():
    numbers = [number for split in SPLITS.values() for number in split]
    assert len(numbers) == len(set(numbers))
    assert [len(SPLITS[split]) for split in ("train", "tuning", "validation")] == [70, 60, 18]
    assert SPLITS["train"] == range(70)
    assert SPLITS["tuning"] == range(2000, 2060)
    assert SPLITS["validation"] == range(1000, 1018)
    assert SPLITS["fresh"] == range(10_000, 15_000)


@pytest.mark.parametrize(
    ("number", "split"),
    [
        (1000, "train"),
        (0, "validation"),
        (1018, "validation"),
        (2000, "train"),
        (70, "train"),
        (-1, "train"),
        (5, "fresh"),
    ],
)
def test_a_tile_of_another_split_is_refused(number, split):
    for ask in (
        lambda: load_tile(SMALL, number, split),
        lambda: check_split(number, split),
        lambda: prepare_tiles(SMALL, split, 1, [number]),
    ):
        with pytest.raises(ValueError, match=rf"^tile {number} does not belong to split '{split}'"):
            ask()
    assert not SMALL.folder().exists()


def test_every_tile_belongs_to_exactly_one_split():
    for split, numbers in SPLITS.items():
        for number in (numbers[0], numbers[-1]):
            check_split(number, split)
            for other in set(SPLITS) - {split}:
                with pytest.raises(ValueError, match=r"does not belong"):
                    check_split(number, other)


def test_an_unknown_split_is_named():
    with pytest.raises(
        ValueError, match=r"^split must be one of train, tuning, validation, fresh, got 'test'"
    ):
        tile_numbers("test")


def test_a_fresh_tile_is_built_in_memory_and_leaves_nothing_on_the_disk():
    prepare_tiles(SMALL, "fresh", 1, [10_000])
    tile = load_tile(SMALL, 10_000, "fresh")
    assert np.array_equal(tile.elevation, build_tile(SMALL, 10_000).elevation)
    assert load_tile(SMALL, 10_000, "fresh") is tile  # for the next policy of the same episode
    assert not SMALL.folder().exists()


# What is kept


def test_a_tile_is_the_terrain_of_its_number():
    tile = load_tile(SMALL, 3, "train")
    assert_equal(tile, build_tile(SMALL, 3))
    dem = hda.terrain.generator.generate_terrain(SMALL_TERRAIN, np.random.default_rng(3))
    np.testing.assert_allclose(tile.elevation, dem, atol=1e-5)
    assert float(tile.elevation.max()) == 50.0
    assert not np.array_equal(tile.elevation, load_tile(SMALL, 4, "train").elevation)


def test_a_kept_tile_is_mapped_read_only_and_equal_to_the_built_one():
    built = load_tile(SMALL, 0, "train")
    forget()
    read = load_tile(SMALL, 0, "train")
    assert read is not built
    assert_equal(read, built)
    for name in LAYERS:
        layer = getattr(read, name)
        assert is_mapped(layer)
        with pytest.raises(ValueError, match=r"read-only"):
            layer[0, 0] = 1
    assert load_tile(SMALL, 0, "train") is read


def test_a_kept_tile_is_not_built_again(monkeypatch):
    built = load_tile(SMALL, 0, "train")
    forget()
    monkeypatch.setattr(dtm_library, "build_tile", pytest.fail)
    kept = load_tile(SMALL, 0, "train")
    assert kept is not built
    np.testing.assert_array_equal(kept.elevation, built.elevation)


def test_files_hold_no_pickle_and_nothing_temporary_remains():
    for number in range(3):
        load_tile(SMALL, number, "train")
    names = sorted(path.name for path in SMALL.folder().iterdir())
    assert names == ["parameters.json", "tile-00000", "tile-00001", "tile-00002"]
    for folder in (folder_of(number) for number in range(3)):
        assert sorted(path.name for path in folder.iterdir()) == [
            "checksums.json",
            *sorted(f"{name}.npy" for name in LAYERS),
        ]
        for name in LAYERS:
            np.load(folder / f"{name}.npy", allow_pickle=False)
            assert (folder / f"{name}.npy").read_bytes().startswith(b"\x93NUMPY")
        assert set(json.loads((folder / "checksums.json").read_text())) == set(LAYERS)
    assert json.loads((SMALL.folder() / "parameters.json").read_text())["terrain"]["size"] == 100


def changed() -> list[Ground]:
    """SMALL with one parameter changed at a time."""
    terrain, criteria = SMALL_TERRAIN, SMALL.criteria
    terrains = [
        replace(terrain, size=101),
        replace(terrain, pixel_size=0.5),
        replace(terrain, maximum_elevation=51.0),
        *(replace(terrain, base_surface=b) for b in (BaseSurface(hurst=0.7), BaseSurface(rms_slope=0.03))),
        *(
            replace(terrain, craters=replace(terrain.craters, **change))
            for change in (
                {"coefficient": 0.05},
                {"exponent": 2.1},
                {"minimum_diameter": 6.0},
                {"maximum_diameter": 41.0},
                {"depth_law": DepthLaw.PIKE},
                {"depth_law": DepthLaw.STOPAR},
                {"depth_ratio_range": (0.08, 0.19)},
                {"ejecta_reach": 2.5},
            )
        ),
        *(replace(terrain, rocks=RockPopulation(area_fraction=f)) for f in (0.1, 0.1 + 1e-12)),
        *(
            replace(terrain, islands=i)
            for i in (IslandField(16.0), IslandField(15.0, -0.7), IslandField(15.0, -0.8, 0.1))
        ),
    ]
    limits = [
        replace(criteria, **change)
        for change in (
            {"footprint_diameter": 9.0},
            {"pad_diameter": 1.5},
            {"max_slope": 0.1},
            {"max_roughness": 0.31},
            {"range_noise": 0.02},
        )
    ]
    return [*(Ground(t, criteria) for t in terrains), *(Ground(terrain, c) for c in limits)]


def test_any_changed_parameter_changes_the_key():
    grounds = [SMALL, *changed()]
    assert len({ground.key for ground in grounds}) == len(grounds)
    assert len({ground.folder() for ground in grounds}) == len(grounds)


def test_a_new_format_changes_the_key(monkeypatch):
    before = SMALL.key
    monkeypatch.setattr(dtm_library, "FORMAT_VERSION", dtm_library.FORMAT_VERSION + 1)
    assert SMALL.key != before


def test_equal_parameters_have_equal_keys():
    twin = Ground(replace(SMALL.terrain), replace(SMALL.criteria))
    assert twin.key == SMALL.key
    assert replace(twin, terrain=replace(SMALL.terrain, size=99)).key != SMALL.key


# Damage


def truncate(path: Path, size: int) -> None:
    os.truncate(path, size)


def flip(path: Path, position: int, mask: int = 0x10) -> None:
    content = bytearray(path.read_bytes())
    content[position] ^= mask
    path.write_bytes(bytes(content))


def empty(folder: Path) -> None:
    for path in folder.iterdir():
        path.unlink()


DAMAGE: dict[str, Callable[[Path], object]] = {
    "empty folder": empty,
    "an empty layer": lambda folder: truncate(folder / "elevation.npy", 0),
    "half a header": lambda folder: truncate(folder / "probability.npy", 60),
    "a header alone": lambda folder: truncate(folder / "deterministic.npy", 128),
    "half a layer": lambda folder: truncate(folder / "elevation.npy", 20_000),
    "one byte short": lambda folder: truncate(folder / "elevation.npy", 40_127),
    "a flipped bit of elevation": lambda folder: flip(folder / "elevation.npy", 30_000, 1),
    "a flipped bit of probability": lambda folder: flip(folder / "probability.npy", -1),
    "a flipped bit of the verdict": lambda folder: flip(folder / "deterministic.npy", 5_000, 1),
    "a missing layer": lambda folder: (folder / "probability.npy").unlink(),
    "no checksums": lambda folder: (folder / "checksums.json").unlink(),
    "empty checksums": lambda folder: truncate(folder / "checksums.json", 0),
    "half the checksums": lambda folder: truncate(folder / "checksums.json", 20),
    "checksums of another kind": lambda folder: (folder / "checksums.json").write_text("[1, 2, 3]"),
    "a checksum too few": lambda folder: (folder / "checksums.json").write_text('{"elevation": 1}'),
    "checksums that are not text": lambda folder: (folder / "checksums.json").write_bytes(b"\xff\xfe\x00"),
    "layers exchanged": lambda folder: (folder / "elevation.npy").write_bytes(
        (folder / "probability.npy").read_bytes()
    ),
    "a pickle": lambda folder: np.save(folder / "elevation.npy", np.array([{}], dtype=object)),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_tile_is_built_again(kind):
    load_tile(SMALL, 2, "train")
    sound = {path.name: path.read_bytes() for path in folder_of(2).iterdir()}
    forget()
    DAMAGE[kind](folder_of(2))
    assert {path.name: path.read_bytes() for path in folder_of(2).iterdir()} != sound
    assert_equal(load_tile(SMALL, 2, "train"), build_tile(SMALL, 2))
    assert {path.name: path.read_bytes() for path in folder_of(2).iterdir()} == sound
    assert sorted(path.name for path in SMALL.folder().iterdir()) == ["parameters.json", "tile-00002"]


def test_no_damaged_byte_of_a_header_goes_unseen():
    """Each byte three ways: no error escapes, and what is read is what was written."""
    load_tile(SMALL, 2, "train")
    path = folder_of(2) / "elevation.npy"
    sound = path.read_bytes()
    truth = build_tile(SMALL, 2)
    refused = 0
    for position in range(72):  # what follows, to 128, is padding
        for mask in (0x01, 0x0F, 0x20 ^ sound[position]):
            flip(path, position, mask)
            forget()
            read = dtm_library._read(folder_of(2), SMALL, 2)
            refused += read is None
            if read is not None:
                assert_equal(read, truth)
            path.write_bytes(sound)
    assert refused > 150


@pytest.mark.parametrize(("position", "mask"), [(21, 2), (21, 13), (22, 15), (22, 48), (23, 24)])
def test_a_header_that_tells_another_type_is_refused(position, mask):
    """'<f4' turned into '>f4', '<i4', 'V4' and the like by one byte: the content's checksum still holds."""
    load_tile(SMALL, 2, "train")
    flip(folder_of(2) / "elevation.npy", position, mask)
    forget()
    assert dtm_library._read(folder_of(2), SMALL, 2) is None


def test_a_tile_whose_list_of_layers_is_not_its_grounds_is_built_again():
    """A list that leaves a layer out, with the sums of the others right, is not the tile that was stored."""
    load_tile(SMALL, 2, "train")
    path = folder_of(2) / "checksums.json"
    sums = json.loads(path.read_text())
    assert set(sums) == set(LAYERS)
    for wrong in ({name: sums[name] for name in LAYERS[:2]}, {**sums, "added": 0}, {}):
        path.write_text(json.dumps(wrong))
        forget()
        assert dtm_library._read(folder_of(2), SMALL, 2) is None
        assert_equal(load_tile(SMALL, 2, "train"), build_tile(SMALL, 2))


# Places


def test_where_nothing_can_be_written_a_tile_lives_in_memory(tmp_path, monkeypatch):
    wall = tmp_path / "file"
    wall.write_text("not a folder")
    monkeypatch.setenv("LUNAR_HDA_CACHE", str(wall / "below"))
    tile = load_tile(SMALL, 1, "train")
    assert not is_mapped(tile.elevation)
    assert_equal(tile, build_tile(SMALL, 1))
    assert load_tile(SMALL, 1, "train") is tile
    prepare_tiles(SMALL, "train", 1, [0, 1])


def test_a_disk_that_fills_up_leaves_nothing_behind(monkeypatch):
    real = np.save
    written = []

    def full(path, *arguments, **options):
        if written:
            raise OSError(28, "No space left on device")
        written.append(path)
        real(path, *arguments, **options)

    monkeypatch.setattr(np, "save", full)
    tile = load_tile(SMALL, 1, "train")
    assert_equal(tile, build_tile(SMALL, 1))
    assert [path.name for path in SMALL.folder().iterdir()] == ["parameters.json"]


def test_removed_tiles_are_built_again():
    first = load_tile(SMALL, 0, "train")
    remove_tiles(SMALL)
    assert not SMALL.folder().exists()
    assert_equal(load_tile(SMALL, 0, "train"), first)


# Several at once


@pytest.mark.parametrize("workers", [1, 2])
def test_missing_tiles_are_built_in_parallel_and_equal(workers, capsys):
    load_tile(SMALL, 1000, "validation")
    prepare_tiles(SMALL, "validation", workers, [1000, 1001, 1002])
    names = sorted(path.name for path in SMALL.folder().iterdir())
    assert names == ["parameters.json", "tile-01000", "tile-01001", "tile-01002"]
    assert "building validation terrain" in capsys.readouterr().out
    forget()
    for number in (1001, 1002):
        assert_equal(load_tile(SMALL, number, "validation"), build_tile(SMALL, number))
    prepare_tiles(SMALL, "validation", workers, [1000, 1001, 1002])
    assert capsys.readouterr().out == ""  # nothing to do, nothing to show


RACER = """
import os, sys, time
import hda.safety.safety_map, hda.terrain.generator
from hda.ground import library as dtm_library
from hda.terrain.craters import CraterPopulation

mine, other = sys.argv[1:]
terrain = hda.terrain.generator.TerrainParameters(
    size=100, craters=CraterPopulation(minimum_diameter=5.0, maximum_diameter=40.0)
)
ground = dtm_library.Ground(terrain, hda.safety.criteria.SafetyCriteria())
build = dtm_library.build_tile

def build_together(ground, number):
    tile = build(ground, number)
    open(mine, "w").close()
    deadline = time.monotonic() + 60.0
    while not os.path.exists(other) and time.monotonic() < deadline:
        time.sleep(0.001)
    return tile

dtm_library.build_tile = build_together  # neither stores before both have built
tile = dtm_library.load_tile(ground, 5, "train")
assert os.path.exists(other)
print(tile.elevation.tobytes().hex()[:4000], int(tile.deterministic.sum()))
"""


def test_two_processes_that_build_at_once_leave_one_good_entry(tmp_path):
    flags = [str(tmp_path / "first"), str(tmp_path / "second")]
    root = Path(dtm_library.__file__).resolve().parent.parent
    racers = [
        subprocess.Popen(
            [sys.executable, "-c", RACER, mine, other],
            stdout=subprocess.PIPE,
            text=True,
            cwd=root,
        )
        for mine, other in (flags, flags[::-1])
    ]
    answers = [racer.communicate(timeout=120)[0] for racer in racers]
    assert [racer.returncode for racer in racers] == [0, 0]
    assert answers[0] == answers[1] != ""
    assert sorted(path.name for path in SMALL.folder().iterdir()) == ["parameters.json", "tile-00005"]
    assert dtm_library._read(folder_of(5), SMALL, 5) is not None
    assert_equal(load_tile(SMALL, 5, "train"), build_tile(SMALL, 5))
