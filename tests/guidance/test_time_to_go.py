"""The time to go: the printed quartic, what it minimises, closed forms, and where it jumps."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar, root_scalar

from guidance import MOON_GRAVITY, PAPER_LANDER, State, propagate, time_to_go, zem_zev_acceleration

GRAVITY = np.array(MOON_GRAVITY)
ORIGIN = np.zeros(3)
PAPER, ENERGY = None, 0.0
TIME_WEIGHTS = pytest.mark.parametrize("time_weight", [PAPER, ENERGY])
COMPONENTS = st.floats(-1.0, 1.0)
EXPONENTS = st.floats(-6.0, 3.0)


def vectors(scale: float):
    return st.tuples(COMPONENTS, COMPONENTS, COMPONENTS).map(lambda numbers: scale * np.array(numbers))


def spread_vectors():
    """Vectors of lengths over nine decades."""
    return st.tuples(vectors(1.0), EXPONENTS).map(lambda drawn: drawn[0] * 10.0 ** drawn[1])


def state_at(miss, velocity, mass: float = 1200.0) -> State:
    """The state from which the origin lies at `miss`."""
    return State(-np.asarray(miss, dtype=float), np.asarray(velocity, dtype=float), mass)


def printed_terms(time, miss, velocity, end_velocity, gravity=GRAVITY, time_weight: float | None = PAPER):
    """The paper's polynomial, term by term; it prints |g|^2 t^4, which is W = |g|^2/2."""
    weight = 0.5 * float(gravity @ gravity) if time_weight is None else time_weight
    squares = velocity @ velocity + end_velocity @ velocity + end_velocity @ end_velocity
    return np.array(
        [
            (weight + 0.5 * gravity @ gravity) * time**4,
            -2.0 * squares * time**2,
            12.0 * miss @ (velocity + end_velocity) * time,
            -18.0 * miss @ miss,
        ]
    )


def real_roots(miss, velocity, end_velocity=ORIGIN, gravity=GRAVITY, time_weight: float | None = PAPER):
    """Positive roots from numpy.roots, rising, and whether two roots are too close to be told apart."""
    fourth, second, first, constant = printed_terms(1.0, miss, velocity, end_velocity, gravity, time_weight)
    roots = np.roots([fourth, 0.0, second, first, constant])
    off_axis = np.abs(roots.imag) / np.abs(roots)
    real = np.sort(roots.real[off_axis < 1e-5])
    blurred = bool(((off_axis > 0.0) & (off_axis < 1e-3)).any()) or bool(
        (np.diff(real) < 1e-3 * real[1:]).any()
    )
    return real[real > 0.0], blurred


def energy(time: float, state: State, end_velocity=ORIGIN, gravity=GRAVITY) -> float:
    """Integral of |a|^2/2 along the cubic in time to the origin, a = r'' - g; Gauss's rule is exact here."""
    average = -state.position / time - state.velocity
    gain = end_velocity - state.velocity
    start, end = (6.0 * average - 2.0 * gain) / time, (4.0 * gain - 6.0 * average) / time
    nodes, weights = np.polynomial.legendre.leggauss(3)
    share = 0.5 * (nodes + 1.0)[:, None]
    acceleration = (1.0 - share) * start + share * end - gravity
    return float(0.25 * time * weights @ (acceleration**2).sum(axis=1))


def cost(time: float, state: State, time_weight: float | None, end_velocity=ORIGIN, gravity=GRAVITY) -> float:
    weight = 0.5 * float(gravity @ gravity) if time_weight is None else time_weight
    return energy(time, state, end_velocity, gravity) + weight * time


@settings(max_examples=400)
@given(
    miss=spread_vectors(),
    velocity=spread_vectors(),
    end_velocity=st.one_of(st.just(ORIGIN), spread_vectors()),
    gravity=vectors(4.0),
    time_weight=st.one_of(st.none(), st.floats(0.0, 10.0)),
)
def test_root_is_positive_solves_the_quartic_and_is_the_first(
    miss, velocity, end_velocity, gravity, time_weight
):
    assume(np.linalg.norm(miss) > 1e-8)
    assume(np.linalg.norm(gravity) > 1e-2)
    found = time_to_go(state_at(miss, velocity), ORIGIN, gravity, end_velocity, time_weight)
    assert found > 0.0
    terms = printed_terms(found, miss, velocity, end_velocity, gravity, time_weight)
    assert abs(terms.sum()) <= 1e-14 * np.abs(terms).sum()
    earlier = np.array(
        [
            printed_terms(found * share, miss, velocity, end_velocity, gravity, time_weight)
            for share in np.linspace(0.01, 0.999, 100)
        ]
    )
    assert (earlier.sum(axis=1) <= 1e-13 * np.abs(earlier).sum(axis=1)).all()


