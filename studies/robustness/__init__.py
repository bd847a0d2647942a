"""One factor of the task at a time, until each policy breaks.

`python -m studies.robustness` is its command. `command` reads the options and runs the study; tables,
conclusions and pictures stand beside it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.robustness.command import Robustness, run_robustness

_HOMES = {
    "studies.robustness.command": (
        "Robustness",
        "run_robustness",
    ),
}

__all__ = [
    "Robustness",
    "run_robustness",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
