"""Every policy's safe-landing ratios are pinned: none may fall, or rise, without somebody saying so.

`safe_ratios.csv` holds safe sites and successes in so many episodes, as `python -m studies.compare --preset
PRESET` gave them at study seed 0. Seeds are fixed, so on one machine the figures repeat; another processor
may turn a cell of terrain in a million, and a policy may change on purpose. The gate is binomial and
two-sided: were a policy still as good as pinned, each of its four bounds would be broken with a probability
of at most 1e-4. At 500 episodes and 95 % it sees a loss of 5 points with a power of 0.75, at 1000 with 0.99.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import pytest

from hda.registry import policy_entry, policy_names
from hda.task.presets import PRESETS
from studies.campaign.monte_carlo import Study, fly_chunk
from studies.statistics.ratios import least_passing


@dataclass(frozen=True)
class Pin:
    preset: str
    policy: str
    episodes: int
    safe_site: int
    success: int
    fast_episodes: int
    slow_episodes: int


def read_pins() -> list[Pin]:
    numbers = ("episodes", "safe_site", "success", "fast_episodes", "slow_episodes")
    with (Path(__file__).parent / "safe_ratios.csv").open() as stream:
        return [
            Pin(row["preset"], row["policy"], *(int(row[name]) for name in numbers))
            for row in csv.DictReader(stream)
        ]


PINS = read_pins()


def check(pin: Pin, episodes: int) -> None:
    rows = fly_chunk(Study(PRESETS[pin.preset], (pin.policy,), episodes), 0, episodes).rows[pin.policy]
    for name in ("safe_site", "success"):
        landed = sum(getattr(row, name) for row in rows)
        ratio = getattr(pin, name) / pin.episodes
        least, most = least_passing(episodes, ratio), episodes - least_passing(episodes, 1.0 - ratio)
        assert least <= landed <= most, (
            f"{pin.policy} on {pin.preset}: {landed} of {episodes} {name}, pinned at {ratio:.1%}; "
            f"outside {least} to {most}, which happens by chance once in 10 000"
        )


@pytest.mark.parametrize("preset", ["paper", "partial"])
def test_every_policy_is_pinned_where_it_belongs(preset: str) -> None:
    made_for = {name: policy_entry(name).preset or "paper" for name in policy_names()}
    pinned = {pin.policy for pin in PINS if pin.preset == preset}
    assert {name for name in made_for if made_for[name] == preset} <= pinned <= set(made_for)


@pytest.mark.parametrize("pin", [p for p in PINS if p.fast_episodes], ids=lambda p: f"{p.preset}-{p.policy}")
def test_ratio_holds(pin: Pin) -> None:
    check(pin, pin.fast_episodes)


@pytest.mark.slow
@pytest.mark.parametrize("pin", PINS, ids=lambda p: f"{p.preset}-{p.policy}")
def test_ratio_holds_over_many_episodes(pin: Pin) -> None:
    check(pin, pin.slow_episodes)
