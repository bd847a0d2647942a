"""Descents in bulk: the answers of single calls, each with its proof, whatever the order and the threads."""

import math
from dataclasses import replace

import numpy as np
import pytest
from descents import GRAVITY, TARGET, feasible_start, harsh_start, paper_start
from hypothesis import given, settings
from hypothesis import strategies as st

import guidance
from guidance import PAPER_LANDER, Descents, Lander, PlanStatus, State, solve_pdg_many
from guidance.bulk.answers import STATUSES
from guidance.descent.problem import LandingProblem
from guidance.flight_time.primer_vector import find_primer_flight

GAP = 5e-3  # [kg] on the paper's descents


def dispersed_start(rng):
    return [
        *rng.uniform(-500, 500, 2),
        rng.uniform(300, 1000),
        *rng.uniform(-30, 30, 2),
        rng.uniform(-50, 5),
        1200.0,
    ]


def starts(sampler, count, seed):
    rng = np.random.default_rng(seed)
    return np.array([sampler(rng) for _ in range(count)])


def same(first: Descents, second: Descents, order: slice | np.ndarray = slice(None)) -> bool:
    """Whether two answers are equal to the last bit, the second in another order."""
    names = ("status", "propellant", "time_of_flight", "lower_bound", "first_thrust", "method")
    parts = [(getattr(first, name)[order], getattr(second, name)) for name in names]
    if first.nodes is not None and second.nodes is not None:
        parts += [(one[order], other) for one, other in zip(first.nodes, second.nodes, strict=True)]
    return all(np.array_equal(one, other, equal_nan=one.dtype.kind == "f") for one, other in parts)


def test_ten_thousand_paper_starts_are_certified_to_five_grams():
    found = solve_pdg_many(starts(paper_start, 10_000, 1), TARGET)
    assert found.optimal.all()
    assert set(found.method) == {"indirect"}
    assert (found.optimality_gap >= 0.0).all()
    assert found.optimality_gap.max() < GAP


@pytest.mark.parametrize("sampler", [paper_start, feasible_start, harsh_start, dispersed_start])
def test_answers_are_those_of_single_calls(sampler):
    """250 starts of each kind: the status of `solve_pdg`, the flight of the indirect method."""
    given_starts = starts(sampler, 250, 2)
    found = solve_pdg_many(given_starts, TARGET)
    for k, start in enumerate(given_starts):
        plan = guidance.solve_pdg(start, TARGET, throw=False)
        assert found.status_of(k) is plan.status
        if plan.status is not PlanStatus.OPTIMAL:
            assert math.isnan(found.propellant[k])
            assert math.isnan(found.time_of_flight[k])
            continue
        assert found.propellant[k] < plan.propellant + 1e-3
        flight = find_primer_flight(plan.problem)
        assert (flight is not None) == (found.method[k] == "indirect")
        if flight is not None:
            burnt = start[6] * -math.expm1(-flight.log_mass_ratio)
            assert found.propellant[k] == pytest.approx(burnt, rel=1e-9)
            assert found.time_of_flight[k] == pytest.approx(flight.time, rel=1e-9)


@pytest.mark.parametrize("sampler", [paper_start, feasible_start, harsh_start, dispersed_start])
def test_every_bound_is_verified_by_the_independent_checker(sampler):
    found, proved = solve_pdg_many(starts(sampler, 60, 3), TARGET), 0
    for k in range(len(found)):
        certificate = found.certificate(k)
        if certificate is None:
            assert math.isnan(found.lower_bound[k])
            continue
        proved += 1
        assert certificate.verified
        assert certificate.lower_bound == found.lower_bound[k]
        assert (certificate.lower_bound == math.inf) == (found.status_of(k) is PlanStatus.INFEASIBLE)
        assert not certificate.lower_bound > found.propellant[k]
    assert proved == len(found)


