"""Times that may grow unseen, each as a ratio to other work of the same run, with the limit that it keeps.

A ratio of two times means the same on every machine, where a time does not. Work and reference take turns, so
that what else the machine does meets both alike.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import TypeVar

import numpy as np

from guidance import solve_pdg, solve_pdg_many
from guidance.validation import finite_number
from hda.flight.episode import advance, begin_flight, observe
from hda.policy import PrivilegedPolicy
from hda.registry import make_policy
from hda.task.scenario import sample_scenario
from rl.inference.latent import load_encoder
from rl.training_libraries import TrainingLibrariesError, require_training_libraries
from studies.columns import Column

Result = TypeVar("Result")

_CALLS = 10  # of work that is too short for one
_STARTS = 40  # times the starts that are measured, in one call in bulk
_UPDATE_ROUNDS = 5  # at most: one takes seconds
_FLIGHTS = 5  # at most: a flight has five or six steps
_IMPORT = "import time; s = time.process_time(); import {module}; print(time.process_time() - s)"

FREE_TO_FIXED_LIMIT = 2.0
"""Most that a free-time solve of the convex method may cost, in fixed-time solves of the same nodes."""
EXACT_TO_MESH_LIMIT = 0.125
"""Most that `solve_pdg` may cost where the indirect method answers, in solves of the convex method."""
BULK_LIMIT = 0.5
"""Most that a start of `solve_pdg_many` may cost, in calls of `solve_pdg`."""
DECISION_LIMIT = 2.0
"""Most that a decision and the flight on it may cost on `navigated`, in those on `paper`, looks left out."""
FILTER_LIMIT = 12.0
"""Most that an interval of flight alone may cost on `navigated`, in those on `paper`: most is the filter."""
ENCODING_LIMIT = 7.0
"""Most that encoding a look may cost, in looks."""
UPDATE_LIMIT = 0.93
"""Most that an update of training may cost, in those of plain Stable-Baselines3; with bfloat16 it is less."""
IMPORT_LIMIT = 0.5
"""Most that `import guidance` may cost, in imports of numpy, which it leaves to those who need it."""


@dataclass(frozen=True)
class SpeedRatio:
    """One piece of work against another.

    Attributes:
        work: what was done.
        reference: what it is measured by.
        work_seconds: [s] median processor time of the work.
        reference_seconds: [s] of the reference.
        limit: greatest ratio that is allowed.
    """

    work: str
    reference: str
    work_seconds: float
    reference_seconds: float
    limit: float

    @property
    def ratio(self) -> float:
        """The work in units of the reference."""
        return self.work_seconds / self.reference_seconds

    @property
    def kept(self) -> bool:
        """Whether the ratio is at most the limit."""
        return self.ratio <= self.limit


COLUMNS: tuple[Column[SpeedRatio], ...] = (
    Column("work", "work", lambda r: r.work, words=True),
    Column("reference", "over", lambda r: r.reference, words=True),
    Column("work_ms", "work", lambda r: 1e3 * r.work_seconds, digits=3, unit="ms"),
    Column("reference_ms", "reference", lambda r: 1e3 * r.reference_seconds, digits=3, unit="ms"),
    Column("ratio", "ratio", lambda r: r.ratio, digits=2),
    Column("limit", "limit", lambda r: r.limit, form="{:g}".format),
    Column("kept", "kept", lambda r: r.kept, form=lambda kept: "yes" if kept else "NO"),
)
"""The ratios: the bench's file and console read this list."""


def measure_ratios(preset: str = "paper", repeats: int = 15) -> list[SpeedRatio]:
    """Measure every ratio; that of training where its libraries (the extra `train`) are installed.

    Args:
        preset: setting of the starts and looks, on the tuning tiles.
        repeats: starts and looks that are measured, after one that warms up.

    Raises:
        ValueError: `repeats` is less than one, or the preset is unknown.
    """
    finite_number("repeats", repeats, at_least=1)
    return [
        *_compare_solves(preset, repeats),
        _compare_bulk(preset, repeats),
        *_compare_steps(min(repeats, _FLIGHTS)),
        _compare_encoding(preset, repeats),
        *_compare_updates(min(repeats, _UPDATE_ROUNDS)),
        _compare_imports(repeats),
    ]


def _compare_solves(preset: str, repeats: int) -> tuple[SpeedRatio, SpeedRatio]:
    exact, free, fixed = [], [], []
    for episode in range(repeats + 1):
        scenario = sample_scenario(preset, 0, episode, "tuning")
        view = scenario.view
        solve = partial(
            solve_pdg, scenario.initial_state, view.nominal_target, lander=view.lander, gravity=view.gravity
        )
        exact.append(_time(solve)[1])
        convex = partial(solve, method="convex")
        plan, seconds = _time(convex)
        free.append(seconds)
        fixed.append(_time(partial(convex, time_of_flight=plan.time_of_flight))[1])
    return (
        SpeedRatio("solve_pdg", "its convex method", _median(exact), _median(free), EXACT_TO_MESH_LIMIT),
        SpeedRatio("free-time solve", "fixed-time solve", _median(free), _median(fixed), FREE_TO_FIXED_LIMIT),
    )


