"""Flying one episode: look, decide, fly five seconds, again, until the ground.

`begin_flight`, `observe` and `advance` are the steps. `fly_legs` takes them in turn to the end, for `fly` and
for whoever else flies an episode; the Gymnasium environments call them one by one.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.rigid_body.state import RigidState
from guidance.state import State
from guidance.upright_time import upright_time_to_go
from hda.flight.outcome import Contact, Outcome, RewardTerms, classify, score_step
from hda.flight.record import EpisodeRecord, join_legs
from hda.flight.rigid.turning import believed_attitude
from hda.flight.touchdown_report import judge_touchdown
from hda.flight.vehicle import ControlPeriods, FlightErrors, FlightStatus, Segment, Surroundings, fly_over
from hda.navigation.navigation_state import NavigationState
from hda.policy import Decision, Memory, Policy, PrivilegedPolicy
from hda.sensing.lidar import look
from hda.sensing.ranging import RangingLidar
from hda.sensing.sensor_axis import sensor_axis
from hda.task import estimation
from hda.task.measurement import measure_look, measured_target
from hda.task.observation import Observation
from hda.task.scenario import Scenario, ground_point

_LATE = 0.5  # of a decision interval: with less time to go no height is changed any more


@dataclass(frozen=True, eq=False)
class Flight:
    """Where an episode stands before a look.

    Attributes:
        index: number of the decision to come.
        state: present state, the true one.
        target: [m] shape (3,), current target, in the frame of the estimated position.
        time_to_go: [s] what remains of the commanded time to go.
        navigation: the lander's filter, with what this look tells of the site; None on a preset without one.
        body: present state with attitude, rates and engine, the true one; None for a point mass.
    """

    index: int
    state: State
    target: Array
    time_to_go: float
    navigation: NavigationState | None = None
    body: RigidState | None = None


@dataclass(frozen=True, eq=False)
class Step:
    """What one decision led to.

    Attributes:
        flight: where the episode stands after it.
        segment: the flown path.
        outcome: how the episode ended, or None while it goes on.
        truncated: the episode was cut after the last decision, still in flight.
        reward: named terms of the reward.
        slant_angle: [rad] least elevation of the lander seen from the target, before and after retargeting.
    """

    flight: Flight
    segment: Segment
    outcome: Outcome | None
    truncated: bool
    reward: RewardTerms
    slant_angle: float


def elevation_angle(position: Array, target: Array) -> float:
    """[rad] elevation of `position` seen from `target` (both shape (3,)): 90 degrees is overhead."""
    offset = position - target
    return float(np.arctan2(offset[2], np.hypot(offset[0], offset[1])))


def begin_flight(scenario: Scenario) -> Flight:
    """Stand at t = 0: first target, and time to go of the quartic to it, or longer under a pointing limit."""
    state, preset = scenario.initial_state, scenario.preset
    target = scenario.nominal_target
    navigation = estimation.begin_estimate(scenario)
    estimate = estimation.displaced(state, estimation.estimation_error(scenario, navigation, state, target))
    clock = upright_time_to_go(estimate, target, preset.guided_lander, preset.gravity)
    body = None if preset.body is None else RigidState.parse(state)
    return Flight(0, state, target, clock, navigation, body)


def observe(scenario: Scenario, flight: Flight) -> Observation:
    """Take the look of this instant; its noise depends on the episode and the number of the look only."""
    lidar, rules = scenario.preset.lidar, scenario.preset.rules
    position = flight.state.position
    navigation, body = flight.navigation, flight.body
    error = estimation.estimation_error(scenario, navigation, flight.state, flight.target)
    aim = estimation.look_aim(scenario, flight.target, error)
    estimate, width = estimation.displaced(flight.state, error), lidar.width(position, aim)
    late = flight.index > 0 and flight.time_to_go <= _LATE * rules.decision_interval
    stance, ground = None if late else scenario.preset.stance, None
    if isinstance(lidar, RangingLidar):
        ground = measure_look(scenario, lidar, flight.index, body or flight.state, aim, error)
        safety_map = ground.safety_map(flight.target, width, lidar.pixels)
    elif lidar.dropout > 0.0 and scenario.streams.map_is_missing(flight.index, lidar.dropout):
        safety_map = np.zeros((lidar.pixels, lidar.pixels), dtype=np.float32)
    else:
        noise = scenario.streams.look(flight.index, lidar.pixels)
        axis = None if body is None else sensor_axis(body.attitude)
        safety_map = look(lidar, position, aim, scenario.tile.probability, noise, axis)
    attitude, rates, attitude_covariance = _believe_turning(scenario, flight)
    return Observation(
        index=flight.index,
        time=flight.index * rules.decision_interval,
        state=estimate,
        target=measured_target(stance, flight.index, flight.target, ground),
        safety_map=safety_map,
        width=width,
        time_to_go=flight.time_to_go,
        ground=ground,
        stance=stance,
        covariance=None if navigation is None else navigation.relative_covariance,
        attitude=attitude,
        rates=rates,
        attitude_covariance=attitude_covariance,
    )


class _BelievedTurning(NamedTuple):
    """Attitude, rates and covariance of an observation; nothing of a point mass."""

    attitude: Array | None = None
    rates: Array | None = None
    covariance: Array | None = None


def _believe_turning(scenario: Scenario, flight: Flight) -> _BelievedTurning:
    """What the lander believes of its attitude."""
    body, navigation = flight.body, flight.navigation
    if body is None:
        return _BelievedTurning()
    return _BelievedTurning(
        believed_attitude(body.attitude, estimation.attitude_error(navigation)),
        body.rates + estimation.rate_error(scenario, navigation, flight.index),
        None if navigation is None else navigation.attitude_covariance,
    )


def advance(scenario: Scenario, flight: Flight, decision: Decision) -> Step:
    """Fly a decision until the next look, the ground, or the end of the episode.

    Raises:
        ValueError: flights end on the target plane, and the decision's site is not on it.
    """
    preset = scenario.preset
    rules = preset.rules
    plane = scenario.nominal_target[2]
    if preset.stance is None and abs(decision.site[2] - plane) > 1e-6:
        raise ValueError(f"site must lie on the target plane z = {plane:g} m, got z = {decision.site[2]:g} m")
    position = flight.state.position
    aims = [ground_point(scenario, site) for site in (flight.target, decision.site)]
    slant = min(elevation_angle(position, aim) for aim in aims)
    thrust_error = scenario.streams.thrust_error(flight.index, rules.thrust_error)
    error = estimation.estimation_error(scenario, flight.navigation, flight.state, flight.target)
    sensing = estimation.open_sensing(scenario, flight.navigation, flight.target, decision.site, flight.index)
    segment = fly_over(
        flight.body or flight.state,
        decision,
        preset.vehicle,
        Surroundings(np.array(preset.gravity), scenario.footing),
        ControlPeriods(rules.control_period, rules.control_periods, preset.attitude_loop),
        FlightErrors(thrust_error, error, sensing),
    )
    state, landed = segment.final_state, segment.status is not FlightStatus.FLYING
    site, following, navigation = decision.site, flight.index + 1, None
    if not landed:
        navigation = estimation.next_estimate(scenario, flight.navigation, sensing, state, site, following)
    after = Flight(following, state, site, segment.time_to_go, navigation, segment.final_body)
    truncated = not landed and after.index >= rules.max_decisions
    initial = scenario.initial_state
    outcome = None
    if landed or truncated:
        contact = _meet_ground(scenario, segment, aims[1])
        outcome = classify(initial, after.state, aims[1], contact, preset.lander, rules)
    burnt = (flight.state.mass - after.state.mass) / (initial.mass - preset.lander.dry_mass)
    return Step(after, segment, outcome, truncated, score_step(burnt, outcome), slant)


def _meet_ground(scenario: Scenario, segment: Segment, site: Array) -> Contact:
    """How the flight's last segment met the plane or the ground; `site` is where it flew to."""
    landed, final = segment.status is not FlightStatus.FLYING, segment.final_state
    under_power = bool(segment.commanded[-1].any())
    return Contact(
        landed=landed,
        safe_cell=landed and scenario.tile.is_safe(final.position),
        tank_empty=segment.status is FlightStatus.TANK_EMPTY,
        report=judge_touchdown(scenario, final, site, under_power, segment.final_body) if landed else None,
    )


