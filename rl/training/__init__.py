"""A training run: its folder, checkpoints and scores, the choice of its best actor, its export.

`StableBaselinesVector` lets the learners of Stable-Baselines3 fly a native vector environment.

`rl.train` is its command. A run resumes to the same bits. It imports everything else of `rl`.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.training.run import run_training
    from rl.training.run_folder import TrainingPlan
    from rl.training.vector_adapter import StableBaselinesVector

_HOMES = {
    "rl.training.run": ("run_training",),
    "rl.training.run_folder": ("TrainingPlan",),
    "rl.training.vector_adapter": ("StableBaselinesVector",),
}

__all__ = [
    "StableBaselinesVector",
    "TrainingPlan",
    "run_training",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
