"""An undisturbed 6/2 flight is the energy-optimal transfer as its control period goes to zero.

Closed form, with ZEM and ZEV at the start and T the time of flight: a(t) = c0 + c1 t, where
c0 = 6 ZEM/T^2 - 2 ZEV/T and c1 = 6 ZEV/T^2 - 12 ZEM/T^3, and the least integral of |a|^2 over the flight is
12 ZEM.ZEM/T^3 - 12 ZEM.ZEV/T^2 + 4 ZEV.ZEV/T. With a thrust held over a control period h the path differs
from it in first order: by half as much when h is halved. Its energy differs in second order, since the
integral is stationary at the optimum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import root_scalar

import hda
from guidance import State, time_to_go
from hda.flight.vehicle import Segment
from hda.task.scenario import Scenario
from rl.environment.env import LunarHDAEnv

Array = NDArray[np.float64]
PERIODS = (0.5, 0.25, 0.125, 0.0625)
TIME_OF_FLIGHT = 40.0  # a whole number of each control period
GRAVITY = np.array([0.0, 0.0, -1.62])
EPISODES = (0, 1, 2)


@dataclass(frozen=True)
class Transfer:
    """The energy-optimal transfer of a scenario, in closed form."""

    state: State
    miss: Array
    velocity_miss: Array

    @property
    def energy(self) -> float:
        z, w, t = self.miss, self.velocity_miss, TIME_OF_FLIGHT
        return float(12.0 * z @ z / t**3 - 12.0 * z @ w / t**2 + 4.0 * w @ w / t)

    def position(self, time: float) -> Array:
        z, w, t = self.miss, self.velocity_miss, TIME_OF_FLIGHT
        first, slope = 6.0 * z / t**2 - 2.0 * w / t, 6.0 * w / t**2 - 12.0 * z / t**3
        coast = self.state.position + time * self.state.velocity + 0.5 * time**2 * GRAVITY
        return coast + time**2 * (first / 2.0 + time * slope / 6.0)


def transfer(scenario: Scenario) -> Transfer:
    state, t = scenario.initial_state, TIME_OF_FLIGHT
    coast = state.position + t * state.velocity + 0.5 * t**2 * GRAVITY
    return Transfer(state, scenario.nominal_target - coast, -state.velocity - t * GRAVITY)


def undisturbed(episode: int, period: float) -> Scenario:
    """An episode without thrust error, from the height from which the quartic gives the time of flight."""
    drawn = hda.sample_scenario("paper", 3, episode)
    preset = drawn.preset
    calm = replace(preset, rules=replace(preset.rules, thrust_error=0.0, control_period=period))
    state, target = drawn.initial_state, drawn.nominal_target

    def start(height: float) -> State:
        return State(np.array([*state.position[:2], height]), state.velocity, state.mass)

    def excess(height: float) -> float:
        return time_to_go(start(height), target) - TIME_OF_FLIGHT

    height = root_scalar(excess, bracket=(200.0, 1500.0), xtol=1e-9).root
    return replace(drawn, preset=calm, initial_state=start(height))


def fly_episode(scenario: Scenario) -> list[Segment]:
    return list(hda.fly(hda.make_policy("no-divert"), scenario).segments)


def step_environment(scenario: Scenario) -> list[Segment]:
    """The middle of the action's ranges is 6/2, a clock of unit rate and a target that stays."""
    env = LunarHDAEnv()
    env.reset(options={"scenario": scenario})
    ended = False
    while not ended:
        _, _, terminated, truncated, _ = env.step(np.zeros(5, dtype=np.float32))
        ended = terminated or truncated
    return [step.segment for step in env.steps]


Fly = Callable[[Scenario], list[Segment]]
FLIGHTS = pytest.mark.parametrize("segments_of", [fly_episode, step_environment])


def spent_energy(segments: list[Segment]) -> float:
    """Integral of |a|^2, from the changes of velocity that the thrust made."""
    total = 0.0
    for segment in segments:
        interval = np.diff(segment.time)
        burning = segment.commanded.any(axis=1)
        pushed = np.diff(segment.path[:, 3:6], axis=0)[burning] / interval[burning, None] - GRAVITY
        total += float((pushed**2).sum(axis=1) @ interval[burning])
    return total


def path_errors(segments: list[Segment], optimum: Transfer) -> Array:
    """[m] from the closed form at the looks, shape (looks, 3)."""
    return np.array([s.path[0, :3] - optimum.position(5.0 * k) for k, s in enumerate(segments)])


@FLIGHTS
@pytest.mark.parametrize("episode", EPISODES)
def test_the_energy_converges_to_the_least_one(segments_of: Fly, episode: int) -> None:
    least = transfer(undisturbed(episode, PERIODS[0])).energy
    spent = np.array([spent_energy(segments_of(undisturbed(episode, period))) for period in PERIODS])
    error = np.abs(spent - least)
    assert error[-1] < 1e-6 * least
    np.testing.assert_allclose(error[:-1] / error[1:], 4.0, rtol=0.05)


@FLIGHTS
@pytest.mark.parametrize("episode", EPISODES)
def test_the_path_converges_to_the_optimal_one(segments_of: Fly, episode: int) -> None:
    optimum = transfer(undisturbed(episode, PERIODS[0]))
    errors = [path_errors(segments_of(undisturbed(episode, period)), optimum) for period in PERIODS]
    greatest = np.array([np.linalg.norm(error, axis=1).max() for error in errors])
    np.testing.assert_allclose(greatest[:-1] / greatest[1:], 2.0, rtol=0.01)
    extrapolated = 2.0 * errors[-1] - errors[-2]  # what is of first order in the control period falls out
    assert np.linalg.norm(extrapolated, axis=1).max() < 2e-3 * greatest[-1]


@FLIGHTS
@pytest.mark.parametrize("episode", EPISODES)
def test_the_flight_ends_at_rest_on_the_target_as_the_control_period_goes_to_zero(
    segments_of: Fly, episode: int
) -> None:
    miss, speed = [], []
    for period in PERIODS:
        scenario = undisturbed(episode, period)
        end = segments_of(scenario)[-1].path[-1]
        miss.append(np.linalg.norm(end[:3] - scenario.nominal_target))
        speed.append(np.linalg.norm(end[3:6]))
    assert miss[0] < 1e-6
    assert speed[0] < 0.005
    np.testing.assert_allclose(np.divide(speed[:-1], speed[1:]), 4.0, rtol=0.05)
