"""Print the least versions that pyproject.toml allows, as a constraints file for pip.

Of the libraries that the packages import, those of the extras too; not of the developers' tools.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
TOOLS = ("dev", "docs")


def minimum_versions(pyproject: str) -> list[str]:
    """`name==version` for each requirement.

    Raises:
        ValueError: a requirement has no lower bound.
    """
    project = tomllib.loads(pyproject)["project"]
    extras = project["optional-dependencies"]
    requirements = [*project["dependencies"]]
    requirements += [line for extra in extras if extra not in TOOLS for line in extras[extra]]
    pins = []
    for requirement in requirements:
        found = re.match(r"([\w.-]+)(?:\[[\w,-]+\])?\s*>=\s*([\w.]+)", requirement)
        if not found:
            raise ValueError(f"{requirement!r} has no lower bound")
        pins.append(f"{found[1]}=={found[2]}")
    return sorted(set(pins))


if __name__ == "__main__":
    sys.stdout.write(
        "\n".join(minimum_versions((ROOT / "pyproject.toml").read_text(encoding="utf-8"))) + "\n"
    )
