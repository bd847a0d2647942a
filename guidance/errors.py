"""What a planner raises when it has no plan to give."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from guidance.plan import Plan


class GuidanceError(Exception):
    """A planner has no plan.

    Attributes:
        plan: the labelled result without a trajectory (its status, message and certificate).
    """

    def __init__(self, message: str, plan: Plan) -> None:
        """Keep the labelled result beside the words."""
        super().__init__(message)
        self.plan = plan


class InfeasibleError(GuidanceError):
    """No flight within the limits exists; `plan.certificate` proves it, and its `scope` says how far."""


class SolverFailedError(GuidanceError):
    """The solver stopped without an answer: nothing is said about whether a flight exists."""
