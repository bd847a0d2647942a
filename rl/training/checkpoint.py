"""Checkpoints of a training run that resume exactly: our own arrays and JSON, none of SB3's pickles.

What learns from a replay memory is kept between two episodes: networks, targets, optimisers, replay memory,
the state of every random generator, and counters. What learns from many environments is kept between two
updates, with the flights under way in place of a replay memory. What SB3 itself names as its torch state is
what is kept, so that every algorithm of it works.
"""

from __future__ import annotations

import re
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from rich.console import Console

from rl.environment.native.landing_vector import LandingVectorEnv
from rl.environment.native.vector_snapshot import restore_snapshot, take_snapshot
from rl.inference.artefacts import Artefact, ArtefactError, Tensors, load_artefact, read_card, save_artefact
from rl.learning.recurrent.td3_lstm import RecurrentTD3

if TYPE_CHECKING:
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
    from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

    from rl.environment.env import LandingEnv

    Algorithm = OffPolicyAlgorithm | OnPolicyAlgorithm | RecurrentTD3
    Environment = LandingEnv[Any] | LandingVectorEnv[Any]

KIND = "checkpoint"
_REPLAY = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def save_checkpoint(folder: Path, algorithm: Algorithm, env: Environment, card: dict[str, Any]) -> Path:
    """Write a checkpoint and remove older ones.

    Args:
        folder: of the run.
        algorithm: between two episodes: its last step ended one; or between two updates, of many.
        env: the environment that it trains on, already reset for the next episode; or the vector.
        card: settings and whatever else the run wants back.

    Returns:
        Path of the checkpoint, without suffix.
    """
    path = folder / f"checkpoint-{algorithm.num_timesteps:09d}"
    generators = {
        "numpy": _numpy_state(),
        "action_space": _jsonable(algorithm.action_space.np_random.bit_generator.state),
    }
    if isinstance(algorithm, RecurrentTD3):
        generators["agent"] = _jsonable(algorithm.rng.bit_generator.state)
    counters = {
        "num_timesteps": algorithm.num_timesteps,
        "n_updates": algorithm._n_updates,
        "episode_num": algorithm._episode_num,
        "study_seed": env.study_seed,
    }
    if isinstance(env, LandingVectorEnv):
        flown = _flight_tensors(algorithm, env)
    else:
        # the environment has begun the next episode already; the resumed run begins it again
        counters["next_episode"] = env.next_episode - 1
        flown = _replay_tensors(algorithm)
    tensors = {**_network_tensors(algorithm), **flown}
    tensors["generator/torch"] = torch.get_rng_state().numpy()
    if algorithm.device.type == "cuda":
        tensors["generator/cuda"] = torch.cuda.get_rng_state(algorithm.device).numpy()
    kept = {**card, "device": algorithm.device.type, "generators": generators, "counters": counters}
    save_artefact(path, KIND, tensors, kept)
    for old in folder.glob("checkpoint-*"):
        if old.stem != path.name:
            old.unlink()
    return path


def newest_checkpoint(folder: Path) -> Path | None:
    """Path (without suffix) of the newest checkpoint whose card is complete; None where there is no card.

    Cards that are not are named on stderr.

    Raises:
        ArtefactError: there are cards, and none is complete.
    """
    cards = sorted(folder.glob("checkpoint-*.json"), reverse=True)
    for card in cards:
        try:
            read_card(card, KIND)
        except ArtefactError as error:
            told = f"passed over: {error}"
            Console(stderr=True).print(told, style="yellow", markup=False, highlight=False, soft_wrap=True)
        else:
            return card.with_suffix("")
    if cards:
        raise ArtefactError(
            f"no checkpoint in {folder} is whole: train in another --out,"
            " or remove checkpoint-* to begin anew"
        )
    return None