@settings(max_examples=400)
@given(
    miss=vectors(1000.0), velocity=vectors(100.0), end_velocity=vectors(20.0), time_weight=st.floats(0.0, 5.0)
)
def test_root_is_the_smallest_of_numpys(miss, velocity, end_velocity, time_weight):
    assume(np.linalg.norm(miss) > 1.0)
    roots, blurred = real_roots(miss, velocity, end_velocity, GRAVITY, time_weight)
    assume(not blurred)
    found = time_to_go(state_at(miss, velocity), ORIGIN, GRAVITY, end_velocity, time_weight)
    assert found == pytest.approx(roots[0], rel=1e-8)


@given(
    distance=st.floats(1.0, 2000.0),
    speed=st.floats(0.0, 150.0),
    time_weight=st.one_of(st.none(), st.just(0.0)),
)
def test_straight_approach_solves_two_quadratics(distance, speed, time_weight):
    """Flying at the target c t^4 = 2 (v t - 3 R)^2, first met where sqrt(c/2) t^2 + v t - 3 R = 0."""
    fourth = GRAVITY @ GRAVITY * (1.0 if time_weight is None else 0.5)
    root = math.sqrt(fourth / 2.0)
    expected = 6.0 * distance / (speed + math.sqrt(speed**2 + 12.0 * root * distance))
    state = state_at([0.0, 0.0, -distance], [0.0, 0.0, -speed])
    assert time_to_go(state, ORIGIN, time_weight=time_weight) == pytest.approx(expected, rel=1e-12)


@TIME_WEIGHTS
@given(miss=vectors(1000.0))
def test_from_rest(miss, time_weight):
    """Without velocity c t^4 = 18 R^2."""
    assume(np.linalg.norm(miss) > 1e-3)
    fourth = GRAVITY @ GRAVITY * (1.0 if time_weight is None else 0.5)
    found = time_to_go(state_at(miss, ORIGIN), ORIGIN, time_weight=time_weight)
    assert found == pytest.approx((18.0 * miss @ miss / fourth) ** 0.25, rel=1e-13)


@TIME_WEIGHTS
@given(velocity=vectors(50.0))
def test_at_the_target_with_velocity(velocity, time_weight):
    """Without a miss c t^2 = 2 v^2; the same holds in the limit of a vanishing one, behind the vehicle."""
    assume(np.linalg.norm(velocity) > 0.1)
    fourth = GRAVITY @ GRAVITY * (1.0 if time_weight is None else 0.5)
    found = time_to_go(state_at(ORIGIN, velocity), ORIGIN, time_weight=time_weight)
    assert found == pytest.approx(math.sqrt(2.0 * velocity @ velocity / fourth), rel=1e-13)
    leaving = state_at(-1e-9 * velocity, velocity)
    assert time_to_go(leaving, ORIGIN, time_weight=time_weight) == pytest.approx(found, rel=1e-6)


@TIME_WEIGHTS
def test_at_rest_on_the_target_no_time_is_left(time_weight):
    assert time_to_go(state_at(ORIGIN, ORIGIN), ORIGIN, time_weight=time_weight) == 0.0


def test_without_gravity_the_weight_ends_the_flight():
    state = state_at([0.0, 0.0, -100.0], ORIGIN)
    assert time_to_go(state, ORIGIN, (0.0, 0.0, 0.0), time_weight=2.0) == pytest.approx(
        (180000 / 2.0) ** 0.25
    )
    for time_weight in (PAPER, ENERGY):
        with pytest.raises(ValueError, match=r"^time_weight must be above zero where there is no gravity"):
            time_to_go(state, ORIGIN, (0.0, 0.0, 0.0), time_weight=time_weight)


