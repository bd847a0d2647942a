"""How long planners take, what their plans cost, and whether these keep their limits.

`python -m studies.timing` is its command. `command` reads the options and runs the study; tables,
conclusions and pictures stand beside it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.timing.command import Timing, study_timing

_HOMES = {
    "studies.timing.command": (
        "Timing",
        "study_timing",
    ),
}

__all__ = [
    "Timing",
    "study_timing",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
