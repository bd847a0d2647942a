"""Gymnasium environments: one step is one decision, flown by the same functions as `hda.fly`."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import Any, Generic, TypeVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hda.flight.episode import Flight, Step, advance, begin_flight, observe
from hda.flight.outcome import Outcome
from hda.task.observation import Observation, ScenarioView
from hda.task.presets import Preset, find_preset
from hda.task.scenario import Scenario
from rl.environment.action import PAPER_ACTIONS, ActionRanges
from rl.environment.dispersions import DISPERSION_NAMES, Dispersions, refuse_unknown_options
from rl.environment.encoding import CURVED, LAYOUTS, Layout
from rl.environment.episode_info import describe_episode
from rl.environment.episode_source import EpisodeSource
from rl.environment.sight import Sight, make_sight
from rl.environment.steering import GainSteering, Steering, make_steering
from rl.inference.arrays import Array32
from rl.inference.artefacts import ENCODER
from rl.inference.latent import encoder_path, load_encoder

ObsType = TypeVar("ObsType")


class LandingEnv(gymnasium.Env[ObsType, Array32], Generic[ObsType]):
    """What the environments share; a subclass says where its actions and steps are others.

    **Action**, Box(-1, 1, (5,), float32), linear between the ends:

    | index | meaning | -1 | +1 |
    |---|---|---|---|
    | 0 | K_R, gain on the zero-effort miss | 5 | 7 |
    | 1 | K_V, gain on the zero-effort velocity | 1 | 3 |
    | 2 | fall of the time to go over the 5 s to the next look, s | 4.25 | 5.75 |
    | 3 | alpha_x: the target moves east by alpha_x times the look's width | -0.25 | 0.25 |
    | 4 | alpha_y: the target moves north by alpha_y times the look's width | -0.25 | 0.25 |

    **Reward**: `hda.flight.outcome.score_step`; the paper's terms with the signs it means.

    **Episode**: `terminated` at touchdown (or crash, or empty tank), `truncated` after `max_decisions` in
    flight. `reset(seed=s)` flies episode 0 of the study s, each later `reset()` the next one: the same
    episodes as `hda.sample_scenario(preset, s, episode, split)`. Without any seed the study is drawn at
    random.

    **Options** of `reset`: `scenario`, an `hda.Scenario` to fly instead; and every field of `Dispersions`
    by name (`{"thrust_error": 0.0}`), for this episode only.

    **Info** has these keys with these types at reset, at every step and at the end:

    | key | type | meaning |
    |---|---|---|
    | `study_seed` | int | of the episode; -1 where it has more than 63 bits |
    | `episode_number`, `tile` | int | within the study; of the split |
    | `reward_terms` | dict of float | the step's, by name, each weighted and signed; 0 at reset |
    | `target_distance` | float | m from the present target; at the end the miss distance |
    | `speed` | float | m/s; at the end the touchdown speed |
    | `propellant_fraction` | float | propellant burnt so far over that at the start |
    | `pointing_limited` | int | control periods so far in which the lander's pointing limit acted |
    | `ending` | int | 0 in flight, then `rl.environment.episode_info.ENDING_CODES`; 1 is a success |
    | `is_success`, `safe_site` | bool | false in flight |

    The objects behind them are `env.unwrapped.outcome` (None in flight), `.steps` and `.scenario`.

    **Many at a time**: `gymnasium.make_vec` (`rl.environment.native.landing_vector.LandingVectorEnv`).
    `gymnasium.make` truncates after 20 decisions, as the rules of every preset do; for rules that allow more
    pass it `max_episode_steps`.

    **Worker processes** that have not imported `rl` know the environments as `"rl:LunarHDA-v0"` and
    `"rl:LunarHDA-Map-v0"`: Gymnasium imports what stands before the colon.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012 - Gymnasium declares it so

    def __init__(
        self,
        preset: str | Preset = "paper",
        split: str = "train",
        dispersions: Dispersions | None = None,
        action_ranges: ActionRanges = PAPER_ACTIONS,
        render_mode: str | None = None,
        layout: str = CURVED.name,
    ) -> None:
        """Make the environment; terrain is loaded at the first reset.

        Args:
            preset: setting to fly.
            split: tile split.
            dispersions: factors on the preset's own; None: as in the preset.
            action_ranges: what -1 and 1 mean.
            render_mode: None or "rgb_array".
            layout: which elements describe the flight, a name in `rl.environment.encoding.LAYOUTS`.

        Raises:
            ValueError: unknown preset, layout or render mode, or a split that the preset's terrain does not
                have.
            ArtefactError: the shipped encoder is needed, and its weights are missing or damaged.
        """
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be None or 'rgb_array', got {render_mode!r}")
        setting = find_preset(preset)
        self.source = EpisodeSource(setting, split, dispersions or Dispersions())
        if layout not in LAYOUTS:
            raise ValueError(f"layout must be one of {', '.join(LAYOUTS)}, got {layout!r}")
        self.layout: Layout = LAYOUTS[layout]
        self.action_ranges = action_ranges
        self.render_mode = render_mode
        self.action_space = spaces.Box(-1.0, 1.0, (self.action_size,), np.float32)
        self.observation_space = self.make_observation_space(setting)
        self.study_seed: int | None = None
        self.next_episode = 0
        self.scenario: Scenario | None = None
        self.steps: list[Step] = []
        self._flight: Flight | None = None
        self._observation: Observation | None = None  # at the last look
        self._now: Observation | None = None
        self._steered: Any = None

    @cached_property
    def steering(self) -> Steering:
        """What an action becomes: ZEM/ZEV with the agent's gains."""
        return GainSteering(self.action_ranges)

    @property
    def action_size(self) -> int:
        """Numbers in an action."""
        return self.steering.size

    @abstractmethod
    def make_observation_space(self, preset: Preset) -> spaces.Space[ObsType]:
        """The space of what `encode` gives on a preset."""

    @abstractmethod
    def encode(self, observation: Observation) -> ObsType:
        """Turn an observation into a new element of the observation space; once for each look."""

    def begin(self, view: ScenarioView) -> None:
        """Remember nothing of the episodes before."""
        self._steered = self.steering.begin(view)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[ObsType, dict[str, Any]]:
        """Begin an episode; where that fails, study and flight stay as they were.

        Raises:
            ValueError: an unknown option.
        """
        chosen = dict(options or {})
        refuse_unknown_options(chosen, ("scenario", *DISPERSION_NAMES))
        study, episode = (self.study_seed, self.next_episode) if seed is None else (seed, 0)
        if study is None:
            study, episode = int(self.np_random.integers(2**31)), 0
        scenario = chosen.pop("scenario", None)
        if scenario is None:
            self.source.prepare()
            scenario = self.source.scenario(study, episode, chosen)
            episode += 1
        elif not isinstance(scenario, Scenario):
            raise ValueError(f"options['scenario'] must be an hda.Scenario, got {type(scenario).__name__}")
        elif chosen:
            raise ValueError(f"a given scenario keeps its dispersions; got also {', '.join(sorted(chosen))}")
        super().reset(seed=seed)
        self.study_seed, self.next_episode = study, episode
        self.scenario, self.steps = scenario, []
        self.begin(scenario.view)
        return self._look(begin_flight(scenario))

    def step(self, action: Array32) -> tuple[ObsType, float, bool, bool, dict[str, Any]]:
        """Fly one decision.

        Raises:
            ValueError: the action is not as many finite numbers as the action space has.
            gymnasium.error.ResetNeeded: no episode is under way.
        """
        scenario, flight, look = self.scenario, self._flight, self._observation
        if scenario is None or flight is None or look is None or self.outcome:
            raise gymnasium.error.ResetNeeded("the episode is over or has not begun: call reset()")
        decision, self._steered = self.steering.decide(action, look, self._steered)
        step = advance(scenario, flight, decision)
        self.steps.append(step)
        terminated = step.outcome is not None and not step.truncated
        seen, info = self._look(step.flight)
        return seen, step.reward.total, terminated, step.truncated, info

    @property
    def outcome(self) -> Outcome | None:
        """How the episode ended; None while it goes on."""
        return self.steps[-1].outcome if self.steps else None

    def continue_study(self, study_seed: int, next_episode: int) -> None:
        """Let the next `reset()` without a seed fly this episode of this study."""
        self.study_seed, self.next_episode = study_seed, next_episode

    def render(self) -> NDArray[np.uint8] | None:
        """Picture of the ground, the path and the field of view, shape (rows, columns, 3); or None.

        Raises:
            gymnasium.error.ResetNeeded: no episode has begun.
        """
        if self.render_mode is None:
            return None
        if self.scenario is None or self._observation is None or self._now is None:
            raise gymnasium.error.ResetNeeded("nothing to render: call reset()")
        from rl.environment.rendering import render_flight

        return render_flight(self.scenario, self.steps, self._observation, self._now)

    def _look(self, flight: Flight) -> tuple[ObsType, dict[str, Any]]:
        """Take the look of this instant: the encoded observation, and the episode's numbers."""
        assert self.scenario is not None
        self._flight = flight
        self._observation = self._now = observe(self.scenario, flight)
        seen = self.encode(self._observation)
        return seen, describe_episode(self.scenario, flight, self.steps)