@settings(max_examples=200)
@given(
    miss=vectors(1000.0),
    velocity=vectors(100.0),
    lengths=st.floats(0.01, 100.0),
    times=st.floats(0.01, 100.0),
)
def test_time_scales_with_the_units(miss, velocity, lengths, times):
    assume(np.linalg.norm(miss) > 1.0)
    assume(not real_roots(miss, velocity)[1])
    scaled = state_at(miss * lengths, velocity * lengths / times)
    expected = times * time_to_go(state_at(miss, velocity), ORIGIN)
    assert time_to_go(scaled, ORIGIN, GRAVITY * lengths / times**2) == pytest.approx(expected, rel=1e-9)


@settings(max_examples=200)
@given(
    miss=vectors(1000.0),
    velocity=vectors(100.0),
    end_velocity=st.one_of(st.just(ORIGIN), vectors(20.0)),
    gravity=vectors(4.0),
    time_weight=st.one_of(st.none(), st.just(0.0), st.floats(0.0, 10.0)),
)
def test_root_minimises_energy_and_time(miss, velocity, end_velocity, gravity, time_weight):
    """Oracle: a numerical minimiser of the integral of |a|^2/2 + W along the flight, not the quartic."""
    assume(np.linalg.norm(miss) > 1.0)
    assume(np.linalg.norm(gravity) > 0.1)
    assume(not real_roots(miss, velocity, end_velocity, gravity, time_weight)[1])
    state = state_at(miss, velocity)
    found = time_to_go(state, ORIGIN, gravity, end_velocity, time_weight)
    best = minimize_scalar(
        cost,
        bounds=(0.99 * found, 1.01 * found),
        args=(state, time_weight, end_velocity, gravity),
        method="bounded",
        options={"xatol": 1e-9 * found},
    )
    least = cost(found, state, time_weight, end_velocity, gravity)
    assert least <= best.fun * (1.0 + 1e-12)
    assert least < cost(0.99 * found, state, time_weight, end_velocity, gravity)
    # before the first minimum the cost only falls
    times = found * np.geomspace(0.01, 1.0, 60)
    costs = [cost(float(time), state, time_weight, end_velocity, gravity) for time in times]
    assert (np.diff(costs) < 0.0).all()


@TIME_WEIGHTS
@pytest.mark.parametrize(
    ("miss", "velocity", "count"),
    [
        ([-210.0, -60.0, -900.0], [-7.0, -2.0, -28.0], 1),  # the paper's start
        ([0.0, 40.0, -500.0], [0.0, 0.0, -100.0], 3),
        ([300.0, 0.0, -200.0], [-40.0, 10.0, 30.0], 1),  # flying away
    ],
)
def test_stationary_points_of_the_cost_are_the_roots(miss, velocity, count, time_weight):
    miss, velocity = np.array(miss), np.array(velocity)
    state = state_at(miss, velocity)

    def slope(time: float) -> float:
        step = 1e-4 * time
        return (cost(time + step, state, time_weight) - cost(time - step, state, time_weight)) / (2.0 * step)

    grid = np.geomspace(0.5, 500.0, 4000)
    slopes = np.array([slope(float(time)) for time in grid])
    turns = np.nonzero(np.signbit(slopes[:-1]) != np.signbit(slopes[1:]))[0]
    stationary = [root_scalar(slope, bracket=(grid[k], grid[k + 1])).root for k in turns]
    assert len(stationary) == count
    roots, _ = real_roots(miss, velocity, time_weight=time_weight)
    np.testing.assert_allclose(stationary, roots, rtol=1e-5)
    assert time_to_go(state, ORIGIN, time_weight=time_weight) == pytest.approx(stationary[0], rel=1e-5)


def test_printed_quartic_flies_shorter_than_the_energy_optimal_one():
    """It weighs time as well; the cost in energy is then greater."""
    state = state_at([-210.0, -60.0, -900.0], [-7.0, -2.0, -28.0])
    printed, optimal = time_to_go(state, ORIGIN), time_to_go(state, ORIGIN, time_weight=ENERGY)
    assert printed < optimal
    assert energy(printed, state) > energy(optimal, state)


