"""Policies that see the true map, as bounds on what any other can do; every table marks them.

Nothing outside may be built on them but studies that ask what could have been known.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.policies.privileged.knowable_ground import KnowableGround, could_have_landed
    from hda.policies.privileged.oracle import OracleSite

_HOMES = {
    "hda.policies.privileged.knowable_ground": (
        "KnowableGround",
        "could_have_landed",
    ),
    "hda.policies.privileged.oracle": ("OracleSite",),
}

__all__ = [
    "KnowableGround",
    "OracleSite",
    "could_have_landed",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
