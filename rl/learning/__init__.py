"""What learns: algorithms on top of Stable-Baselines3 and torch, the autoencoder, and TD3 with memory.

torch lives here and in `rl.training`; where the extra `train` is missing, importing this wing says so in one
line. It knows environments by their spaces; runs, files and scores belong to `rl.training`, which imports it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports
from rl.training_libraries import require_training_libraries

require_training_libraries()

if TYPE_CHECKING:
    from rl.learning.algorithms import make_algorithm
    from rl.learning.td3 import FastTD3

_HOMES = {
    "rl.learning.algorithms": ("make_algorithm",),
    "rl.learning.td3": ("FastTD3",),
}

__all__ = [
    "FastTD3",
    "make_algorithm",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
