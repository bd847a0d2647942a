"""The tables of the documentation, each with the command that makes it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Result:
    """One table, or several that one command makes.

    Attributes:
        page: which shows it, from docs/results.
        command: what makes it, behind `python -m`.
        resumable: the command has `--resume`.
    """

    page: str
    command: str
    resumable: bool = True


RESULTS: dict[str, Result] = {
    "comparison": Result("comparison.md", "studies.compare"),
    "hard": Result(
        "comparison.md",
        "studies.compare --preset hard --policies hazard-aware single-divert nearest-safe nearest-safe+convex"
        " oracle-fuel deferred-decision --out results/hard",
    ),
    "hard-memory": Result(
        "trade-off.md",
        "studies.compare --preset hard --policies td3-lstm td3-lstm-plus --no-figures"
        " --out results/hard_memory",
    ),
    "reliability": Result(
        "reliability.md",
        "studies.compare --split fresh --episodes 2995 --policies hazard-aware single-divert nearest-safe"
        " nearest-safe+convex oracle-fuel --no-figures --out results/fresh",
    ),
    "reliability-lidar": Result(
        "reliability.md",
        "studies.compare --preset lidar --split fresh --episodes 2995 --policies hazard-aware single-divert"
        " nearest-safe nearest-safe+convex oracle-fuel --no-figures --out results/fresh_lidar",
    ),
    "stability": Result("stability.md", "studies.stability"),
    "memory": Result("memory.md", "studies.memory", resumable=False),
    "partial": Result(
        "memory.md",
        "studies.compare --preset partial --policies single-divert nearest-safe oracle hazard-aware"
        " hazard-aware+zem-zev td3 td3-partial td3-lstm-partial td3-lstm-plus-partial td3-belief-partial",
    ),
    "robustness-partial": Result(
        "memory.md",
        "studies.robustness --preset partial --factors map-noise map-dropout position-error velocity-error"
        " --levels 4 --policies nearest-safe td3-partial td3-lstm-partial td3-lstm-plus-partial"
        " --out results/robustness_partial",
    ),
    "agents-paper": Result(
        "learnt-agents.md",
        "studies.compare --policies nearest-safe nearest-safe+convex hazard-aware --no-figures"
        " --out results/agents_paper",
    ),
    "agents-partial": Result(
        "learnt-agents.md",
        "studies.compare --preset partial --policies nearest-safe nearest-safe+convex hazard-aware td3"
        " --no-figures --out results/agents_partial",
    ),
    "agents-lidar": Result(
        "learnt-agents.md",
        "studies.compare --preset lidar --policies nearest-safe nearest-safe+convex hazard-aware td3"
        " --no-figures --out results/agents_lidar",
    ),
    "learnt-agents": Result(
        "learnt-agents.md",
        "rl.figures agents --results results/agents_paper results/agents_partial results/agents_lidar",
        resumable=False,
    ),
    "shortfall": Result("agents.md", "studies.shortfall --policies td3-convex nearest-safe+convex"),
    "planner": Result("planner.md", "studies.timing"),
    "answers": Result(
        "planner.md", "studies.timing --answers 100000 --starts 2 --out results/timing_answers"
    ),
    "closed-loop": Result("closed-loop.md", "studies.closed_loop --episodes 300"),
    "looks": Result("looks.md", "studies.looks"),
    "trade-off": Result("trade-off.md", "studies.trade_off --sweep-episodes 200"),
    "rivals": Result(
        "rivals.md",
        "studies.trade_off --presets paper hard partial lidar navigated rigid-body --policies rivals"
        " hazard-aware --weights none --ratio success --reference hazard-aware --no-bounds"
        " --out results/rivals",
    ),
    "robustness": Result(
        "robustness.md", "studies.robustness --levels 1 --episodes 1000 --policies nearest-safe hazard-aware"
    ),
    "robustness-thrust-error": Result(
        "robustness.md",
        "studies.robustness --levels 4 --factors thrust-error --policies nearest-safe nearest-safe+convex"
        " hazard-aware --out results/robustness_thrust_error",
    ),
    "robustness-lidar": Result(
        "robustness.md",
        "studies.robustness --preset lidar --factors rays range-noise range-bias ray-dropout pointing-error"
        " scan-time --levels 2 --policies nearest-safe nearest-safe+convex hazard-aware"
        " --out results/robustness_lidar",
    ),
    "robustness-navigated": Result(
        "robustness.md",
        "studies.robustness --preset navigated --factors navigation --levels 2 --policies single-divert"
        " nearest-safe nearest-safe+convex hazard-aware deferred-decision --out results/robustness_navigated",
    ),
    "navigated": Result(
        "robustness.md",
        "studies.compare --preset navigated --policies hazard-aware single-divert nearest-safe"
        " nearest-safe+convex td3 alhat+convex",
    ),
    "faults-navigated": Result(
        "robustness.md",
        "studies.faults --episodes 300 --explained 6 --policies hazard-aware nearest-safe+convex nearest-safe"
        " single-divert td3 --out results/faults_navigated",
    ),
    "faults": Result("robustness.md", "studies.faults --episodes 100 --explained 4"),
    "measured": Result(
        "realism.md",
        "studies.realism --presets paper lidar lidar-coarse --episodes 500 --explained 8"
        " --out results/measured",
    ),
    "realism": Result("realism.md", "studies.realism --explained 6"),
    "rare-events": Result("rare-events.md", "studies.rare_events --effort 0.08 --whole 6000"),
    "rare-events-single-divert": Result(
        "rare-events.md",
        "studies.rare_events --policy single-divert --effort 0.08 --whole 6000 --out results/rare_divert",
    ),
    "rare-events-hazard-aware": Result(
        "rare-events.md",
        "studies.rare_events --policy hazard-aware --whole 600 --out results/rare_hazard_aware",
    ),
    "rare-causes": Result("rare-events.md", "studies.rare_events --effort 0.5 --out results/rare_causes"),
    "information-bound": Result("information-bound.md", "studies.information_bound"),
    "information-bound-hard": Result(
        "information-bound.md",
        "studies.information_bound --preset hard --out results/information_bound_hard",
    ),
    "rigid-body": Result(
        "../explanation/rigid-body.md",
        "studies.compare --preset rigid-body --policies hazard-aware nearest-safe+convex nearest-safe",
    ),
    "faults-rigid-body": Result(
        "../explanation/rigid-body.md",
        "studies.faults --preset rigid-body --split tuning --episodes 100 --policies single-divert"
        " nearest-safe+convex hazard-aware --faults weak-torque body-fixed-sensor throttle-floor"
        " --explained 30 --out results/faults_rigid_body",
    ),
    "rigid-plans": Result("../explanation/rigid-body-plans.md", "studies.rigid_plans --starts 1000"),
    "calibration": Result("../explanation/calibration.md", "studies.calibrate"),
    "scale": Result("scale.md", "studies.scale --episodes 1000 10000"),
}
"""Name -> what is made, the README's first."""
