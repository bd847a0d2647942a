"""Pictures of learning and of what agents do, from runs and shipped weights.

`python -m rl.figures` is the command. `options` has what each figure is drawn from.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.figures.agents import draw_agents
    from rl.figures.flights import draw_comparison, draw_gains
    from rl.figures.learning import draw_reconstruction, draw_training, moving_average
    from rl.figures.options import (
        AgentsFigure,
        ComparisonFigure,
        GainsFigure,
        ReconstructionFigure,
        ShiftsFigure,
        TrainingFigure,
    )
    from rl.figures.shifts import draw_shifts

_HOMES = {
    "rl.figures.agents": ("draw_agents",),
    "rl.figures.flights": ("draw_comparison", "draw_gains"),
    "rl.figures.learning": ("draw_reconstruction", "draw_training", "moving_average"),
    "rl.figures.options": (
        "AgentsFigure",
        "ComparisonFigure",
        "GainsFigure",
        "ReconstructionFigure",
        "ShiftsFigure",
        "TrainingFigure",
    ),
    "rl.figures.shifts": ("draw_shifts",),
}

__all__ = [
    "AgentsFigure",
    "ComparisonFigure",
    "GainsFigure",
    "ReconstructionFigure",
    "ShiftsFigure",
    "TrainingFigure",
    "draw_agents",
    "draw_comparison",
    "draw_gains",
    "draw_reconstruction",
    "draw_shifts",
    "draw_training",
    "moving_average",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
