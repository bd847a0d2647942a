"""A policy flown by fuel-optimal guidance with one option changed, by path.

`studies.closed_loop.laws:single-divert+convex.speed_limit=40` goes wherever a policy's path does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from guidance.tracking.soft_landing import DEFAULT_OPTIONS
from guidance.validation import unknown_name
from hda.policies.composition import ComposedPolicy
from hda.policies.planned_descent import PlannedDescent
from hda.site_selection import NearestSafeSite, SingleDivertSite, SiteSelection

SITES: dict[str, Callable[[], SiteSelection]] = {
    "single-divert": SingleDivertSite,
    "nearest-safe": NearestSafeSite,
}
"""Site selections that the study flies."""

OPTIONS: dict[str, Callable[[str], float]] = {
    "thrust_margin": float,
    "terminal_periods": int,
    "speed_limit": float,
}
"""Options of `SoftLandingOptions` that it changes -> how their values are read."""


def law_name(sites: str, option: str, value: float) -> str:
    """Name in tables of a policy with one option changed."""
    return f"{sites}+convex.{option}-{value:g}"


def law_path(sites: str, option: str, value: float) -> str:
    """Path of a policy with one option changed."""
    return f"{__name__}:{sites}+convex.{option}={value:g}"


def change_law(sites: str, option: str, value: str) -> ComposedPolicy:
    """A site selection flown by fuel-optimal guidance with one option changed.

    Raises:
        ValueError: there are no such sites or no such option, or the value is out of range.
    """
    if sites not in SITES:
        raise ValueError(unknown_name("sites", sites, SITES))
    if option not in OPTIONS:
        raise ValueError(unknown_name("option", option, OPTIONS))
    number = OPTIONS[option](value)
    constant = option == "thrust_margin"
    law = PlannedDescent(replace(DEFAULT_OPTIONS, **{option: number}), bears_engine=not constant)
    return ComposedPolicy(law_name(sites, option, number), SITES[sites](), law)


def __getattr__(name: str) -> ComposedPolicy:
    """Give the policy of an attribute `sites+convex.option=value`."""
    law, equals, value = name.partition("=")
    sites, dot, option = law.partition("+convex.")
    try:
        if equals and dot:
            return change_law(sites, option, value)
    except ValueError as error:
        raise AttributeError(str(error)) from error
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
