"""The flight code in C against the kernels of Python: the same answers, on any input, and nothing but C99."""

import math
import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from builds import HEADER, SOURCE, STATUSES, Build, compile_c, compiler, enumerated
from descents import CASES, TARGET, feasible_start, harsh_start, paper_start
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import MOON_GRAVITY, PAPER_LANDER, Lander, State, solve_pdg
from guidance.bulk.certified_flight import Finding
from guidance.descent.problem import LandingProblem
from guidance.export_c.export import export_flight_code
from guidance.flight_code.reference import Question, Refusal, answer_question
from guidance.flight_code.vectors import draw_questions, edge_questions, write_table, wrong_questions
from guidance.flight_time.primer_vector import find_primer_flight

_TOUCHING = [
    [-164.2, -138.1, 179.3, -2.2, -29.1, -46.7, 1199.0],
    [-11.3, 0.4, 202.6, 17.4, 25.7, -48.7, 1194.5],
    [9.4, -38.2, 103.7, 8.9, 27.0, -29.2, 1186.2],
]
TIGHT = 5e-3  # [kg] below the flight: a bound is that tight where its primers have converged


@pytest.fixture(scope="module")
def build(tmp_path_factory) -> Build:
    return Build.at(tmp_path_factory.mktemp("build"))


def question_of(start, lander=PAPER_LANDER, gravity=MOON_GRAVITY, target=TARGET, glide_slope_limit=None):
    limit = math.inf if lander.pointing_limit is None else lander.pointing_limit
    glide = math.inf if glide_slope_limit is None else glide_slope_limit
    engine = lander.max_thrust, lander.min_thrust, lander.dry_mass, lander.exhaust_velocity
    state, site = tuple(map(float, start)), tuple(map(float, target))
    return Question(*engine, tuple(map(float, gravity)), limit, math.inf, glide, state, site)


def dispersed_start(rng):
    place = [*rng.uniform(-500, 500, 2), rng.uniform(300, 1000)]
    return [*place, *rng.uniform(-30, 30, 2), rng.uniform(-50, 5), 1200.0]


def check_equal(found, expected) -> float:
    """Assert that answers are equal to 1e-9, directions to 1e-8; returns what is between the bounds.

    That is in propellants. Of a bound beside a touch of the ground that lies more than 1 % below the flight
    it is only said that it is a bound, for how weak it is hangs on rounding.
    """
    assert found.status is expected.status
    assert found.propellant == pytest.approx(expected.propellant, rel=1e-9, nan_ok=True)
    assert found.time_of_flight == pytest.approx(expected.time_of_flight, rel=1e-9, nan_ok=True)
    assert found.touch_time == pytest.approx(expected.touch_time, rel=1e-9, nan_ok=True)
    force = float(np.nan_to_num(np.abs(expected.first_thrust)).max())
    np.testing.assert_allclose(found.first_thrust, expected.first_thrust, atol=1e-8 * force, rtol=0.0)
    if found.status is not Finding.OPTIMAL:
        assert found.lower_bound == pytest.approx(expected.lower_bound, nan_ok=True)
        return 0.0
    assert found.lower_bound <= found.propellant
    if found.touch_time > -math.inf and expected.lower_bound < 0.99 * expected.propellant:
        return 0.0
    return abs(found.lower_bound - expected.lower_bound) / expected.propellant


@pytest.mark.parametrize(
    ("sampler", "count"), [(paper_start, 4000), (dispersed_start, 3000), (harsh_start, 3000)]
)
def test_ten_thousand_answers_are_those_of_python(build, sampler, count):
    rng, apart, seen = np.random.default_rng(81), [], set()
    for _ in range(count):
        question = question_of(sampler(rng))
        expected = answer_question(question)
        apart.append(check_equal(build.answer(question), expected))
        seen.add(expected.status)
        if expected.propellant - expected.lower_bound < TIGHT:
            assert apart[-1] < 1e-9
    assert max(apart) < 1e-5
    assert np.mean(np.array(apart) < 1e-9) > 0.998
    assert Finding.OPTIMAL in seen
    assert sampler is not harsh_start or {Finding.INFEASIBLE, Finding.NO_FLIGHT} < seen


