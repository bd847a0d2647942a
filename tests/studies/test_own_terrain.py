"""`compare --terrain`: a study over a user's own ground, from file to provenance."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from examples.own_terrain import write_site
from studies.compare import Comparison, compare, plan_study


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("site") / "site.npy"
    write_site(path)
    return path


@pytest.mark.slow
def test_a_study_over_own_ground(site: Path, tmp_path: Path) -> None:
    options = Comparison(
        episodes=3,
        policies=("no-divert", "single-divert"),
        terrain=site,
        workers=1,
        out=tmp_path / "study",
        figures=False,
    )
    compare(options)
    provenance = json.loads((tmp_path / "study" / "provenance.json").read_text())
    assert provenance["study"]["split"] == "own"
    terrain = provenance["preset"]["terrain"]
    assert terrain["file"] == "site.npy"
    assert len(terrain["sha256"]) == 64
    assert terrain["resampling"] == "none"
    with (tmp_path / "study" / "episodes.csv").open(newline="") as stream:
        assert len(list(csv.DictReader(stream))) == 6
    assert (tmp_path / "study" / "report.html").stat().st_size > 1000
    np.save(tmp_path / "site.npy", np.load(site, allow_pickle=False) + 1.0)
    with pytest.raises(ValueError, match=r"preset\.terrain\.sha256 was"):
        compare(replace(options, terrain=tmp_path / "site.npy", resume=True))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"split": "tuning"}, "split must be 'own'"),
        ({"terrain": None, "hazard_share": 0.1}, "hazard_share is for a terrain of your own"),
        ({"terrain": None, "split": "own"}, "needs a terrain of your own"),
        ({"terrain": Path("none.tif")}, "no such file"),
    ],
)
def test_a_wrong_option_is_one_line(
    site: Path, tmp_path: Path, change: dict[str, object], words: str
) -> None:
    options = Comparison(episodes=1, policies=("no-divert",), terrain=site, workers=1, out=tmp_path / "study")
    with pytest.raises(ValueError, match=words) as caught:
        compare(replace(options, **change))  # pyright: ignore[reportArgumentType]
    assert "\n" not in str(caught.value)


def test_the_policies_meet_the_same_ground(site: Path) -> None:
    study = plan_study(Comparison(episodes=1, policies=("oracle",), terrain=site, workers=1))
    assert study.preset.name == "paper-site"
    assert study.split == "own"
