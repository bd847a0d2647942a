"""`compare --terrain`: a study over a user's own ground, from file to provenance."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tyro

from examples.own_terrain import write_site
from studies.campaign.command_line import choose_policies
from studies.compare.command import Comparison, compare, plan_study, read_options

# rasterio 1.4 multiplies affine 3 transforms the old way, inside itself.
pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")


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
        ({"terrain": None, "nodata": (0.0,)}, "nodata is for a terrain of your own"),
        ({"terrain": None, "band": 1}, "band is for a terrain of your own"),
        ({"terrain": None, "flat_is_ground": True}, "flat_is_ground is for a terrain of your own"),
        ({"terrain": None, "detail": 1}, "detail is for a terrain of your own"),
        ({"rock_abundance": "dense"}, "rocks that are added: give --detail SEED too"),
        ({"detail": 1}, "pixels of 1 m show their own hazards"),
        ({"detail": 1, "rock_abundance": "dens"}, "rock abundance.*dense"),
        ({"detail": -1}, "whole number of at least 0"),
        ({"band": 2}, "band is for GeoTIFF files"),
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


@pytest.mark.slow
def test_a_tile_without_hazard_does_not_stop_the_study(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heights = np.load(site, allow_pickle=False)
    smooth = np.random.default_rng(0).normal(scale=1e-3, size=heights.shape) + 0.01 * np.arange(1000)
    smooth[:, :30] = -9999.0
    np.save(tmp_path / "two.npy", np.hstack([smooth, heights]))
    options = Comparison(
        episodes=3,
        policies=("no-divert", "single-divert"),
        terrain=tmp_path / "two.npy",
        workers=1,
        out=tmp_path / "study",
        figures=False,
        report=False,
    )
    with pytest.raises(ValueError, match=r"3% of tile 0 is exactly -9999 m.*--nodata=-9999"):
        compare(options)
    compare(replace(options, nodata=(-9999.0,)))
    assert "two.npy: 1 of 2 tiles are not flown over, tile 0" in capsys.readouterr().err
    terrain = json.loads((tmp_path / "study" / "provenance.json").read_text())["preset"]["terrain"]
    assert terrain["too_safe"] == [0]
    assert terrain["nodata"] == [-9999.0]
    with (tmp_path / "study" / "episodes.csv").open(newline="") as stream:
        assert {row["tile"] for row in csv.DictReader(stream)} == {"1"}


@pytest.mark.slow
def test_posts_of_5_m_go_to_a_table_of_all_policies(tmp_path: Path) -> None:
    """One command, from an orbiter's GeoTIFF to every policy that flies by default."""
    write_site(tmp_path / "site.tif")
    terrain, out = tmp_path / "site.tif", tmp_path / "study"
    ground = ["--terrain", str(terrain), "--detail", "3", "--rock-abundance", "medium", "--preset", "lidar"]
    study = ["--episodes", "2", "--workers", "1", "--no-figures", "--out", str(out)]
    compare(read_options([*ground, *study]))
    with (out / "table.csv").open(newline="") as stream:
        assert {row["policy"] for row in csv.DictReader(stream)} >= set(
            choose_policies(("default",), "lidar")[0]
        )
    with (out / "episodes.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 2 * len({row["policy"] for row in rows})
    provenance = json.loads((out / "provenance.json").read_text())
    assert provenance["preset"]["name"] == "lidar-site-medium"
    added = provenance["preset"]["terrain"]["added"]
    assert (added["seed"], added["rock_abundance"]) == (3, "medium")
    assert provenance["preset"]["terrain"]["source_pixel"] == 5.0
    assert (out / "report.html").stat().st_size > 1000


@pytest.mark.parametrize(
    "words", [["--nodata", "-9999"], ["--nodata=-3.4e+38"], ["--nodata", "0", "-3.4e+38"]]
)
def test_negative_values_can_be_typed(words: list[str], site: Path) -> None:
    options = tyro.cli(Comparison, args=["--terrain", str(site), *words, "--flat-is-ground", "--band", "1"])
    assert options.nodata[-1] < 0.0
    assert options.flat_is_ground
    assert options.band == 1
