"""Updates a second of plain Stable-Baselines3 TD3 and of ours: same sizes, one thread, taken in turn.

The agents with memory are measured apart: they learn from sequences, and there is no other to compare with.
The processor is timed by its own time, which other programs disturb least, a GPU by the clock on the wall.

python -m rl.training_speed
python -m rl.training_speed --profile    # and what the update of td3-lstm spends its time on, and the bound
"""

from __future__ import annotations

import sys
import time as clock
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
import tyro

from guidance.console import one_line_errors, tolerate_encoding
from rl.training_libraries import require_training_libraries


@dataclass(frozen=True)
class TrainingSpeed:
    """Measure updates a second.

    Attributes:
        rounds: how often each is measured; the median counts.
        updates: in one measurement.
        batch_size: transitions per update.
        hidden: sizes of the hidden layers.
        sequences: per update of an agent with memory.
        length: transitions in each.
        memory: hidden size of its LSTMs.
        device: that torch learns on.
        profile: print what the update of td3-lstm spends its time on, and how many this core can make; of the
            processor alone.
    """

    rounds: int = 7
    updates: int = 60
    batch_size: int = 256
    hidden: tuple[int, ...] = (256, 256)
    sequences: int = 100
    length: int = 10
    memory: int = 128
    device: Literal["cpu", "cuda"] = "cpu"
    profile: bool = False

    @property
    def precisions(self) -> dict[str, str]:
        """Precisions of torch by what they mean: on a GPU cuDNN's LSTM multiplies in TF32 in any case."""
        fewer_bits = "bfloat16" if self.device == "cpu" else "TF32"
        return {"float32": "highest", fewer_bits: "medium"}

    def check(self) -> None:
        """Refuse what cannot be measured here.

        Raises:
            ValueError: a GPU is asked for its profile, or torch sees none.
        """
        from rl.learning.device import choose_device

        choose_device(self.device, with_memory=True)
        if self.profile and self.device != "cpu":
            raise ValueError(f"device must be cpu with --profile, got {self.device}")


@dataclass(frozen=True)
class UpdateRate:
    """Updates a second, medians over the rounds.

    Attributes:
        processor: by processor time. A thread that waits for a GPU spins, and its waiting counts.
        wall: by the clock on the wall.
    """

    processor: float
    wall: float

    def on(self, device: str) -> float:
        """What counts on a device: processor time on "cpu", the clock on the wall on "cuda"."""
        return self.processor if device == "cpu" else self.wall


def time_work(work: Callable[[], None], device: str) -> tuple[float, float]:
    """[s] processor time and wall time of some work, the GPU's own share included."""
    import torch

    if device == "cuda":
        torch.cuda.synchronize()
    started = clock.process_time(), clock.perf_counter()
    work()
    if device == "cuda":
        torch.cuda.synchronize()
    return clock.process_time() - started[0], clock.perf_counter() - started[1]


def _rates(times: dict[str, list[tuple[float, float]]], updates: int) -> dict[str, UpdateRate]:
    medians = {name: np.median(values, axis=0) / updates for name, values in times.items()}
    return {name: UpdateRate(*(1.0 / float(value) for value in spent)) for name, spent in medians.items()}


def _filled(kind: Any, options: TrainingSpeed, fused: bool) -> Any:
    from rl.environment.env import LunarHDAEnv

    extra = {"optimizer_kwargs": {"fused": True}} if fused else {}
    model = kind(
        "MlpPolicy",
        LunarHDAEnv(),
        seed=0,
        buffer_size=10_000,
        device=options.device,
        policy_kwargs={"net_arch": list(options.hidden), **extra},
    )
    model._setup_learn(1, None)
    rng = np.random.default_rng(0)
    replay = model.replay_buffer
    for name in ("observations", "next_observations", "actions"):
        array = getattr(replay, name)
        array[...] = rng.uniform(-1.0, 1.0, array.shape)
    replay.pos, replay.full = 0, True
    return model


def measure_training_speed(options: TrainingSpeed) -> dict[str, UpdateRate]:
    """Updates a second: plain SB3, ours in float32, ours with products of fewer bits."""
    import torch
    from stable_baselines3 import TD3

    from rl.learning.precision import matmul_precision
    from rl.learning.td3 import FastTD3

    torch.set_num_threads(1)
    plain, fast = _filled(TD3, options, fused=False), _filled(FastTD3, options, fused=True)
    cases = {
        "stable-baselines3": (plain, "highest"),
        **{kind: (fast, precision) for kind, precision in options.precisions.items()},
    }
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in cases}
    for _ in range(options.rounds):
        for name, (model, precision) in cases.items():
            with matmul_precision(precision):
                model.train(4, options.batch_size)
                work = partial(model.train, options.updates, options.batch_size)
                times[name].append(time_work(work, options.device))
    return _rates(times, options.updates)


