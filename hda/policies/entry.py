"""One line of the registry: a policy's name, and how to make it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hda.policy import Policy, PrivilegedPolicy

AnyPolicy = Policy[Any] | PrivilegedPolicy


@dataclass(frozen=True)
class PolicyEntry:
    """One line of the registry.

    Attributes:
        name: name in tables; lower case, hyphens.
        make: gives a new policy of that name.
        summary: what it does, in one line.
        privileged: it sees the true map; every table marks it.
        slow: a decision takes more than about 50 ms; flown only when asked for.
        rival: rebuilt from the paper of another group; flown only by name, as `rivals` or with `all`.
        preset: setting that it was made for, flown on others only when asked for; None: made for all.
    """

    name: str
    make: Callable[[], AnyPolicy]
    summary: str
    privileged: bool = False
    slow: bool = False
    rival: bool = False
    preset: str | None = None

    def belongs_on(self, preset: str) -> bool:
        """Whether tables of a setting hold it without being asked."""
        return not (self.slow or self.rival) and self.preset in (None, preset)
