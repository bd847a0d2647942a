"""Many of `LunarHDA-Thrust-v0` in one batch."""

from __future__ import annotations

from typing import Any

import numpy as np

from guidance.arrays import Index
from rl.environment.native.landing_vector import Parts
from rl.environment.native.vector_env import NativeVectorEnv
from rl.environment.thrust.thrust_action import LookPlace, encode_thrust_flights
from rl.environment.thrust.thrust_batch import ThrustBatch
from rl.environment.thrust.thrust_env import LunarHDAThrustEnv
from rl.inference.arrays import Array32
from rl.inference.latent import LATENT_SIZE


class LunarHDAThrustVectorEnv(NativeVectorEnv[Array32]):
    """Observations of shape (n, 47); see `LandingVectorEnv` and `LunarHDAThrustEnv`.

    A look is taken where ten control periods have passed, or an episode begins or ends; else the latent of
    the last one stays.
    """

    BATCH = ThrustBatch
    KEPT = ("latents",)
    batch: ThrustBatch
    single: LunarHDAThrustEnv

    def __init__(self, num_envs: int = 1, **options: Any) -> None:
        """Make the environments; as of `LandingVectorEnv`."""
        super().__init__(num_envs, **options)
        self.latents = np.zeros((self.num_envs, LATENT_SIZE), np.float32)

    def make_single(self, **options: Any) -> LunarHDAThrustEnv:
        """One of them."""
        return LunarHDAThrustEnv(**options)

    def look(self, places: Index) -> Parts:
        """The 47 numbers of each."""
        batch, encoder = self.batch, self.single.encoder
        due = places[batch.held[places] == 0]

        def encode(k: int, safety_map: Array32) -> None:
            self.latents[due[k]] = encoder.encode(safety_map)

        batch.look(due, encode)
        age = batch.held[places, None] / batch.settings.preset.rules.control_periods
        last = LookPlace(self.latents[places], age, batch.middle[places], batch.width[places, None])
        nominal = batch.nominal_target[places]
        return {"vector": encode_thrust_flights(self.single.layout, batch.seen(places), nominal, last)}

    def present(self, parts: Parts) -> Array32:
        """The vectors."""
        return parts["vector"]
