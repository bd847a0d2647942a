"""`python -m rl.dataset`: episodes are those of the environment and of `hda.fly`; stopped, it goes on."""

import json
import os
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from packaging.requirements import Requirement

import hda
import hda.worker_pool as pool
import rl
from rl.dataset import Transitions, command, read_dataset
from rl.dataset.behaviours import behaviour_names, find_behaviour
from rl.dataset.command import MakeDataset, run_dataset
from rl.dataset.flights import record_episode
from rl.dataset.minari_file import (
    OFFLINE_LIBRARIES,
    OfflineLibrariesError,
    find_spec,
    minari_name,
    require_offline_libraries,
    write_minari,
)
from rl.dataset.transitions import KINDS
from rl.environment.episode_info import ENDING_CODES

ROOT = Path(__file__).parents[3]
with_minari = pytest.mark.skipif(
    any(find_spec(name) is None for name in OFFLINE_LIBRARIES), reason="Minari is missing (extra `offline`)"
)


def record(name: str, episodes: int) -> Transitions:
    columns: dict[str, list[Any]] = {field: [] for field in KINDS}
    for episode in range(episodes):
        scenario = hda.sample_scenario("paper", 3, episode, "train")
        record_episode(find_behaviour(name), scenario, columns)
        columns["policy"].append(0)
    arrays: dict[str, Any] = {field: np.array(values, KINDS[field]) for field, values in columns.items()}
    return Transitions(**arrays)


@pytest.mark.parametrize("name", ["random", "td3", "td3-lstm-plus"])
def test_an_episode_is_that_of_the_environment(name: str) -> None:
    data = record(name, 2)
    env: Any = gymnasium.make("rl:LunarHDA-v0")
    for number in range(2):
        flown, info = data.one(number), {}
        seen = [env.reset(seed=3 if number == 0 else None)[0]]
        for k, action in enumerate(flown.actions):
            vector, reward, terminated, truncated, info = env.step(action)
            seen.append(vector)
            assert (reward, terminated, truncated) == (
                flown.rewards[k], flown.terminated[k], flown.truncated[k]
            )  # fmt: skip
        assert np.array_equal(np.stack(seen), flown.observations)
        assert (data.ending[number], data.tile[number]) == (info["ending"], info["tile"])
    env.close()


@pytest.mark.parametrize("name", ["td3", "td3-lstm-plus", "sac"])
def test_an_agent_lands_as_it_is_flown(name: str) -> None:
    data, policy = record(name, 2), hda.make_policy(name)
    for episode in range(2):
        outcome = hda.fly(policy, hda.sample_scenario("paper", 3, episode, "train")).outcome
        assert data.ending[episode] == ENDING_CODES[outcome.ending]
        assert data.safe_site[episode] == outcome.safe_site


def test_who_has_no_such_actions_is_refused() -> None:
    assert {"random", "td3", "td3-lstm-plus"} <= set(behaviour_names())
    assert not {"td3-convex", "ppo-thrust", "nearest-safe"} & set(behaviour_names())
    for name in ("nearest-safe", "td3+convex", "nobody"):
        with pytest.raises(ValueError, match=f"policies must be among random, .* got '.*{name[-4:]}'"):
            find_behaviour(name)


SMALL = MakeDataset(("td3", "random"), 5, workers=1, minari=False)
DRAWS = replace(SMALL, policies=("random",), episodes=2)


def test_a_stopped_call_goes_on_to_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "BLOCK_EPISODES", 2)
    whole, stopped = replace(SMALL, out=tmp_path / "whole"), replace(SMALL, out=tmp_path / "stopped")
    run_dataset(whole, "made")
    with monkeypatch.context() as patch:
        patch.setattr(pool, "map_in_processes", lambda fly, blocks, *_, **__: [fly(b) for b in blocks[:2]])
        with pytest.raises(OSError, match="pass --resume"):
            run_dataset(stopped, "made")
    with pytest.raises(ValueError, match="already holds a dataset"):
        run_dataset(stopped, "made")
    with pytest.raises(ValueError, match="was begun with other policies"):
        run_dataset(replace(stopped, study_seed=1, resume=True), "made")
    damaged = stopped.out / "parts" / "td3-00000000.npz"
    damaged.write_bytes(damaged.read_bytes()[:-9])
    run_dataset(replace(stopped, resume=True), "made")
    for name in ("dataset.npz", "card.json", "README.md"):
        assert (stopped.out / name).read_bytes() == (whole.out / name).read_bytes()
    assert not (stopped.out / "parts").exists()

    run_dataset(replace(stopped, resume=True), "again")  # nothing is left to do
    assert (stopped.out / "dataset.npz").read_bytes() == (whole.out / "dataset.npz").read_bytes()
    with pytest.raises(ValueError, match="holds another dataset"):
        run_dataset(replace(stopped, episodes=6, resume=True), "made")

    found = read_dataset(whole.out / "dataset.npz")
    assert found.transitions.policy.tolist() == [0] * 5 + [1] * 5
    assert found.transitions.episode.tolist() == [*range(5), *range(5)]
    card = json.loads((whole.out / "card.json").read_text())
    assert {**card, "format": 1} == found.card
    assert card["policies"][1] == {"name": "random", "weights_sha256": None}
    for place, score in enumerate(card["scores"]):
        own = found.transitions.policy == place
        ratio, low, high = score["success_percent"]
        assert ratio == 100.0 * np.mean(found.transitions.ending[own] == 1)
        assert low - 1e-9 <= ratio <= high + 1e-9
        assert high - low > 10.0  # of five episodes
        assert score["steps"] == found.transitions.length[own].sum()
    page = (whole.out / "README.md").read_text()
    assert "`made`" in page
    assert "| td3 | 5 |" in page


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_wrong_options_leave_a_finished_folder_as_it_was(tmp_path: Path) -> None:
    right = replace(DRAWS, out=tmp_path)
    run_dataset(right, "made")
    before = contents(tmp_path)
    for changes in ({"study_seed": 1}, {"episodes": 3}, {"policies": ("td3",)}):
        with pytest.raises(ValueError, match="holds another dataset"):
            run_dataset(replace(right, resume=True, **changes), "made")
        assert contents(tmp_path) == before
    run_dataset(replace(right, resume=True), "made")
    assert (tmp_path / "dataset.npz").read_bytes() == before["dataset.npz"]
    with pytest.raises(ValueError, match="already holds a dataset"):
        run_dataset(right, "made")