limits = st.none() | st.floats(0.0, 1.0)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), limits, limits, limits)
def test_any_lander_and_limits_are_bounded_and_flown_within_them(seed, lean, slope, speed):
    rng = np.random.default_rng(seed)
    pull = rng.uniform(0.5, 10.0)
    mass = rng.uniform(500.0, 3000.0)
    lander = Lander(
        mass * rng.uniform(0.3, 0.95),
        mass * pull * rng.uniform(1.1, 8.0),
        rng.uniform(150.0, 450.0),
        pointing_limit=None if lean is None else 0.2 + lean,
    )
    start = [*rng.normal(0.0, 300.0, 2), rng.uniform(1.0, 2000.0), *rng.normal(0.0, 20.0, 3), mass]
    found = solve_pdg_many(
        start,
        (0.0, 0.0, 0.0),
        lander=lander,
        gravity=(0.0, 0.0, -pull),
        glide_slope_limit=None if slope is None else 0.5 + slope,
        speed_limit=None if speed is None else 20.0 + 200.0 * speed,
        nodes=41,
        fallback=False,
    )
    certificate = found.certificate(0)
    if certificate is not None:
        assert certificate.verified
    if not found.optimal[0]:
        return
    assert found.lower_bound[0] <= found.propellant[0] <= mass - lander.dry_mass
    assert found.nodes is not None
    path, thrust = found.nodes.position[0], found.nodes.thrust[0]
    scale = float(np.abs(path).max())
    assert path[:, 2].min() > -1e-2 * scale
    if lean is not None:
        size = np.linalg.norm(thrust, axis=1)
        assert (thrust[:, 2] >= size * (math.cos(0.2 + lean) - 1e-2)).all()
    if speed is not None:
        assert np.linalg.norm(found.nodes.velocity[0], axis=1).max() < 1.01 * (20.0 + 200.0 * speed)
    if slope is not None:
        across = np.hypot(path[:, 0], path[:, 1])
        assert (across * math.cos(0.5 + slope) <= path[:, 2] * math.sin(0.5 + slope) + 1e-2 * scale).all()


def test_order_and_threads_change_nothing():
    mixed = np.concatenate([starts(sampler, 150, 4) for sampler in (paper_start, harsh_start)])
    order = np.random.default_rng(5).permutation(len(mixed))
    reference = solve_pdg_many(mixed, TARGET, nodes=7, threads=1)
    for threads in (1, 2, 3, 8):
        assert same(reference, solve_pdg_many(mixed, TARGET, nodes=7, threads=threads))
        assert same(reference, solve_pdg_many(mixed[order], TARGET, nodes=7, threads=threads), order)


def test_one_start_to_many_targets_is_many_starts_to_one():
    rng = np.random.default_rng(6)
    start = np.array(paper_start(rng))
    targets = TARGET + np.column_stack([rng.uniform(-60.0, 60.0, (90, 2)), rng.uniform(-5.0, 5.0, 90)])
    found = solve_pdg_many(start, targets)
    rows = solve_pdg_many(np.tile(start, (90, 1)), targets)
    state = solve_pdg_many(State(start[:3], start[3:6], start[6]), targets)
    assert same(found, rows)
    assert same(found, state)
    moved = np.tile(start, (90, 1))
    moved[:, :3] -= targets - TARGET
    np.testing.assert_allclose(solve_pdg_many(moved, TARGET).propellant, found.propellant, rtol=1e-9)


def test_without_a_fallback_nothing_is_said_of_the_rest():
    found = solve_pdg_many(starts(harsh_start, 200, 7), TARGET, fallback=False)
    full = solve_pdg_many(starts(harsh_start, 200, 7), TARGET)
    rest = found.method == ""
    assert 0 < rest.sum() < 200
    assert {found.status_of(int(k)) for k in np.flatnonzero(rest)} == {PlanStatus.LIMIT_REACHED}
    assert np.isnan(found.lower_bound[rest]).all()
    assert found.certificate(int(rest.argmax())) is None
    assert np.array_equal(found.status[~rest], full.status[~rest])
    assert (full.method[rest] != "").all()
    assert not (full.status == STATUSES.index(PlanStatus.LIMIT_REACHED)).any()


