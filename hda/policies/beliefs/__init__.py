"""What a policy believes of the ground after its looks, and what counting on training tiles taught it.

`belief` fuses looks that are maps with noise, `measured_belief` those of a ranging LIDAR (`map_readings` and
`measured_readings` say what a reading is worth); `surroundings` infers what was not seen. The policies that
choose sites import it; nothing here knows a policy.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.policies.beliefs.belief import GroundBelief
    from hda.policies.beliefs.measured_belief import MeasuredBelief
    from hda.policies.beliefs.surroundings import infer_unseen

_HOMES = {
    "hda.policies.beliefs.belief": ("GroundBelief",),
    "hda.policies.beliefs.measured_belief": ("MeasuredBelief",),
    "hda.policies.beliefs.surroundings": ("infer_unseen",),
}

__all__ = ["GroundBelief", "MeasuredBelief", "infer_unseen"]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
