"""hazard-aware with one weight changed, as a policy by path: `studies.trade_off.weights:failure_cost=200`.

The paths go wherever a policy's path does, as in `python -m studies.compare --split tuning --policies`.
"""

from __future__ import annotations

from dataclasses import fields, replace

from guidance.validation import unknown_name
from hda.policies.composition import ComposedPolicy
from hda.policies.hazard_aware import HazardAwareSite
from hda.policies.site_price import HazardAwareWeights
from hda.policies.waiting_descent import WaitingDescent

SWEEP: dict[str, tuple[float, ...]] = {
    "failure_cost": (2.0, 20.0, 200.0, 20000.0),
    "divert_cost": (0.0, 20.0),
    "surprise_area": (1.0, 100.0),
    "island_area": (50.0, 5000.0),
    "divert_slope": (0.01, 0.16),
    "switch_gain": (0.0, 1.0),
    "commit_time": (0.5, 7.5),
}
"""Weight -> values beside the default."""


def change_weight(weight: str, value: float) -> ComposedPolicy:
    """hazard-aware with one weight changed.

    Raises:
        ValueError: there is no such weight, or the value is out of range.
    """
    names = [field.name for field in fields(HazardAwareWeights)]
    if weight not in names:
        raise ValueError(unknown_name("weight", weight, names))
    weights = replace(HazardAwareWeights(), **{weight: value})
    return ComposedPolicy(sweep_name(weight, value), HazardAwareSite(weights), WaitingDescent())


def sweep_name(weight: str, value: float) -> str:
    """Name in tables of hazard-aware with one weight changed."""
    return f"hazard-aware.{weight}-{value:g}"


def sweep_path(weight: str, value: float) -> str:
    """Path of hazard-aware with one weight changed."""
    return f"{__name__}:{weight}={value:g}"


def __getattr__(name: str) -> ComposedPolicy:
    """Give the policy of an attribute `weight=value`."""
    weight, equals, value = name.partition("=")
    try:
        if equals:
            return change_weight(weight, float(value))
    except ValueError as error:
        raise AttributeError(str(error)) from error
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
