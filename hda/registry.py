"""Policies by name: what tables, tests and scripts can ask for.

A name is one of this package's, one that was registered, one that an installed package offers through the
entry-point group `lunar_hda.policies`, or a path `package.module:Name` to a policy of one's own.
"""

from __future__ import annotations

import difflib
import importlib
import re
import sys
import warnings
from collections.abc import Callable
from importlib import metadata
from typing import Any

from guidance.validation import unknown_name
from hda.policies.entry import AnyPolicy, PolicyEntry
from hda.policy import Policy, PrivilegedPolicy

ENTRY_POINT_GROUP = "lunar_hda.policies"

AGENTS = (
    "td3",
    "td3-fixed-gain",
    "td3+convex",
    "sac",
    "td3-lstm",
    "td3-lstm-plus",
    "td3-paper",
    "td3-partial",
    "td3-lstm-partial",
    "td3-lstm-plus-partial",
)
"""Names that `import rl` registers; this package may not import it, but may say so."""

_NAME = re.compile(r"[a-z0-9][a-z0-9+._-]{0,59}")


_entries: dict[str, PolicyEntry] = {}
_paths: dict[str, str] = {}  # path -> name of the policy that it gave
_plugins_read: list[str] = []


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
    return tuple(_registry(plugins=True))


def policy_entry(name: str) -> PolicyEntry:
    """Registry line of a name, or of a path `package.module:Name`, which is imported and registered.

    Raises:
        ValueError: there is no such policy, and the nearest valid names are given; or the path leads to
            nothing that is a policy.
    """
    if isinstance(name, str) and ":" in name:
        return _entry_of_path(name)
    entries = _registry(plugins=True)
    if name not in entries:
        raise ValueError(unknown_name("policy", name, entries) + _agents_hint(name))
    return entries[name]


def make_policy(name: str) -> AnyPolicy:
    """Make the policy of a name or a path, ready for `hda.fly`.

    Raises:
        ValueError: there is no such policy; the nearest valid names are given.
    """
    return policy_entry(name).make()


def describe_policy(target: object, origin: str) -> PolicyEntry:
    """Make a registry line of a policy, or of a class or function without arguments that makes one.

    Args:
        target: what was found; a registry line passes through.
        origin: where, for messages.

    Raises:
        ValueError: it is none of these, or making it failed.
    """
    if isinstance(target, PolicyEntry):
        return target
    make: Callable[[], Any] = target if callable(target) else lambda: target
    try:
        policy = make()
    except Exception as error:
        raise ValueError(f"{origin} cannot be made: {type(error).__name__}: {error}") from error
    if not isinstance(policy, Policy | PrivilegedPolicy):
        lacking = [part for part in ("name", "begin", "decide") if not hasattr(policy, part)]
        raise ValueError(f"{origin} is no policy: {type(policy).__name__} has no {', '.join(lacking)}")
    name = policy.name
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ValueError(f"{origin}: its name must be lower case, digits and hyphens, got {name!r}")
    lines = (type(policy).__doc__ or "").strip().splitlines()
    summary = lines[0] if lines else f"from {origin}"
    return PolicyEntry(name, make, summary, privileged=isinstance(policy, PrivilegedPolicy))


def _agents_hint(name: object) -> str:
    """Say how the agents come into the registry, where a name means one and nobody has registered them."""
    if "rl.policies.catalogue" in sys.modules or not difflib.get_close_matches(
        str(name), AGENTS, n=1, cutoff=0.8
    ):
        return ""
    return "; `import rl` registers the agents"


def _entry_of_path(path: str) -> PolicyEntry:
    if _paths.get(path) in _registry():
        return _entries[_paths[path]]
    module_name, _, attribute = path.partition(":")
    try:
        module = importlib.import_module(module_name)
    except Exception as error:  # the module is a third party's: anything may happen
        raise ValueError(
            f"policy {path!r}: cannot import {module_name!r}: {type(error).__name__}: {error}"
        ) from error
    if not hasattr(module, attribute):
        public = [name for name in vars(module) if not name.startswith("_")]
        raise ValueError(unknown_name(f"policy {path!r}: name", attribute, public))
    entry = describe_policy(getattr(module, attribute), f"policy {path!r}")
    register_policy(entry)
    _paths[path] = entry.name
    return entry


def _registry(plugins: bool = False) -> dict[str, PolicyEntry]:
    if not _entries:
        from hda.policies.catalogue import ENTRIES

        _entries.update((entry.name, entry) for entry in ENTRIES)
    if plugins and not _plugins_read:
        _plugins_read.append(ENTRY_POINT_GROUP)  # first, as a plugin may ask for names itself
        for point in metadata.entry_points(group=ENTRY_POINT_GROUP):
            origin = f"entry point {point.name!r} of {point.dist.name if point.dist else 'a package'}"
            try:
                register_policy(describe_policy(point.load(), origin))
            except Exception as error:  # a third party's package must not take the others down
                warnings.warn(f"{origin} is left out: {error}", RuntimeWarning, stacklevel=2)
    return _entries
