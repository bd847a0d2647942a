"""Tiles without first targets do not stop a study: the console, the provenance and the report name them."""

import csv
import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from hda.ground.library import SPLITS, Ground, load_tile
from hda.task.first_target import offers_targets
from hda.task.presets import PRESETS
from studies.campaign.claimed_folder import Existing
from studies.campaign.executor import local_processes
from studies.campaign.monte_carlo import Study, fly_chunk
from studies.campaign.points import describe_left_out
from studies.campaign.study_folder import open_study_folder
from studies.compare.command import Comparison, write_results
from studies.compare.flying import fly_comparison

PAPER = PRESETS["paper"]
STRICT = replace(PAPER, name="strict", start=replace(PAPER.start, hazard_share=0.99))
"""Of the 18 validation tiles a few have no place with so much hazard around it."""


def test_a_study_goes_on_without_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ground = Ground(STRICT.terrain, STRICT.criteria)
    tiles = {number: load_tile(ground, number, "validation") for number in SPLITS["validation"]}
    unfit = {number for number, tile in tiles.items() if not offers_targets(tile, STRICT.start)}
    assert 0 < len(unfit) < len(tiles)
    study = Study(STRICT, ("single-divert",), 30)
    with open_study_folder(tmp_path, study, Existing.REFUSE) as folder:
        fly_comparison(folder, partial(local_processes, 1), here=True, workers=1)
        told = capsys.readouterr().out
        write_results(folder, study, Comparison(out=tmp_path, figures=False, workers=1))
    left_out = json.loads((tmp_path / "provenance.json").read_text())["flight"]["left_out_tiles"]
    assert left_out
    assert set(left_out) <= unfit
    named = re.findall(r"not flown over: tiles? ([\d, ]+), without enough", told.replace("\n", " "))
    assert sorted(int(number) for group in named for number in group.split(",")) == left_out
    (line,) = re.findall(r'id="left-out">(.*?)</span>', (tmp_path / "report.html").read_text())
    assert [int(number) for number in re.findall(r"\d+", line)] == left_out
    with (tmp_path / "episodes.csv").open(newline="") as stream:
        flown = {int(row["tile"]) for row in csv.DictReader(stream)}
    assert len(flown) > 5
    assert not flown & unfit


def test_each_is_named_once() -> None:
    study = Study(STRICT, ("single-divert",), 30)
    chunks = [replace(fly_chunk(study, 0, 1), left_out=tiles) for tiles in [(1, 2), (2,), (2, 3)]]
    named: set[int] = set()
    words = [describe_left_out(chunk, study, named) for chunk in chunks]
    assert "tiles 1, 2, without" in words[0]
    assert words[1] == ""
    assert "tile 3, without" in words[2]
