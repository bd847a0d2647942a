"""Measure the speed of the inner loops: a decision step, a tile, a safety map; after warm-up, in one run.

What must not grow is printed as ratios too, with the limits that they keep: they mean the same on every
machine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
import tyro
from rich.console import Console

from guidance import solve_pdg, solve_pdg_many
from guidance.console import one_line_errors, tolerate_encoding
from guidance.descent.residuals import fly_residuals
from guidance.rigid_body import DEFAULT_BODY, RigidState, hold_thrust
from guidance.validation import finite_number
from hda.flight.episode import advance, begin_flight, fly_legs, observe
from hda.policy import PrivilegedPolicy
from hda.registry import make_policy
from hda.task.scenario import sample_scenario
from rl.training_libraries import TrainingLibrariesError, require_training_libraries
from studies.bench.environment_speed import COLUMNS as RATE_COLUMNS
from studies.bench.environment_speed import NATIVE, SINGLE, StepRate, measure_environments
from studies.bench.speed_ratios import COLUMNS as RATIO_COLUMNS
from studies.bench.speed_ratios import SpeedRatio, measure_ratios
from studies.bench.terrain_timing import measure_terrain
from studies.campaign.command_line import open_folder
from studies.campaign.provenance import describe_run, write_provenance
from studies.columns import Column, console_table, write_csv

_BULK, _BULK_CALLS = 2000, 20  # starts of a call, and calls

NATIVE_LIMITS = {"LunarHDA-v0": 0.65, "LunarHDA-Map-v0": 0.5}
"""Most that a step of a native vector of 64 environments may cost on one thread, in steps of a single one."""


@dataclass(frozen=True)
class Bench:
    """Command line of the bench.

    Attributes:
        policy: whose decisions are timed; not a privileged one.
        preset: the setting.
        episodes: episodes that are flown for the decision step.
        repeats: repetitions of the terrain work.
        out: folder for results.
    """

    policy: str = "single-divert"
    preset: str = "paper"
    episodes: int = 200
    repeats: int = 5
    out: Path = Path("results/bench")


@dataclass(frozen=True)
class Work:
    """How long one piece of work takes by the clock.

    Attributes:
        name: what was done.
        median: [s] the middle one.
        high: [s] 99 % quantile; of work on terrain, which is repeated seldom, the greatest.
    """

    name: str
    median: float
    high: float


COLUMNS: tuple[Column[Work], ...] = (
    Column("work", "work", lambda work: work.name, words=True),
    Column("median_ms", "median", lambda work: 1e3 * work.median, digits=3, unit="ms"),
    Column("high_ms", "99 %", lambda work: 1e3 * work.high, digits=3, unit="ms"),
)
"""The times: times.csv and the console read this list."""


def measure_steps(options: Bench) -> dict[str, np.ndarray]:
    """Wall time [s] of each look, decision and interval of flight over the episodes.

    Raises:
        ValueError: the policy is privileged, or a name is unknown.
    """
    policy = make_policy(options.policy)
    if isinstance(policy, PrivilegedPolicy):
        raise ValueError(f"policy must not be privileged, got {options.policy!r}")
    times: list[tuple[float, float, float]] = []
    warm_up = 5
    for episode in range(-warm_up, options.episodes):
        scenario = sample_scenario(options.preset, 0, episode % options.episodes, "tuning")
        memory = policy.begin(scenario.view, scenario.streams.policy())
        legs = list(fly_legs(scenario, policy.decide, memory))
        if episode >= 0:
            times += [(leg.look_time, leg.decision_time, leg.flight_time) for leg in legs]
    looks, decisions, flights = np.array(times).T
    return {
        "look": looks,
        f"decision ({options.policy})": decisions,
        "5 s of flight": flights,
        "decision step (look + 5 s of flight)": looks + flights,
    }


def measure_scans(episodes: int) -> dict[str, np.ndarray]:
    """Wall time [s] of each look of a ranging LIDAR: scan, elevation map, Algorithm 1 on board."""
    policy, times = make_policy("single-divert"), []
    assert not isinstance(policy, PrivilegedPolicy)
    for episode in range(-1, episodes):
        scenario = sample_scenario("lidar", 0, max(episode, 0), "tuning")
        memory = policy.begin(scenario.view, scenario.streams.policy())
        flight, ended = begin_flight(scenario), False
        while not ended:
            start = perf_counter()
            observation = observe(scenario, flight)
            taken = perf_counter() - start
            decision, memory = policy.decide(observation, memory)
            step = advance(scenario, flight, decision)
            flight, ended = step.flight, step.outcome is not None
            if episode >= 0:
                times.append(taken)
    return {"look of a ranging LIDAR (128 x 128 rays)": np.array(times)}


def measure_plans(options: Bench) -> dict[str, np.ndarray]:
    """Wall time [s] of a plan to the first target of each episode, and of the flight that checks it."""
    times: list[tuple[float, float]] = []
    for episode in range(-1, options.episodes):
        scenario = sample_scenario(options.preset, 0, max(episode, 0), "tuning")
        state, view = scenario.initial_state, scenario.view
        start = perf_counter()
        plan = solve_pdg(state, view.nominal_target, lander=view.lander, gravity=view.gravity)
        planned = perf_counter()
        fly_residuals(plan.trajectory, plan.problem)
        checked = perf_counter()
        if episode >= 0:
            times.append((planned - start, checked - planned))
    plans, checks = np.array(times).T
    return {"plan (solve_pdg)": plans, "of which the flight that checks it": checks}


def measure_bulk(options: Bench) -> dict[str, np.ndarray]:
    """Wall time [s] that a start takes among thousands, on all cores: those of the episodes, many times."""
    scenarios = [sample_scenario(options.preset, 0, episode, "tuning") for episode in range(options.episodes)]
    view, again = scenarios[0].view, math.ceil(_BULK / options.episodes)
    states = np.tile([scenario.initial_state.as_array() for scenario in scenarios], (again, 1))
    targets = np.tile([scenario.view.nominal_target for scenario in scenarios], (again, 1))
    times = []
    for _ in range(_BULK_CALLS + 1):
        start = perf_counter()
        solve_pdg_many(states, targets, lander=view.lander, gravity=view.gravity)
        times.append((perf_counter() - start) / len(states))
    return {"a start in bulk (solve_pdg_many, all cores)": np.array(times[1:])}


def measure_rigid_body(options: Bench) -> dict[str, np.ndarray]:
    """Wall time [s] of 5 s of a rigid body under its attitude loop, from the start of each episode."""
    times = []
    for episode in range(-1, options.episodes):
        scenario = sample_scenario(options.preset, 0, max(episode, 0), "tuning")
        state, wanted = RigidState.parse(scenario.initial_state), np.array([-1000.0, 500.0, 4500.0])
        start = perf_counter()
        hold_thrust(state, wanted, 5.0, DEFAULT_BODY)
        if episode >= 0:
            times.append(perf_counter() - start)
    return {"5 s of flight of a rigid body, attitude loop at 10 Hz": np.array(times)}


def compare_native(rates: Sequence[StepRate]) -> list[SpeedRatio]:
    """A step of each native vector environment over that of a single one, on one thread."""
    seconds = {(rate.environment, rate.way): rate.processor_seconds for rate in rates}
    return [
        SpeedRatio(
            f"a native step of {name}",
            "a step of it alone",
            seconds[name, NATIVE],
            seconds[name, SINGLE],
            limit,
        )
        for name, limit in NATIVE_LIMITS.items()
    ]


def bench(options: Bench) -> tuple[list[Work], list[SpeedRatio]]:
    """Measure, write times.csv, ratios.csv, steps.csv and provenance.json, and print the tables.

    Raises:
        ValueError: an option is out of range or names something unknown, or the policy is privileged.
        OSError: the folder cannot be written.
    """
    finite_number("episodes", options.episodes, at_least=1)
    out, console = open_folder(options.out), Console(width=max(Console().width, 120))
    measured = measure_steps(options) | measure_scans(options.episodes)
    measured |= measure_rigid_body(options) | measure_plans(options) | measure_bulk(options)
    works = [Work(name, *np.quantile(seconds, (0.5, 0.99))) for name, seconds in measured.items()]
    works += [Work(wall.name, wall.median, max(wall.seconds)) for wall in measure_terrain(options.repeats)]
    rates = measure_environments()
    ratios = measure_ratios(options.preset) + compare_native(rates)
    write_csv(out / "times.csv", COLUMNS, works)
    write_csv(out / "ratios.csv", RATIO_COLUMNS, ratios)
    write_csv(out / "steps.csv", RATE_COLUMNS, rates)
    write_provenance(out / "provenance.json", describe_run(options))
    title = f"preset {options.preset}, {options.episodes} episodes; one core unless said"
    console.print(console_table(COLUMNS, works, title))
    console.print(console_table(RATE_COLUMNS, rates, "environments on paper, steps under random actions"))
    console.print(console_table(RATIO_COLUMNS, ratios, "processor times as ratios, and the limits they keep"))
    (bulk,) = (work for work in works if "solve_pdg_many" in work.name)
    console.print(f"{bulk.name}: {1.0 / bulk.median:.0f} starts a second")
    try:
        require_training_libraries()
    except TrainingLibrariesError as error:
        console.print(f"an update of training is not measured: {error}", markup=False)
    console.print(f"results in {out}")
    return works, ratios


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    options = tyro.cli(Bench, description=__doc__)
    with one_line_errors():
        bench(options)
