"""The parts of a study's policies, whose code processes compile side by side before the flights.

Compiled code is kept on the disk (`guidance.kernel`), so that what one process compiled the others load. A
planner, the prices of sites and the vehicle share little of it and take about as long as each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from hda.flight.episode import inform_pilot
from hda.policies.composition import ComposedPolicy, PrivilegedComposition
from hda.policies.zem_zev import FixedGainZemZev
from hda.registry import policy_entry
from hda.task.scenario import sample_scenario, view_of_preset
from hda.worker_pool import map_in_processes
from studies.campaign.monte_carlo import Study, fly_chunk


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


def quick_policies(study: Study) -> list[str]:
    """The policies of a study that are not slow."""
    return [name for name in study.policies if not policy_entry(name).slow]


def list_parts(study: Study) -> list[PolicyPart]:
    """What to compile side by side, each once, in the order in which it is begun.

    The law that plans takes longest and is first. Other laws share most of its code, and come last, so that
    they find it compiled. A flight of a policy that is no composition, or is flown by ZEM/ZEV, compiles the
    vehicle, and the ground unless there are tiles already; one such composition is enough.
    """
    laws: dict[str, PolicyPart] = {}
    sites: dict[str, PolicyPart] = {}
    flights: dict[str, PolicyPart] = {}
    for name in quick_policies(study):
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


def compile_parts(
    study: Study, parts: Sequence[PolicyPart], workers: int, on_done: Callable[[], None]
) -> None:
    """Compile parts in several processes.

    Args:
        study: whose they are.
        parts: of `list_parts`.
        workers: processes.
        on_done: called after each part.
    """
    map_in_processes(partial(_make_ready, study), parts, workers, _use_one_thread, on_done)


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