def test_other_vehicles_worlds_and_limits_are_answered_alike(build):
    questions = [*draw_questions(1500, np.random.default_rng(82)), *edge_questions(), *wrong_questions()]
    apart = [check_equal(build.answer(question), answer_question(question)) for question in questions]
    assert max(apart) < 1e-5
    assert np.mean(np.array(apart) < 1e-9) > 0.99
    seen = {build.answer(question).status for question in questions}
    assert seen >= set(STATUSES.values()) - {Finding.TANK_TOO_SMALL, Finding.BELOW_GROUND, Refusal.NO_TIME}


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_every_shared_reference_case_agrees(build, case):
    lander = Lander(pointing_limit=case["pointing_limit"], **case["lander"])
    start = [*case["position"], *case["velocity"], case["mass"]]
    question = question_of(start, lander, case["gravity"], case["target"], case["glide_slope_limit"])
    answer = build.answer(question)
    check_equal(answer, answer_question(question))
    if lander.min_thrust > 0.0:
        assert answer.status is Finding.LEAST_THRUST
    elif not case["feasible"]:
        assert answer.status is not Finding.OPTIMAL
    elif answer.status is Finding.OPTIMAL:
        optimum = case["mass"] - case["optimal_final_mass"]
        assert answer.propellant == pytest.approx(optimum, rel=1e-3)
        assert answer.lower_bound <= optimum * (1.0 + 1e-6) + 2e-3
    else:
        problem = LandingProblem(
            State.parse(start),
            np.array(case["target"]),
            lander,
            np.array(case["gravity"]),
            case["glide_slope_limit"],
        )
        assert answer.status is not Finding.INFEASIBLE
        assert find_primer_flight(problem) is None


@pytest.mark.parametrize("start", _TOUCHING)
def test_a_flight_that_touches_the_ground_thrusts_as_that_of_python(build, start):
    flight = build.solve(question_of(start))
    problem = LandingProblem(State.parse(start), TARGET, PAPER_LANDER, np.array(MOON_GRAVITY))
    expected = find_primer_flight(problem)
    assert expected is not None
    assert flight.touch[0] == pytest.approx(expected.extremal.touch[0], rel=1e-9)
    near = flight.touch[0] + np.array([-1e-3, 0.0, 1e-3])
    for time in (*np.linspace(0.0, 0.99 * expected.first_burn, 40), *near):
        _, thrust = build.thrust(flight, float(time))
        full = PAPER_LANDER.max_thrust * expected.direction_at(float(time))
        np.testing.assert_allclose(thrust, full, atol=1e-4)


def test_touches_and_flights_without_a_coast_are_answered_alike(build):
    touched = coastless = 0
    for question in edge_questions():
        found = build.answer(question)
        check_equal(found, answer_question(question))
        if found.status is Finding.OPTIMAL:
            flight = build.solve(question)
            touched += found.touch_time > 0.0
            coast = flight.primer_times[1] - max(flight.primer_times[0], 0.0)
            coastless += coast < 1e-6 * flight.time_of_flight
    assert (touched, coastless) == (4, 3)


def test_thrust_is_that_of_the_flight_at_every_time(build):
    rng = np.random.default_rng(83)
    for _ in range(50):
        start = paper_start(rng)
        flight = build.solve(question_of(start))
        problem = LandingProblem(State.parse(start), TARGET, PAPER_LANDER, np.array(MOON_GRAVITY))
        expected = find_primer_flight(problem)
        assert expected is not None
        for time in rng.uniform(0.0, expected.time, 20):
            burning = time < expected.first_burn or time >= expected.braking
            force = PAPER_LANDER.max_thrust if burning else 0.0
            status, thrust = build.thrust(flight, time)
            assert status is Finding.OPTIMAL
            np.testing.assert_allclose(thrust, force * expected.direction_at(time), atol=1e-5)
        assert build.thrust(flight, 1.01 * expected.time)[1].tolist() == [0.0, 0.0, 0.0]
        for wrong in (-1.0, math.nan):
            assert build.thrust(flight, wrong)[0] is Refusal.NO_TIME
    refused = build.solve(question_of([math.nan] * 7))
    assert build.thrust(refused, 0.0)[0] is Refusal.NO_TIME


def test_the_bound_lies_below_what_the_solver_finds(build):
    rng = np.random.default_rng(84)
    for _ in range(30):
        start = feasible_start(rng)
        answer, plan = build.answer(question_of(start)), solve_pdg(start, TARGET)
        if answer.status is Finding.OPTIMAL:
            assert answer.lower_bound <= answer.propellant < plan.propellant + 1e-3


def number(most: float = 1e9):
    small = st.floats(-most, most)
    return st.one_of(small, small, st.floats(), st.sampled_from([0.0, -0.0, 5e-324, math.inf, math.nan]))


@settings(max_examples=400)
@given(st.lists(number(), min_size=20, max_size=20))
def test_any_numbers_give_a_status_and_numbers_that_fit_it(build, numbers):
    vectors = tuple(numbers[4:7]), tuple(numbers[10:17]), tuple(numbers[17:])
    question = Question._make([*numbers[:4], vectors[0], *numbers[7:10], *vectors[1:]])
    answer = build.answer(question)
    assert answer.status is answer_question(question).status
    if answer.status is Finding.OPTIMAL:
        assert 0.0 <= answer.lower_bound <= answer.propellant * (1.0 + 1e-12) < math.inf
    else:
        assert math.isnan(answer.propellant)
        assert math.isnan(answer.lower_bound) == (answer.status is not Finding.INFEASIBLE)


