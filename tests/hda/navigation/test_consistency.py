"""Whether the filter errs as it says it does: 200 descents with errors and ground drawn as it believes them.

A sum of squared errors in units of their covariance is chi-squared where the covariance is right (NEES for
the estimate, NIS for innovations with the predicted covariance). Means over the runs stand against that
distribution at every instant. As many instants as independent ones would leave within its 95 % band, but for
one false alarm in 1000, and all within a band of one false alarm in 1000 over them together.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from hda.navigation import NAVIGATION_FAULTS, InertialUnit, NavigationSystem, Velocimeter, add_fault
from hda.navigation.layout import BEAM_BIAS, ESTIMATED, TILT
from tests.hda.navigation.filter_cases import Descent, Run, fly_many, run_many

RUNS = 200
FALSE_ALARM = 1e-3
SYSTEM = NavigationSystem()
WITHOUT = {
    "altimeter": (replace(SYSTEM, altimeter=None), (1.0, 1.0)),
    "velocimeter": (replace(SYSTEM, velocimeter=None), (1.5, 3.0)),
    "terrain": (replace(SYSTEM, terrain=None), (1.0, 1.0)),
    "site": (replace(SYSTEM, site=None), (2.0, 1.0)),
}
"""Systems that lack a sensor, and how many times the deviations of relative position and velocity at the end
must be at least: the site is known by its fixes and the velocity by the velocimeter."""


@pytest.fixture(scope="module")
def descents() -> list[Descent]:
    return fly_many(RUNS, seed=20)


@pytest.fixture(scope="module")
def nominal(descents: list[Descent]) -> list[Run]:
    return run_many(SYSTEM, descents, seed=30)


def check_band(squares: np.ndarray, freedom: int) -> None:
    """Hold mean squares, instants in rows and runs in columns, NaN without a reading, against chi-squared."""
    counted = np.isfinite(squares).sum(axis=1)
    squares = squares[counted > 0]
    counted = counted[counted > 0]
    sums = np.nansum(squares, axis=1)
    low, high = chi2.ppf([[0.025], [0.975]], freedom * counted)
    assert ((low <= sums) & (sums <= high)).sum() >= binom.ppf(FALSE_ALARM, counted.size, 0.95)
    tail = 0.5 * FALSE_ALARM / counted.size
    low, high = chi2.ppf([[tail], [1.0 - tail]], freedom * counted)
    assert ((low <= sums) & (sums <= high)).all()


def estimation_squares(runs: list[Run], pick: slice = slice(0, ESTIMATED)) -> np.ndarray:
    """NEES at the end of each leg (rows) of each run (columns); the last row is the end of the flight."""
    legs = min(len(run.error) for run in runs)
    ends = [*range(legs - 1), -1]
    return np.array(
        [
            [
                run.error[k, pick] @ np.linalg.solve(run.covariance[k][pick, pick], run.error[k, pick])
                for run in runs
            ]
            for k in ends
        ]
    )


def relative_error(run: Run) -> np.ndarray:
    """Error of position less site and of velocity at the end of the flight, shape (6,)."""
    return np.concatenate([run.error[-1, :3] - run.error[-1, 10:13], run.error[-1, 3:6]])


def test_the_errors_are_as_large_as_the_covariance_says(nominal: list[Run]):
    check_band(estimation_squares(nominal), ESTIMATED)


@pytest.mark.parametrize(("name", "freedom"), [("altimeter", 1), ("velocimeter", 3), ("terrain", 3)])
def test_the_innovations_are_as_large_as_predicted(nominal: list[Run], name: str, freedom: int):
    column = ["altimeter", "velocimeter", "terrain"].index(name)
    periods = min(len(run.squares) for run in nominal)
    squares = np.array([run.squares[:periods, column] for run in nominal]).T
    assert np.isfinite(squares).sum() > 10 * RUNS
    check_band(squares, freedom)


def test_the_fixes_of_the_site_are_as_far_off_as_predicted(nominal: list[Run]):
    looks = min(len(run.site_squares) for run in nominal)
    squares = np.array([run.site_squares[:looks] for run in nominal]).T
    assert np.isfinite(squares).sum() > RUNS
    check_band(squares, 3)


def test_a_gate_rejects_one_true_reading_in_a_thousand(nominal: list[Run]):
    readings = rejected = 0
    for column, freedom in enumerate((1, 3, 3)):
        squares = np.concatenate([run.squares[:, column] for run in nominal])
        readings += np.isfinite(squares).sum()
        rejected += (squares > chi2.isf(1e-3, freedom)).sum()
    assert abs(rejected - 1e-3 * readings) < 4.0 * math.sqrt(1e-3 * readings)


@pytest.mark.parametrize("without", sorted(WITHOUT))
def test_a_sensor_that_is_off_costs_what_the_covariance_says(
    descents: list[Descent], nominal: list[Run], without: str
):
    system, least = WITHOUT[without]
    runs = run_many(system, descents, seed=30)
    check_band(estimation_squares(runs), ESTIMATED)
    predicted, full = (
        np.array([np.diag(run.final.relative_covariance) for run in some]) for some in (runs, nominal)
    )
    worse = np.sqrt(predicted.sum(axis=0) / full.sum(axis=0))
    # A gain that considers errors is the best for each reading, not for all of them together: 1 %.
    assert (worse > 0.99 * np.repeat(least, 3)).all()
    if without == "altimeter":  # beside looks and velocimeter it adds nothing to a landing
        assert (worse < 1.02).all()
    errors = np.array([relative_error(run) for run in runs])
    sums = (errors**2 / predicted).sum(axis=0)
    low, high = chi2.ppf([FALSE_ALARM / 12, 1.0 - FALSE_ALARM / 12], RUNS)  # six numbers, both sides
    assert ((low < sums) & (sums < high)).all()


@pytest.mark.parametrize("fault", sorted(NAVIGATION_FAULTS))
def test_the_filter_stays_honest_in_every_named_fault(descents: list[Descent], fault: str):
    check_band(estimation_squares(run_many(add_fault(SYSTEM, fault), descents, seed=22)), ESTIMATED)


def test_errors_that_are_only_considered_count_with_their_right_sign(descents: list[Descent]):
    """A tilt and beam biases far above all noise: the velocity errs by them, and by what the filter says."""
    loud = replace(
        SYSTEM,
        inertial=InertialUnit(noise=1e-5, bias=1e-4, tilt=5e-3),
        velocimeter=Velocimeter(noise=1e-3, bias=0.02),
    )
    runs = run_many(loud, descents, seed=23)
    check_band(estimation_squares(runs, slice(3, 6)), 3)
    deaf = run_many(replace(loud, inertial=InertialUnit(noise=1e-5, bias=1e-4, tilt=0.0)), descents[:1], 23)
    ratio = np.diag(runs[0].covariance[0])[3:6] / np.diag(deaf[0].covariance[0])[3:6]
    assert ratio.max() > 4.0


def test_what_is_considered_is_never_learnt(nominal: list[Run]):
    run = nominal[0]
    np.testing.assert_array_equal(
        run.final.covariance[BEAM_BIAS:, BEAM_BIAS:], run.final.covariance[BEAM_BIAS:, BEAM_BIAS:].T
    )
    deviations = np.sqrt(np.diag(run.final.covariance))
    np.testing.assert_allclose(deviations[TILT:], 1e-3)
    np.testing.assert_allclose(deviations[BEAM_BIAS:TILT], 0.005)
