"""The wheel, installed where the repository cannot be seen: every command explains itself and runs.

The clean environment borrows the libraries of the running one through a .pth file, whose own .pth files (an
editable install of this repository among them) are not read there. Nothing is fetched from a network.
"""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

from guidance.kernel import cache_folder

ROOT = Path(__file__).parents[1]
PACKAGES = ("guidance", "hda", "rl", "studies")
SMALL = ["--episodes", "2", "--workers", "1"]

RUNS: dict[str, tuple[list[str], list[str]]] = {
    "guidance.export_c": (["--out", "code"], ["code/powered_descent.c", "code/vectors.csv"]),
    "guidance.pdg": (
        ["--state", "100", "0", "900", "0", "0", "-30", "1200", "--plot", "plan.png"],
        ["plan.png"],
    ),
    "hda.belief_statistics": (["--tiles", "1"], []),
    "hda.flight.film": (["--step", "5", "--width", "300", "--out", "flight.gif"], ["flight.gif"]),
    "hda.look_statistics": (["--episodes", "1", "--rays", "32"], []),
    "hda.terrain": (["--size", "200", "--show", "tile.png"], ["tile.png"]),
    "rl.dataset": (
        ["--policies", "random", *SMALL, "--no-minari", "--out", "offline"],
        ["offline/dataset.npz", "offline/README.md"],
    ),
    "rl.figures": (["gains", "--out", "gains.png"], ["gains.png"]),
    "rl.model_cards": (["--out", "cards.md"], ["cards.md"]),
    "rl.train": (
        ["td3", "--steps", "40", "--validate-every", "20", "--validation-episodes", "2", "--out", "run"],
        ["run/run.json", "run/validation.csv"],
    ),
    "rl.training_speed": (["--rounds", "1", "--updates", "2", "--batch-size", "8"], []),
    "studies.bench": (["--episodes", "1", "--repeats", "1"], []),
    "studies.calibrate": (
        [*SMALL, "--sweep-episodes", "2", "--out", "calibrated"],
        ["calibrated/paper.csv"],
    ),
    "studies.closed_loop": ([*SMALL, "--out", "laws"], ["laws/table.csv"]),
    "studies.compare": (
        [*SMALL, "--policies", "single-divert", "hazard-aware", "td3", "td3-lstm", "--out", "compared"],
        ["compared/table.csv", "compared/report.html", "compared/figures/histograms.png"],
    ),
    "studies.faults": (
        [*SMALL, "--faults", "velocimeter-lost", "--policies", "no-divert", "--out", "faulty"],
        ["faulty/table.csv", "faulty/table.md"],
    ),
    "studies.realism": (
        [*SMALL, "--presets", "paper", "partial", "--policies", "single-divert", "--out", "layered"],
        ["layered/table.csv", "layered/order.md", "layered/realism.png"],
    ),
    "studies.rare_events": (
        ["--episodes", "4", "--pilot", "2", "--workers", "1", "--out", "rare"],
        ["rare/table.csv", "rare/causes.md", "rare/rare-events.png"],
    ),
    "studies.information_bound": (
        [*SMALL, "--looks", "0", "--out", "bounded"],
        ["bounded/table.csv", "bounded/information-bound.png"],
    ),
    "studies.failures": (["--study", "failing", "--out", "failed"], ["failed/failures.csv"]),
    "studies.looks": (
        [
            "--rays",
            "64",
            "--ranges",
            "300",
            "--looks",
            "1",
            "--tiles",
            "2",
            "--workers",
            "1",
            "--out",
            "looked",
        ],
        ["looked/table.csv", "looked/looks.png", "looked/calibration.png"],
    ),
    "studies.memory": (["--train", "list"], []),
    "studies.results": (["--list"], []),
    "studies.rigid_plans": (["--starts", "1", "--out", "turned"], ["turned/table.csv"]),
    "studies.robustness": (
        [*SMALL, "--levels", "1", "--factors", "thrust-error", "--policies", "no-divert", "--out", "swept"],
        ["swept/thrust-error.png"],
    ),
    "studies.sample_size": ([], []),
    "studies.shortfall": (
        ["--policies", "td3", "--episodes", "2", "--workers", "1", "--out", "short"],
        ["short/losses.csv", "short/islands.csv", "short/parts.csv"],
    ),
    "studies.scale": ([*SMALL, "--out", "scaled"], ["scaled/table.csv"]),
    "studies.stability": (["--gain-points", "2", "--out", "stable"], ["stable/stability.png"]),
    "studies.timing": (
        ["--starts", "1", "--answers", "20", "--processes", "1", "--out", "timed"],
        ["timed/timing.csv", "timed/timing.png", "timed/answers/answers.csv"],
    ),
    "studies.trade_off": (
        [
            *SMALL,
            "--presets",
            "paper",
            "--weights",
            "none",
            "--policies",
            "no-divert",
            "--reference",
            "no-divert",
            "--out",
            "traded",
        ],
        ["traded/table.csv", "traded/trade-off.png", "traded/standings.md"],
    ),
    "studies.verify": (["flown", "--least", "1", "--workers", "1"], []),
}
"""Command -> arguments of one small run, and what it must leave behind."""

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Installation:
    """A clean environment with the wheel in it.

    Attributes:
        python: its interpreter.
        packages: its site-packages.
        wheel: what was installed.
        place: an empty folder to run in.
        cache: of compiled code; terrain is shared with the running environment.
    """

    python: Path
    packages: Path
    wheel: Path
    place: Path
    cache: Path

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        return subprocess.run(
            [str(self.python), *arguments],
            capture_output=True,
            text=True,
            encoding="utf-8",
            cwd=self.place,
            env={**kept, "LUNAR_HDA_CACHE": str(self.cache), "PYTHONIOENCODING": "utf-8"},
            timeout=600,
        )