def _filled_with_sequences(name: str, options: TrainingSpeed) -> Any:
    """An agent with memory whose replay memory holds random episodes of one length."""
    from dataclasses import replace

    from rl.environment.env import LunarHDAEnv
    from rl.learning.algorithms import make_agent_with_memory
    from rl.learning.recurrent.replay import Episode
    from rl.recipes import RECURRENT_RECIPES

    recipe = replace(RECURRENT_RECIPES[name], batch_size=options.sequences, memory=options.memory)
    agent = make_agent_with_memory(recipe, LunarHDAEnv(), 0, options.device)
    rng, length = np.random.default_rng(0), options.length
    for _ in range(2 * options.sequences):
        observations = rng.uniform(-1.0, 1.0, (length + 1, agent.sizes.observation))
        actions = rng.uniform(-1.0, 1.0, (length, agent.sizes.action))
        parts = (part.astype(np.float32) for part in (observations, actions, rng.uniform(-1.0, 1.0, length)))
        agent.replay_buffer.store(Episode(*parts, terminated=True))
    return agent


def measure_memory_speed(options: TrainingSpeed) -> dict[str, UpdateRate]:
    """Updates a second of td3-lstm and td3-lstm-plus, in float32 and with products of fewer bits."""
    import torch

    from rl.learning.precision import matmul_precision

    torch.set_num_threads(1)
    agents = {name: _filled_with_sequences(name, options) for name in ("td3-lstm", "td3-lstm-plus")}
    times: dict[str, list[tuple[float, float]]] = {}
    for _ in range(options.rounds):
        for name, agent in agents.items():
            for kind, precision in options.precisions.items():
                with matmul_precision(precision):
                    agent.train(2)
                    spent = time_work(partial(agent.train, options.updates), options.device)
                times.setdefault(f"{name} {kind}", []).append(spent)
    return _rates(times, options.updates)


def profile_memory(options: TrainingSpeed) -> str:
    """Table of what the update of td3-lstm spends its time on, operator by operator."""
    import torch
    from torch.profiler import ProfilerActivity, profile

    torch.set_num_threads(1)
    agent = _filled_with_sequences("td3-lstm", options)
    agent.train(4)
    with profile(activities=[ProfilerActivity.CPU]) as taken:
        agent.train(options.updates)
    return taken.key_averages().table(sort_by="self_cpu_time_total", row_limit=12, max_name_column_width=40)


def count_products(name: str, options: TrainingSpeed) -> float:
    """Floating-point operations of the matrix products of one update (every second one moves the actor)."""
    import torch
    from torch.utils.flop_counter import FlopCounterMode

    agent = _filled_with_sequences(name, options)
    agent.train(2)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="TF32 acceleration")  # of a flag that is left as it is
        # without oneDNN the LSTM consists of products that are counted
        with torch.backends.mkldnn.flags(enabled=False), FlopCounterMode(display=False) as counter:
            agent.train(2)
    return counter.get_total_flops() / 2


def measure_products(size: int = 1024, rounds: int = 20, precision: str = "highest") -> float:
    """Floating-point operations a second of one thread in the product of two square matrices.

    Args:
        size: of the matrices.
        rounds: products that are timed; the median counts.
        precision: of torch; "medium" multiplies in bfloat16 where the processor can.
    """
    import torch

    from rl.learning.precision import matmul_precision

    torch.set_num_threads(1)
    a, b = torch.ones(size, size), torch.ones(size, size)
    times = []
    with matmul_precision(precision):
        for _ in range(rounds):
            started = clock.process_time()
            torch.mm(a, b)
            times.append(clock.process_time() - started)
    return 2.0 * size**3 / float(np.median(times))


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    options = tyro.cli(TrainingSpeed, description=__doc__)
    with one_line_errors():
        require_training_libraries()
        options.check()
        _print_speeds(options)
        if options.profile:
            sys.stdout.write(profile_memory(options))
            products, rate = count_products("td3-lstm", options), measure_products()
            sys.stdout.write(
                f"an update of td3-lstm multiplies {products / 1e9:.2f} GFLOP, this core {rate / 1e9:.0f} "
                f"GFLOP/s: at most {rate / products:.0f} updates/s in float32\n"
            )


def _print_speeds(options: TrainingSpeed) -> None:
    clock_name = "processor time" if options.device == "cpu" else "the wall clock"
    sys.stdout.write(f"updates a second on {options.device}, by {clock_name}\n")
    speeds = measure_training_speed(options)
    reference = speeds["stable-baselines3"].on(options.device)
    for name, rate in speeds.items():
        speed = rate.on(options.device)
        sys.stdout.write(f"{name:23s} {speed:6.1f} updates/s  {speed / reference:5.2f}\n")
    for name, rate in measure_memory_speed(options).items():
        other = f", {rate.wall:6.1f} by the wall clock" if options.device == "cpu" else ""
        sys.stdout.write(f"{name:23s} {rate.on(options.device):6.1f} updates/s{other}\n")


if __name__ == "__main__":
    main()
