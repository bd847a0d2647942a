"""The closed loop's options: lines are policies by path, flown once, kept, and gone on with."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hda
from hda import registry
from hda.flight.episode import fly
from hda.registry import make_policy
from hda.task.scenario import sample_scenario
from studies.campaign import monte_carlo
from studies.campaign.claimed_folder import FolderError
from studies.closed_loop.command import ClosedLoop, plan_study, run_closed_loop
from studies.closed_loop.laws import law_name, law_path


@pytest.fixture(autouse=True)
def forgetful_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    hda.policy_names()
    monkeypatch.setattr(registry, "REGISTRY", registry.REGISTRY.copy())


def options(out: Path, **changes) -> ClosedLoop:
    small = ClosedLoop(
        episodes=6, margins=(0.0,), terminal_periods=(), speed_limits=(30.0,), workers=1, out=out
    )
    return replace(small, **changes)


def test_an_option_at_its_default_flies_as_the_registered_policy() -> None:
    scenario = sample_scenario("paper", 5, 0, "tuning")
    plain = fly(make_policy("single-divert+convex"), scenario)
    same = fly(make_policy(law_path("single-divert", "terminal_periods", 4)), scenario)
    assert same.policy == law_name("single-divert", "terminal_periods", 4)
    assert np.array_equal(same.path, plain.path)


@pytest.mark.parametrize(
    "name",
    [
        "single-divert+convex.speed_limt=3",
        "nobody+convex.speed_limit=3",
        "nearest-safe+convex.thrust_margin=2",
        "nearest-safe+convex.terminal_periods=x",
        "x",
    ],
)
def test_a_wrong_path_is_no_policy(name: str) -> None:
    with pytest.raises(ValueError, match="policy"):
        make_policy(f"studies.closed_loop.laws:{name}")


def test_the_lines_are_those_of_the_options() -> None:
    study, laws = plan_study(ClosedLoop())
    assert list(laws.values())[:3] == ["ZEM/ZEV 6/2", "default", "thrust margin 0%"]
    assert len(laws) == 2 + 3 + 3 + 4
    assert study.policies == tuple(laws)
    assert [study.make_policy(name).name for name in study.policies] == list(laws)


def test_rows_table_and_provenance_stand_in_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = run_closed_loop(options(tmp_path))
    assert [line.guidance for line in lines] == [
        "ZEM/ZEV 6/2",
        "default",
        "thrust margin 0%",
        "speed limit 30 m/s",
    ]
    with (tmp_path / "flights" / "episodes.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    with (tmp_path / "table.csv").open() as stream:
        table = list(csv.DictReader(stream))
    for line in table:
        speeds = [float(row["touchdown_speed_mps"]) for row in rows if row["policy"] == line["policy"]]
        assert len(speeds) == 6
        assert float(line["speed_mps_max"]) == pytest.approx(max(speeds))
    assert float(table[0]["propellant_percent"]) > float(table[1]["propellant_percent"]) + 5.0
    provenance = json.loads((tmp_path / "provenance.json").read_text())
    assert provenance["options"]["speed_limits"] == [30.0]
    assert (tmp_path / "table.md").read_text().count("\n") == 6
    with pytest.raises(FolderError, match="holds a study already"):
        run_closed_loop(options(tmp_path))

    def refuse(*_: object) -> None:
        raise AssertionError("flown again")

    before = (tmp_path / "table.csv").read_bytes()
    monkeypatch.setattr(monte_carlo, "fly_chunk", refuse)
    run_closed_loop(options(tmp_path, resume=True))
    assert (tmp_path / "table.csv").read_bytes() == before
    with pytest.raises(ValueError, match="exclude each other"):
        run_closed_loop(options(tmp_path, resume=True, overwrite=True))
    with pytest.raises(AssertionError, match="flown again"):
        run_closed_loop(options(tmp_path, overwrite=True))


def test_options_are_checked() -> None:
    with pytest.raises(ValueError, match="episodes must be at least 1"):
        ClosedLoop(episodes=0)
    with pytest.raises(ValueError, match="thrust_margin"):
        plan_study(ClosedLoop(margins=(2.0,)))
