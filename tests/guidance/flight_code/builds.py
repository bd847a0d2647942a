"""The flight code, compiled and called: a missing compiler is a failure that says what to install."""

import ctypes
import math
import re
import shutil
import subprocess
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from guidance.bulk.certified_flight import Finding
from guidance.flight_code.reference import CodeAnswer, CodeStatus, Question, Refusal

SOURCE = files("guidance.flight_code") / "powered_descent.c"
HEADER = files("guidance.flight_code") / "powered_descent.h"
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off"]
STATUSES: dict[int, CodeStatus] = {int(status): status for kind in (Finding, Refusal) for status in kind}


class Vehicle(ctypes.Structure):
    _fields_ = [
        ("max_thrust", ctypes.c_double),
        ("min_thrust", ctypes.c_double),
        ("dry_mass", ctypes.c_double),
        ("exhaust_velocity", ctypes.c_double),
        ("gravity", ctypes.c_double * 3),
        ("pointing_limit", ctypes.c_double),
        ("speed_limit", ctypes.c_double),
        ("glide_slope_limit", ctypes.c_double),
    ]


class Flight(ctypes.Structure):
    _fields_ = [
        ("status", ctypes.c_int),
        ("propellant", ctypes.c_double),
        ("time_of_flight", ctypes.c_double),
        ("lower_bound", ctypes.c_double),
        ("max_thrust", ctypes.c_double),
        ("primer", ctypes.c_double * 6),
        ("primer_times", ctypes.c_double * 2),
        ("touch", ctypes.c_double * 2),
    ]


def compiler() -> str:
    """The C compiler of this machine."""
    for name in ("gcc", "cc"):
        if shutil.which(name):
            return name
    raise AssertionError("no C compiler: install one, with `apt-get install gcc` or `xcode-select --install`")


def compile_c(arguments: list[str], folder: Path) -> None:
    command = [compiler(), *STRICT, *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@dataclass(frozen=True)
class Build:
    """A loaded build of the flight code."""

    library: ctypes.CDLL

    @classmethod
    def at(cls, folder: Path, optimisation: str = "-O2") -> "Build":
        path = folder / f"powered_descent{optimisation}.so"
        compile_c([optimisation, "-shared", "-fPIC", str(SOURCE), "-o", str(path), "-lm"], folder)
        library = ctypes.CDLL(str(path))
        library.descent_words.restype = ctypes.c_char_p
        return cls(library)

    def solve(self, question: Question) -> Flight:
        flight, gravity = Flight(), (ctypes.c_double * 3)(*question.gravity)
        vehicle = Vehicle(*question[:4], gravity, *question[5:8])
        state, target = (ctypes.c_double * 7)(*question.state), (ctypes.c_double * 3)(*question.target)
        self.library.descent_solve(ctypes.byref(vehicle), state, target, ctypes.byref(flight))
        return flight

    def thrust(self, flight: Flight, time: float) -> tuple[CodeStatus, np.ndarray]:
        thrust = (ctypes.c_double * 3)()
        status = self.library.descent_thrust(ctypes.byref(flight), ctypes.c_double(time), thrust)
        return STATUSES[status], np.array(thrust)

    def answer(self, question: Question) -> CodeAnswer:
        flight = self.solve(question)
        told, thrust = self.thrust(flight, 0.0)
        if told is not Finding.OPTIMAL:
            thrust = np.full(3, math.nan)
        status = STATUSES[flight.status]
        told = flight.propellant, flight.time_of_flight, flight.lower_bound, thrust, flight.touch[0]
        return CodeAnswer(status, *told)

    def words(self, status: int) -> str:
        return self.library.descent_words(status).decode()


def enumerated() -> dict[str, int]:
    """Names and numbers of the header's statuses."""
    found = re.findall(r"^ +DESCENT_(\w+) = (\d+)", HEADER.read_text(), re.MULTILINE)
    return {name: int(number) for name, number in found}
