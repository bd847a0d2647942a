"""The cone programme: least propellant, or least landing error, at one time of flight.

From the bottom: where each unknown stands (`layout`), units (`scaling`), one function per constraint
(`constraints`, and without states `condensed`), which of them a problem needs (`constraint_set`), the one
door to Clarabel, the arrays it is given (`assembly`), the programmes, and the check of its proofs
(`farkas`). It knows nothing of the search for a time, of planners, or of the references, which share no code
with it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.convex.branched_programme import Branching
    from guidance.convex.clarabel_solver import ConicAnswer, ConicSolver, SolveStatus
    from guidance.convex.constraint_set import ConstraintSet
    from guidance.convex.farkas import FarkasProof
    from guidance.convex.programme import ConvexSolution, convex_template
    from guidance.convex.scaling import ScaledProblem, scale_problem

_HOMES = {
    "guidance.convex.branched_programme": ("Branching",),
    "guidance.convex.clarabel_solver": (
        "ConicAnswer",
        "ConicSolver",
        "SolveStatus",
    ),
    "guidance.convex.constraint_set": ("ConstraintSet",),
    "guidance.convex.farkas": ("FarkasProof",),
    "guidance.convex.programme": (
        "ConvexSolution",
        "convex_template",
    ),
    "guidance.convex.scaling": (
        "ScaledProblem",
        "scale_problem",
    ),
}

__all__ = [
    "Branching",
    "ConicAnswer",
    "ConicSolver",
    "ConstraintSet",
    "ConvexSolution",
    "FarkasProof",
    "ScaledProblem",
    "SolveStatus",
    "convex_template",
    "scale_problem",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
