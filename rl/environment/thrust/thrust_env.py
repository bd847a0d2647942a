"""The environment whose action is the thrust at each control period."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from guidance.tracking.reference import TrackingReference
from hda.flight.episode import Flight, Step, elevation_angle
from hda.flight.outcome import score_step
from hda.flight.vehicle import ControlPeriods, FlightErrors, FlightStatus, Surroundings, fly_over
from hda.policy import Decision, PlanCommand
from hda.task.estimation import displaced
from hda.task.observation import Observation, ScenarioView
from hda.task.presets import Preset
from hda.task.scenario import ground_point
from rl.environment.action import clip_actions
from rl.environment.encoding import LATENT_BOUND, seen_flight
from rl.environment.env import LandingEnv
from rl.environment.episode_info import describe_episode
from rl.environment.native.batch_settings import refuse_unserved
from rl.environment.native.flight_batch import judge_flight
from rl.environment.thrust.thrust_action import (
    LOOK_ELEMENTS,
    THRUST_ACTIONS,
    LookPlace,
    encode_thrust_flights,
    site_shift,
    thrust_acceleration,
)
from rl.inference.arrays import Array32
from rl.inference.artefacts import ENCODER
from rl.inference.latent import LATENT_SIZE, encoder_path, load_encoder


class LunarHDAThrustEnv(LandingEnv[Array32]):
    """`LunarHDA-Thrust-v0`: the thrust is the action, once each control period; 47 numbers are seen.

    **Action**, Box(-1, 1, (5,), float32):

    | index | meaning | -1 | +1 |
    |---|---|---|---|
    | 0, 1, 2 | acceleration of the vehicle east, north, up, m/s^2 | -5 | 5 |
    | 3, 4 | shift of the target east, north, in widths of the look; at a look only | -0.25 | 0.25 |

    The thrust is the lander's mass times this acceleration less gravity, brought within the engine's limits
    and the pointing limit; nothing cuts the engine off. A step is one control period of the preset (0.5 s on
    `paper`); after ten of them, 5 s, the next look is taken. The episode ends at touchdown, with an empty
    tank, or in flight after as many looks as the rules allow.

    **Observation**: the 44 numbers of `LunarHDA-v0`, the first twelve of this instant, the latent of the last
    look; then the look's age (0 to 1, of the time between two looks), and where its middle lies east and
    north of the target, in its widths. The time to go is the first one's clock, and may pass zero.

    **Reward**, options and `info`: as of `LandingEnv`. Served are presets whose looks are the true map with
    noise and whose flights end on the target plane; `gymnasium.make_vec` gives a native vector.
    """

    def __init__(self, *arguments: Any, encoder: str = ENCODER, **options: Any) -> None:
        """Make the environment.

        Args:
            arguments: as of `LandingEnv`.
            encoder: shipped encoder of the looks, by name.
            options: as of `LandingEnv`.

        Raises:
            ValueError: a preset that is not served, or no such encoder; else as `LandingEnv`.
        """
        self.encoder = load_encoder(encoder_path(encoder))
        self._latent, self._held = np.zeros(LATENT_SIZE, np.float32), 0
        super().__init__(*arguments, **options)

    def make_observation_space(self, preset: Preset) -> spaces.Space[Array32]:
        """A box.

        Raises:
            ValueError: the preset is not served.
        """
        refuse_unserved(preset, "thrusts are flown on paper, hard, partial and presets of their kind")
        bound, place = np.full(LATENT_SIZE, LATENT_BOUND, np.float32), np.ones(len(LOOK_ELEMENTS), np.float32)
        low = np.concatenate([self.layout.low, -bound, -place])
        return spaces.Box(low, np.concatenate([self.layout.high, bound, place]), dtype=np.float32)

    @property
    def action_size(self) -> int:
        """Numbers in an action."""
        return len(THRUST_ACTIONS)

    def begin(self, view: ScenarioView) -> None:
        """The look to come is the first."""
        self._held = 0

    def encode(self, observation: Observation) -> Array32:
        """The numbers at a look."""
        self._latent = self.encoder.encode(observation.safety_map)
        return self._encode_now(observation, observation)

    def _encode_now(self, now: Observation, look: Observation) -> Array32:
        assert self.scenario is not None
        age = self._held / self.scenario.preset.rules.control_periods
        place = LookPlace(self._latent, np.array([age]), look.target, np.array([look.width]))
        return encode_thrust_flights(self.layout, seen_flight(now), self.scenario.nominal_target, place)

    def step(self, action: Array32) -> tuple[Array32, float, bool, bool, dict[str, Any]]:
        """Fly one control period.

        Raises:
            ValueError: the action is not five finite numbers.
            gymnasium.error.ResetNeeded: no episode is under way.
        """
        look, flight = self._observation, self._flight
        if self.scenario is None or flight is None or look is None or self.outcome:
            raise gymnasium.error.ResetNeeded("the episode is over or has not begun: call reset()")
        step = self._fly(clip_actions(action, (5,)), flight, look)
        self.steps.append(step)
        terminated = step.outcome is not None and not step.truncated
        if self._held == 0:
            seen, info = self._look(step.flight)
        else:
            self._flight = step.flight
            state = displaced(step.flight.state, self.scenario.navigation_error)
            time = look.time + self._held * self.scenario.preset.rules.control_period
            flown = {"target": step.flight.target, "time_to_go": step.flight.time_to_go}
            self._now = now = replace(look, time=time, state=state, **flown)
            seen, info = self._encode_now(now, look), describe_episode(self.scenario, step.flight, self.steps)
        return seen, step.reward.total, terminated, step.truncated, info

    def _fly(self, values: Any, flight: Flight, look: Observation) -> Step:
        """Hold the thrust of an action for one control period."""
        scenario = self.scenario
        assert scenario is not None
        preset, rules, lander = scenario.preset, scenario.preset.rules, scenario.preset.lander
        site = flight.target
        if self._held == 0:
            site = site + site_shift(values, np.asarray(look.width), self.action_ranges.shift)
        gravity = np.array(preset.gravity)
        asked = np.tile(thrust_acceleration(values, gravity), (2, 1))
        reference = TrackingReference(rules.control_period, np.zeros((3, 3)), np.zeros((3, 3)), asked)
        error = scenario.streams.thrust_error(flight.index, rules.thrust_error)
        segment = fly_over(
            flight.state,
            Decision(site, PlanCommand(reference, (0.0, 0.0))),
            lander,
            Surroundings(gravity),
            ControlPeriods(rules.control_period, 1),
            FlightErrors(error, scenario.navigation_error),
        )
        landed = segment.status is not FlightStatus.FLYING
        self._held = 0 if landed else (self._held + 1) % rules.control_periods
        index = flight.index + (self._held == 0)
        after = Flight(index, segment.final_state, site, flight.time_to_go - rules.control_period)
        truncated = not landed and index >= rules.max_decisions
        outcome = judge_flight(scenario, after.state, site, segment.status) if landed or truncated else None
        spent = flight.state.mass - after.state.mass
        burnt = spent / (scenario.initial_state.mass - lander.dry_mass)
        aim = ground_point(scenario, site)
        slant = elevation_angle(flight.state.position, aim)
        return Step(after, segment, outcome, truncated, score_step(burnt, outcome), slant)
