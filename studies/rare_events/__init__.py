"""How likely a policy fails where failures are rare: flights are branched where failure is near.

`python -m studies.rare_events` is its command. `command` reads the options and runs the study; `splitting`
grows weighted trees out of any start, `levels` and `level_values` say where a branch is worth its steps.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.rare_events.command import RareEvents, run_rare_events
    from studies.rare_events.splitting import Window, grow_tree

_HOMES = {
    "studies.rare_events.command": (
        "RareEvents",
        "run_rare_events",
    ),
    "studies.rare_events.splitting": (
        "Window",
        "grow_tree",
    ),
}

__all__ = [
    "RareEvents",
    "Window",
    "grow_tree",
    "run_rare_events",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
