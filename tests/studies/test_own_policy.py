"""A policy of a user's own: found by path or entry point, checked against the contract, flown and pinned."""

import csv
import importlib
import random
import runpy
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

import hda
from hda import registry
from hda.registry import ENTRY_POINT_GROUP, PolicyRegistry, policy_entry
from hda.task.presets import PRESETS
from studies.campaign.claimed_folder import FolderError
from studies.compare.command import Comparison, compare, plan_study
from studies.contract import ContractError, check_contract
from studies.statistics.ratios import least_passing
from studies.testing import assert_safe_ratio

ROOT = Path(__file__).resolve().parents[2]
GOOD = '''
import numpy as np
import hda

class Straight:
    """Flies straight on."""
    name = "straight"
    def begin(self, scenario_view, rng):
        return None
    def decide(self, observation, memory):
        command = hda.ZemZevCommand(6.0, 2.0, observation.time_to_go)
        return hda.Decision(observation.target, command), memory

class Random(Straight):
    """Draws from its own stream, kept in the memory."""
    name = "random"
    def begin(self, scenario_view, rng):
        return rng
    def decide(self, observation, memory):
        row, column = memory.integers(64, size=2)
        command = hda.ZemZevCommand(6.0, 2.0, observation.time_to_go)
        return hda.Decision(observation.site(row, column), command), memory

a_policy = Straight()
'''
BAD = """
import numpy as np
import random
import hda
from {module} import Straight

class Counting(Straight):
    name = "counting"
    calls = 0
    def decide(self, observation, memory):
        self.calls += 1
        command = hda.ZemZevCommand(6.0, 2.0, observation.time_to_go + 0.01 * self.calls)
        return hda.Decision(observation.target, command), memory

class Sneaky(Straight):
    name = "sneaky"
    shared = []
    def decide(self, observation, memory):
        self.shared.append(1)
        command = hda.ZemZevCommand(6.0, 2.0, observation.time_to_go + 0.01 * (len(self.shared) > 40))
        return hda.Decision(observation.target, command), memory

class Painter(Straight):
    name = "painter"
    def decide(self, observation, memory):
        observation.safety_map[:] = 1.0
        return super().decide(observation, memory)

class Alone(Straight):
    name = "alone"
    def decide(self, observation, memory):
        return super().decide(observation, memory)[0]

class OffPlane(Straight):
    name = "off-plane"
    def decide(self, observation, memory):
        command = hda.ZemZevCommand(6.0, 2.0, observation.time_to_go)
        return hda.Decision(observation.target + np.array([0.0, 0.0, 3.0]), command), memory

class Broken(Straight):
    name = "broken"
    def decide(self, observation, memory):
        1 // (observation.index - 2)
        return super().decide(observation, memory)

class LateBroken(Straight):
    name = "late-broken"
    def begin(self, scenario_view, rng):
        return rng.random() < 0.05
    def decide(self, observation, memory):
        if memory:
            raise KeyError("no idea")
        return super().decide(observation, memory)

class Loud(Straight):
    name = "LOUD / name"

class Unfinished:
    name = "unfinished"
    def begin(self, scenario_view, rng):
        return None

class Needy(Straight):
    def __init__(self, weights):
        self.weights = weights

class Oracle(Straight):
    name = "oracle"
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A user's file beside the command, and a registry that forgets it afterwards."""
    hda.policy_names()
    monkeypatch.setattr(registry, "REGISTRY", registry.REGISTRY.copy())
    name = f"own_{random.randrange(10**9)}"
    (tmp_path / f"{name}.py").write_text(GOOD)
    (tmp_path / f"{name}_bad.py").write_text(BAD.format(module=name))
    (tmp_path / f"{name}_error.py").write_text("import not_there_at_all\n")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    yield name
    for loaded in (name, f"{name}_bad", f"{name}_error"):
        sys.modules.pop(loaded, None)


def options(out: Path, *policies: str, workers: int = 1) -> Comparison:
    return Comparison(20, policies, workers=workers, out=out, figures=False, report=False)


@pytest.mark.parametrize("workers", [1, 2])
def test_it_stands_in_the_table_beside_the_others(module: str, tmp_path: Path, workers: int) -> None:
    out = tmp_path / "study"
    compare(options(out, f"{module}:Straight", "no-divert", workers=workers))
    with (out / "table.csv").open() as stream:
        own, other = sorted(csv.DictReader(stream), key=lambda row: row["policy"], reverse=True)
    assert (own.pop("policy"), other.pop("policy")) == ("straight", "no-divert")
    assert own == other  # it flies as no-divert does


def test_a_changed_file_is_another_study(module: str, tmp_path: Path) -> None:
    out = tmp_path / "study"
    compare(options(out, f"{module}:Straight"))
    with (tmp_path / f"{module}.py").open("a") as stream:
        stream.write("# changed\n")
    with pytest.raises(FolderError, match=rf"sources\.{module} was"):
        compare(Comparison(20, (f"{module}:Straight",), out=out, resume=True, report=False, figures=False))