def call(*command: str | Path) -> None:
    done = subprocess.run([sys.executable, "-m", *map(str, command)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def installation(tmp_path_factory: pytest.TempPathFactory) -> Installation:
    folder = tmp_path_factory.mktemp("installed")
    call("build", "--wheel", "--no-isolation", "--outdir", folder, ROOT)
    (wheel,) = folder.glob("*.whl")
    home = folder / "environment"
    venv.create(home, with_pip=False)
    scheme = sysconfig.get_preferred_scheme("prefix")
    places = sysconfig.get_paths(scheme, {"base": str(home), "platbase": str(home)})
    python = Path(places["scripts"]) / Path(sys.executable).name
    packages = Path(places["purelib"])
    call("pip", "--python", python, "install", "--no-deps", "--no-index", "--quiet", wheel)
    borrowed = dict.fromkeys((sysconfig.get_path("purelib"), sysconfig.get_path("platlib")))
    (packages / "borrowed.pth").write_text("".join(f"{path}\n" for path in borrowed))
    place, cache = folder / "empty", folder / "cache"
    place.mkdir()
    cache.mkdir()
    terrain = cache_folder() / "terrain"
    terrain.mkdir(parents=True, exist_ok=True)
    (cache / "terrain").symlink_to(terrain.resolve(), target_is_directory=True)
    return Installation(python, packages, wheel, place, cache)


def commands(packages: Path) -> list[str]:
    """Every module of the installed packages that can be run."""
    files = [path for package in PACKAGES for path in (packages / package).rglob("*.py")]
    guarded = [path for path in files if "\nif __name__ == " in path.read_text(encoding="utf-8")]
    names = [path.relative_to(packages).with_suffix("").as_posix().replace("/", ".") for path in guarded]
    return sorted(name.removesuffix(".__main__") for name in names)


def test_every_command_that_was_installed_is_run_below(installation: Installation) -> None:
    assert commands(installation.packages) == sorted(RUNS)


def test_the_packages_come_from_the_wheel(installation: Installation) -> None:
    """And none of them from the repository, which must not be seen."""
    done = installation.run(
        "-c", f"import {', '.join(PACKAGES)}; print(*[{'.__file__, '.join(PACKAGES)}.__file__])"
    )
    assert done.returncode == 0, done.stderr
    homes = [Path(name).resolve() for name in done.stdout.split()]
    assert all(home.is_relative_to(installation.packages.resolve()) for home in homes)
    seen = installation.run("-c", "import sys; print(*sys.path, sep='\\n')").stdout.splitlines()
    assert str(ROOT) not in seen
    assert installation.run("-c", "import tests").returncode != 0


def test_the_wheel_holds_the_packages_and_their_data_and_nothing_else(installation: Installation) -> None:
    with zipfile.ZipFile(installation.wheel) as wheel:
        names = [name for name in wheel.namelist() if ".dist-info/" not in name]
    assert {name.split("/")[0] for name in names} == set(PACKAGES)
    tracked = subprocess.run(
        ["git", "ls-files", *PACKAGES], capture_output=True, text=True, cwd=ROOT, check=True
    ).stdout.split()
    assert sorted(names) == sorted(tracked)


def test_the_one_command_is_installed(installation: Installation) -> None:
    """As a file beside the interpreter, which its spawned workers read too."""
    launcher = str(installation.python.with_name("lunar-hda"))
    call = "import subprocess, sys; sys.exit(subprocess.call(sys.argv[1:]))"
    explained = installation.run("-c", call, launcher, "--help")
    assert explained.returncode == 0, explained.stderr
    assert "lunar-hda COMMAND" in explained.stdout
    flown = ["compare", "--episodes", "20", "--workers", "2", "--policies", "no-divert", "--no-report"]
    done = installation.run("-c", call, launcher, *flown, "--out", "launched")
    assert done.returncode == 0, done.stdout + done.stderr
    assert (installation.place / "launched" / "table.csv").stat().st_size > 0


@pytest.mark.parametrize("command", RUNS)
def test_an_installed_command_explains_itself(installation: Installation, command: str) -> None:
    done = installation.run("-m", command, "--help")
    assert done.returncode == 0, done.stderr
    assert "usage:" in done.stdout
    assert not any(installation.place.glob("*.png"))


@pytest.mark.parametrize("command", RUNS)
def test_an_installed_command_runs(installation: Installation, command: str) -> None:
    arguments, written = RUNS[command]
    if command in ("studies.failures", "studies.verify"):
        folder = arguments[arguments.index("--study") + 1] if "--study" in arguments else arguments[0]
        flown = ["--policies", "no-divert", "--no-figures", "--no-report", "--out", folder]
        assert installation.run("-m", "studies.compare", *SMALL, *flown).returncode == 0
    done = installation.run("-m", command, *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout.strip()
    for name in written:
        assert (installation.place / name).stat().st_size > 0
