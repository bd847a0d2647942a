"""Every policy on the same episodes: table, paired differences, figures and the report.

`python -m studies.compare` is its command. `command` reads the options and runs the study; tables,
conclusions and pictures stand beside it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.compare.command import Comparison, compare

_HOMES = {
    "studies.compare.command": (
        "Comparison",
        "compare",
    ),
}

__all__ = [
    "Comparison",
    "compare",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