def _compare_bulk(preset: str, repeats: int) -> SpeedRatio:
    scenarios = [sample_scenario(preset, 0, episode, "tuning") for episode in range(repeats + 1)]
    view = scenarios[0].view
    options = {"lander": view.lander, "gravity": view.gravity}
    states = np.array([scenario.initial_state.as_array() for scenario in scenarios])
    targets = np.array([scenario.view.nominal_target for scenario in scenarios])
    many = np.tile(states, (_STARTS, 1)), np.tile(targets, (_STARTS, 1))
    bulk, single = [], []
    for state, target in zip(states, targets, strict=True):
        bulk.append(_time(partial(solve_pdg_many, *many, **options))[1] / len(many[0]))
        single.append(_time(partial(solve_pdg, state, target, **options))[1])
    return SpeedRatio("a start in bulk", "a single solve", _median(bulk), _median(single), BULK_LIMIT)


def _compare_steps(flights: int) -> tuple[SpeedRatio, SpeedRatio]:
    """Decisions of `hazard-aware` and the flight on them, by the filter's estimate and by the known state."""
    pairs = [
        tuple(_time_steps(preset, episode) for preset in ("navigated", "paper"))
        for episode in range(flights + 1)
    ]
    own, known = ([_median([pair[k][part] for pair in pairs]) for part in (0, 1)] for k in (0, 1))
    return (
        SpeedRatio(
            "a decision and 5 s of flight on navigated", "on paper", sum(own), sum(known), DECISION_LIMIT
        ),
        SpeedRatio("5 s of flight on navigated", "on paper", own[1], known[1], FILTER_LIMIT),
    )


def _time_steps(preset: str, episode: int) -> tuple[float, float]:
    """[s] least processor time of a decision and of an interval, means over a flight."""
    scenario, policy = sample_scenario(preset, 0, episode, "tuning"), make_policy("hazard-aware")
    assert not isinstance(policy, PrivilegedPolicy)
    memory, flight = policy.begin(scenario.view, scenario.streams.policy()), begin_flight(scenario)
    decisions, intervals, ended = [], [], False
    while not ended:
        decide = partial(policy.decide, observe(scenario, flight), memory)
        decision, memory = decide()
        fly_on = partial(advance, scenario, flight, decision)
        step = fly_on()
        decisions.append(min(_time(decide)[1] for _ in range(_CALLS)))
        intervals.append(_least(fly_on))
        flight, ended = step.flight, step.outcome is not None
    return float(np.mean(decisions)), float(np.mean(intervals))


def _compare_encoding(preset: str, repeats: int) -> SpeedRatio:
    encoder = load_encoder()
    encodings, looks = [], []
    for episode in range(repeats + 1):
        scenario = sample_scenario(preset, 0, episode, "tuning")
        look = partial(observe, scenario, begin_flight(scenario))
        looks.append(_least(look))
        encodings.append(_least(partial(encoder.encode, look().safety_map)))
    return SpeedRatio("encoding a look", "the look", _median(encodings), _median(looks), ENCODING_LIMIT)


def _compare_updates(rounds: int) -> tuple[SpeedRatio, ...]:
    """None where the libraries that training needs are not installed."""
    from rl.training_speed import TrainingSpeed, measure_training_speed

    try:
        require_training_libraries()
    except TrainingLibrariesError:
        return ()
    speeds = measure_training_speed(TrainingSpeed(rounds=rounds))
    # the processor decides which of ours is faster
    ours = max(speeds[name].processor for name in ("float32", "bfloat16"))
    theirs = speeds["stable-baselines3"].processor
    return (SpeedRatio("an update", "plain Stable-Baselines3's", 1.0 / ours, 1.0 / theirs, UPDATE_LIMIT),)


def _compare_imports(repeats: int) -> SpeedRatio:
    pairs = [(_import_seconds("guidance"), _import_seconds("numpy")) for _ in range(repeats + 1)]
    own, numpy = ([pair[k] for pair in pairs] for k in (0, 1))
    return SpeedRatio("import guidance", "import numpy", _median(own), _median(numpy), IMPORT_LIMIT)


def _time(work: Callable[[], Result]) -> tuple[Result, float]:
    """What the work gives, and its processor time [s]."""
    start = process_time()
    result = work()
    return result, process_time() - start


def _least(work: Callable[[], object]) -> float:
    """[s] least processor time of the work, which is too short for one call."""
    return min(_time(lambda: [work() for _ in range(_CALLS)])[1] for _ in range(_CALLS)) / _CALLS


def _median(seconds: Sequence[float]) -> float:
    """The middle one, without the first, which warms up."""
    return float(np.median(seconds[1:]))


def _import_seconds(module: str) -> float:
    """[s] processor time of an import in a process of its own."""
    told = subprocess.run(
        [sys.executable, "-c", _IMPORT.format(module=module)], capture_output=True, text=True, check=True
    )
    return float(told.stdout)
