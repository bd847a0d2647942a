"""Where policies fall short: what was seen of the ground that a landing failed on, and where propellant goes.

`python -m studies.shortfall` is its command. `encoded_sight` holds looks and what an encoder keeps of them
against the true map, `propellant_parts` flies episodes again with the last site known earlier, `flights` does
both for an episode; `command` reads the options and runs the study; its tables stand beside it. Nothing
imports it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.shortfall.command import Shortfall, study_shortfall

_HOMES = {
    "studies.shortfall.command": (
        "Shortfall",
        "study_shortfall",
    ),
}

__all__ = [
    "Shortfall",
    "study_shortfall",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
