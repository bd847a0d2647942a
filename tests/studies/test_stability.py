"""ZEM/ZEV stability: closed forms against python-control, powers against integration, sampled flights."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from guidance import MOON_GRAVITY, Lander, State, zem_zev_acceleration
from hda.flight.vehicle import ControlPeriods, FlightErrors, FlightStatus, Surroundings, fly_over
from hda.policy import Decision, DecisionStatus, ZemZevCommand
from hda.task.presets import PRESETS
from studies.campaign.claimed_folder import FolderError
from studies.stability import command
from studies.stability.command import Stability, study_pair, study_stability
from studies.stability.held_loop import (
    Gains,
    closed_margins,
    least_safe_time,
    margins_by_control,
    sampled_margins,
    sampled_margins_by_control,
    stable_above,
)
from studies.stability.sampled_flight import (
    Clock,
    error_growth,
    flight_powers,
    fly_sampled,
    speed_vanishes,
    thrust_bounded,
    touch_down,
)
from studies.stability.sweep import gain_box, mean_descent

PERIOD = 0.5
BOX = st.builds(Gains, st.floats(5.0, 7.0), st.floats(1.0, 3.0))
CORNERS = [Gains(6.0, 2.0), Gains(5.0, 1.0), Gains(7.0, 1.0), Gains(5.0, 3.0), Gains(7.0, 3.0)]


def feedback(gains: Gains, time_to_go: float) -> np.ndarray:
    """Gains on position and velocity, differenced from the law itself (linear, so exactly)."""

    def push(x: float, v: float) -> float:
        state = State(np.array([x, 0.0, 0.0]), np.array([v, 0.0, 0.0]), 1200.0)
        pair = (gains.position, gains.velocity)
        return float(zem_zev_acceleration(state, np.zeros(3), time_to_go, pair)[0])

    return -np.array([push(1.0, 0.0), push(0.0, 1.0)])


def sampled_matrix(gains: Gains, time_to_go: float, loop_gain: float = 1.0) -> np.ndarray:
    """(e, e') after one period under the held command."""
    moved = np.array([[0.5 * PERIOD**2], [PERIOD]])
    return np.array([[1.0, PERIOD], [0.0, 1.0]]) - loop_gain * moved * feedback(gains, time_to_go)


def spectral_radius(matrix: np.ndarray) -> float:
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def test_figures_of_the_optimal_gains() -> None:
    for time in (0.25, 1.0, 40.0):
        margins = closed_margins(Gains(6.0, 2.0), time)
        assert margins.crossover * time == pytest.approx(math.sqrt(18.0))
        assert math.degrees(margins.phase_margin) == pytest.approx(70.5288, abs=1e-4)
        assert margins.delay_margin == pytest.approx(0.29014 * time, rel=1e-4)
        assert margins.gain_margin == math.inf


@given(BOX, st.floats(0.25, 80.0))
def test_feedback_is_the_law_differenced(gains: Gains, time: float) -> None:
    expected = [gains.position / time**2, gains.damping / time]
    assert feedback(gains, time) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("gains", CORNERS)
@pytest.mark.parametrize("time", [0.25, 0.7, 3.0, 60.0])
def test_continuous_margins_against_python_control(gains: Gains, time: float) -> None:
    ours, theirs = closed_margins(gains, time), margins_by_control(gains, time)
    assert ours.crossover == pytest.approx(theirs.crossover, rel=1e-9)
    assert ours.phase_margin == pytest.approx(theirs.phase_margin, rel=1e-9)
    assert ours.delay_margin == pytest.approx(theirs.delay_margin, rel=1e-9)
    assert theirs.gain_margin == math.inf


@pytest.mark.parametrize("gains", CORNERS)
@pytest.mark.parametrize("time", [1.6, 2.0, 5.0, 40.0])
def test_sampled_margins_against_python_control(gains: Gains, time: float) -> None:
    ours, theirs = sampled_margins(gains, time, PERIOD), sampled_margins_by_control(gains, time, PERIOD)
    assert ours.crossover == pytest.approx(theirs.crossover, rel=1e-6)
    assert ours.phase_margin == pytest.approx(theirs.phase_margin, abs=1e-6)
    assert ours.gain_margin == pytest.approx(theirs.gain_margin, rel=1e-9)


@given(BOX, st.floats(0.3, 40.0))
def test_sampled_stability_is_the_spectral_radius(gains: Gains, time: float) -> None:
    limit = stable_above(gains, PERIOD)
    if abs(time / limit - 1.0) < 1e-6:
        return
    radius = spectral_radius(sampled_matrix(gains, time))
    margins = sampled_margins(gains, time, PERIOD)
    assert (radius < 1.0) == (time > limit)
    assert (radius < 1.0) == (margins.gain_margin > 1.0 and margins.phase_margin > 0.0)


@given(BOX, st.floats(1.01, 20.0))
def test_gain_margin_is_where_the_sampled_loop_turns_unstable(gains: Gains, excess: float) -> None:
    time = excess * stable_above(gains, PERIOD)
    margin = sampled_margins(gains, time, PERIOD).gain_margin
    assert spectral_radius(sampled_matrix(gains, time, 0.999 * margin)) < 1.0
    assert spectral_radius(sampled_matrix(gains, time, 1.001 * margin)) > 1.0


@given(BOX, st.floats(0.0, 0.6), st.floats(1.0, 4.0))
def test_least_safe_time_is_a_threshold(gains: Gains, phase: float, gain: float) -> None:
    time = least_safe_time(gains, PERIOD, phase, gain)
    assert time >= stable_above(gains, PERIOD) * (1.0 - 1e-9)
    for factor in (1.001, 1.1, 3.0, 30.0):
        assert sampled_margins(gains, factor * time, PERIOD).meet(phase, gain)
    for factor in (0.999, 0.7, 0.3):
        assert not sampled_margins(gains, factor * time, PERIOD).meet(phase, gain)


def test_a_margin_beyond_the_loop_is_refused() -> None:
    with pytest.raises(ValueError, match="phase_margin 48 deg"):
        least_safe_time(Gains(5.0, 3.0), PERIOD, math.radians(48.0), 2.0)
    with pytest.raises(ValueError, match="position gain"):
        Gains(1.0, 1.0)


@given(BOX)
def test_powers_solve_their_quadratic_and_its_regions(gains: Gains) -> None:
    powers = flight_powers(gains)
    left = powers**2 - (1.0 + gains.damping) * powers + gains.position
    assert np.abs(left).max() < 1e-12
    assert powers.sum().real == pytest.approx(1.0 + gains.damping)
    assert speed_vanishes(gains)  # K_R - K_V > 1 in the whole box
    rule = gains.velocity + 3.0 <= gains.position <= 2.0 * gains.velocity + 2.0
    near = min(abs(gains.position - gains.velocity - 3.0), abs(gains.position - 2.0 * gains.velocity - 2.0))
    assert near < 1e-9 or thrust_bounded(gains) == rule


def test_speed_need_not_vanish_outside_the_box() -> None:
    assert not speed_vanishes(Gains(2.5, 1.5))
    assert flight_powers(Gains(2.5, 1.5))[0].real == pytest.approx(1.0)


@pytest.mark.parametrize("gains", CORNERS)
@pytest.mark.parametrize("gravity", [0.0, -1.62])
def test_powers_against_integration_of_the_law(gains: Gains, gravity: float) -> None:
    """A flight of the law itself, by an integrator, is free fall plus the two powers of the time to go."""
    start, end = 40.0, 0.05
    pull = np.array([0.0, 0.0, gravity])

    def move(time: float, x: np.ndarray) -> np.ndarray:
        state = State(np.array([0.0, 0.0, x[0]]), np.array([0.0, 0.0, x[1]]), 1.0)
        push = zem_zev_acceleration(state, np.zeros(3), start - time, (gains.position, gains.velocity), pull)
        return np.array([x[1], push[2] + gravity])

    times = np.linspace(0.0, start - end, 12)
    flown = solve_ivp(
        move, (0.0, start - end), [900.0, -27.5], method="DOP853", t_eval=times, rtol=1e-11, atol=1e-10
    )
    left = (start - times) / start
    n = flight_powers(gains)
    first = np.array([900.0 - 0.5 * gravity * start**2, -27.5 + gravity * start], dtype=complex)
    weights = np.linalg.solve(np.array([[1.0, 1.0], -n / start]), first)
    position = (weights * left[:, None] ** n).sum(axis=1) + 0.5 * gravity * (start * left) ** 2
    velocity = (-n / start * weights * left[:, None] ** (n - 1.0)).sum(axis=1) - gravity * start * left
    assert flown.y[0] == pytest.approx(position.real, abs=1e-5)
    assert flown.y[1] == pytest.approx(velocity.real, abs=1e-5)
    assert np.abs(position.imag).max() < 1e-9


@given(BOX, st.floats(0.3, 60.0))
def test_clock_reaches_cut_off_as_the_vehicle_does(gains: Gains, time: float) -> None:
    times = Clock.of(time, PERIOD).times_to_go
    assert times[0] == pytest.approx(time)
    assert (times > 0.5 * PERIOD - 1e-12).all()
    assert times[-1] - PERIOD <= 0.5 * PERIOD + 1e-12


@given(BOX, st.floats(3.0, 30.0))
def test_sampled_flight_against_the_vehicle(gains: Gains, time: float) -> None:
    """`hda.flight.vehicle` with no thrust limit and hardly any mass change flies the sampled loop."""
    if abs((time / PERIOD) % 1.0 - 0.5) < 1e-6:
        return
    lander = Lander(dry_mass=1.0, max_thrust=1e12, specific_impulse=1e15)
    position, velocity = np.array([-100.0, 40.0, 60.0 * time + 2e4]), np.array([6.0, -2.0, -25.0])
    site = np.array([0.0, 0.0, 0.0])
    gravity = np.array(MOON_GRAVITY)
    clock = Clock.of(time, PERIOD)
    ours = fly_sampled(gains, clock, position, velocity, gravity)
    command = ZemZevCommand(gains.position, gains.velocity, time)
    flown = fly_over(
        State(position, velocity, 1000.0),
        Decision(site, command, DecisionStatus.NOMINAL),
        lander,
        Surroundings(gravity),
        ControlPeriods(PERIOD, clock.periods),
        FlightErrors(),
    )
    nodes = flown.path.shape[0] - 1 if flown.status != FlightStatus.FLYING else clock.periods + 1
    assert nodes >= 2
    scale = 1e-9 * np.abs(position).max()
    assert flown.path[:nodes, :3] == pytest.approx(ours.position[:nodes], abs=scale)
    assert flown.path[:nodes, 3:6] == pytest.approx(ours.velocity[:nodes], abs=scale)
    pushed = flown.commanded[: nodes - 1] / flown.path[: nodes - 1, 6:]
    assert pushed == pytest.approx(ours.acceleration[: nodes - 1], abs=scale)


@pytest.mark.parametrize("gains", [Gains(6.0, 2.0), Gains(6.5, 2.0), Gains(6.0, 2.5), Gains(7.0, 3.0)])
def test_mean_descent_touches_down_as_the_vehicle_does(gains: Gains) -> None:
    """The whole mean descent of `paper`: the vehicle's touchdown, early or not, mass change and all."""
    preset = PRESETS["paper"]
    position, velocity, time = mean_descent(preset)
    gravity = np.array(preset.gravity)
    for shift in (-0.2, 0.0, 0.15):
        clock = Clock.of(time + shift, PERIOD)
        ours = fly_sampled(gains, clock, position, velocity, gravity)
        command = ZemZevCommand(gains.position, gains.velocity, time + shift)
        flown = fly_over(
            State(position, velocity, 1200.0),
            Decision(np.zeros(3), command, DecisionStatus.NOMINAL),
            preset.lander,
            Surroundings(gravity),
            ControlPeriods(PERIOD, clock.periods + 1),
            FlightErrors(),
        )
        assert flown.status == FlightStatus.TOUCHDOWN
        speed, moment = touch_down(ours, PERIOD, gravity)
        assert float(np.linalg.norm(flown.path[-1, 3:6])) == pytest.approx(float(speed), abs=0.05)
        assert flown.time[-1] == pytest.approx(float(moment), abs=0.1)


def test_flights_of_many_phases_are_flights_of_one() -> None:
    phases = np.array([0.6, 1.0, 1.5])
    gravity = np.array(MOON_GRAVITY)
    together = fly_sampled(
        Gains(5.5, 2.5), Clock(PERIOD, 30, phases, 1.2), [9.0, 1.0, 80.0], np.ones(3), gravity
    )
    for k, phase in enumerate(phases):
        alone = fly_sampled(
            Gains(5.5, 2.5), Clock(PERIOD, 30, float(phase), 1.2), [9.0, 1.0, 80.0], np.ones(3), gravity
        )
        assert np.array_equal(together.position[:, k], alone.position)
        assert np.array_equal(together.acceleration[:, k], alone.acceleration)
    growth = error_growth(Gains(5.5, 2.5), Clock(PERIOD, 30, phases))
    single = [error_growth(Gains(5.5, 2.5), Clock(PERIOD, 30, float(phase))) for phase in phases]
    assert growth.velocity == max(one.velocity for one in single)
    assert growth.thrust == max(one.thrust for one in single)


def test_frozen_gains_hold_the_law_of_that_time() -> None:
    clock = Clock(PERIOD, 4, 1.0, frozen_below=1.1)
    flight = fly_sampled(Gains(6.0, 2.0), clock, 3.0, -1.0, 0.0)
    state = np.array([3.0, -1.0])
    for k, time in enumerate((2.0, 1.5, 1.1, 1.1)):
        state = sampled_matrix(Gains(6.0, 2.0), time) @ state
        assert [flight.position[k + 1, 0], flight.velocity[k + 1, 0]] == pytest.approx(state, abs=1e-12)


def test_study_writes_its_folder(tmp_path) -> None:
    margins, gains = study_stability(Stability(gain_points=2, out=tmp_path))
    with (tmp_path / "gains.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [(float(r["position_gain"]), float(r["velocity_gain"])) for r in rows] == [
        (g.position, g.velocity) for g in gain_box(2)
    ]
    assert len(margins) % len(gains) == 0
    assert min(row.time_to_go_s for row in margins) < 0.51 * PERIOD
    assert all(row.margins_met <= row.sampled_stable for row in margins)
    text = (tmp_path / "conclusions.txt").read_text()
    assert "the speed vanishes at touchdown for 4 of 4 pairs" in text
    assert (tmp_path / "stability.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("stop", [0, 3])
def test_a_stopped_study_goes_on_where_it_was(tmp_path, monkeypatch, stop: int) -> None:
    """Equal bytes, and no pair of gains worked out twice."""
    whole = Stability(gain_points=2, figures=False, out=tmp_path / "whole")
    study_stability(whole)
    options, done = replace(whole, out=tmp_path / "parts"), []

    def study(gains: Gains, *rest) -> command.PairRows:
        if len(done) == stop and not options.resume:
            raise KeyboardInterrupt
        done.append(gains)
        return study_pair(gains, *rest)

    monkeypatch.setattr(command, "study_pair", study)
    with pytest.raises(KeyboardInterrupt):
        study_stability(options)
    assert done == gain_box(2)[:stop]
    with pytest.raises(FolderError, match=r"--resume.*--overwrite"):
        study_stability(options)
    options = replace(options, resume=True)
    study_stability(options)
    assert done == gain_box(2)
    for name in ("gains.csv", "gains.md", "margins.csv", "conclusions.txt"):
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    for changes, named in (
        ({"preset": "hard"}, r"options\.preset was .paper., is .hard."),
        ({"phase_margin": 20.0}, r"options\.phase_margin was 30\.0, is 20\.0"),
    ):
        with pytest.raises(FolderError, match=named):
            study_stability(replace(options, **changes))
    study_stability(replace(options, resume=False, overwrite=True, phase_margin=20.0))
    assert len(done) == 8


@pytest.mark.parametrize("field", [{"gain_points": 1}, {"phase_margin": 60.0}, {"gain_margin": 0.5}])
def test_options_are_checked(field: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(field))):
        Stability(**field)  # type: ignore[arg-type]