def test_an_engine_that_cannot_stop_is_left_to_the_solvers():
    lander = replace(PAPER_LANDER, min_thrust=500.0)
    start = starts(paper_start, 2, 8)
    assert set(solve_pdg_many(start, TARGET, lander=lander, fallback=False).method) == {""}
    found = solve_pdg_many(start, TARGET, lander=lander, nodes=13)
    plan = guidance.solve_pdg(start[1], TARGET, lander=lander)
    assert found.optimal.all()
    assert found.propellant[1] == plan.propellant
    assert found.nodes is not None
    assert np.array_equal(found.first_thrust[1], plan.thrust[0])
    np.testing.assert_allclose(found.nodes.position[1, [0, -1]], plan.position[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(found.nodes.mass[1, [0, -1]], plan.mass[[0, -1]], rtol=1e-9)
    np.testing.assert_allclose(found.nodes.thrust[1], plan.thrust_at(found.nodes.time[1]))


def test_a_start_that_rounding_puts_outside_is_taken_onto_the_limit():
    start = [100.0, 0.0, 50.0 + 100.0 / math.tan(1.0) - 2e-5, 0.0, 0.0, -1.0, 1200.0]
    found = solve_pdg_many(start, TARGET, glide_slope_limit=1.0)
    plan = guidance.solve_pdg(start, TARGET, glide_slope_limit=1.0)
    assert found.status_of(0) is plan.status is PlanStatus.OPTIMAL


def test_nothing_is_asked_and_nothing_answered():
    for states, targets in ((np.empty((0, 7)), TARGET), (starts(paper_start, 1, 9), np.empty((0, 3)))):
        found = solve_pdg_many(states, targets, nodes=5)
        assert len(found) == 0
        assert found.propellant.shape == (0,)


GOOD = [200.0, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"states": [1.0, 2.0]}, r"states must have shape \(7,\) or \(N, 7\)"),
        ({"states": "north"}, "states must be rows of 7 numbers"),
        ({"states": [GOOD, [*GOOD[:6], math.nan]]}, r"states\[1\]: must be finite"),
        ({"states": [GOOD, [*GOOD[:6], 1150.0]]}, r"states\[1\]: mass must exceed the dry mass 1150 kg"),
        ({"states": [GOOD, [1e10, *GOOD[1:]]]}, r"states\[1\]: no number may exceed 1e\+09"),
        ({"states": [GOOD, [0.0, 0.0, 49.0, *GOOD[3:]]]}, r"states\[1\]: the start lies below"),
        ({"targets": [TARGET, [0.0, 0.0, math.inf]]}, r"targets\[1\]: must be finite"),
        ({"states": [GOOD] * 3, "targets": [TARGET] * 2}, "must be as many, or one of either, got 3 and 2"),
        ({"gravity": (0.0, 0.0)}, "gravity must have shape"),
        ({"gravity": (0.0, 0.0, -1e10)}, "gravity: no number may exceed"),
        ({"lander": None}, "lander must be a Lander"),
        ({"glide_slope_limit": 2.0}, "glide_slope_limit must be at most"),
        ({"speed_limit": 0.0}, "speed_limit must be greater than 0"),
        ({"nodes": 1}, "nodes must be an integer of at least 2"),
        ({"nodes": True}, "nodes must be an integer"),
        ({"threads": 0}, "threads must be at least 1"),
    ],
)
def test_a_bad_argument_is_named(changes, words):
    arguments = {"states": GOOD, "targets": TARGET} | changes
    with pytest.raises(ValueError, match=words):
        solve_pdg_many(**arguments)


def test_a_row_is_the_landing_problem_of_its_single_call():
    found = solve_pdg_many([GOOD, GOOD], TARGET, glide_slope_limit=1.2, speed_limit=80.0)
    problem = found.starts.problem(1)
    assert isinstance(problem, LandingProblem)
    assert problem.state.as_array().tolist() == GOOD
    assert (problem.glide_slope_limit, problem.speed_limit) == (1.2, 80.0)
    assert np.array_equal(problem.gravity, GRAVITY)
