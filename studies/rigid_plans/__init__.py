"""Plans for a body that must turn: both methods of `guidance.solve_pdg_6dof`, and a planner of others.

`python -m studies.rigid_plans` is its command. `command` reads the options and runs the study, `starts` plans
dispersed starts. With `--openscvx-python` the same problems go to OpenSCvx: `peer_problems` states them,
`openscvx_body` talks to `openscvx_body_worker` in the other interpreter, `commanded_flight` flies what comes
back, `peer_answers` has the table.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from studies.rigid_plans.command import RigidPlans, study_rigid_plans

_HOMES = {"studies.rigid_plans.command": ("RigidPlans", "study_rigid_plans")}

__all__ = ["RigidPlans", "study_rigid_plans"]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
