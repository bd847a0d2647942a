"""The faults of navigation: what is planned, what is refused, and that a run repeats and goes on."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from hda.navigation import NAVIGATION_FAULTS, add_fault
from hda.task.body_variants import BODY_VARIANTS, vary_body
from hda.task.presets import PRESETS
from studies.campaign import monte_carlo
from studies.campaign.claimed_folder import FolderError
from studies.failures import explained
from studies.faults import NO_FAULT, Faults, fault_presets, plan_points, run_faults


def test_every_fault_is_flown_beside_the_preset_as_it_is() -> None:
    points = plan_points(Faults(policies=("nearest-safe",)))
    assert [point.label for point in points] == [NO_FAULT, *NAVIGATION_FAULTS]
    own = PRESETS["navigated"]
    assert points[0].study.preset == own
    assert own.navigation is not None
    for point in points[1:]:
        assert point.study.preset == replace(own, navigation=add_fault(own.navigation, point.label))
        assert replace(point.study, preset=own) == points[0].study


def test_on_a_rigid_body_its_variants_are_flown_too() -> None:
    own = PRESETS["rigid-body"]
    worlds = fault_presets(own, ("all",))
    assert list(worlds) == [NO_FAULT, *NAVIGATION_FAULTS, *BODY_VARIANTS]
    for name in BODY_VARIANTS:
        assert worlds[name] == vary_body(own, name)
    assert list(fault_presets(own, ("weak-torque", "plume-noise"))) == [
        NO_FAULT,
        "plume-noise",
        "weak-torque",
    ]
    with pytest.raises(ValueError, match="unknown navigation fault"):
        fault_presets(PRESETS["navigated"], ("weak-torque",))


def test_chosen_faults_come_in_their_own_order() -> None:
    chosen = fault_presets(PRESETS["navigated"], ("plume-noise", "velocimeter-lost"))
    assert list(chosen) == [NO_FAULT, "velocimeter-lost", "plume-noise"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"preset": "lidar"}, "'lidar' has no navigation filter"),
        ({"faults": ("velocimeter-gone",)}, "did you mean velocimeter-lost"),
        ({"faults": ()}, "faults must name at least one"),
        ({"episodes": 0}, "episodes must be at least 1"),
        ({"explained": -1}, "explained must be at least 0"),
    ],
)
def test_a_wrong_option_is_named(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan_points(Faults(**options))


def test_a_run_tells_why_and_goes_on_without_flying_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = Faults(
        faults=("velocimeter-lost",),
        policies=("no-divert",),
        episodes=3,
        explained=2,
        workers=1,
        out=tmp_path,
    )
    lines = run_faults(options)
    assert [(line.fault, line.policy) for line in lines] == [
        (NO_FAULT, "no-divert"),
        ("velocimeter-lost", "no-divert"),
    ]
    with (tmp_path / "table.csv").open() as stream:
        told = list(csv.DictReader(stream))
    assert float(told[0]["success_drop_points"]) == 0.0
    for line, row in zip(lines, told, strict=True):
        failed = 3 - round(3 * line.score.success.estimate)
        assert failed > 0
        assert sum(int(part.split(" x ")[0]) for part in row["causes"].split("; ")) == min(failed, 2)
    before = (tmp_path / "table.csv").read_bytes()

    def refuse(*arguments: object) -> None:
        raise AssertionError("it was flown again")

    for module in (explained, monte_carlo):  # explains; flies the points
        monkeypatch.setattr(module, "fly", refuse)
    with pytest.raises(FolderError, match="holds a study already"):
        run_faults(options)
    run_faults(replace(options, resume=True))
    assert (tmp_path / "table.csv").read_bytes() == before
    next((tmp_path / NO_FAULT / "shards").glob("episodes-*.jsonl")).unlink()
    with pytest.raises(ValueError, match="it was flown again"):  # what is missing is flown, in this process
        run_faults(replace(options, resume=True))
