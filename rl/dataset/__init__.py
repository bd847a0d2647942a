"""Offline data: what policies saw, did and were paid for, as files that other learners read.

`python -m rl.dataset` writes them; `read_dataset` reads the plain file, as numbers and text. A file of
Minari's is written, and never read: what it names as its environment would be code to run.
It imports everything of `rl` that flies, nothing of what learns.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.dataset.plain_file import Dataset, DatasetError, read_dataset
    from rl.dataset.transitions import Transitions

_HOMES = {
    "rl.dataset.plain_file": ("Dataset", "DatasetError", "read_dataset"),
    "rl.dataset.transitions": ("Transitions",),
}

__all__ = [
    "Dataset",
    "DatasetError",
    "Transitions",
    "read_dataset",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
