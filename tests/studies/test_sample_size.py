"""The planner's power is that of the test that the table prints."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from studies.sample_size import (
    SampleSize,
    comparison_episodes,
    independent_discordance,
    mcnemar_power,
    plan_comparison,
)
from studies.statistics.ratios import mcnemar_p_value


@pytest.mark.parametrize(
    ("episodes", "discordant", "difference"),
    [(200, 0.2, 0.08), (500, 0.06, 0.03), (300, 0.1, 0.0), (40, 0.3, 0.3)],
)
def test_power_is_what_simulated_studies_reject(episodes: int, discordant: float, difference: float) -> None:
    """4000 studies: five standard errors are 4 points at most."""
    rng = np.random.default_rng(9)
    only_one, only_other = (discordant + difference) / 2, (discordant - difference) / 2
    tables = rng.multinomial(episodes, [only_one, only_other, 1 - discordant], size=4000)
    distinct, counts = np.unique(tables, axis=0, return_counts=True)
    rejected = 0
    for (one, other, both), times in zip(distinct, counts, strict=True):
        first, second = np.repeat([1, 0, 1], [one, other, both]), np.repeat([0, 1, 1], [one, other, both])
        rejected += int(times) * (mcnemar_p_value(first, second) <= 0.05)
    assert mcnemar_power(episodes, discordant, difference) == pytest.approx(rejected / 4000, abs=0.04)


def test_the_false_alarm_is_kept() -> None:
    for episodes in (10, 100, 1000, 10_000):
        assert mcnemar_power(episodes, 0.1, 0.0) <= 0.05


def test_so_many_episodes_reach_the_power_and_fewer_do_not() -> None:
    for difference, discordant in ((0.01, 0.05), (0.05, 0.2), (0.2, 0.2)):
        count = comparison_episodes(difference, 0.9, discordant)
        assert mcnemar_power(count, discordant, difference) >= 0.9
        assert mcnemar_power(int(0.97 * count) - 1, discordant, difference) < 0.9


def test_it_agrees_with_the_normal_approximation_where_that_holds() -> None:
    """Connor, Biometrics 43, 1987: (z_a sqrt(psi) + z_b sqrt(psi - d^2))^2 / d^2."""
    discordant, difference = 0.172, 0.01
    root = 1.959964 * np.sqrt(discordant) + 1.281552 * np.sqrt(discordant - difference**2)
    assert comparison_episodes(difference, 0.9, discordant) == pytest.approx(
        (root / difference) ** 2, rel=0.02
    )


def test_independent_policies_differ_as_often_as_they_should() -> None:
    rng = np.random.default_rng(0)
    one, other = rng.random(200_000) < 0.9, rng.random(200_000) < 0.93
    assert independent_discordance(0.9, 0.03) == pytest.approx(np.mean(one != other), abs=0.005)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (SampleSize(difference=0.0), "difference"),
        (SampleSize(difference=20.0), "reference"),
        (SampleSize(power=1.0), "power"),
        (SampleSize(significance=0.0), "significance"),
        (SampleSize(discordant=0.5), "discordant"),
        (SampleSize(difference=1e-4), "takes more than"),
    ],
)
def test_a_wrong_option_is_named(options: SampleSize, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan_comparison(options)


def test_the_command_prints_and_keeps_both_tables(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "studies.sample_size", "--difference", "1", "--power", "0.9"]
    command += ["--out", str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert "power of 0.9" in ended.stdout
    assert "852" in ended.stdout
    with (tmp_path / "demonstration.csv").open() as stream:
        assert {row["failures_0"] for row in csv.DictReader(stream)} == {"45", "230", "852", "1705"}
    with (tmp_path / "comparison.csv").open() as stream:
        plans = list(csv.DictReader(stream))
    assert len(plans) == 3
    assert all(float(plan["power"]) >= 0.9 for plan in plans)
    assert json.loads((tmp_path / "provenance.json").read_text())["options"]["power"] == 0.9
