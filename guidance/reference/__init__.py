"""Independent planners, written for reading: the same problem by cvxpy, the unrelaxed one by CasADi.

They share no code with `guidance.convex` and never import one another; cvxpy and casadi are imported here
alone, on first use. `guidance.pdg` asks them.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.reference.casadi_planner import plan_casadi
    from guidance.reference.cvxpy_planner import plan_cvxpy

_HOMES = {
    "guidance.reference.casadi_planner": ("plan_casadi",),
    "guidance.reference.cvxpy_planner": ("plan_cvxpy",),
}

__all__ = [
    "plan_casadi",
    "plan_cvxpy",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
