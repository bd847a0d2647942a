"""Measure the speed of the inner loops: a decision step, a tile, a safety map; after warm-up, in one run."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from guidance import solve_pdg
from guidance.console import tolerate_encoding
from guidance.descent.residuals import fly_residuals
from guidance.validation import finite_number
from hda.flight.episode import fly_legs
from hda.policy import PrivilegedPolicy
from hda.registry import make_policy
from hda.task.scenario import sample_scenario
from studies.campaign.command_line import one_line_errors
from studies.terrain_timing import measure_terrain


@dataclass(frozen=True)
class Bench:
    """Command line of the bench.

    Attributes:
        policy: whose decisions are timed; not a privileged one.
        preset: the setting.
        episodes: episodes that are flown for the decision step.
        repeats: repetitions of the terrain work.
    """

    policy: str = "single-divert"
    preset: str = "paper"
    episodes: int = 200
    repeats: int = 5


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


def bench(options: Bench) -> None:
    """Measure and print."""
    finite_number("episodes", options.episodes, at_least=1)
    table = Table(title=f"preset {options.preset}, {options.episodes} episodes; one core unless said")
    for column in ("work", "median", "99 %", "unit"):
        table.add_column(column, justify="left" if column == "work" else "right")
    for name, seconds in (measure_steps(options) | measure_plans(options)).items():
        middle, high = 1e6 * np.quantile(seconds, (0.5, 0.99))
        table.add_row(name, f"{middle:.0f}", f"{high:.0f}", "us")
    for wall in measure_terrain(options.repeats):
        table.add_row(wall.name, f"{wall.median:.3f}", f"{max(wall.seconds):.3f}", "s")
    Console().print(table)


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    options = tyro.cli(Bench, description=__doc__)
    with one_line_errors():
        bench(options)


if __name__ == "__main__":
    main()
