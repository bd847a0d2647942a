"""What a landing problem is, and what its answer is.

The problem, the flight on its nodes, the plan with its status, the certificate of a problem that has none,
and the check that flies a plan in SI and measures every limit. Nothing here plans: every planner may import
this wing, and it imports none.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.descent.certificate import Certificate, Proof
    from guidance.descent.dual_bound import DualBound, DualPiece
    from guidance.descent.limits import NO_LIMITS, Cone, Limits
    from guidance.descent.plan import GuidanceError, InfeasibleError, Plan, PlanStatus, SolverFailedError
    from guidance.descent.problem import LandingProblem
    from guidance.descent.residuals import FLIGHT_TOLERANCE, FlightTolerance, Residuals
    from guidance.descent.trajectory import Trajectory

_HOMES = {
    "guidance.descent.certificate": (
        "Certificate",
        "Proof",
    ),
    "guidance.descent.dual_bound": (
        "DualBound",
        "DualPiece",
    ),
    "guidance.descent.limits": (
        "NO_LIMITS",
        "Cone",
        "Limits",
    ),
    "guidance.descent.plan": (
        "GuidanceError",
        "InfeasibleError",
        "Plan",
        "PlanStatus",
        "SolverFailedError",
    ),
    "guidance.descent.problem": ("LandingProblem",),
    "guidance.descent.residuals": (
        "FLIGHT_TOLERANCE",
        "FlightTolerance",
        "Residuals",
    ),
    "guidance.descent.trajectory": ("Trajectory",),
}

__all__ = [
    "FLIGHT_TOLERANCE",
    "NO_LIMITS",
    "Certificate",
    "Cone",
    "DualBound",
    "DualPiece",
    "FlightTolerance",
    "GuidanceError",
    "InfeasibleError",
    "LandingProblem",
    "Limits",
    "Plan",
    "PlanStatus",
    "Proof",
    "Residuals",
    "SolverFailedError",
    "Trajectory",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
