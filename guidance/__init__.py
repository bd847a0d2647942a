"""Mathematics of powered descent: vehicle, motion, guidance laws. No terrain, no simulator.

Frame: site-fixed, x east, y north, z up. SI units. Angles in radians.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.bulk.answers import Descents
    from guidance.bulk.solve import solve_pdg_many
    from guidance.constants import MOON_GRAVITY, STANDARD_GRAVITY
    from guidance.descent.limits import Cone, Limits
    from guidance.descent.plan import GuidanceError, InfeasibleError, Plan, PlanStatus, SolverFailedError
    from guidance.dynamics import propagate
    from guidance.lander import PAPER_LANDER, Lander
    from guidance.pdg.prepared import solve_pdg
    from guidance.rigid_body.body import RigidBody
    from guidance.rigid_body.state import RigidState
    from guidance.rigid_descent.plan import RigidPlan
    from guidance.state import State
    from guidance.successive.solve import solve_pdg_6dof
    from guidance.zem_zev import saturate_thrust, time_to_go, zem_zev_acceleration

__all__ = [
    "MOON_GRAVITY",
    "PAPER_LANDER",
    "STANDARD_GRAVITY",
    "Cone",
    "Descents",
    "GuidanceError",
    "InfeasibleError",
    "Lander",
    "Limits",
    "Plan",
    "PlanStatus",
    "RigidBody",
    "RigidPlan",
    "RigidState",
    "SolverFailedError",
    "State",
    "propagate",
    "saturate_thrust",
    "solve_pdg",
    "solve_pdg_6dof",
    "solve_pdg_many",
    "time_to_go",
    "zem_zev_acceleration",
]

__getattr__, __dir__ = lazy_exports(
    __name__,
    {
        "MOON_GRAVITY": "guidance.constants",
        "PAPER_LANDER": "guidance.lander",
        "STANDARD_GRAVITY": "guidance.constants",
        "Cone": "guidance.descent.limits",
        "Descents": "guidance.bulk.answers",
        "GuidanceError": "guidance.descent.plan",
        "InfeasibleError": "guidance.descent.plan",
        "Lander": "guidance.lander",
        "Limits": "guidance.descent.limits",
        "Plan": "guidance.descent.plan",
        "PlanStatus": "guidance.descent.plan",
        "RigidBody": "guidance.rigid_body.body",
        "RigidPlan": "guidance.rigid_descent.plan",
        "RigidState": "guidance.rigid_body.state",
        "SolverFailedError": "guidance.descent.plan",
        "State": "guidance.state",
        "propagate": "guidance.dynamics",
        "saturate_thrust": "guidance.zem_zev",
        "solve_pdg": "guidance.pdg.prepared",
        "solve_pdg_6dof": "guidance.successive.solve",
        "solve_pdg_many": "guidance.bulk.solve",
        "time_to_go": "guidance.zem_zev",
        "zem_zev_acceleration": "guidance.zem_zev",
    },
)
