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
from collections.abc import Callable, Iterable
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
    "td3-convex",
    "ppo",
    "td3-partial",
    "td3-lstm-partial",
    "td3-lstm-plus-partial",
    "td3-belief-partial",
    "td3-lidar",
)
"""Names that `import rl` registers; this package may not import it, but may say so."""

_NAME = re.compile(r"[a-z0-9][a-z0-9+._-]{0,59}")


class PolicyRegistry:
    """Policies by name. One instance serves the process; another knows nothing of it.

    Attributes:
        plugin_group: entry-point group whose policies it offers too; None for none.
    """

    def __init__(self, first: Callable[[], Iterable[PolicyEntry]], plugin_group: str | None = None) -> None:
        """Make one.

        Args:
            first: gives the entries that it begins with; called when it is first asked, as policies take long
                to import.
            plugin_group: entry-point group whose policies it offers too; read when names are first asked for.
        """
        self.plugin_group = plugin_group
        self._first = first
        self._known: dict[str, PolicyEntry] | None = None
        self._name_of_path: dict[str, str] = {}
        self._plugins_read = False

    def register(self, entry: PolicyEntry) -> None:
        """Add a policy.

        Raises:
            ValueError: the name is taken, or the policy's own name or privilege differs from the entry's.
        """
        known = self._own()
        if entry.name in known:
            raise ValueError(f"policy {entry.name!r} is registered already")
        policy = entry.make()
        if policy.name != entry.name:
            raise ValueError(f"entry {entry.name!r} makes a policy that calls itself {policy.name!r}")
        if isinstance(policy, PrivilegedPolicy) != entry.privileged:
            raise ValueError(f"entry {entry.name!r} must say whether its policy is privileged")
        known[entry.name] = entry

    def names(self) -> tuple[str, ...]:
        """Names of all policies, in the order of tables."""
        return tuple(self._all())

    def entry(self, name: str) -> PolicyEntry:
        """Registry line of a name, or of a path `package.module:Name`, which is imported and registered.

        Raises:
            ValueError: there is no such policy, and the nearest valid names are given; or the path leads to
                nothing that is a policy.
        """
        if isinstance(name, str) and ":" in name:
            return self._entry_of_path(name)
        known = self._all()
        if name not in known:
            raise ValueError(unknown_name("policy", name, known) + _agents_hint(name))
        return known[name]

    def make(self, name: str) -> AnyPolicy:
        """Make the policy of a name or a path, ready for `hda.fly`.

        Raises:
            ValueError: there is no such policy; the nearest valid names are given.
        """
        return self.entry(name).make()

    def copy(self) -> PolicyRegistry:
        """One that knows the same, and keeps to itself what it learns later."""
        other = PolicyRegistry(self._first, self.plugin_group)
        other._known = None if self._known is None else dict(self._known)
        other._name_of_path = dict(self._name_of_path)
        other._plugins_read = self._plugins_read
        return other

    def _own(self) -> dict[str, PolicyEntry]:
        """Entries without those of plugins that have not been read."""
        if self._known is None:
            self._known = {entry.name: entry for entry in self._first()}
        return self._known

    def _all(self) -> dict[str, PolicyEntry]:
        """Entries of plugins too."""
        if self.plugin_group is not None and not self._plugins_read:
            self._plugins_read = True  # first, as a plugin may ask for names itself
            for point in metadata.entry_points(group=self.plugin_group):
                origin = f"entry point {point.name!r} of {point.dist.name if point.dist else 'a package'}"
                try:
                    self.register(describe_policy(point.load(), origin))
                except Exception as error:  # a third party's package must not take the others down
                    warnings.warn(f"{origin} is left out: {error}", RuntimeWarning, stacklevel=3)
        return self._own()

    def _entry_of_path(self, path: str) -> PolicyEntry:
        known = self._own()
        if self._name_of_path.get(path) in known:
            return known[self._name_of_path[path]]
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
        self.register(entry)
        self._name_of_path[path] = entry.name
        return entry


def _catalogue() -> Iterable[PolicyEntry]:
    from hda.policies.catalogue import ENTRIES

    return ENTRIES


REGISTRY = PolicyRegistry(_catalogue, ENTRY_POINT_GROUP)
"""That of the process; the functions below ask it."""


def register_policy(entry: PolicyEntry) -> None:
    """Add a policy to the registry.

    Raises:
        ValueError: the name is taken, or the policy's own name or privilege differs from the entry's.
    """
    REGISTRY.register(entry)


def policy_names() -> tuple[str, ...]:
    """Names of all registered policies, in the order of tables."""
    return REGISTRY.names()


def policy_entry(name: str) -> PolicyEntry:
    """Registry line of a name, or of a path `package.module:Name`, which is imported and registered.

    Raises:
        ValueError: there is no such policy, and the nearest valid names are given; or the path leads to
            nothing that is a policy.
    """
    return REGISTRY.entry(name)


def make_policy(name: str) -> AnyPolicy:
    """Make the policy of a name or a path, ready for `hda.fly`.

    Raises:
        ValueError: there is no such policy; the nearest valid names are given.
    """
    return REGISTRY.make(name)


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