@dataclass(frozen=True, eq=False)
class Leg:
    """One look, the decision on it, and the flight that followed.

    Attributes:
        observation: what was seen.
        decision: what was decided.
        step: what that led to.
        look_time: [s] wall time of the look; the three times are not reproducible.
        decision_time: [s] wall time of the decision.
        flight_time: [s] wall time of the flight.
    """

    observation: Observation
    decision: Decision
    step: Step
    look_time: float
    decision_time: float
    flight_time: float


Decide = Callable[[Observation, Memory], tuple[Decision, Memory]]
"""Gives the decision on an observation, and the memory for the next."""


def fly_leg(scenario: Scenario, flight: Flight, decide: Decide[Memory], memory: Memory) -> tuple[Leg, Memory]:
    """Look, decide, fly on once; give the leg and the memory after it.

    Raises:
        ValueError: flights end on the target plane, and the decision's site is not on it.
    """
    started = clock.perf_counter()
    observation = observe(scenario, flight)
    looked = clock.perf_counter()
    decision, memory = decide(observation, memory)
    decided = clock.perf_counter()
    step = advance(scenario, flight, decision)
    flown = clock.perf_counter()
    return Leg(observation, decision, step, looked - started, decided - looked, flown - decided), memory


def fly_legs(scenario: Scenario, decide: Decide[Memory], memory: Memory) -> Iterator[Leg]:
    """Look, decide, fly on, until the episode ends: one leg after another.

    Raises:
        ValueError: flights end on the target plane, and a decision's site is not on it.
    """
    flight, ended = begin_flight(scenario), False
    while not ended:
        leg, memory = fly_leg(scenario, flight, decide, memory)
        yield leg
        flight, ended = leg.step.flight, leg.step.outcome is not None


