"""What the landing problem of a rigid body is, and what its answer is.

The problem, the flight on its nodes, the plan with its status, and the check that flies a plan in SI and
measures every limit. Nothing here plans: every planner of rigid bodies may import this wing.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.rigid_descent.flight import RigidFlight
    from guidance.rigid_descent.plan import RigidPlan
    from guidance.rigid_descent.problem import RigidLandingProblem
    from guidance.rigid_descent.residuals import RigidResiduals, cut_commands, fly_plan

_HOMES = {
    "guidance.rigid_descent.flight": ("RigidFlight",),
    "guidance.rigid_descent.plan": ("RigidPlan",),
    "guidance.rigid_descent.problem": ("RigidLandingProblem",),
    "guidance.rigid_descent.residuals": ("RigidResiduals", "cut_commands", "fly_plan"),
}

__all__ = [
    "RigidFlight",
    "RigidLandingProblem",
    "RigidPlan",
    "RigidResiduals",
    "cut_commands",
    "fly_plan",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
