"""What each layer of reality costs each policy, and whether their order is still the order.

`python -m studies.realism` is its command. `command` reads the options and runs the study; tables,
conclusions and pictures stand beside it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.realism.command import Realism, run_realism

_HOMES = {
    "studies.realism.command": (
        "Realism",
        "run_realism",
    ),
}

__all__ = [
    "Realism",
    "run_realism",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
