"""Margins of the ZEM/ZEV loop over the agent's gains, and held flights.

`python -m studies.stability` is its command. `command` reads the options and runs the study; tables,
conclusions and pictures stand beside it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.stability.command import Stability, study_stability

_HOMES = {
    "studies.stability.command": (
        "Stability",
        "study_stability",
    ),
}

__all__ = [
    "Stability",
    "study_stability",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
