"""Does memory help: agents with and without it, compared over training seeds.

`python -m studies.memory` is its command. `command` reads the options and runs the study; tables,
conclusions and pictures stand beside it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.memory.command import MemoryStudy, study_memory

_HOMES = {
    "studies.memory.command": (
        "MemoryStudy",
        "study_memory",
    ),
}

__all__ = [
    "MemoryStudy",
    "study_memory",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