@pytest.mark.parametrize("left", ["", '{"environment": "Lun'])
def test_a_record_cut_short_counts_for_none(tmp_path: Path, left: str) -> None:
    """Whose the blocks beside it are is not known: they are flown anew."""
    options = replace(DRAWS, out=tmp_path / "cut")
    run_dataset(replace(DRAWS, out=tmp_path / "whole"), "made")
    (options.out / "parts").mkdir(parents=True)
    (options.out / "parts" / "identity.json").write_text(left)
    foreign = options.out / "parts" / "random-00000000.npz"
    foreign.write_bytes((tmp_path / "whole" / "dataset.npz").read_bytes())
    with pytest.raises(ValueError, match="already holds a dataset"):
        run_dataset(options, "made")
    run_dataset(replace(options, resume=True), "made")
    assert contents(options.out) == contents(tmp_path / "whole")


def test_a_file_of_minaris_goes_with_its_dataset(tmp_path: Path) -> None:
    (tmp_path / "minari").mkdir()
    (tmp_path / "minari" / "old").write_text("of another dataset")
    run_dataset(replace(DRAWS, out=tmp_path), "made")
    assert not (tmp_path / "minari").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"episodes": 0}, "episodes must be at least 1"),
        ({"workers": 0}, "workers must be at least 1"),
        ({"policies": ("td3", "td3")}, "policies must name each one once"),
        ({"policies": ()}, "policies must name each one once"),
        ({"split": "moon"}, "split must be one of"),
        ({"preset": "moon"}, "moon"),
    ],
)
def test_a_wrong_option_is_named(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        run_dataset(replace(SMALL, out=tmp_path / "d", **changes), "made")
    assert not (tmp_path / "d").exists()


def test_the_extra_is_what_minari_needs() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert {Requirement(line).name for line in extras["offline"]} == set(OFFLINE_LIBRARIES)
    assert any("offline" in Requirement(line).extras for line in extras["dev"])


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rl.dataset.minari_file.find_spec", lambda name: None)
    with pytest.raises(OfflineLibrariesError, match=r"needs minari, h5py; .*\[offline\].*--no-minari"):
        require_offline_libraries()


@with_minari
def test_minari_reads_it_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import minari  # type: ignore[import-not-found,unused-ignore]

    run_dataset(replace(SMALL, out=tmp_path / "d"), "made")
    dataset = read_dataset(tmp_path / "d" / "dataset.npz")
    before = dict(os.environ)
    write_minari(tmp_path / "d" / "minari", dataset)
    assert before == dict(os.environ)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "d" / "minari"))
    read = minari.load_dataset(minari_name("paper"))
    data = dataset.transitions
    assert (read.total_episodes, read.total_steps) == (10, len(data.actions))
    for number, episode in enumerate(read.iterate_episodes()):
        mine = data.one(number)
        pairs = zip(
            mine,
            (
                episode.observations,
                episode.actions,
                episode.rewards,
                episode.terminations,
                episode.truncations,
            ),
            strict=True,
        )
        assert all(np.array_equal(ours, its) for ours, its in pairs)
    (said,) = read.storage.get_episode_metadata([7])
    assert (said["policy"], int(said["episode"]), int(said["tile"])) == ("random", 2, data.tile[7])
    env = rl.LunarHDAEnv()
    assert read.spec.observation_space == env.observation_space
    assert read.spec.action_space == env.action_space
    assert read.env_spec is not None
    assert read.env_spec.entry_point == "rl.environment.env:LunarHDAEnv"
