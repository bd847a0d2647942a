"""The scale of a study: every line is measured whole, kept, and not measured again."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from studies import scale
from studies.scale import Measurement, Scale, measure_scale


def test_lines_are_kept_and_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = Scale(episodes=(3,), workers=(1,), policy="single-divert", out=tmp_path)
    (first,) = measure_scale(options)
    assert (first.episodes, first.workers) == (3, 1)
    assert first.memory > 50e6  # a process that has numpy and numba
    folder = tmp_path / "3-episodes-1-workers"
    assert (folder / "episodes.csv").read_text().count("\n") == 1 + 3
    assert json.loads((tmp_path / "provenance.json").read_text())["options"]["episodes"] == [3]
    with pytest.raises(ValueError, match="holds a study already"):
        measure_scale(options)

    measured = []

    def note(study) -> Measurement:
        measured.append((study.episodes, study.workers, study.overwrite))
        study.out.mkdir(exist_ok=True)
        return Measurement(study.episodes, study.workers, 2.0, 1.0, 10**8, 10**6)

    monkeypatch.setattr(scale, "measure_study", note)
    lines = measure_scale(replace(options, episodes=(3, 4), resume=True))
    assert lines[0] == first
    assert measured == [(4, 1, True)]
    with (tmp_path / "table.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["episodes"] for row in rows] == ["3", "4"]
    assert [rows[1][name] for name in ("episodes_per_s", "memory_mb")] == ["2", "100"]

    lines = measure_scale(replace(options, overwrite=True))
    assert measured == [(4, 1, True), (3, 1, True)]
    assert lines[0].memory == 10**8

    held = folder / "shards" / "study.json"
    held.write_text(held.read_text().replace('"study_seed": 0', '"study_seed": 1'))
    with pytest.raises(ValueError, match="study_seed was 1, is 0"):
        measure_scale(replace(options, resume=True))


def test_wrong_options_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="workers must be at least 1"):
        Scale(workers=(0,))
    with pytest.raises(ValueError, match="did you mean single-divert"):
        measure_scale(Scale(policy="singel-divert", out=tmp_path))
