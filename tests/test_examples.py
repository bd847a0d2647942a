"""What the examples print is so."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import torch

import guidance
from examples.ppo_single_file import Rollout, Settings, estimate_advantages, evaluate, train

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def test_the_planning_example_counts_solves_as_the_plan_does(capsys: pytest.CaptureFixture[str]) -> None:
    """A plan counts coarse and fine solves together, so no line may call them fine."""
    example = runpy.run_path(str(EXAMPLES / "solve_pdg.py"))
    example["main"]()
    lines = capsys.readouterr().out.splitlines()
    plan = guidance.solve_pdg(example["STATE"], example["TARGET"])
    assert lines[0].endswith(f"{plan.time_of_flight:.2f} s, {plan.solves} conic solves")
    assert not any("fine" in line for line in lines)


def flown(horizon: int, environments: int) -> Rollout:
    torch.manual_seed(1)
    parts = torch.randn(2, horizon, environments)
    ended = torch.rand(horizon, environments) < 0.2
    unused = torch.empty(0)
    return Rollout(unused, unused, unused, parts[0], parts[1], ended, torch.randn(environments))


@pytest.mark.parametrize("trace", [0.0, 0.6, 1.0])
def test_advantages_of_the_learner_are_weighted_sums_of_surprises(trace: float) -> None:
    """Against their definition: each later surprise of the same episode, discounted, and no other."""
    discount, rollout = 0.9, flown(12, 3)
    following = torch.cat([rollout.value[1:], rollout.next_value[None]])
    surprise = rollout.reward + discount * following * ~rollout.ended - rollout.value
    given = estimate_advantages(rollout, discount, trace)
    for k in range(12):
        for row in range(3):
            total, weight = 0.0, 1.0
            for later in range(k, 12):
                total += weight * float(surprise[later, row])
                weight *= discount * trace
                if rollout.ended[later, row]:
                    break
            assert float(given[k, row]) == pytest.approx(total, abs=1e-5)


@pytest.mark.slow
def test_the_learner_in_one_file_learns(capsys: pytest.CaptureFixture[str]) -> None:
    """After 40 000 steps; a flight that never moves its target succeeds in 6 of 100 episodes."""
    agent, rows = train(Settings(steps=40_960))
    gains = [gained for _, gained, _ in rows]
    assert rows[-1][0] == 40_960
    assert gains[-1] > gains[0] + 0.4
    gained, landed = evaluate(agent, 200)
    assert landed > 0.4
    assert gained > np.mean(gains[:3])
    assert "steps/s" in capsys.readouterr().out