class LunarHDAEnv(LandingEnv[Array32]):
    """`LunarHDA-v0`: the 44 numbers that the agents see; float32, clipped to finite bounds.

    x = (value - center) / scale; where "curved", asinh(x) / 2: fine near the ground and coarse above.

    | index | meaning | center | scale | |
    |---|---|---|---|---|
    | 0, 1 | position east, north of the current target, m | 0 | 5 | curved |
    | 2 | height above the target, m | 0 | 5 | curved |
    | 3, 4, 5 | velocity east, north, up, m/s | 0 | 2 | curved |
    | 6 | mass, kg | 1175 | 25 | |
    | 7 | width of the look, m | 0 | 2 | curved |
    | 8 | time to go, s | 0 | 1 | curved |
    | 9, 10 | current target east, north of the first one, m | 0 | 100 | |
    | 11 | current target above the first one, m: always 0 | 0 | 100 | |
    | 12-43 | latent of the safety map, about normal over random rollouts | 0 | 1 | |

    Bounds are -8 to 8, for height and width -1 to 8. `layout="relative"` has the same elements without
    curves, on the scales in `rl.environment.encoding`; `layout="printed"` has elements 0-11 as the paper
    prints them: position, velocity, mass, width twice, target. Rewards, actions and options: `LandingEnv`.
    """

    def __init__(
        self,
        *arguments: Any,
        encoder: str = ENCODER,
        sight: str = "look",
        guidance: str = "zem-zev",
        **options: Any,
    ) -> None:
        """Make the environment.

        Args:
            arguments: as of `LandingEnv`.
            encoder: shipped encoder of the looks, by name.
            sight: "look", or "belief": what all looks so far have left, in 92 numbers
                (`rl.environment.sight.BeliefSight`), which is `LunarHDA-Belief-v0`.
            guidance: "zem-zev", or "convex": the action is the site alone, elements 3 and 4, and convex
                guidance flies to it (`rl.environment.steering.SiteSteering`), which is `LunarHDA-Site-v0`.
            options: as of `LandingEnv`.

        Raises:
            ValueError: there is no such encoder, sight or guidance; else as `LandingEnv`.
        """
        self.encoder = load_encoder(encoder_path(encoder))
        self._guidance, self._sight_name, self._seen = guidance, sight, None
        super().__init__(*arguments, **options)

    @cached_property
    def steering(self) -> Steering:
        """What an action becomes."""
        return make_steering(self._guidance, self.action_ranges)

    @cached_property
    def sight(self) -> Sight:
        """What is seen."""
        return make_sight(self._sight_name, self.layout, self.encoder)

    def begin(self, view: ScenarioView) -> None:
        """Remember nothing of the episodes before."""
        super().begin(view)
        self._seen = self.sight.begin(view)

    def make_observation_space(self, preset: Preset) -> spaces.Space[Array32]:
        """A box."""
        low, high = self.sight.bounds
        return spaces.Box(low, high, dtype=np.float32)

    def encode(self, observation: Observation) -> Array32:
        """The numbers."""
        vector, self._seen = self.sight.see(observation, self._seen)
        return vector
