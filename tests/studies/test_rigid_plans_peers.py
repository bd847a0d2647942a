"""OpenSCvx beside `solve_pdg_6dof`: the problems, the flight that judges both, and the talk with its process.

What needs the package itself runs where it is installed (extra `peers`); nothing else does.
"""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import solve_pdg_6dof
from guidance.rigid_descent import RigidPlan
from studies.peers.openscvx_process import (
    open_worker,
    openscvx_version,
)
from studies.rigid_plans.commanded_flight import (
    CommandedFlight,
    fly_commanded,
    limit_excess,
)
from studies.rigid_plans.openscvx_body import (
    NEAR,
    SERVE_BODY,
    OpenscvxSettings,
    Weights,
    ask_openscvx,
    read_body_answer,
    write_body_case,
)
from studies.rigid_plans.peer_answers import HELD, SHIPPED, measure_flight
from studies.rigid_plans.peer_problems import (
    EXAMPLE_BODY,
    PeerProblem,
    published_example,
    shared_example,
    start_problem,
)
from studies.rigid_plans.peer_table import NO_FLIGHT, OWN_METHOD, PeerAnswer, conclude_peers, sum_up_peers
from studies.rigid_plans.starts import draw_start

HERE = Path(sys.executable)
OPENSCVX = openscvx_version(HERE)
LINEAR = OpenscvxSettings("linear", 31, "FOH", 2, Weights(1.0, 1.0, 1.0, 1e-3))
with_openscvx = pytest.mark.skipif(OPENSCVX is None, reason="OpenSCvx is not installed (extra `peers`)")


@pytest.fixture(scope="module")
def own_plan() -> tuple[PeerProblem, RigidPlan]:
    """A start of ours, planned by ours."""
    peer = start_problem("paper", 0)
    asked = peer.problem
    plan = solve_pdg_6dof(asked.state, asked.target, asked.body, gravity=asked.gravity, nodes=31)
    return peer, plan


def test_our_own_plan_is_flown_as_its_residuals_say(own_plan: tuple[PeerProblem, RigidPlan]) -> None:
    """The same commands, start and motion as `RigidPlan.residuals`, and so the same end and excesses."""
    peer, plan = own_plan
    flight = CommandedFlight.of_flight(plan.flight, peer.problem.body.engine_lag)
    path = fly_commanded(flight, peer)
    landed = np.linalg.norm(path[-1, :3] - peer.problem.target)
    assert landed == pytest.approx(plan.residuals.landing_position, abs=1e-9)
    excess, body = limit_excess(path, flight, peer), peer.problem.body
    assert excess["rate"] == pytest.approx(plan.residuals.rate / body.rate_limit, abs=1e-9)
    assert excess["tilt"] == pytest.approx(plan.residuals.tilt / body.tilt_limit, abs=1e-9)
    assert max(excess.values()) < 0.06  # 0.01 rad/s of rate is allowed
    found = measure_flight(flight, peer)
    assert found.burnt == pytest.approx(1200.0 - path[-1, 13], abs=1e-9)
    assert found.burnt == pytest.approx(plan.propellant, abs=1e-3)
    assert found.share == pytest.approx(found.burnt / 1200.0)
    assert found.miss == pytest.approx(landed, abs=1e-9)
    assert found.speed == pytest.approx(plan.residuals.landing_velocity, abs=1e-9)
    assert found.fastest >= np.linalg.norm(peer.problem.state.velocity)


def test_what_is_burnt_is_flown_and_not_what_a_plan_says(own_plan: tuple[PeerProblem, RigidPlan]) -> None:
    """A planned end moved by 3 m, with 5 kg more left: the flight lands and burns what it did."""
    peer, plan = own_plan
    flight = CommandedFlight.of_flight(plan.flight, peer.problem.body.engine_lag)
    told = flight.states.copy()
    told[-1, 0] += 3.0
    told[-1, 13] += 5.0
    true, moved = measure_flight(flight, peer), measure_flight(replace(flight, states=told), peer)
    assert moved.gap == pytest.approx(3.0, abs=0.01)
    assert moved[:2] == true[:2]
    assert moved[4:] == true[4:]


@pytest.mark.parametrize("change", [{"engine_lag": 0.2}, {"torque_limit": (1.0, 0.0, 0.0)}])
def test_a_body_that_the_worker_does_not_state_is_refused(change: dict) -> None:
    peer = shared_example()
    peer = replace(peer, problem=replace(peer.problem, body=replace(EXAMPLE_BODY, **change)))
    with pytest.raises(ValueError, match="gimbal only without"):
        write_body_case(peer, HELD)


