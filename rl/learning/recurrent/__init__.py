"""TD3 with memory for any Gymnasium environment with boxes: networks, sequences, losses and the agent.

`td3_lstm` lists where it departs from the paper's Algorithm 3. Nothing here knows of landings.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.learning.recurrent.hyperparameters import Hyperparameters
    from rl.learning.recurrent.replay import EpisodeReplay
    from rl.learning.recurrent.td3_lstm import RecurrentTD3

_HOMES = {
    "rl.learning.recurrent.hyperparameters": ("Hyperparameters",),
    "rl.learning.recurrent.replay": ("EpisodeReplay",),
    "rl.learning.recurrent.td3_lstm": ("RecurrentTD3",),
}

__all__ = [
    "EpisodeReplay",
    "Hyperparameters",
    "RecurrentTD3",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
