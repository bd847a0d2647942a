"""What a look of a ranging LIDAR is worth: how often ground that it calls safe is safe, by range and rays.

`python -m studies.looks` is its command. `counts` takes looks and counts pixels, `calibration` flies beliefs;
`command` reads the options and runs the study; its tables and pictures stand beside it. Nothing imports it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.looks.command import Looks, study_looks

_HOMES = {
    "studies.looks.command": (
        "Looks",
        "study_looks",
    ),
}

__all__ = [
    "Looks",
    "study_looks",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