def test_the_example_is_told_with_its_published_numbers() -> None:
    told = json.loads(write_body_case(published_example(), SHIPPED))
    assert (told["nodes"], told["hold"], told["looseness"], told["leak"]) == (5, "FOH", 0.1, 0.01)
    assert told["weights"] == {
        "lam_cost": 0.01,
        "lam_vc": 10.0,
        "lam_prox": 1.0,
        "ep_tr": 0.005,
        "ep_vc": 1e-6,
    }
    assert told["exhaust_velocity"] == pytest.approx(30.0)
    assert told["drag"] == [0.25, 0.25, 0.125]  # rho S c / 2 with c = 1 across, 0.5 along
    assert math.degrees(math.acos(told["gimbal_cosine"])) == pytest.approx(20.0)
    assert told["torque_limit"] == [0.0, 0.0, 0.0]
    shared = json.loads(write_body_case(shared_example(), SHIPPED))
    assert (shared["drag"], shared["leak"], shared["looseness"], shared["speed_limit"]) == (
        None,
        0.0,
        1.0,
        None,
    )


@settings(max_examples=20, deadline=None)
@given(st.floats(0.1, 1e4), st.floats(0.1, 100.0), st.floats(0.1, 1e4))
def test_what_has_no_unit_does_not_depend_on_the_units(length: float, duration: float, mass: float) -> None:
    peer = start_problem("paper", 1)
    told = json.loads(write_body_case(replace(peer, length=length, duration=duration, mass=mass), LINEAR))
    body, weight = peer.problem.body, 1200.0 * 1.62
    gravity = -told["gravity"][2]
    assert told["max_thrust"] / (told["mass"] * gravity) == pytest.approx(12000.0 / weight)
    turning = told["torque_limit"][0] / told["inertia"][0] / told["rate_limit"] ** 2
    assert turning == pytest.approx(66.0 / 880.0 / body.rate_limit**2)
    assert told["rate_limit"] * told["engine_lag"] == pytest.approx(body.rate_limit * 0.2)
    fall = told["velocity"][2] ** 2 / (gravity * told["position"][2])
    offset = peer.problem.state.position - peer.problem.target
    assert fall == pytest.approx(peer.problem.state.velocity[2] ** 2 / (1.62 * offset[2]))


def answer_of(peer: PeerProblem, plan: RigidPlan, **changes: Any) -> str:
    """A worker's line that holds a plan, in the peer's units."""
    length, time, mass = peer.length, peer.duration, peer.mass
    force = mass * length / time**2
    told = {
        "converged": True,
        "iterations": 9,
        "time": plan.time / time,
        "mass": plan.mass / mass,
        "position": (plan.position - peer.problem.target) / length,
        "velocity": plan.velocity * time / length,
        "attitude": plan.attitude,
        "rates": plan.rates * time,
        "thrust": plan.thrust / force,
        "torque": plan.torque / (force * length),
    }
    lists = {name: np.asarray(value).tolist() for name, value in told.items()}
    return json.dumps({**lists, "processor": 0.25, **changes})


def test_an_answer_is_the_flight_that_it_tells(own_plan: tuple[PeerProblem, RigidPlan]) -> None:
    peer, plan = own_plan
    answer = read_body_answer(answer_of(peer, plan), peer, LINEAR)
    assert (answer.status, answer.processor, answer.iterations) == ("converged", 0.25, 9)
    assert answer.flight is not None
    assert answer.flight.states == pytest.approx(plan.flight.states, abs=1e-9)
    assert answer.flight.thrust == pytest.approx(plan.flight.thrust_commands(0.0), abs=1e-6)
    held = read_body_answer(answer_of(peer, plan), peer, replace(LINEAR, hold="ZOH")).flight
    assert held is not None
    assert np.array_equal(held.thrust[:, 0], held.thrust[:, 1])
    assert held.torque[:, 0] == pytest.approx(plan.torque[:-1], abs=1e-9)
    assert read_body_answer(answer_of(peer, plan, converged=False), peer, LINEAR).status == "not converged"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass": [1.0]}, "mass is no part"),
        ({"rates": [[math.nan] * 3] * 31}, "rates is no part"),
        ({"time": [0.0] * 31}, "time does not grow"),
        ({"position": [[0.0] * 3] * 31}, "starts elsewhere"),
        ({"mass": [0.9] * 31}, "starts elsewhere: mass"),
        ({"attitude": [[0.0, 1.0, 0.0, 0.0]] * 31}, "starts elsewhere: lean"),
        ({"error": "it broke"}, "it broke"),
        ({"thrust": "none"}, "no answer of the worker"),
    ],
)
def test_what_is_no_flight_is_named(
    own_plan: tuple[PeerProblem, RigidPlan], changes: dict, words: str
) -> None:
    answer = read_body_answer(answer_of(*own_plan, **changes), own_plan[0], LINEAR)
    assert answer.flight is None
    assert answer.status.startswith("failed")
    assert words in answer.status


