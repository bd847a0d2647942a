"""The table is a pure function of rows, and its bytes are a pure function of its summaries."""

import csv
import io
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import rich.console
from pyarrow.parquet import read_table

from hda.flight.episode_row import MEASURES, EpisodeRow
from studies.campaign.episode_files import write_episodes
from studies.campaign.monte_carlo import Chunk
from studies.compare.scores import score_study
from studies.compare.table import PolicySummary, print_table, summarize_policy, write_table
from studies.statistics.ratios import clustered_interval, mcnemar_p_value, wilson_interval
from studies.statistics.reliability import exact_lower_bound


def make_rows(policy: str, safe: np.ndarray) -> list[EpisodeRow]:
    rng = np.random.default_rng(7)
    return [
        EpisodeRow(
            policy=policy,
            episode=k,
            tile=1000 + k % 4,
            outcome="success" if ok else "unsafe-site",
            safe_site=bool(ok),
            success=bool(ok and k % 3 != 0),
            miss_distance_m=float(rng.random()),
            touchdown_speed_mps=float(rng.random()),
            propellant_percent=60.0 + float(rng.random()),
            minimum_slant_angle_deg=70.0,
            maximum_thrust_n=4500.0,
            reward=1.0 / 3.0,
            flight_time_s=40.0,
            decisions=8,
            fallbacks=k % 2,
            touchdown_x_m=500.0,
            touchdown_y_m=500.0,
        )
        for k, ok in enumerate(safe)
    ]


def chunks_of(rows: dict[str, list[EpisodeRow]], size: int) -> Iterator[Chunk]:
    count = len(next(iter(rows.values())))
    for first in range(0, count, size):
        own = {name: whole[first : first + size] for name, whole in rows.items()}
        yield Chunk(first, min(first + size, count), own, {name: np.full(3, 0.001) for name in rows})


@pytest.fixture
def summaries() -> list[PolicySummary]:
    rng = np.random.default_rng(3)
    first, second = rng.random(60) < 0.8, rng.random(60) < 0.95
    rows = {"single-divert": make_rows("single-divert", first), "other": make_rows("other", second)}
    scores = score_study(tuple(rows), "single-divert", chunks_of(rows, 7))
    return [
        summarize_policy(scores.policies["single-divert"], "paper", False, is_reference=True),
        summarize_policy(scores.policies["other"], "paper", True, is_reference=False),
    ]


def test_ratios_and_test_are_those_of_the_rows(summaries: list[PolicySummary]) -> None:
    rng = np.random.default_rng(3)
    first, second = rng.random(60) < 0.8, rng.random(60) < 0.95
    tiles = 1000 + np.arange(60) % 4
    assert summaries[1].safe_site == wilson_interval(int(second.sum()), 60)
    assert summaries[1].safe_site_by_tile == clustered_interval(second, tiles)
    assert summaries[1].mcnemar_p == mcnemar_p_value(second, first)
    assert np.isnan(summaries[0].mcnemar_p)
    assert summaries[1].success.estimate == np.mean(second & (np.arange(60) % 3 != 0))
    assert summaries[1].fallbacks == 30
    successes = int((second & (np.arange(60) % 3 != 0)).sum())
    assert summaries[1].success_at_least == exact_lower_bound(successes, 60, 0.95)
    assert summaries[1].success_at_least_by_tile == exact_lower_bound(0, 4, 0.95)  # each tile saw a failure


def test_means_are_those_of_the_rows(summaries: list[PolicySummary]) -> None:
    from scipy.stats import t

    rows = make_rows("other", np.ones(60))
    tiles = np.array([row.tile for row in rows])
    for name in MEASURES:
        values = np.array([getattr(row, name) for row in rows])
        mean, by_tile = summaries[1].means[name], summaries[1].means_by_tile[name]
        assert mean.estimate == pytest.approx(values.mean(), rel=1e-13)
        half = t.ppf(0.975, 59) * values.std(ddof=1) / np.sqrt(60)
        assert (mean.low, mean.high) == pytest.approx((values.mean() - half, values.mean() + half))
        totals = np.array([(values[tiles == tile] - values.mean()).sum() for tile in np.unique(tiles)])
        variance = max(values.var(ddof=1) / 60, 4 / 3 * (totals**2).sum() / 60**2)
        assert by_tile.high - by_tile.estimate == pytest.approx(t.ppf(0.975, 3) * np.sqrt(variance))


def test_means_hold_their_interval(summaries: list[PolicySummary]) -> None:
    for name in MEASURES:
        mean = summaries[1].means[name]
        assert mean.low <= mean.estimate <= mean.high
    constant = summaries[1].means["maximum_thrust_n"]
    assert (constant.low, constant.estimate, constant.high) == (4500.0, 4500.0, 4500.0)


def test_table_file_has_the_columns_of_the_contract(summaries: list[PolicySummary], tmp_path) -> None:
    write_table(tmp_path / "table.csv", summaries)
    with (tmp_path / "table.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    wanted = ["policy", "preset", "episodes", "safe_site_percent", "safe_site_low", "safe_site_high"]
    wanted += ["success_percent", "success_low", "success_high", "mcnemar_p", "fallbacks", "privileged"]
    wanted += [f"{name}{end}" for name in MEASURES for end in ("", "_low", "_high")]
    assert set(wanted) <= set(rows[0])
    assert rows[0]["mcnemar_p"] == ""
    assert rows[1]["privileged"] == "True"
    assert float(rows[1]["safe_site_percent"]) == pytest.approx(100.0 * summaries[1].safe_site.estimate)


def test_episode_files_agree(tmp_path) -> None:
    rows = make_rows("single-divert", np.arange(20) % 5 > 0)
    write_episodes(tmp_path, rows)
    parquet = read_table(tmp_path / "episodes.parquet")
    with (tmp_path / "episodes.csv").open(newline="") as stream:
        lines = list(csv.DictReader(stream))
    assert len(lines) == len(rows) == parquet.num_rows
    assert list(lines[0]) == parquet.column_names
    for name in parquet.column_names:
        for line, value in zip(lines, parquet[name].to_pylist(), strict=True):
            if isinstance(value, float):
                assert float(line[name]) == pytest.approx(value, rel=1e-8)
            else:
                assert line[name] == str(value)


def test_unequal_episodes_are_refused() -> None:
    rows = make_rows("other", np.ones(10, dtype=bool))
    moved = [replace(row, episode=row.episode + 1) for row in make_rows("single-divert", np.ones(10))]
    with pytest.raises(ValueError, match="same episodes"):
        score_study(("other",), "single-divert", chunks_of({"other": rows, "single-divert": moved}, 5))


@pytest.mark.parametrize("width", [80, 100, 240])
def test_no_number_is_cut_off_on_a_terminal_of_any_width(
    summaries: list[PolicySummary], monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    screen = io.StringIO()
    made = rich.console.Console

    def open_console(width: int = width) -> rich.console.Console:
        return made(file=screen, force_terminal=True, width=width)

    monkeypatch.setattr(rich.console, "Console", open_console)
    print_table(summaries)
    shown = screen.getvalue()
    assert "…" not in shown
    assert ("slant" in shown) == (width == 240)
    assert f"{100.0 * summaries[1].success_at_least_by_tile:.2f}" in shown