def restore_checkpoint(path: Path, algorithm: Algorithm, env: Environment) -> dict[str, Any]:
    """Put a fresh algorithm and environment where the checkpoint was taken.

    A checkpoint of the processor holds no state of a GPU's generator: resumed on a GPU, that generator begins
    with the run's seed.

    Args:
        path: of the checkpoint, without suffix.
        algorithm: made with the same settings; everything that learns is overwritten.
        env: the environment inside it.

    Returns:
        The checkpoint's card.

    Raises:
        ArtefactError: the checkpoint is damaged or does not fit the algorithm.
    """
    artefact = load_artefact(path, KIND)
    try:
        _restore_run(artefact, algorithm, env)
    except (AssertionError, IndexError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise ArtefactError(f"{path} does not fit this algorithm: {error!r}") from error
    return artefact.card


def _restore_run(artefact: Artefact, algorithm: Algorithm, env: Environment) -> None:
    counters, generators = artefact.card["counters"], artefact.card["generators"]
    algorithm.num_timesteps = counters["num_timesteps"]
    algorithm._n_updates = counters["n_updates"]
    algorithm._episode_num = counters["episode_num"]
    if isinstance(env, LandingVectorEnv):
        _restore_flights(algorithm, env, counters["study_seed"], artefact.tensors)
    else:
        env.continue_study(counters["study_seed"], counters["next_episode"])
        _begin_episode(algorithm)
        _restore_replay(algorithm, artefact.tensors)
    _restore_networks(algorithm, artefact.tensors)
    algorithm.action_space.np_random.bit_generator.state = generators["action_space"]
    if isinstance(algorithm, RecurrentTD3):
        algorithm.rng.bit_generator.state = generators["agent"]
    name, keys, *rest = generators["numpy"]
    np.random.set_state((name, np.array(keys, dtype=np.uint32), *rest))  # noqa: NPY002 - SB3 draws from it
    torch.set_rng_state(torch.from_numpy(artefact.tensors["generator/torch"].copy()))
    if algorithm.device.type == "cuda":
        assert algorithm.seed is not None  # that of the run
        _restore_gpu_generator(artefact.tensors, algorithm.device, algorithm.seed)


def _restore_gpu_generator(tensors: Tensors, device: torch.device, seed: int) -> None:
    """Put the generator of a GPU where it was; where no GPU was, to the run's seed."""
    if "generator/cuda" in tensors:
        torch.cuda.set_rng_state(torch.from_numpy(tensors["generator/cuda"].copy()), device)
    else:
        torch.cuda.manual_seed(seed)


def _begin_episode(algorithm: Any) -> None:
    if isinstance(algorithm, RecurrentTD3):
        algorithm.restart_episode()
        return
    vectorized = algorithm.get_env()
    assert vectorized is not None
    vectorized._reset_seeds()
    algorithm._last_obs = vectorized.reset()  # type: ignore[assignment]


def _numpy_state() -> list[Any]:
    name, keys, *rest = np.random.get_state()  # noqa: NPY002 - SB3 draws from it
    return [name, [int(key) for key in keys], *rest]


def _jsonable(state: Any) -> Any:
    if isinstance(state, dict):
        return {key: _jsonable(value) for key, value in state.items()}
    return state if isinstance(state, str) else int(state)


def _network_tensors(algorithm: Algorithm) -> Tensors:
    modules, variables = algorithm._get_torch_save_params()
    tensors: Tensors = {}
    for name in modules:
        state = attrgetter(name)(algorithm).state_dict()
        if "param_groups" in state:  # an optimiser
            for index, moments in state["state"].items():
                for key, value in moments.items():
                    tensors[f"{name}/{index}/{key}"] = value.cpu().numpy()
        else:
            tensors.update({f"{name}/{key}": value.cpu().numpy() for key, value in state.items()})
    for name in variables:
        tensors[f"variable/{name}"] = attrgetter(name)(algorithm).detach().cpu().numpy()
    return tensors


def _restore_networks(algorithm: Algorithm, tensors: Tensors) -> None:
    modules, variables = algorithm._get_torch_save_params()
    for name in modules:
        module = attrgetter(name)(algorithm)
        own = {
            key.removeprefix(f"{name}/"): torch.tensor(value)
            for key, value in tensors.items()
            if key.startswith(f"{name}/")
        }
        if isinstance(module, torch.optim.Optimizer):
            state: dict[int, dict[str, torch.Tensor]] = {}
            for key, value in own.items():
                match = re.fullmatch(r"(\d+)/(\w+)", key)
                if match is None:
                    raise ValueError(f"optimiser state {name}/{key} is not of Adam")
                state.setdefault(int(match[1]), {})[match[2]] = value
            module.load_state_dict({"state": state, "param_groups": module.state_dict()["param_groups"]})
        else:
            module.load_state_dict(own)
    for name in variables:
        attrgetter(name)(algorithm).data.copy_(torch.tensor(tensors[f"variable/{name}"]))


def _replay_tensors(algorithm: Any) -> Tensors:
    if isinstance(algorithm, RecurrentTD3):
        return {f"replay/{name}": array for name, array in algorithm.replay_buffer.tensors().items()}
    replay: Any = algorithm.replay_buffer
    size = replay.size()
    tensors: Tensors = {f"replay/{name}": getattr(replay, name)[:size] for name in _REPLAY}
    tensors["replay/position"] = np.array([replay.pos, int(replay.full)])
    return tensors


def _restore_replay(algorithm: Any, tensors: Tensors) -> None:
    if isinstance(algorithm, RecurrentTD3):
        kept = {name: tensors[f"replay/{name}"] for name in algorithm.replay_buffer.tensors()}
        algorithm.replay_buffer.restore(kept)
        return
    replay: Any = algorithm.replay_buffer
    for name in _REPLAY:
        stored = tensors[f"replay/{name}"]
        if len(stored) > replay.buffer_size:
            raise ValueError(
                f"replay memory of {len(stored)} transitions, this run keeps {replay.buffer_size}"
            )
        getattr(replay, name)[: len(stored)] = stored
    position, full = tensors["replay/position"]
    replay.pos, replay.full = int(position), bool(full)


def _flight_tensors(algorithm: Any, env: LandingVectorEnv[Any]) -> Tensors:
    """Flights under way, and what the learner remembers of them."""
    tensors: Tensors = {f"flight/{name}": part for name, part in take_snapshot(env).items()}
    tensors["rollout/episode_starts"] = np.asarray(algorithm._last_episode_starts, np.bool_)
    for network, memory in _memories(algorithm).items():
        for name, part in zip(("hidden", "cell"), memory, strict=True):
            tensors[f"rollout/{network}/{name}"] = part.cpu().numpy()
    return tensors


def _restore_flights(algorithm: Any, env: LandingVectorEnv[Any], study_seed: int, tensors: Tensors) -> None:
    kept = {key.removeprefix("flight/"): part for key, part in tensors.items() if key.startswith("flight/")}
    algorithm.get_env()._reset_seeds()  # the flights go on: no reset of the learner's begins the study again
    algorithm._last_obs = restore_snapshot(env, study_seed, kept)
    algorithm._last_episode_starts = tensors["rollout/episode_starts"].copy()
    for network, memory in _memories(algorithm).items():
        for name, part in zip(("hidden", "cell"), memory, strict=True):
            part.copy_(torch.tensor(tensors[f"rollout/{network}/{name}"]))


def _memories(algorithm: Any) -> dict[str, tuple[torch.Tensor, torch.Tensor]]:
    """(hidden, cell) of the actor's and of the critic's LSTM; empty without memory."""
    states = getattr(algorithm, "_last_lstm_states", None)
    return {} if states is None else {"actor": states.pi, "critic": states.vf}
