"""Descents that several test files fly: reference cases, dispersed starts, starts known to be feasible."""

import json
from pathlib import Path

import numpy as np

from guidance import PAPER_LANDER, Lander, Limits, State
from guidance.descent.problem import LandingProblem
from guidance.pdg.solve import METHODS, PlanningMethod

ROOT = Path(__file__).parents[2]
TARGET = np.array([0.0, 0.0, 50.0])
GRAVITY = np.array([0.0, 0.0, -1.62])
COMPLETE: tuple[PlanningMethod, ...] = tuple(method for method in METHODS if method != "indirect")
"""Methods that answer every problem; the indirect one leaves what has limits that bind to others."""
CASES = json.loads((ROOT / "studies" / "timing" / "cases" / "pdg_cases.json").read_text())["cases"]
FEASIBLE = [case for case in CASES if case["feasible"]]
IMPOSSIBLE = [case for case in CASES if not case["feasible"]]


def arguments(case):
    """Keyword arguments of `solve_pdg` for a reference case, state and target first."""
    return {
        "state": [*case["position"], *case["velocity"], case["mass"]],
        "target": case["target"],
        "lander": Lander(pointing_limit=case["pointing_limit"], **case["lander"]),
        "gravity": case["gravity"],
        "glide_slope_limit": case["glide_slope_limit"],
    }


def problem_of(case):
    given = arguments(case)
    return LandingProblem(
        State.parse(given["state"]),
        np.array(given["target"]),
        given["lander"],
        np.array(given["gravity"]),
        Limits(glide_slope=given["glide_slope_limit"]),
    )


def paper_start(rng):
    """Start of the paper's scenario, seen from a first target at the origin, plane at 50 m."""
    distance, bearing = rng.uniform(200.0, 250.0), rng.uniform(0.0, 2.0 * np.pi)
    heading, speed = bearing + np.pi + rng.uniform(-0.52, 0.52), rng.uniform(5.0, 10.0)
    return [
        distance * np.cos(bearing),
        distance * np.sin(bearing),
        rng.uniform(900.0, 1000.0),
        speed * np.cos(heading),
        speed * np.sin(heading),
        -rng.uniform(20.0, 35.0),
        1200.0,
    ]


def arrival_velocity(rng, start):
    """Velocity at the target: from rest to faster than free fall, any way but up."""
    fall = np.sqrt(start[5] ** 2 + 2.0 * 1.62 * (start[2] - TARGET[2]))
    return np.array([*rng.normal(0.0, 0.15, 2) * fall, -rng.uniform(0.0, 1.2) * fall])


def harsh_start(rng):
    """Low, fast, short of propellant: about half of these cannot land."""
    distance, bearing = rng.uniform(0.0, 300.0), rng.uniform(0.0, 2.0 * np.pi)
    return [
        distance * np.cos(bearing),
        distance * np.sin(bearing),
        50.0 + rng.uniform(0.5, 300.0),
        *rng.uniform(-30.0, 30.0, 2),
        rng.uniform(-60.0, 10.0),
        rng.uniform(1152.0, 1200.0),
    ]


def start_with_strong_engine(rng):
    """State, target and options of a descent whose engine, once lit, always pushes more than the weight."""
    gravity, dry_mass = rng.choice([1.62, 3.71]), rng.choice([300.0, 1150.0, 1505.0])
    mass = dry_mass * (1.0 + rng.uniform(0.05, 0.3))
    strongest = rng.uniform(2.5, 6.0)
    lander = Lander(
        float(dry_mass),
        mass * gravity * strongest,
        rng.uniform(220.0, 360.0),
        min_thrust=mass * gravity * max(1.2, 0.5 * strongest),
        pointing_limit=None if rng.random() < 0.5 else rng.uniform(0.8, 2.2),
    )
    time = rng.uniform(8.0, 30.0)
    height = rng.uniform(0.3, 1.2) * 0.5 * gravity * time**2
    start = [*rng.normal(0.0, 0.3, 2) * height, 50.0 + height, *rng.normal(0.0, 0.15, 2) * gravity * time]
    start += [-rng.uniform(0.0, 0.5) * gravity * time, mass]
    return {"state": start, "target": TARGET, "lander": lander, "gravity": (0.0, 0.0, -gravity)}


def feasible_start(rng):
    """A start that can land: random burns of at most 95 % thrust flown backward in time from touchdown."""
    while True:
        start = _fly_backward(rng)
        if start is not None:
            return start


def _fly_backward(rng):
    steps, duration = 400, rng.uniform(8.0, 40.0)
    dt = duration / steps
    burns = rng.integers(2, 6)
    changes = np.sort(rng.uniform(0.0, duration, burns - 1))
    mass = PAPER_LANDER.dry_mass + rng.uniform(1.0, 25.0)
    throttle = rng.uniform(0.05, 0.95, burns)
    throttle[0] = max(throttle[0], 1.3 * mass * 1.62 / PAPER_LANDER.max_thrust)
    tilt, azimuth = rng.uniform(0.0, 0.5, burns), rng.uniform(0.0, 2.0 * np.pi, burns)
    position, velocity = TARGET.copy(), np.zeros(3)
    for k in range(steps):
        burn = np.searchsorted(changes, (k + 0.5) * dt)
        thrust = throttle[burn] * PAPER_LANDER.max_thrust
        burnt = thrust / PAPER_LANDER.exhaust_velocity * dt
        if mass + burnt > 1200.0:
            thrust = burnt = 0.0
        across = np.sin(tilt[burn])
        push = np.array([across * np.cos(azimuth[burn]), across * np.sin(azimuth[burn]), np.cos(tilt[burn])])
        acceleration = thrust / (mass + 0.5 * burnt) * push + GRAVITY
        position = position - velocity * dt + 0.5 * acceleration * dt * dt
        velocity = velocity - acceleration * dt
        mass += burnt
        if position[2] < TARGET[2]:
            return None
    return [*position, *velocity, mass]
