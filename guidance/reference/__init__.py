"""Independent planners, written for reading: the same problem by cvxpy, the unrelaxed one by CasADi.

A rigid body's descent is there too, by CasADi.

They share no code with `guidance.convex` and never import one another; cvxpy and casadi are imported here
alone, on first use. `guidance.pdg` asks them, and `guidance.successive` that of the rigid body.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.reference.casadi_planner import plan_casadi
    from guidance.reference.cvxpy_planner import plan_cvxpy
    from guidance.reference.rigid_planner import plan_rigid_casadi

_HOMES = {
    "guidance.reference.casadi_planner": ("plan_casadi",),
    "guidance.reference.cvxpy_planner": ("plan_cvxpy",),
    "guidance.reference.rigid_planner": ("plan_rigid_casadi",),
}

__all__ = [
    "plan_casadi",
    "plan_cvxpy",
    "plan_rigid_casadi",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