@settings(max_examples=200)
@given(
    miss=vectors(1000.0),
    velocity=vectors(100.0),
    time_weight=st.one_of(st.none(), st.just(0.0), st.floats(0.0, 5.0)),
    share=st.floats(0.01, 0.98),
)
def test_falls_at_unit_rate_along_an_undisturbed_flight(miss, velocity, time_weight, share):
    assume(np.linalg.norm(miss) > 1.0)
    assume(not real_roots(miss, velocity, time_weight=time_weight)[1])
    first = time_to_go(state_at(miss, velocity), ORIGIN, time_weight=time_weight)
    remaining = (1.0 - share) * first
    third = -(-2.0 * miss / first + velocity) / first**2
    second = -miss / first**2 - third * first
    position = second * remaining**2 + third * remaining**3
    later = State(position, -2.0 * second * remaining - 3.0 * third * remaining**2, 1.0)
    assert time_to_go(later, ORIGIN, time_weight=time_weight) == pytest.approx(remaining, rel=1e-7)


@TIME_WEIGHTS
def test_falls_at_unit_rate_along_a_simulated_flight(time_weight):
    state = state_at([-210.0, -60.0, -900.0], [-7.0, -2.0, -28.0])
    first = time_to_go(state, ORIGIN, time_weight=time_weight)
    period = first / 4000
    for k in range(3600):
        thrust = state.mass * zem_zev_acceleration(state, ORIGIN, first - k * period)
        state = propagate(state, thrust, period, PAPER_LANDER)
    assert time_to_go(state, ORIGIN, time_weight=time_weight) == pytest.approx(0.1 * first, rel=2e-3)


@TIME_WEIGHTS
def test_jumps_where_the_smaller_pair_of_roots_vanishes(time_weight):
    """A fast approach has three roots; as the target moves aside the two smaller meet, the third is left."""
    velocity = np.array([0.0, 0.0, -100.0])

    def miss_at(aside: float) -> np.ndarray:
        return np.array([aside, 0.0, -500.0])

    low, high = 0.0, 300.0
    assert len(real_roots(miss_at(low + 1.0), velocity, time_weight=time_weight)[0]) == 3
    assert len(real_roots(miss_at(high), velocity, time_weight=time_weight)[0]) == 1
    for _ in range(60):
        middle = 0.5 * (low + high)
        fourth, second, first, constant = printed_terms(
            1.0, miss_at(middle), velocity, ORIGIN, GRAVITY, time_weight
        )
        # the quartic's greatest value between its two positive stationary points
        stationary = np.sort(np.roots([4.0 * fourth, 0.0, 2.0 * second, first]).real)
        summit = np.polyval([fourth, 0.0, second, first, constant], stationary[1])
        low, high = (middle, high) if summit > 0.0 else (low, middle)

    before = state_at(miss_at(low * (1.0 - 1e-4)), velocity)
    after = state_at(miss_at(high * (1.0 + 1e-4)), velocity)
    roots_before, _ = real_roots(-before.position, velocity, time_weight=time_weight)
    roots_after, _ = real_roots(-after.position, velocity, time_weight=time_weight)
    assert len(roots_before) == 3
    assert len(roots_after) == 1
    assert roots_before[1] / roots_before[0] < 1.1
    found_before = time_to_go(before, ORIGIN, time_weight=time_weight)
    found_after = time_to_go(after, ORIGIN, time_weight=time_weight)
    assert found_before == pytest.approx(roots_before[0], rel=1e-7)
    assert found_after == pytest.approx(roots_after[0], rel=1e-7)
    assert found_after == pytest.approx(roots_before[2], rel=1e-3)
    assert found_after > 3.0 * found_before


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("target", [0.0, 0.0]),
        ("target", [math.nan, 0.0, 0.0]),
        ("target", None),
        ("gravity", [0.0, 0.0, math.inf]),
        ("gravity", -1.62),
        ("target_velocity", [0.0, 0.0]),
        ("target_velocity", [0.0, 0.0, math.nan]),
        ("time_weight", -0.1),
        ("time_weight", math.nan),
        ("time_weight", math.inf),
        ("time_weight", "heavy"),
    ],
)
def test_wrong_argument_is_named(argument, value):
    state = state_at([0.0, 0.0, -900.0], [0.0, 0.0, -30.0])
    with pytest.raises(ValueError, match=rf"^{argument} must"):
        time_to_go(state, **{"target": ORIGIN, argument: value})
