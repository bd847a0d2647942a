"""Policies by name: what tables, tests and scripts can ask for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hda.policy import Policy, PrivilegedPolicy
from hda.presets import unknown_name

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
    """

    name: str
    make: Callable[[], AnyPolicy]
    summary: str
    privileged: bool = False
    slow: bool = False


_entries: dict[str, PolicyEntry] = {}


def register_policy(entry: PolicyEntry) -> None:
    """Add a policy to the registry.

    Raises:
        ValueError: the name is taken, or the policy's own name or privilege differs from the entry's.
    """
    if entry.name in _registry():
        raise ValueError(f"policy {entry.name!r} is registered already")
    policy = entry.make()
    if policy.name != entry.name:
        raise ValueError(f"entry {entry.name!r} makes a policy that calls itself {policy.name!r}")
    if isinstance(policy, PrivilegedPolicy) != entry.privileged:
        raise ValueError(f"entry {entry.name!r} must say whether its policy is privileged")
    _entries[entry.name] = entry


def policy_names() -> tuple[str, ...]:
    """Names of all registered policies, in the order of tables."""
    return tuple(_registry())


def policy_entry(name: str) -> PolicyEntry:
    """Registry line of a name.

    Raises:
        ValueError: there is no such policy; the nearest valid names are given.
    """
    entries = _registry()
    if name not in entries:
        raise ValueError(unknown_name("policy", name, entries))
    return entries[name]


def make_policy(name: str) -> AnyPolicy:
    """Make the policy of a name, ready for `hda.fly`.

    Raises:
        ValueError: there is no such policy; the nearest valid names are given.
    """
    return policy_entry(name).make()


def _registry() -> dict[str, PolicyEntry]:
    if not _entries:
        from hda.policies.catalogue import ENTRIES

        _entries.update((entry.name, entry) for entry in ENTRIES)
    return _entries