@pytest.mark.parametrize(
    ("name", "words"),
    [("position", "position"), ("velocity", "velocity"), ("attitude", "lean"), ("rates", "rates")],
)
@pytest.mark.parametrize("share", [0.5, 2.0])
def test_a_flight_ends_where_it_was_asked(
    own_plan: tuple[PeerProblem, RigidPlan], name: str, words: str, share: float
) -> None:
    """Off by a share of what is tolerated, in the units of the answer."""
    peer, plan = own_plan
    told = json.loads(answer_of(peer, plan))
    told["position"][-1], told["velocity"][-1], told["rates"][-1] = [0.0] * 3, [0.0] * 3, [0.0] * 3
    told["attitude"][-1] = [1.0, 0.0, 0.0, 0.0]
    off = {
        "position": peer.farthest / peer.length,
        "velocity": peer.fastest * peer.duration / peer.length,
        "attitude": 0.5,
        "rates": peer.problem.body.rate_limit * peer.duration,
    }[name]
    told[name][-1][1] = share * NEAR * off
    answer = read_body_answer(json.dumps(told), peer, LINEAR)
    assert (answer.flight is None) == (share > 1.0)
    assert share < 1.0 or answer.status.startswith(f"failed: the flight ends elsewhere: {words}")


def answered(method: str, start: int, burnt: float, seconds: float = 1.0, **changes: Any) -> PeerAnswer:
    made = PeerAnswer(
        "p",
        start,
        method,
        "optimal",
        seconds,
        9.0,
        7,
        burnt,
        burnt / 100.0,
        30.0,
        0.0,
        0.1,
        0.2,
        9.0,
        0.0,
        "",
    )
    return replace(made, **changes)


def test_lines_and_conclusions_are_of_what_was_planned() -> None:
    lost = dict(zip(NO_FLIGHT._fields, NO_FLIGHT, strict=True))
    own = [answered(f"{OWN_METHOD}, 31", start, 20.0 + start, 0.5) for start in range(3)]
    unsettled = PeerAnswer("p", 0, f"{OWN_METHOD}, 41", "limit reached", 1.0, 1.0, 60, *NO_FLIGHT)
    theirs = [
        answered(HELD.name, 0, 20.5, 1.0, excess=0.3, limit="tilt"),
        answered(HELD.name, 1, 20.75, 3.0, miss=0.7),
        answered(
            HELD.name,
            2,
            math.nan,
            8.0,
            status="not converged",
            **{k: v for k, v in lost.items() if k != "burnt"},
        ),
    ]
    ours, row = sum_up_peers(own + theirs)
    assert (ours.flights, ours.share, ours.limit) == (3, 0.21, "")
    assert (row.count, row.flights, row.seconds, row.miss) == (3, 2, (3.0, 8.0), 0.7)
    assert (row.excess, row.limit) == (0.3, "tilt")
    words = conclude_peers([*own, unsettled, *theirs])
    assert words[:2] == [f"{OWN_METHOD}, 41, p: limit reached.", f"{HELD.name}, p: not converged."]
    assert "burns -0.2500 to +0.5000 more" in words[2]
    assert "on 2 that both plan, +0.1250 in the median, and takes 4.0 times as long" in words[2]
    finer = [answered(f"{OWN_METHOD}, 61", start, 20.5 + start, 2.0) for start in range(3)]
    twice = conclude_peers([*own, *finer, *theirs])[1:3]
    assert f"-0.2500 to +0.5000 more than {OWN_METHOD}, 31 on 2" in twice[0]
    assert f"-0.7500 to +0.0000 more than {OWN_METHOD}, 61 on 2" in twice[1]
    (alone,) = sum_up_peers(theirs[2:])
    assert alone.flights == 0
    assert all(math.isnan(number) for number in (alone.share, alone.miss, alone.speed, alone.excess))


def test_a_start_is_the_same_problem_whoever_is_asked() -> None:
    asked, drawn = start_problem("paper", 5).problem, draw_start("paper", 5)
    assert np.array_equal(asked.state.as_array(), drawn.state.as_array())
    assert np.array_equal(asked.target, drawn.target)
    assert asked.body == drawn.body


@with_openscvx
@pytest.mark.slow
def test_openscvx_plans_its_example_and_flies_it_where_controls_are_held() -> None:
    peer = shared_example()
    with open_worker(HERE, SERVE_BODY) as worker:
        answer = ask_openscvx(worker, peer, HELD)
    assert answer.status == "converged"
    assert answer.flight is not None
    found = measure_flight(answer.flight, peer)
    assert found.miss < 0.01
    assert found.burnt > 0.4227  # what ours burns with 31 nodes
