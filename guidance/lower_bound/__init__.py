"""What no flight can undercut: a lower bound on the propellant over all times of flight, with its proof.

The bound is the dual function of a convex relaxation in continuous time, so it needs no solver and no mesh.
The search for good dual variables (primers) is compiled; `guidance.descent.dual_bound` checks what it found
by code of its own. Planners and `guidance.pdg` import this wing; it imports `guidance.descent` and
`guidance.flight_time`.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.lower_bound.proof import (
        GAP_TOLERANCE,
        bound_outside,
        certify_bound,
        prove_least_propellant,
        prove_no_flight,
        prove_no_landing,
    )

_HOMES = {
    "guidance.lower_bound.proof": (
        "GAP_TOLERANCE",
        "bound_outside",
        "certify_bound",
        "prove_least_propellant",
        "prove_no_flight",
        "prove_no_landing",
    ),
}

__all__ = [
    "GAP_TOLERANCE",
    "bound_outside",
    "certify_bound",
    "prove_least_propellant",
    "prove_no_flight",
    "prove_no_landing",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