def test_a_class_and_an_object_are_found_by_path(module: str) -> None:
    assert hda.make_policy(f"{module}:Straight").name == "straight"
    entry = policy_entry(f"{module}:Straight")
    assert (entry.summary, entry.privileged) == ("Flies straight on.", False)
    with pytest.raises(ValueError, match="'straight' is registered already"):
        policy_entry(f"{module}:a_policy")


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("{}:Strait", "unknown policy .* did you mean Straight"),
        ("{}_error:X", "cannot import .*_error.*: ModuleNotFoundError.*not_there_at_all"),
        ("no_such_module_here:X", "cannot import 'no_such_module_here'"),
        (":X", "cannot import ''"),
        ("{}:", "unknown policy"),
        ("{}_bad:Loud", "must be lower case"),
        ("{}_bad:Unfinished", "is no policy: Unfinished has no decide"),
        ("{}_bad:Needy", "cannot be made: TypeError"),
        ("{}_bad:Oracle", "'oracle' is registered already"),
        ("{}:np", "is no policy|cannot be made"),
    ],
)
def test_what_a_path_lacks_is_named(module: str, path: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan_study(Comparison(policies=(path.format(module),)))


@pytest.mark.parametrize("name", ["Straight", "Random"])
def test_good_policies_keep_the_contract(module: str, name: str) -> None:
    check_contract(policy_entry(f"{module}:{name}").make, PRESETS["paper"])


@pytest.mark.parametrize("name", ["oracle", "nearest-safe"])
def test_the_policies_of_the_package_keep_it(name: str) -> None:
    check_contract(policy_entry(name).make, PRESETS["paper"])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Counting", "look 0 .*asked again, it decides otherwise"),
        ("Sneaky", "keeps state"),
        ("Painter", "changed the observation"),
        ("Alone", r"must return \(Decision, memory\), got Decision"),
        ("OffPlane", "look 0 .*site must lie on the target plane"),
        ("Broken", r"look 2 of a trial episode: ZeroDivisionError: .*_bad\.py, line"),
    ],
)
def test_a_broken_promise_is_named_before_any_flight(
    module: str, tmp_path: Path, name: str, message: str
) -> None:
    with pytest.raises(ContractError, match=message):
        compare(options(tmp_path / "study", f"{module}_bad:{name}"))
    assert not (tmp_path / "study").exists()


def test_a_failure_in_flight_names_policy_episode_and_line(module: str, tmp_path: Path) -> None:
    path = f"{module}_bad:LateBroken"
    with pytest.raises(ValueError, match=r"'late-broken' failed in episode \d+ .*KeyError.*_bad\.py, line"):
        compare(Comparison(400, (path,), workers=1, out=tmp_path / "s", figures=False, report=False))


def test_entry_points_are_read_and_a_broken_one_is_left_out(module: str, tmp_path: Path) -> None:
    info = tmp_path / "plugin-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: plugin\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        f"[lunar_hda.policies]\nstraight = {module}:Straight\nbroken = {module}_error:X\n"
    )
    importlib.invalidate_caches()
    policies = PolicyRegistry(lambda: (), ENTRY_POINT_GROUP)
    with pytest.warns(RuntimeWarning, match="entry point 'broken' of plugin is left out"):
        names = policies.names()
    assert names == ("straight",)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert policies.make("straight").name == "straight"


def test_the_example_lands_and_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    source = ROOT / "examples" / "my_policy.py"
    assert len(source.read_text().splitlines()) < 40
    policy = runpy.run_path(str(source))["SafestNearby"]
    check_contract(policy, PRESETS["paper"])
    assert assert_safe_ratio(policy, episodes=100, at_least=0.95).estimate > 0.9


def test_the_command_takes_a_path(module: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "studies.compare", "--episodes", "2", "--no-figures", "--no-report"]
    command += ["--workers", "1", "--policies", f"{module}:Nothing", "--out", str(tmp_path / "study")]
    environment = {"PYTHONPATH": f"{tmp_path}:{ROOT}", "PATH": "/usr/bin:/bin"}
    ended = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=120)
    assert ended.returncode == 2
    assert "Straight" in ended.stderr
    assert "Traceback" not in ended.stderr


# ---- assert_safe_ratio ----


def test_a_ratio_that_holds_passes_and_is_given_back() -> None:
    flown = assert_safe_ratio("single-divert", episodes=100, at_least=0.85)
    landed = round(100 * flown.estimate)
    assert flown.low < flown.estimate < flown.high
    assert landed >= least_passing(100, 0.85, 1e-3)


def test_a_ratio_that_fails_says_what_and_how_sure() -> None:
    with pytest.raises(AssertionError) as failure:
        assert_safe_ratio("no-divert", preset="paper", episodes=60, at_least=0.9, measure="success")
    text = str(failure.value)
    assert "'no-divert' on preset 'paper': success in " in text
    assert "of 60 episodes" in text
    assert f"at least {least_passing(60, 0.9, 1e-3)} are asked for" in text
    assert "true ratio is 90.0% falls below with a probability of" in text
    assert "false-alarm rate, at most 0.001" in text


def test_a_line_of_the_registry_and_an_object_do_too() -> None:
    entry = policy_entry("nearest-safe")
    same = [assert_safe_ratio(policy, episodes=30, at_least=0.9) for policy in (entry, entry.make())]
    assert same[0] == same[1] == assert_safe_ratio("nearest-safe", episodes=30, at_least=0.9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"episodes": 2, "at_least": 0.9}, "2 cannot fail a claim of 90.0%"),
        ({"episodes": 0}, "episodes must be at least 1"),
        ({"at_least": 1.5}, "at_least"),
        ({"at_least": 0.0}, "at_least"),
        ({"measure": "fuel"}, "measure must be one of safe_site, success"),
        ({"false_alarm": 0.9}, "false_alarm"),
        ({"preset": "papper"}, "did you mean paper"),
    ],
)
def test_a_wrong_argument_is_named(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        assert_safe_ratio("no-divert", **changes)  # pyright: ignore[reportArgumentType]
