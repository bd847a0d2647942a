"""OpenSCvx (successive convexification, JAX) in a process of its own, which stays alive between cases.

It runs in an interpreter that has the package, as it brings JAX and compiles for each mesh and set of limits.
"""

from __future__ import annotations

import json
import re
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

PEERS_WING = Path(__file__).parent
"""What the rows of every study that asks a peer depend on (`identify_run`)."""
OPENSCVX_PACKAGE = "openscvx"
OPENSCVX_METHOD = "OpenSCvx"
FIRST_ORDER_HOLD = (
    "Version 0.5.2 blends its controls between nodes up to n/(n - 1) in place of 1 (its issue 584), so that "
    "what it integrates is not the thrust that it gives at the nodes."
)
"""Why its plans miss when they are flown."""
_PACKAGES = (OPENSCVX_PACKAGE, "jax", "jaxlib", "diffrax", "cvxpy", "qoco", "numpy")
_VERSIONS = f"""
import json, platform
from importlib import metadata
found = {{"python": platform.python_version()}}
for name in {_PACKAGES!r}:
    try:
        found[name] = metadata.version(name)
    except metadata.PackageNotFoundError:
        pass
print(json.dumps(found))
"""
_NUMBER = re.compile(r"\d+(\.\w+)+")
_PATIENCE = 60.0  # [s] for an interpreter to name its versions


def peer_versions(python: Path) -> dict[str, str]:
    """Package -> version of what decides the peer's answers in an interpreter, and that of Python itself.

    Returns:
        Nothing if it does not answer as an interpreter does, or later than after a minute.

    Raises:
        OSError: there is no such interpreter.
    """
    try:
        asked = subprocess.run(
            [str(python), "-c", _VERSIONS], capture_output=True, text=True, timeout=_PATIENCE
        )
        told = json.loads(asked.stdout)
        return {str(name): version for name, version in told.items() if _NUMBER.match(version)}
    except (subprocess.TimeoutExpired, ValueError, TypeError, AttributeError):
        return {}


def openscvx_version(python: Path) -> str | None:
    """Version of the package that an interpreter has; None if it has none.

    Raises:
        OSError: there is no such interpreter.
    """
    return peer_versions(python).get(OPENSCVX_PACKAGE)


def demand_openscvx(python: Path) -> dict[str, str]:
    """As `peer_versions`, of the interpreter which the user names.

    Raises:
        ValueError: it has no such package, or names no versions.
        OSError: there is no such interpreter.
    """
    found = peer_versions(python)
    if not found:
        raise ValueError(f"openscvx_python: {python} has no Python that names its packages within a minute")
    if OPENSCVX_PACKAGE not in found:
        raise ValueError(f"openscvx_python: {python} has no {OPENSCVX_PACKAGE}")
    return found


def serving_code(worker: Path) -> str:
    """Python that answers lines there, by the `name_programme` and `build_programme` of a worker's file."""
    folders = [str(Path(__file__).parent), str(worker.parent)]
    return (
        f"import sys; sys.path[:0] = {folders!r}; import openscvx_serving, {worker.stem} as worker; "
        "del sys.path[:2]; openscvx_serving.serve(worker.name_programme, worker.build_programme)"
    )


@dataclass(eq=False)
class WorkerProcess:
    """A process that answers lines, begun when the first is asked (`open_worker`).

    Attributes:
        python: its interpreter.
        code: what runs there.
        said: file of what it prints beside its answers.
    """

    python: Path
    code: str
    said: IO[str]
    _process: subprocess.Popen[str] | None = None

    def ask(self, line: str) -> str:
        """Send a line and wait for one; empty if the process ended, which is then begun anew."""
        answer = self._exchange(line)
        if not answer:
            self.close()
        return answer

    def last_words(self) -> str:
        """End of what the process printed beside its answers."""
        self.said.seek(0)
        return self.said.read().strip()[-300:]

    def _exchange(self, line: str) -> str:
        if self._process is None:
            self._process = subprocess.Popen(
                [str(self.python), "-c", self.code],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self.said,
                text=True,
            )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            return ""
        return self._process.stdout.readline()

    def close(self) -> None:
        """End the process, if there is one."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
        self._process = None


@contextmanager
def open_worker(python: Path, code: str) -> Iterator[WorkerProcess]:
    """A process that ends with the block.

    Args:
        python: interpreter that has what the code needs.
        code: Python that answers lines of stdin on stdout.
    """
    with tempfile.TemporaryFile("w+") as said:
        process = WorkerProcess(python, code, said)
        try:
            yield process
        finally:
            process.close()