def wild_question(rng) -> Question:
    """A world, a vehicle and a start of any size, some of them out of range."""

    def size():
        low, high = ((-320.0, -3.0), (3.0, 9.0), (-3.0, 4.0), (-3.0, 4.0))[rng.integers(4)]
        return 0.0 if rng.random() < 0.1 else float(10.0 ** rng.uniform(low, high))

    mass, pull, height = size() + 1e-300, float(10.0 ** rng.uniform(-4, 3)), float(10.0 ** rng.uniform(-3, 6))
    speed = math.sqrt(pull * height)
    likely = rng.random() < 0.7
    place = [*rng.normal(0.0, height, 2), rng.uniform(0.0, height)]
    motion = rng.normal(0.0, speed * 10.0 ** rng.uniform(-2, 1), 3)
    return Question(
        mass * pull * float(10.0 ** rng.uniform(-0.1, 3.0)) if likely else size(),
        0.0 if rng.random() < 0.9 else size(),
        mass * float(rng.uniform(0.1, 1.05)),
        speed * float(10.0 ** rng.uniform(-1.0, 3.0)) if likely else size(),
        (0.0, 0.0, -pull) if likely else (size(), -size(), -size()),
        math.inf if rng.random() < 0.7 else float(rng.uniform(0.0, 3.3)),
        math.inf if rng.random() < 0.7 else size(),
        math.inf if rng.random() < 0.7 else float(rng.uniform(0.0, 1.7)),
        (*map(float, place), *map(float, motion), mass) if likely else (*(size() for _ in range(6)), mass),
        (0.0, 0.0, 0.0),
    )


def test_sanitizers_find_nothing_in_wild_and_wrong_questions(tmp_path):
    """Built with the address and undefined-behaviour sanitizers, of which any report ends the program."""
    export_flight_code(tmp_path)
    rng = np.random.default_rng(85)
    questions = [wild_question(rng) for _ in range(3000)] + wrong_questions()
    (tmp_path / "vectors.csv").write_text(write_table(questions))
    done = subprocess.run(
        ["make", "sanitize", f"CC={compiler()}"], cwd=tmp_path, capture_output=True, text=True
    )
    assert "runtime error" not in done.stderr
    assert "Sanitizer" not in done.stderr
    told = re.search(r"(\d+) of (\d+) vectors agree", done.stdout)
    assert told is not None, done.stderr
    agree, count = map(int, told.groups())
    assert count == len(questions)
    assert agree >= 0.998 * count  # an iteration on the edge of its convergence may end otherwise
    assert done.stderr.count("differs") == count - agree


@pytest.mark.parametrize("optimisation", ["-O0", "-O3"])
def test_optimisation_changes_no_answer(build, tmp_path, optimisation):
    other = Build.at(tmp_path, optimisation)
    for question in draw_questions(300, np.random.default_rng(86)):
        assert check_equal(other.answer(question), build.answer(question)) < 1e-5


def test_the_header_names_the_statuses_of_python(build):
    assert enumerated() == {status.name: number for number, status in STATUSES.items()}
    words = {build.words(number) for number in STATUSES}
    assert len(words) == len(STATUSES)
    assert build.words(99) == "unknown status"


def test_the_source_has_no_heap_no_state_and_no_library_but_mathematics(tmp_path):
    text = SOURCE.read_text()
    assert set(re.findall(r"#include (\S+)", text)) == {'"powered_descent.h"', "<math.h>"}
    assert not re.search(r"\b(malloc|calloc|realloc|free|while \(1\)|goto|long double)\b", text)
    assert not re.findall(r"^static (?!const)[^()]*[;=]", text, re.MULTILINE)
    assert re.findall(r"\bfloat\b", HEADER.read_text()) == []
    compile_c(["-O2", "-fstack-usage", "-c", str(SOURCE), "-o", "code.o"], tmp_path)
    frames = [line.split("\t") for line in (tmp_path / "code.su").read_text().splitlines()]
    assert all("static" in kind or "bounded" in kind for _, _, kind in frames)
    assert sum(int(size) for _, size, _ in frames) < 24_000
    symbols = subprocess.run(["nm", "-u", "code.o"], cwd=tmp_path, capture_output=True, text=True, check=True)
    needed = {name.strip("_") for name in re.findall(r"U (\w+)", symbols.stdout)}
    mathematics = {"ceil", "cos", "exp", "expm1", "fabs", "hypot", "log", "log1p", "pow"}
    mathematics |= {"sin", "sincos", "sqrt"}
    assert needed <= mathematics | {"stack_chk_fail"}


def test_a_pointing_limit_of_python_is_one_of_c(build):
    lander = replace(PAPER_LANDER, pointing_limit=0.3)
    start = paper_start(np.random.default_rng(87))
    assert build.answer(question_of(start, lander)).status is Finding.LEANS
    assert build.answer(question_of(start)).status is Finding.OPTIMAL
