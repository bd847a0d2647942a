"""An agent that gives the thrust itself, as a policy: the lander tracks the flight that it foretells.

A policy decides once a look, such an agent once a control period. At each look its flight to the next one is
foretold, with an engine that does not err: state, action, state. The lander tracks that flight. In
`LunarHDA-Thrust-v0` the agent answers to the engine's error itself; here the tracking does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from guidance.arrays import Array
from guidance.dynamics import propagate_into
from guidance.state import State
from guidance.thrust_limits import limit_into, pointing_angle
from guidance.tracking.reference import make_reference
from guidance.tracking.regulator import DEFAULT_WEIGHTS, tracking_gains
from hda.policy import Decision, PlanCommand
from hda.task.observation import Observation, ScenarioView
from rl.environment.encoding import seen_flight
from rl.environment.thrust.thrust_action import (
    THRUST_ACTIONS,
    LookPlace,
    encode_thrust_flights,
    site_shift,
    thrust_acceleration,
    thrust_vector_size,
)
from rl.inference.artefacts import Tensors
from rl.inference.networks import Perceptron
from rl.policies.actor_design import ActorDesign, bound_action


@dataclass(frozen=True, eq=False)
class ThrustMemory:
    """What is remembered between looks.

    Attributes:
        view: the scenario.
        clock: [s] time to go at the first look; None before it.
    """

    view: ScenarioView
    clock: float | None = None


@dataclass(frozen=True, eq=False)
class ThrustActor:
    """Observation -> decision, of an agent that acts at each control period.

    Attributes:
        design: what it sees, and what its actions mean.
        network: its dense layers.
    """

    design: ActorDesign
    network: Perceptron

    def begin(self, view: ScenarioView) -> ThrustMemory:
        """Nothing seen yet."""
        return ThrustMemory(view)

    def decide(self, observation: Observation, memory: ThrustMemory) -> tuple[Decision, ThrustMemory]:
        """Foretell the flight to the next look, and let the lander track it."""
        view = memory.view
        clock = observation.time_to_go if memory.clock is None else memory.clock
        states, site = self.foretell(observation, view, clock)
        period, gravity = view.control_period, view.gravity
        reference = make_reference(states[:, :3].copy(), states[:, 3:6].copy(), period, gravity)
        command = PlanCommand(reference, tracking_gains(period, DEFAULT_WEIGHTS))
        return Decision(site, command), replace(memory, clock=clock)

    def foretell(self, look: Observation, view: ScenarioView, clock: float) -> tuple[Array, Array]:
        """States at the control instants until one period after the next look, or the target plane.

        What the next look will show is not known: the last period repeats the action before it.

        Args:
            look: of this instant.
            view: the scenario.
            clock: [s] time to go at the first look.

        Returns:
            Shape (n, 7), n at least 2: position [m], velocity [m/s], mass [kg]; and the site, shape (3,).
        """
        design, lander, period = self.design, view.lander, view.control_period
        latent = design.encoder.encode(look.safety_map)
        now = replace(look, time_to_go=clock - look.time)
        states, site = [look.state.as_array()], look.target
        action = np.zeros(len(THRUST_ACTIONS))
        for k in range(view.control_periods + 1):
            if k < view.control_periods:
                age = np.array([k / view.control_periods])
                place = LookPlace(latent, age, look.target, np.array([look.width]))
                vector = encode_thrust_flights(design.layout, seen_flight(now), view.nominal_target, place)
                action = bound_action(self.network.evaluate(vector), design.algorithm).astype(np.float64)
            if k == 0:
                site = site + site_shift(action, np.asarray(look.width), design.ranges.shift)
            thrust = states[-1][6] * thrust_acceleration(action, view.gravity)
            limit_into(thrust, lander.min_thrust, lander.max_thrust, pointing_angle(lander))
            after = np.empty(7)
            propagate_into(states[-1], thrust, period, view.gravity, lander.exhaust_velocity, after)
            states.append(after)
            if after[2] <= site[2] or after[6] <= lander.dry_mass:
                break
            state = State(after[:3], after[3:6], float(after[6]))
            left = clock - look.time - period * (k + 1)
            now = replace(look, state=state, target=site, time_to_go=left)
        return np.array(states), site


def thrust_actor_from_tensors(tensors: Tensors, design: ActorDesign) -> ThrustActor:
    """Make one from verified weights.

    Raises:
        ArtefactError: they have other shapes.
    """
    sizes = (thrust_vector_size(design.layout), *design.hidden, len(THRUST_ACTIONS))
    return ThrustActor(design, Perceptron.from_tensors(tensors, sizes))
