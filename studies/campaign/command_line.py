"""The edge of every study's command: errors in one line, policies by name, a folder that can be written."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from guidance.console import one_line_errors
from hda.registry import policy_entry, policy_names


@contextmanager
def resumable(way: str = "--resume goes on") -> Iterator[None]:
    """As `one_line_errors`; a study that the user stops says how it goes on, and exits with code 130.

    Args:
        way: how, in words.
    """
    try:
        with one_line_errors():
            yield
    except KeyboardInterrupt:
        Console(stderr=True).print(f"stopped; finished work is kept, {way}", style="yellow")
        sys.exit(130)


def choose_policies(wanted: Sequence[str], preset: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names in the order of the registry, each once, and the paths among what was asked for.

    Args:
        wanted: names, paths `package.module:Name`, which are loaded and give a name, `default`,
            `rivals` or `all`.
        preset: setting that they fly on; `default` stands for those that belong there.

    Raises:
        ValueError: a name is unknown, a path leads to no policy, or none was given.
    """
    if not wanted:
        raise ValueError("policies must name at least one policy")
    groups = {
        "all": policy_names(),
        "rivals": tuple(name for name in policy_names() if policy_entry(name).rival),
        "default": tuple(name for name in policy_names() if policy_entry(name).belongs_on(preset)),
    }
    chosen = {name for entry in wanted for name in groups.get(entry) or (policy_entry(entry).name,)}
    paths = tuple(dict.fromkeys(entry for entry in wanted if ":" in entry))
    return tuple(name for name in policy_names() if name in chosen), paths


def open_folder(out: Path) -> Path:
    """Make the results folder and write a file in it, before any episode is flown.

    Raises:
        OSError: the folder cannot be made or written.
    """
    out.mkdir(parents=True, exist_ok=True)
    probe = out / ".writable"
    probe.write_text("")
    probe.unlink()
    return out
