"""The paper's figures of learning, from runs and shipped weights.

python -m rl.figures training --run runs/td3-0            # losses, reward and safe ratio over a run
python -m rl.figures reconstruction                       # looks above, their reconstructions below
python -m rl.figures gains --episode 3                    # gains and rate of time over one episode
python -m rl.figures comparison --search 300              # agent and fixed gains where they part
python -m rl.figures shifts --preset lidar                # at what height policies move their targets
python -m rl.figures agents --results results/paper       # every agent beside rule and optimiser, by seed
"""

from __future__ import annotations

import sys
from typing import Annotated, Any

import tyro

from guidance.console import one_line_errors, tolerate_encoding
from rl.figures.agents import draw_agents
from rl.figures.flights import draw_comparison, draw_gains
from rl.figures.learning import draw_reconstruction, draw_training
from rl.figures.options import (
    AgentsFigure,
    ComparisonFigure,
    GainsFigure,
    ReconstructionFigure,
    ShiftsFigure,
    TrainingFigure,
)
from rl.figures.shifts import draw_shifts

Command = (
    Annotated[TrainingFigure, tyro.conf.subcommand("training")]
    | Annotated[ReconstructionFigure, tyro.conf.subcommand("reconstruction")]
    | Annotated[GainsFigure, tyro.conf.subcommand("gains")]
    | Annotated[ComparisonFigure, tyro.conf.subcommand("comparison")]
    | Annotated[ShiftsFigure, tyro.conf.subcommand("shifts")]
    | Annotated[AgentsFigure, tyro.conf.subcommand("agents")]
)


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    drawers: dict[type, Any] = {
        TrainingFigure: draw_training,
        ReconstructionFigure: draw_reconstruction,
        GainsFigure: draw_gains,
        ComparisonFigure: draw_comparison,
        ShiftsFigure: draw_shifts,
        AgentsFigure: draw_agents,
    }
    with one_line_errors():
        command = tyro.cli(Command, description=__doc__)  # type: ignore[call-overload]
        figure = drawers[type(command)](command)
        command.out.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(command.out)
    sys.stdout.write(f"wrote {command.out}\n")
