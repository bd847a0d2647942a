"""Descents of the kinds that users bring: each function draws one at random, as arguments of `solve_pdg`."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from guidance import Lander

Descent = dict[str, Any]
EARTH, MARS, MOON = 9.80665, 3.7114, 1.62


def _descent(state: list[float], lander: Lander, gravity: float, nodes: int = 61) -> Descent:
    return {
        "state": state,
        "target": (0.0, 0.0, 0.0),
        "lander": lander,
        "gravity": (0.0, 0.0, -gravity),
        "nodes": nodes,
    }


def earth_hopper(rng: np.random.Generator) -> Descent:
    """A test vehicle with little thrust to spare and a tight pointing limit."""
    dry_mass = rng.uniform(400.0, 2000.0)
    mass = dry_mass * rng.uniform(1.1, 1.5)
    most = mass * EARTH * rng.uniform(1.25, 2.2)
    limit = math.radians(rng.uniform(10.0, 30.0))
    lander = Lander(dry_mass, most, rng.uniform(170.0, 300.0), most * rng.uniform(0.15, 0.45), limit)
    height = rng.uniform(50.0, 800.0)
    start = [
        *rng.uniform(-0.4, 0.4, 2) * height,
        height,
        *rng.uniform(-20.0, 20.0, 2),
        rng.uniform(-40.0, 10.0),
    ]
    return _descent([*start, mass], lander, EARTH)


def mars_lander(rng: np.random.Generator) -> Descent:
    dry_mass = rng.uniform(500.0, 2000.0)
    mass = dry_mass * rng.uniform(1.1, 1.45)
    most = mass * MARS * rng.uniform(1.4, 3.5)
    limit = math.radians(rng.uniform(20.0, 90.0)) if rng.random() < 0.8 else None
    lander = Lander(dry_mass, most, rng.uniform(180.0, 300.0), most * rng.uniform(0.1, 0.45), limit)
    height = rng.uniform(500.0, 3500.0)
    start = [
        *rng.uniform(-0.5, 0.5, 2) * height,
        height,
        *rng.uniform(-60.0, 60.0, 2),
        rng.uniform(-100.0, 0.0),
    ]
    return _descent([*start, mass], lander, MARS)


def booster(rng: np.random.Generator) -> Descent:
    dry_mass = rng.uniform(15e3, 30e3)
    mass = dry_mass * rng.uniform(1.1, 1.35)
    most = mass * EARTH * rng.uniform(1.5, 3.2)
    limit = math.radians(rng.uniform(8.0, 45.0))
    lander = Lander(dry_mass, most, rng.uniform(270.0, 320.0), most * rng.uniform(0.3, 0.6), limit)
    height = rng.uniform(800.0, 5000.0)
    start = [
        *rng.uniform(-0.15, 0.15, 2) * height,
        height,
        *rng.uniform(-30.0, 30.0, 2),
        -rng.uniform(60.0, 260.0),
    ]
    return _descent([*start, mass], lander, EARTH)


def long_lunar_descent(rng: np.random.Generator) -> Descent:
    """A braking burn of hundreds of kilometres that ends along the ground."""
    dry_mass = rng.uniform(4000.0, 8000.0)
    mass = dry_mass * rng.uniform(1.9, 2.3)
    most = mass * MOON * rng.uniform(1.7, 3.0)
    lander = Lander(dry_mass, most, rng.uniform(300.0, 330.0), 0.1 * most if rng.random() < 0.5 else 0.0)
    speed = rng.uniform(400.0, 1690.0)
    way = speed**2 / (2.0 * most / mass) * rng.uniform(1.25, 2.1)
    start = [-way, rng.uniform(-2e3, 2e3), rng.uniform(6e3, 18e3), speed, rng.uniform(-10.0, 10.0)]
    return _descent([*start, rng.uniform(-40.0, 5.0), mass], lander, MOON, int(rng.choice([31, 61])))


def vertical_descent(rng: np.random.Generator) -> Descent:
    """On the axis or next to it, mostly with a least thrust above the weight."""
    gravity, dry_mass = float(rng.choice([MOON, MARS, EARTH])), rng.uniform(300.0, 2000.0)
    mass = dry_mass * rng.uniform(1.03, 1.3)
    least = mass * gravity * rng.uniform(0.9, 2.2)
    most = max(least * rng.uniform(1.0, 5.0), mass * gravity * 1.6)
    limit = None if rng.random() < 0.5 else rng.uniform(0.3, 2.2)
    lander = Lander(dry_mass, most, rng.uniform(200.0, 340.0), least, limit)
    height, aside = rng.uniform(50.0, 1000.0), float(rng.choice([0.0, 0.0, 1e-9, 1e-6, 1e-3, 0.1]))
    sink = rng.uniform(0.0, 0.8) * math.sqrt(2.0 * (most / mass - gravity) * height)
    return _descent([aside, 0.0, height, 0.0, 0.0, -sink, mass], lander, gravity)


def engine_that_cannot_hover(rng: np.random.Generator) -> Descent:
    gravity, dry_mass = float(rng.choice([MOON, MARS])), float(rng.choice([300.0, 1150.0, 1505.0]))
    mass = dry_mass * rng.uniform(1.05, 1.3)
    strongest = rng.uniform(2.5, 6.0)
    least = mass * gravity * max(1.2, 0.5 * strongest)
    limit = None if rng.random() < 0.5 else rng.uniform(0.8, 2.2)
    lander = Lander(dry_mass, mass * gravity * strongest, rng.uniform(220.0, 360.0), least, limit)
    time = rng.uniform(8.0, 30.0)
    height = rng.uniform(0.3, 1.2) * 0.5 * gravity * time**2
    start = [*rng.normal(0.0, 0.3, 2) * height, height, *rng.normal(0.0, 0.15, 2) * gravity * time]
    return _descent([*start, -rng.uniform(0.0, 0.5) * gravity * time, mass], lander, gravity)


def engine_without_throttle(rng: np.random.Generator) -> Descent:
    drawn = (vertical_descent if rng.random() < 0.4 else engine_that_cannot_hover)(rng)
    lander, mass = drawn["lander"], drawn["state"][6]
    thrust = mass * -drawn["gravity"][2] * rng.uniform(1.3, 4.0)
    limit = None if rng.random() < 0.5 else rng.uniform(0.6, 2.2)
    return drawn | {"lander": Lander(lander.dry_mass, thrust, lander.specific_impulse, thrust, limit)}


KINDS: dict[str, Callable[[np.random.Generator], Descent]] = {
    kind.__name__: kind
    for kind in (
        earth_hopper,
        mars_lander,
        booster,
        long_lunar_descent,
        vertical_descent,
        engine_that_cannot_hover,
        engine_without_throttle,
    )
}
