"""Experiments over policies. Everything may be imported here; nothing imports this."""

import rl  # noqa: F401 - puts the learning agents into the registry
