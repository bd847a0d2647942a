"""Policies of other groups, rebuilt from what their papers say; docstrings list sources and deviations.

They meet the same looks and vehicle as the rest, and fly when asked for by name, as `rivals` or with `all`.
They read the beliefs, the price's estimates and the laws beside them; only the catalogue imports them.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.policies.rivals.alhat import AlhatSite
    from hda.policies.rivals.polynomial_laws import ApolloGuidance, EGuidance
    from hda.policies.rivals.reachability_steering import ReachabilitySteeringSite

_HOMES = {
    "hda.policies.rivals.alhat": ("AlhatSite",),
    "hda.policies.rivals.polynomial_laws": ("ApolloGuidance", "EGuidance"),
    "hda.policies.rivals.reachability_steering": ("ReachabilitySteeringSite",),
}

__all__ = ["AlhatSite", "ApolloGuidance", "EGuidance", "ReachabilitySteeringSite"]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
