"""The loop beside OpenSCvx, in the interpreter that has it: cases come in as JSON lines, answers go out.

It needs nothing of these packages. A case whose programme is compiled already is answered by it.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Hashable
from typing import IO, Any, Protocol

Case = dict[str, Any]


class CompiledProgramme(Protocol):
    """What answers the cases of one name."""

    def solve(self, case: Case) -> dict[str, Any]:
        """Answer a case."""
        ...


NameProgramme = Callable[[Case], Hashable]
"""What of a case is compiled."""
BuildProgramme = Callable[[Case], CompiledProgramme]
"""Compile it."""


def answer_case(
    programmes: dict[Hashable, CompiledProgramme], case: Case, name: NameProgramme, build: BuildProgramme
) -> dict[str, Any]:
    """The answer to one case with its processor time [s]; an exception is told, not raised."""
    started = time.process_time()
    try:
        key = name(case)
        if key not in programmes:
            programmes[key] = build(case)
        answer = programmes[key].solve(case)
    except Exception as error:
        answer = {"error": f"{type(error).__name__}: {error}"}
    return {**answer, "processor": time.process_time() - started}


def serve(name: NameProgramme, build: BuildProgramme) -> None:
    """Answer the JSON lines of stdin on stdout until it is closed; what else is printed goes to stderr."""
    answers: IO[str] = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    programmes: dict[Hashable, CompiledProgramme] = {}
    for line in sys.stdin:
        answers.write(json.dumps(answer_case(programmes, json.loads(line), name, build)) + "\n")
        answers.flush()