def inform_pilot(policy: Policy[Any] | PrivilegedPolicy, scenario: Scenario) -> Policy[Any]:
    """The policy itself; a privileged one as it is when told the scenario."""
    return policy.informed(scenario) if isinstance(policy, PrivilegedPolicy) else policy


def _check_answer(name: str, answer: object) -> tuple[Decision, Any]:
    """Refuse what is not (Decision, memory), with the policy's name: a third party wrote it."""
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise ValueError(f"policy {name!r} must return (Decision, memory), got {type(answer).__name__}")
    decision, memory = answer
    if not isinstance(decision, Decision):
        raise ValueError(f"policy {name!r} must return a Decision, got {type(decision).__name__}")
    return decision, memory


def begin_decisions(policy: Policy[Any] | PrivilegedPolicy, scenario: Scenario) -> tuple[Decide[Any], Any]:
    """How a policy decides in an episode, with its answers checked, and its memory before the first look."""
    pilot = inform_pilot(policy, scenario)

    def decide(observation: Observation, memory: Any) -> tuple[Decision, Any]:
        return _check_answer(policy.name, pilot.decide(observation, memory))

    return decide, pilot.begin(scenario.view, scenario.streams.policy())


def fly(policy: Policy[Any] | PrivilegedPolicy, scenario: Scenario) -> EpisodeRecord:
    """Fly one episode.

    Args:
        policy: any policy; a privileged one is first given the scenario, with its true map.
        scenario: what to fly.

    Returns:
        The record; equal for equal arguments, but for `decision_time`.

    Raises:
        ValueError: the policy returns something that is not (Decision, memory), or a site off the target
            plane where flights end on it.
    """
    decide, memory = begin_decisions(policy, scenario)
    return join_legs(policy.name, scenario, tuple(fly_legs(scenario, decide, memory)))
