"""For the tests of users' own policies."""

from __future__ import annotations

from collections.abc import Callable

import rl  # noqa: F401 - puts the learning agents into the registry
from guidance.validation import finite_number
from hda.flight.episode import fly
from hda.ground.library import Ground, prepare_tiles
from hda.policies.entry import AnyPolicy, PolicyEntry
from hda.registry import describe_policy, policy_entry
from hda.task.presets import Preset, find_preset
from hda.task.scenario import sample_scenario
from studies.statistics.ratios import Interval, least_passing, wilson_interval

_MEASURES = ("safe_site", "success")


def assert_safe_ratio(
    policy: str | PolicyEntry | AnyPolicy | Callable[[], AnyPolicy],
    preset: str | Preset = "paper",
    episodes: int = 500,
    at_least: float = 0.9,
    measure: str = "safe_site",
    false_alarm: float = 1e-3,
) -> Interval:
    """Assert that a policy lands on safe ground often enough; for pytest.

    The policy flies the first episodes of study seed 0 on the validation tiles. The gate is the exact
    binomial one of `least_passing`: a policy whose true ratio on these tiles is `at_least` fails with a
    probability of at most `false_alarm`. Few episodes can only see a large loss.

    Args:
        policy: a name, a path `package.module:Name`, a registry line, a policy, or what makes one.
        preset: name of a preset, or a Preset.
        episodes: at least 1.
        at_least: the ratio that is claimed, in (0, 1].
        measure: `safe_site` (the paper's ratio) or `success`.
        false_alarm: in (0, 0.5].

    Returns:
        The ratio that was flown, with Wilson's 95 % interval.

    Raises:
        AssertionError: the policy landed safely too rarely; the message states the false-alarm rate.
        ValueError: an argument is out of range, or so few episodes cannot fail anything at that rate.
    """
    from scipy.stats import binom

    if measure not in _MEASURES:
        raise ValueError(f"measure must be one of {', '.join(_MEASURES)}, got {measure!r}")
    claimed = finite_number("at_least", at_least, above=0.0, at_most=1.0)
    least = least_passing(episodes, claimed, false_alarm)
    if least == 0:
        raise ValueError(
            f"episodes: {episodes} cannot fail a claim of {claimed:.1%} at a false alarm of {false_alarm:g}"
        )
    entry = policy_entry(policy) if isinstance(policy, str) else describe_policy(policy, "policy")
    setting = find_preset(preset)
    prepare_tiles(Ground(setting.terrain, setting.criteria), "validation")
    pilot = entry.make()
    landed = sum(
        getattr(fly(pilot, sample_scenario(setting, 0, episode)).outcome, measure)
        for episode in range(episodes)
    )
    flown = wilson_interval(landed, episodes)
    if landed < least:
        alarm = float(binom.cdf(least - 1, episodes, claimed))
        raise AssertionError(
            f"policy {entry.name!r} on preset {setting.name!r}: {measure} in {landed} of {episodes} episodes"
            f" ({flown.estimate:.1%}, 95 % interval {flown.low:.1%} to {flown.high:.1%}), at least {least}"
            f" are asked for. A policy whose true ratio is {claimed:.1%} falls below with a probability of"
            f" {alarm:.1e} (false-alarm rate, at most {false_alarm:g})"
        )
    return flown
