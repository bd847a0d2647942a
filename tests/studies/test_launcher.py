"""`lunar-hda`: it lists every command of the packages, loads one alone, and completes them in a shell."""

import importlib
import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

from studies.launcher import COMMANDS, explain

ROOT = Path(__file__).parents[2]
PACKAGES = ("guidance", "hda", "rl", "studies")
LAUNCH = "from studies.launcher import main; main()"


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", LAUNCH, *words], cwd=ROOT, capture_output=True, text=True)


def runnable_modules() -> set[str]:
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    guarded = [path for path in files if "\nif __name__ == " in path.read_text(encoding="utf-8")]
    names = {path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".") for path in guarded}
    return {name.removesuffix(".__main__") for name in names}


def test_every_command_of_the_packages_is_listed() -> None:
    homes = [re.sub(r"\.(command|__main__)$", "", command.home) for command in COMMANDS.values()]
    assert sorted(homes) == sorted(runnable_modules())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["scripts"] == {"lunar-hda": "studies.launcher:main"}


def test_its_help_lists_them_and_loads_nothing_heavy() -> None:
    """What it loads stands for what it costs: half a second is a promise, and a test asserts no time."""
    code = f"{LAUNCH}; import sys; sys.stderr.write(' '.join(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code, "--help"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout == explain() == run().stdout
    assert [name for name in COMMANDS if f"\n  {name} " not in done.stdout] == []
    assert not {"numpy", "numba", "tyro", "rich", "gymnasium", "rl"} & set(done.stderr.split())
    assert max(map(len, done.stdout.splitlines())) <= 90


@pytest.mark.parametrize("name", COMMANDS)
def test_each_has_a_main_and_its_options(name: str) -> None:
    home = importlib.import_module(COMMANDS[name].home)
    assert callable(home.main)
    assert getattr(home, COMMANDS[name].options) is not None


def test_a_command_is_that_of_the_module() -> None:
    words = ["--state", "100", "0", "900", "0", "0", "-30", "1200"]
    module = subprocess.run(
        [sys.executable, "-m", "guidance.pdg", *words], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert run("plan", *words).stdout == module.stdout
    assert "propellant" in module.stdout


@pytest.mark.parametrize("name", ["plan", "terrain", "sample-size"])
def test_it_is_called_by_its_own_name(name: str) -> None:
    assert f"usage: lunar-hda {name} " in run(name, "--help").stdout


def test_a_wrong_word_is_told_from_the_right_one() -> None:
    done = run("compair")
    assert done.returncode == 2
    assert done.stderr.startswith("error: unknown command 'compair'; did you mean compare")
    assert done.stderr.count("\n") == 1


def test_it_knows_its_version() -> None:
    assert run("--version").stdout == f"lunar-hda {version('lunar-hda')}\n"


def test_a_shell_completes_commands_and_options(tmp_path: Path) -> None:
    script = tmp_path / "completion.bash"
    script.write_text(run("--tyro-print-completion", "bash").stdout)
    ask = """
    source "$1"; shift
    COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMP_LINE="$*"; COMP_POINT=${#COMP_LINE}
    completer=$(complete -p lunar-hda | sed 's/.*-F \\([^ ]*\\).*/\\1/')
    $completer lunar-hda "${COMP_WORDS[-1]}" "${COMP_WORDS[-2]}"; echo "${COMPREPLY[@]}"
    """

    def complete(*words: str) -> set[str]:
        asked = ["bash", "-c", ask, "bash", str(script), "lunar-hda", *words]
        return set(subprocess.run(asked, capture_output=True, text=True, check=True).stdout.split())

    assert complete("") >= set(COMMANDS)
    assert complete("compare", "--epi") == {"--episodes"}
    assert "--study-seed" in complete("compare", "--st")
    assert complete("train", "td3", "--se") == {"--seed"}
