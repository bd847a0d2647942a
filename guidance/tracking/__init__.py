"""Flying a plan: a reference at the control instants, the feedback about it, a gentle end, a change of site.

It stands on top of `guidance`: it asks `guidance.pdg`, and policies and the vehicle import it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.tracking.reference import TrackingReference, make_reference
    from guidance.tracking.regulator import DEFAULT_WEIGHTS, TrackingWeights, tracking_gains
    from guidance.tracking.soft_landing import SoftLanding, SoftLandingOptions, plan_soft_landing

_HOMES = {
    "guidance.tracking.reference": (
        "TrackingReference",
        "make_reference",
    ),
    "guidance.tracking.regulator": (
        "DEFAULT_WEIGHTS",
        "TrackingWeights",
        "tracking_gains",
    ),
    "guidance.tracking.soft_landing": (
        "SoftLanding",
        "SoftLandingOptions",
        "plan_soft_landing",
    ),
}

__all__ = [
    "DEFAULT_WEIGHTS",
    "SoftLanding",
    "SoftLandingOptions",
    "TrackingReference",
    "TrackingWeights",
    "make_reference",
    "plan_soft_landing",
    "tracking_gains",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
