"""Policies: where to land, and how to fly there.

Each is a site selection with a guidance law (`composition`); `catalogue` lists them for the registry. The
price of a site stands beside the policies that use it; what is believed of the ground lives in `beliefs`, and
those that see the true map in `privileged`. A policy knows the task and `guidance`, never the simulator.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.policies.composition import ComposedPolicy
    from hda.policies.entry import AnyPolicy, PolicyEntry
    from hda.policies.planned_descent import PlannedDescent
    from hda.policies.zem_zev import FixedGainZemZev

_HOMES = {
    "hda.policies.composition": ("ComposedPolicy",),
    "hda.policies.entry": (
        "AnyPolicy",
        "PolicyEntry",
    ),
    "hda.policies.planned_descent": ("PlannedDescent",),
    "hda.policies.zem_zev": ("FixedGainZemZev",),
}

__all__ = [
    "AnyPolicy",
    "ComposedPolicy",
    "FixedGainZemZev",
    "PlannedDescent",
    "PolicyEntry",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
