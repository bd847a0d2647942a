"""Native vector environments: many episodes at a time, flown together and to the bit as one by one."""

from __future__ import annotations

from typing import Any

import numpy as np

from guidance.arrays import Index
from hda.task.presets import find_preset
from rl.environment.encoding import clip_latent, encode_flights, map_into
from rl.environment.env import LunarHDAEnv
from rl.environment.map_env import LunarHDAMapEnv
from rl.environment.native.batch_settings import BatchSettings
from rl.environment.native.flight_batch import FlightBatch
from rl.environment.native.landing_vector import LandingVectorEnv, Parts, Seen
from rl.environment.native.vector_info import describe_batch
from rl.environment.sight import LookSight
from rl.environment.steering import GainSteering
from rl.inference.arrays import Array32
from rl.inference.latent import LATENT_SIZE


class NativeVectorEnv(LandingVectorEnv[Seen]):
    """What the native vector environments share: one batch, whose kernels fly and look.

    Flown are presets whose looks are the true map with noise and whose flights end on the target plane, such
    as `paper`, `hard` and `partial`.
    """

    BATCH: type[FlightBatch] = FlightBatch
    """What flies them."""

    def make_batch(self, num_envs: int, threads: int) -> FlightBatch:
        """What flies them.

        Raises:
            ValueError: a batch does not serve the preset, or a number is below one.
        """
        preset = find_preset(self.single.source.preset)
        return self.BATCH(BatchSettings(preset, num_envs, self.single.action_ranges, threads))

    def describe(self) -> dict[str, Any]:
        """Numbers of every episode as it stands, arrays of shape (n,)."""
        return describe_batch(self.batch)

    def _flights(self, places: Index) -> Array32:
        """All that is seen but the maps, shape (m, 12), after the look."""
        batch = self.batch
        return encode_flights(self.single.layout, batch.seen(places), batch.nominal_target[places])


class LunarHDAVectorEnv(NativeVectorEnv[Array32]):
    """Many of `LunarHDA-v0`: observations of shape (n, 44); see `LandingVectorEnv` and `LunarHDAEnv`."""

    def make_single(self, **options: Any) -> LunarHDAEnv:
        """One of them.

        Raises:
            ValueError: another sight or guidance, which a batch does not serve.
        """
        single = LunarHDAEnv(**options)
        if not isinstance(single.sight, LookSight) or not isinstance(single.steering, GainSteering):
            raise ValueError(
                "sight must be 'look' and guidance 'zem-zev' in a native vector:"
                " LunarHDA-Belief-v0 and LunarHDA-Site-v0 have vectors of their own"
            )
        return single

    def look(self, places: Index) -> Parts:
        """The 44 numbers of each."""
        assert isinstance(self.single, LunarHDAEnv)
        encoder, latents = self.single.encoder, np.empty((len(places), LATENT_SIZE), np.float32)

        def encode(k: int, safety_map: Array32) -> None:
            latents[k] = encoder.encode(safety_map)

        self.batch.look(places, encode)
        return {"vector": np.concatenate([self._flights(places), clip_latent(latents)], axis=1)}

    def present(self, parts: Parts) -> Array32:
        """The vectors."""
        return parts["vector"]


class LunarHDAMapVectorEnv(NativeVectorEnv[dict[str, Any]]):
    """Many of `LunarHDA-Map-v0`: `flight` (n, 12) and `map` (n, 1, 64, 64).

    See `LandingVectorEnv` and `LunarHDAMapEnv`.
    """

    def make_single(self, **options: Any) -> LunarHDAMapEnv:
        """One of them."""
        return LunarHDAMapEnv(**options)

    def look(self, places: Index) -> Parts:
        """The flight and the map of each."""
        pixels = self.batch.settings.preset.lidar.pixels
        maps = np.empty((len(places), 1, pixels, pixels), np.uint8)
        self.batch.look(places, lambda k, safety_map: map_into(safety_map, maps[k, 0]))
        return {"flight": self._flights(places), "map": maps}

    def present(self, parts: Parts) -> dict[str, Any]:
        """The dictionary."""
        return parts
