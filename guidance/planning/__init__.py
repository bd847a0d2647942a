"""Plans by convex optimisation, and what else the cone programme can say.

A task is refined at one time (`convex_task`), searched over times (`minimum_propellant`), and made a plan
(`convex_planner`); beside them stand the proofs that no flight exists, the reachable sites, and flights
that put off the choice between several. It imports `convex` and `flight_time`; `guidance.pdg` asks it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.planning.convex_planner import plan_convex, plan_nearest, plan_weighed, prove_infeasible
    from guidance.planning.convex_task import ConvexTask
    from guidance.planning.deferred_decision import DeferredDecision, TrunkOptions, plan_deferred
    from guidance.planning.reachability import ReachableSet, reachable_set

_HOMES = {
    "guidance.planning.convex_planner": (
        "plan_convex",
        "plan_nearest",
        "plan_weighed",
        "prove_infeasible",
    ),
    "guidance.planning.convex_task": ("ConvexTask",),
    "guidance.planning.deferred_decision": (
        "DeferredDecision",
        "TrunkOptions",
        "plan_deferred",
    ),
    "guidance.planning.reachability": (
        "ReachableSet",
        "reachable_set",
    ),
}

__all__ = [
    "ConvexTask",
    "DeferredDecision",
    "ReachableSet",
    "TrunkOptions",
    "plan_convex",
    "plan_deferred",
    "plan_nearest",
    "plan_weighed",
    "prove_infeasible",
    "reachable_set",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
