"""Work spread over processes, from wherever a library is called."""

import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from hda.worker_pool import map_in_processes

ROOT = Path(__file__).parents[2]

UNGUARDED = """
import os
from pathlib import Path
from hda import Ground, SafetyCriteria, TerrainParameters, load_tile, prepare_tiles
from hda.terrain.craters import CraterPopulation
from hda.worker_pool import map_in_processes

print("started")
terrain = TerrainParameters(size=100, craters=CraterPopulation(minimum_diameter=5.0, maximum_diameter=40.0))
ground = Ground(terrain, SafetyCriteria())
prepare_tiles(ground, "train", 2, [0, 1, 2])
print(sorted(path.name for path in ground.folder().glob("tile-*")))
places = map_in_processes(os.path.abspath, ["a", "b"], 2)
print("all", len(places))
"""


@pytest.mark.parametrize("how", ["script", "pipe", "command", "prompt"])
def test_a_call_works_without_a_main_guard(how: str, tmp_path: Path, cache: Path) -> None:
    (tmp_path / "script.py").write_text(UNGUARDED)
    commands = {"script": ["script.py"], "pipe": ["-"], "command": ["-c", UNGUARDED], "prompt": ["-i", "-q"]}
    done = subprocess.run(
        [sys.executable, *commands[how]],
        input=UNGUARDED if how in ("pipe", "prompt") else "",
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT), "LUNAR_HDA_CACHE": str(cache)},
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout.count("started") == 1  # no worker has run the script again
    assert "['tile-00000', 'tile-00001', 'tile-00002']" in done.stdout
    assert "all 2" in done.stdout


def pid_of(_: int) -> int:
    return os.getpid()


WORK = """
import os, sys
from hda.worker_pool import map_in_processes
sys.path.insert(0, {here!r})
import work
print(os.getpid(), *{call})
"""


def run_work(call: str, tmp_path: Path) -> list[int]:
    (tmp_path / "work.py").write_text(
        "import os\n"
        "def pid(_): return os.getpid()\n"
        "def die(parent):\n    if os.getpid() != parent: os._exit(1)\n    return parent\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", WORK.format(here=str(tmp_path), call=call)],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        timeout=300,
        check=True,
    )
    return [int(word) for word in done.stdout.split()]


def test_several_workers_are_other_processes(tmp_path: Path) -> None:
    parent, *workers = run_work("map_in_processes(work.pid, range(4), 2)", tmp_path)
    assert len(workers) == 4
    assert parent not in workers


def test_one_worker_is_this_process() -> None:
    assert map_in_processes(pid_of, [0, 1, 2], 1) == [os.getpid()] * 3


def test_what_a_worker_dies_of_is_done_here(tmp_path: Path) -> None:
    parent, *done = run_work("map_in_processes(work.die, [os.getpid()] * 3, 2)", tmp_path)
    assert done == [parent] * 3


def test_results_keep_their_order_and_every_item_is_counted() -> None:
    counted: list[None] = []
    items = [f"x{number}" for number in range(7)]
    results = map_in_processes(os.path.basename, items, 3, on_done=lambda: counted.append(None))
    assert results == items
    assert len(counted) == 7


@pytest.mark.parametrize("workers", [1, 2])
def test_what_the_function_raises_is_raised(workers: int) -> None:
    with pytest.raises(ValueError, match=r"math domain error|nonnegative input"):
        map_in_processes(math.sqrt, [-1.0, -2.0], workers)
