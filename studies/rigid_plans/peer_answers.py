"""`solve_pdg_6dof` and OpenSCvx on the same problems: who is asked what.

A plan is flown open loop by the true motion, and limits are those that the problem states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from studies.campaign.journal import Journal
from studies.peers.openscvx_process import OPENSCVX_METHOD, WorkerProcess
from studies.rigid_plans.commanded_flight import CommandedFlight, fly_commanded, limit_excess
from studies.rigid_plans.openscvx_body import OpenscvxSettings, Weights, ask_openscvx
from studies.rigid_plans.peer_problems import PeerProblem, published_example, shared_example, start_problem
from studies.rigid_plans.peer_table import LEAST_EXCESS, NO_FLIGHT, OWN_METHOD, FlownPlan, PeerAnswer
from studies.rigid_plans.starts import plan_problem

EXAMPLE_MESHES = (21, 31, 41)
"""Nodes of our plans for the example."""
SHIPPED_WEIGHTS = Weights(lam_cost=1e-2, lam_vc=10.0, lam_prox=1.0, ep_tr=5e-3)
SHIPPED = OpenscvxSettings(f"{OPENSCVX_METHOD}, shipped, 5", 5, "FOH", 2, SHIPPED_WEIGHTS)
"""As the example is shipped; QOCO is called in place of the solver that it generates in C."""
HELD = OpenscvxSettings(f"{OPENSCVX_METHOD}, shipped, held, 5", 5, "ZOH", 2, SHIPPED_WEIGHTS)
TUNED = OpenscvxSettings(f"{OPENSCVX_METHOD}, tuned, held, 16", 16, "ZOH", 4, Weights(1.0, 10.0, 0.1, 5e-3))
"""With weights chosen on the example itself."""
START_LOOSE = OpenscvxSettings(
    f"{OPENSCVX_METHOD}, tuned, held, 31", 31, "ZOH", 6, Weights(1.0, 100.0, 1e-3, 5e-3)
)
START_TIGHT = OpenscvxSettings(
    f"{OPENSCVX_METHOD}, tuned, tight, held, 31", 31, "ZOH", 6, Weights(1.0, 100.0, 1e-3, 1e-4)
)
"""Weights chosen on the first starts of `paper`; tight is where it says that it converged."""
CHOSEN_ON = 3
"""How many starts these were; the others alone are asked."""


@dataclass(frozen=True, eq=False)
class _Plan:
    status: str
    seconds: float
    solves: int
    flight: CommandedFlight | None


Ask = Callable[[PeerProblem], _Plan]


def _ask_own(peer: PeerProblem, nodes: int) -> _Plan:
    plan, seconds = plan_problem(peer.problem, nodes)
    flight = CommandedFlight.of_flight(plan.flight, peer.problem.body.engine_lag) if plan.nodes else None
    return _Plan(plan.status.value, seconds, plan.solves, flight)


def _ask_peer(peer: PeerProblem, settings: OpenscvxSettings, worker: WorkerProcess) -> _Plan:
    answer = ask_openscvx(worker, peer, settings)
    return _Plan(answer.status, answer.processor, answer.iterations, answer.flight)


def _questions(
    preset: str, nodes: int, starts: int, worker: WorkerProcess
) -> Iterator[tuple[list[tuple[int, PeerProblem]], list[tuple[str, Ask]]]]:
    """Problems of a kind with the numbers of their starts, and who is asked them."""

    def own(meshes: Sequence[int]) -> list[tuple[str, Ask]]:
        return [(f"{OWN_METHOD}, {mesh}", partial(_ask_own, nodes=mesh)) for mesh in meshes]

    def peers(*settings: OpenscvxSettings) -> list[tuple[str, Ask]]:
        return [(each.name, partial(_ask_peer, settings=each, worker=worker)) for each in settings]

    yield [(0, published_example())], peers(SHIPPED)
    yield [(0, shared_example())], own(EXAMPLE_MESHES) + peers(SHIPPED, HELD, TUNED)
    drawn = [(start, start_problem(preset, start)) for start in range(CHOSEN_ON, CHOSEN_ON + starts)]
    yield drawn, own([nodes]) + peers(START_LOOSE, START_TIGHT)


def ask_all(
    preset: str, nodes: int, starts: int, worker: WorkerProcess, journal: Journal[PeerAnswer]
) -> list[PeerAnswer]:
    """Ask every question; what the journal has is not asked again. The first of a kind is asked twice."""
    out = []
    for problems, methods in _questions(preset, nodes, starts, worker):
        for method, ask in methods:
            keys = [(peer.name, start, method) for start, peer in problems]
            asked = all(journal.find(key) is not None for key in keys)
            first = math.nan if asked else ask(problems[0][1]).seconds
            for key, (_, peer) in zip(keys, problems, strict=True):
                out.append(journal.finish(key, lambda p=peer, k=key, a=ask, f=first: _measure(p, k, a, f)))
    return out


def _measure(peer: PeerProblem, key: tuple[str, int, str], ask: Ask, first_seconds: float) -> PeerAnswer:
    name, start, method = key
    plan = ask(peer)
    flown = NO_FLIGHT if plan.flight is None else measure_flight(plan.flight, peer)
    return PeerAnswer(name, start, method, plan.status, plan.seconds, first_seconds, plan.solves, *flown)


def measure_flight(flight: CommandedFlight, peer: PeerProblem) -> FlownPlan:
    """Fly a plan, and say what it burns, where it ends and which limit it leaves by most."""
    path, planned, problem = fly_commanded(flight, peer), flight.states[-1], peer.problem
    excess = limit_excess(path, flight, peer)
    worst = max(excess, key=lambda name: excess[name])
    burnt = problem.state.mass - float(path[-1, 13])
    return FlownPlan(
        burnt,
        burnt / problem.state.mass,
        float(flight.time[-1]),
        float(np.linalg.norm(path[-1, :3] - planned[:3])),
        float(np.linalg.norm(path[-1, :3] - problem.target)),
        float(np.linalg.norm(path[-1, 3:6] - problem.target_velocity)),
        float(np.linalg.norm(path[:, 3:6], axis=1).max()),
        excess[worst],
        worst if excess[worst] > LEAST_EXCESS else "",
    )
