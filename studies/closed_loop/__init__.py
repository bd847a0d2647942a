"""What the options of fuel-optimal guidance are worth in closed loop.

`python -m studies.closed_loop` is its command. `command` reads the options and runs the study; `laws` gives
the policies of its lines by path.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.closed_loop.command import ClosedLoop, run_closed_loop

_HOMES = {
    "studies.closed_loop.command": (
        "ClosedLoop",
        "run_closed_loop",
    ),
}

__all__ = [
    "ClosedLoop",
    "run_closed_loop",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
