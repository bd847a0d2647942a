"""The bench: times of the inner loops, and ratios that say when a limit is not kept."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from rl.training_libraries import TrainingLibrariesError
from studies.bench import Bench, bench
from studies.bench.speed_ratios import COLUMNS, SpeedRatio, measure_ratios
from studies.columns import Column


def cell(name: str, ratio: SpeedRatio) -> str:
    column: Column[SpeedRatio] = next(column for column in COLUMNS if column.key == name)
    return column.text(ratio)


def test_a_ratio_above_its_limit_is_shouted() -> None:
    ratio = SpeedRatio("work", "reference", 0.003, 0.002, 1.5)
    assert (cell("ratio", ratio), cell("limit", ratio), cell("kept", ratio)) == ("1.50", "1.5", "yes")
    assert cell("kept", replace(ratio, work_seconds=0.0031)) == "NO"
    assert cell("kept", replace(ratio, reference_seconds=0.0019)) == "NO"


def test_every_ratio_is_of_two_works() -> None:
    ratios = measure_ratios(repeats=2)
    works = ["solve_pdg", "free-time solve", "a start in bulk"]
    works += ["a decision and 5 s of flight on navigated", "5 s of flight on navigated"]
    works += ["encoding a look", "an update", "import guidance"]
    assert [ratio.work for ratio in ratios] == works
    for ratio in ratios:
        assert ratio.work_seconds > 0.0
        assert ratio.ratio == pytest.approx(ratio.work_seconds / ratio.reference_seconds)
    with pytest.raises(ValueError, match="repeats must be at least 1"):
        measure_ratios(repeats=0)


@pytest.mark.slow
def test_the_bench_leaves_its_tables(tmp_path: Path) -> None:
    works, ratios = bench(Bench(episodes=3, repeats=1, out=tmp_path))
    with (tmp_path / "times.csv").open() as stream:
        times = list(csv.DictReader(stream))
    with (tmp_path / "ratios.csv").open() as stream:
        kept = list(csv.DictReader(stream))
    assert [row["work"] for row in times] == [work.name for work in works]
    assert all(0.0 < float(row["median_ms"]) <= float(row["high_ms"]) for row in times)
    assert [float(row["ratio"]) for row in kept] == pytest.approx([ratio.ratio for ratio in ratios])
    with (tmp_path / "steps.csv").open() as stream:
        steps = list(csv.DictReader(stream))
    own = {"LunarHDA-v0": "native", "LunarHDA-Map-v0": "native"}
    own |= {"LunarHDA-Site-v0": "stepped", "LunarHDA-Belief-v0": "stepped"}
    assert {row["environment"] for row in steps} == set(own)
    for name, vector in own.items():
        ways = [row["way"].split(",")[0] for row in steps if row["environment"] == name]
        assert list(dict.fromkeys(ways)) == ["one", "sync", "async", vector]
    assert all(float(row["steps_per_second"]) > 0.0 for row in steps)
    assert all((row["processor_us"] == "") == row["way"].startswith("async") for row in steps)
    native = {ratio.work: ratio for ratio in ratios if "native" in ratio.work}
    assert len(native) == 2
    assert all(ratio.ratio < 1.0 for ratio in native.values())
    assert json.loads((tmp_path / "provenance.json").read_text())["options"]["episodes"] == 3


@pytest.mark.slow
def test_without_the_libraries_of_training_its_ratio_is_left_out_and_that_is_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse() -> None:
        raise TrainingLibrariesError("training needs torch")

    for module in ("studies.bench.speed_ratios", "studies.bench.command"):
        monkeypatch.setattr(f"{module}.require_training_libraries", refuse)
    _, ratios = bench(Bench(episodes=1, repeats=1, out=tmp_path))
    assert "encoding a look" in [ratio.work for ratio in ratios]
    assert "an update" not in [ratio.work for ratio in ratios]
    assert "an update of training is not measured: training needs torch" in capsys.readouterr().out
