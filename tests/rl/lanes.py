"""A single environment that flies what a row of a native vector flies."""

from __future__ import annotations

from typing import Any

import gymnasium


class Lane(gymnasium.Wrapper):
    """Flies the episodes `first`, `first + of`, and so on of a study."""

    def __init__(self, env: gymnasium.Env[Any, Any], first: int, of: int, study: int = 0) -> None:
        super().__init__(env)
        self.first, self.of, self.study, self.next = first, of, study, first

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        if seed is not None:  # Gymnasium's vector adds the number of the environment
            self.study, self.next = seed - self.first, self.first
        single: Any = self.unwrapped
        single.continue_study(self.study, self.next)
        self.next += self.of
        return self.env.reset(options=options)
