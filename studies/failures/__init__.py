"""Failed episodes and the computed cause of each.

`python -m studies.failures` is its command. `command` reads the options and runs the study; tables,
conclusions and pictures stand beside it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.failures.command import Failures, show_failures

_HOMES = {
    "studies.failures.command": (
        "Failures",
        "show_failures",
    ),
}

__all__ = [
    "Failures",
    "show_failures",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
