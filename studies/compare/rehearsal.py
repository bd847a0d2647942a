"""Code compiled before the flights: parts of the policies side by side in processes, then a flight of each.

Compiled code is kept on the disk (`guidance.kernel`), so that what one process compiled the others load. A
planner, the prices of sites and the vehicle share little of it and take about as long as each other.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Literal

import numpy as np
from rich.console import Console

from guidance.kernel import kernel_folder
from hda.flight.episode import inform_pilot
from hda.policies.composition import ComposedPolicy, PrivilegedComposition
from hda.policies.zem_zev import FixedGainZemZev
from hda.registry import policy_entry
from hda.task.scenario import sample_scenario, view_of_preset
from hda.worker_pool import map_in_processes
from studies.campaign.monte_carlo import Study, fly_chunk
from studies.compare.display import Phase, show_phase

COMPILING_SECONDS = 25.0
"""[s] about what compiling takes, once for a version of the code; for the display alone."""
LOADING_SECONDS = 5.0
"""[s] about what loading compiled code takes."""


@dataclass(frozen=True)
class PolicyPart:
    """Something whose code one process compiles while others do theirs.

    Attributes:
        policy: name of a policy that has it.
        kind: its guidance law or its site selection, which make themselves ready as an episode begins, or a
            whole flight.
    """

    policy: str
    kind: Literal["law", "site", "flight"]


def rehearse(study: Study, console: Console, workers: int = 1) -> float:
    """Fly the first episode twice with each policy in this process, so that all code is compiled.

    Slow policies are left out. Where nothing is compiled yet and there are several workers, they compile the
    parts of the policies before. Workers of the flights then load what was compiled here, each kernel once.

    Args:
        study: what is going to be flown.
        console: where it is shown.
        workers: processes.

    Returns:
        [s] about what an episode of all policies takes, compiled.

    Raises:
        PolicyError: a policy raised something.
    """
    ready, names = is_compiled(study), _rehearsed(study)
    at_once = min(workers, os.cpu_count() or 1)
    parts = [] if ready or at_once == 1 else list_parts(study)
    title = "loading compiled code" if ready else "compiling, once for this version of the code"
    expected = LOADING_SECONDS if ready else COMPILING_SECONDS
    seconds = 0.0
    phase = Phase(title, len(parts) + len(names), expected, steady=False)
    with show_phase(console, phase) as display:
        if parts:
            make_ready = partial(_make_ready, study)
            map_in_processes(make_ready, parts, at_once, _use_one_thread, partial(display.advance, 1))
        for name in names:
            alone = replace(study, policies=(name,))
            fly_chunk(alone, 0, 1)
            began = perf_counter()
            fly_chunk(alone, 0, 1)
            seconds += perf_counter() - began
            display.advance(1)
    with suppress(OSError):  # nowhere to write: nothing is kept there either
        kernel_folder().mkdir(parents=True, exist_ok=True)
        _flown_before().write_text("".join(f"{name}\n" for name in sorted({*_read_flown(), *names})))
    return seconds


def is_compiled(study: Study) -> bool:
    """Whether each policy has flown at these sources on this machine: what is left is to load its code."""
    return set(_rehearsed(study)) <= _read_flown()


def list_parts(study: Study) -> list[PolicyPart]:
    """What to compile side by side, each once, in the order in which it is begun.

    The law that plans takes longest and is first. Other laws share most of its code, and come last, so that
    they find it compiled. A flight of a policy that is no composition, or is flown by ZEM/ZEV, compiles the
    vehicle, and the ground unless there are tiles already; one such composition is enough.
    """
    laws: dict[str, PolicyPart] = {}
    sites: dict[str, PolicyPart] = {}
    flights: dict[str, PolicyPart] = {}
    for name in _rehearsed(study):
        policy = study.make_policy(name)
        if not isinstance(policy, ComposedPolicy | PrivilegedComposition):
            flights[name] = PolicyPart(name, "flight")
            continue
        law = policy.guidance_law
        if isinstance(law, FixedGainZemZev):
            flights.setdefault(repr(law), PolicyPart(name, "flight"))
        else:
            laws.setdefault(repr(law), PolicyPart(name, "law"))
        site = repr(policy.site_selection) if isinstance(policy, ComposedPolicy) else name
        sites.setdefault(site, PolicyPart(name, "site"))
    planned, flown = list(laws.values()), list(flights.values())
    return [*planned[:1], *flown[:1], *sites.values(), *flown[1:], *planned[1:]]


def _make_ready(study: Study, part: PolicyPart) -> None:
    """Compile a part in this process; what fails here fails again as its policy flies, and is told."""
    with suppress(Exception):
        if part.kind == "flight":
            fly_chunk(replace(study, policies=(part.policy,)), 0, 1)
            return
        policy = study.make_policy(part.policy)
        assert isinstance(policy, ComposedPolicy | PrivilegedComposition)
        if part.kind == "law":  # it needs no ground, which another process may be building
            policy.guidance_law.begin(view_of_preset(study.preset, np.zeros(3)))
            return
        scenario = sample_scenario(study.preset, study.study_seed, 0, study.split)
        pilot = inform_pilot(policy, scenario)
        assert isinstance(pilot, ComposedPolicy)
        pilot.site_selection.begin(scenario.view)


def _use_one_thread() -> None:
    import numba

    numba.set_num_threads(1)


def _rehearsed(study: Study) -> list[str]:
    """The policies that are flown here: those that are not slow."""
    return [name for name in study.policies if not policy_entry(name).slow]


def _flown_before() -> Path:
    """Names of the policies that a rehearsal flew, beside the code that it compiled."""
    return kernel_folder() / "rehearsed.txt"


def _read_flown() -> set[str]:
    try:
        return set(_flown_before().read_text().split())
    except (OSError, UnicodeError):
        return set()
