"""The study of memory: groups of seeds, verdicts with a closed form beside them, and tiny runs end to end."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ttest_ind

from hda.task.presets import PRESETS
from rl.inference.artefacts import WEIGHTS_FOLDER
from rl.recipes import RECIPES
from rl.training.candidates import Choice
from rl.training.run import run_training
from rl.training.run_folder import TrainingPlan
from studies.memory.answer import compare_groups, conclude, welch_interval
from studies.memory.command import MemoryStudy, PlannedRun, find_sources, planned_runs, study_memory
from studies.memory.scores import (
    AgentScore,
    collect_scores,
    read_scores,
    scores_of_card,
    write_scores,
)


def score(agent: str, preset: str, seed: int, safe: float, **changes) -> AgentScore:
    values = AgentScore(
        agent, preset, seed, f"runs/{agent}-{preset}-{seed}", "a", 10, 10, "10", 100, safe, safe, 0.5
    )
    return replace(values, **changes)


def group(agent: str, preset: str, values: list[float]) -> list[AgentScore]:
    return [score(agent, preset, seed, value) for seed, value in enumerate(values)]


WITHOUT, WITH = [90.0, 91.0, 92.0], [95.0, 96.0, 97.5]


@pytest.mark.parametrize("sizes", [(3, 3), (3, 5), (6, 2)])
def test_welchs_interval_is_scipys(sizes):
    rng = np.random.default_rng(sum(sizes))
    one, two = (rng.normal(90.0 + k, 1.0 + k, size) for k, size in enumerate(sizes))
    ours = welch_interval(one, two)
    theirs = ttest_ind(one, two, equal_var=False).confidence_interval()  # type: ignore[attr-defined]
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), rel=1e-9)
    assert ours.estimate == pytest.approx(one.mean() - two.mean())


def test_welchs_interval_covers_at_its_level():
    rng, covered, draws = np.random.default_rng(0), 0, 1500
    for _ in range(draws):
        interval = welch_interval(rng.normal(0.0, 1.0, 3), rng.normal(0.0, 2.0, 3))
        covered += interval.low <= 0.0 <= interval.high
    assert covered / draws > 0.95 - 4.0 * np.sqrt(0.95 * 0.05 / draws)  # false alarm about once in 30 000


def test_verdicts_follow_the_intervals():
    scores = [
        *group("td3", "paper", WITHOUT),
        *group("td3-lstm", "paper", [90.5, 91.0, 92.0]),
        *group("td3", "partial", WITHOUT),
        *group("td3-lstm", "partial", WITH),
        *group("td3-lstm-plus", "partial", [80.0, 81.0, 82.0]),
    ]
    rows = compare_groups(scores, "td3", np.random.default_rng(0))
    assert [row.agent for row in rows[::2]] == ["td3", "td3-lstm", "td3", "td3-lstm", "td3-lstm-plus"]
    verdicts = {(row.preset, row.agent): row.verdict for row in rows}
    assert verdicts == {
        ("paper", "td3"): "",
        ("paper", "td3-lstm"): "no difference shown",
        ("partial", "td3"): "",
        ("partial", "td3-lstm"): "helps",
        ("partial", "td3-lstm-plus"): "harms",
    }
    helped = next(row for row in rows if (row.preset, row.agent) == ("partial", "td3-lstm"))
    assert helped.interquartile_mean.estimate == pytest.approx(np.mean(WITH))
    assert helped.improvement.estimate == 1.0
    assert helped.improvement.low == pytest.approx(0.025 ** (1 / 3))
    assert helped.difference.estimate == pytest.approx(np.mean(WITH) - np.mean(WITHOUT))
    sentences = conclude(rows, "td3")
    assert len(sentences) == 3
    assert sentences[0].startswith("On paper, no difference shown for td3-lstm: +0.2 points")
    assert sentences[1].startswith("On partial, td3-lstm helps: +5.2 points")
    assert sentences[2].startswith("On partial, td3-lstm-plus harms: -10.0 points")


def test_one_seed_shows_nothing():
    rows = compare_groups(
        [score("td3", "paper", 0, 50.0), score("td3-lstm", "paper", 0, 99.0)], "td3", np.random.default_rng(0)
    )
    assert rows[2].verdict == "no difference shown"
    assert (rows[2].improvement.low, rows[2].improvement.high) == (0.0, 1.0)


def test_what_cannot_be_compared_is_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="unequal episodes"):
        compare_groups([score("td3", "paper", 0, 1.0), score("td3", "paper", 1, 1.0, episodes=7)], "td3", rng)
    with pytest.raises(ValueError, match="different settings"):
        compare_groups(
            [score("td3", "paper", 0, 1.0), score("td3", "paper", 1, 1.0, settings="b")], "td3", rng
        )


def test_scores_on_disk_come_back(tmp_path):
    scores = group("td3", "paper", WITHOUT)
    write_scores(tmp_path / "scores.csv", scores)
    assert read_scores(tmp_path / "scores.csv") == scores
    assert read_scores(tmp_path / "none.csv") == []
    (tmp_path / "scores.csv").write_text("agent,preset\ntd3,paper\n")
    with pytest.raises(ValueError, match="damaged"):
        read_scores(tmp_path / "scores.csv")


def test_scores_stay_where_new_ones_cannot_be_written(tmp_path, monkeypatch):
    kept = group("td3", "paper", WITHOUT)
    write_scores(tmp_path / "scores.csv", kept)

    def stop(_descriptor):
        raise OSError("the disk is full")

    monkeypatch.setattr(os, "fsync", stop)
    with pytest.raises(OSError, match="disk is full"):
        write_scores(tmp_path / "scores.csv", [])
    assert read_scores(tmp_path / "scores.csv") == kept
    assert [path.name for path in tmp_path.iterdir()] == ["scores.csv"]


def test_cards_give_a_score_per_seed(tmp_path):
    validation = {"episodes": 1000, "safe_site_percent": 90.0, "success_percent": 80.0, "reward": 0.4}
    training = {
        "recipe": "td3",
        "planned_steps": 270000,
        "settings": {"algorithm": "td3"},
        "preset": "paper",
        "seeds": [{"seed": s, "steps": [10, 20], "validation": validation} for s in (0, 1)],
    }
    path = tmp_path / "of-any-name.json"
    path.write_text(json.dumps({"training": training}))
    first, second = scores_of_card(path)
    assert (first.agent, first.seed, second.seed, first.chosen_steps) == ("td3", 0, 1, "10+20")
    assert first.safe_site_percent == 90.0
    assert (first.trained_steps, first.unfinished) == (270000, False)
    with pytest.raises(ValueError, match="both td3 on paper, seed 0"):
        collect_scores((path, path), tmp_path / "scores.csv", 1000, Choice())
    path.write_text("{}")
    with pytest.raises(ValueError, match="not a card"):
        scores_of_card(path)


SHIPPED = sorted(set(WEIGHTS_FOLDER.glob("*.json")) - set(WEIGHTS_FOLDER.glob("autoencoder*.json")))


@pytest.mark.parametrize("card", SHIPPED, ids=lambda card: card.stem)
def test_shipped_cards_say_what_they_were_trained_with(card):
    """The first cards have no field for it; the command in them, for people, says the same."""
    training = json.loads(card.read_text())["training"]
    words = training["command"].split()
    steps = int(words[words.index("--steps") + 1])
    for one in scores_of_card(card):
        assert one.agent == words[words.index("rl.train") + 1]
        assert steps - steps % 10_000 <= one.trained_steps <= steps


def test_an_old_card_of_another_name_is_refused(tmp_path):
    shutil.copy(WEIGHTS_FOLDER / "td3.json", tmp_path / "mine.json")
    with pytest.raises(ValueError, match="does not name its recipe"):
        scores_of_card(tmp_path / "mine.json")


# Tiny runs

TINY = {"hidden": (8,), "batch_size": 1, "random_steps": 20, "replay_size": 100}
SETTINGS = {
    "td3": replace(RECIPES["td3"], **TINY),
    "td3-lstm": replace(RECIPES["td3-lstm"], **TINY, memory=8, update_every=1),
}


def train(root: Path, agent: str, seed: int, steps: int = 40) -> None:
    plan = TrainingPlan(
        steps, seed, agent, validate_every=20, validation_episodes=2, checkpoint_every=1000, log_every=20
    )
    run_training(root / f"{agent}-paper-{seed}", PRESETS["paper"], SETTINGS[agent], plan, resume=False)


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for agent in SETTINGS:
        for seed in (0, 1):
            train(folder, agent, seed)
    return folder


def options_for(root: Path, out: Path, **changes) -> MemoryStudy:
    options = MemoryStudy(
        agents=("td3", "td3-lstm"),
        presets=("paper",),
        seeds=2,
        root=root,
        validation_episodes=3,
        choice=Choice(averages=(1,), candidates=1, episodes=2),
        out=out,
    )
    return replace(options, **changes)


def test_runs_are_flown_compared_and_drawn(root, tmp_path, capsys):
    rows = study_memory(options_for(root, tmp_path))
    assert [(row.agent, row.seeds, row.episodes) for row in rows[::2]] == [("td3", 2, 3), ("td3-lstm", 2, 3)]
    scores = read_scores(tmp_path / "scores.csv")
    assert [(s.agent, s.seed, s.trained_steps) for s in scores] == [
        ("td3", 0, 40),
        ("td3", 1, 40),
        ("td3-lstm", 0, 40),
        ("td3-lstm", 1, 40),
    ]
    with (tmp_path / "memory.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert len(table) == 4
    assert float(table[2]["difference"]) == pytest.approx(
        np.mean([s.safe_site_percent for s in scores[2:]])
        - np.mean([s.safe_site_percent for s in scores[:2]]),
        abs=1e-4,
    )
    told = json.loads((tmp_path / "provenance.json").read_text())
    assert len(told["sources"]) == 4
    assert told["options"]["validation_episodes"] == 3
    assert "| paper | td3-lstm | safe site | 2 |" in (tmp_path / "memory.md").read_text()
    assert (tmp_path / "memory.png").stat().st_size > 5000
    assert re.search(r"On paper, .*td3-lstm.* points of safe", capsys.readouterr().out)


def test_agents_without_runs_are_read_from_their_cards(root, tmp_path):
    card = WEIGHTS_FOLDER / "td3.json"
    assert find_sources(options_for(tmp_path / "none", tmp_path)) == (
        card,
        *(path for path in (WEIGHTS_FOLDER / "td3-lstm.json",) if path.exists()),
    )
    runs = tuple(root / f"{agent}-paper-{seed}" for agent in ("td3", "td3-lstm") for seed in (0, 1))
    assert find_sources(options_for(root, tmp_path)) == runs
    shutil.copytree(runs[3], tmp_path / "runs" / runs[3].name)
    here = options_for(tmp_path / "runs", tmp_path)
    assert find_sources(here) == (card, tmp_path / "runs" / runs[3].name)


def test_what_was_flown_is_not_flown_again(root, tmp_path):
    kept = tmp_path / "runs"
    shutil.copytree(root, kept)
    first = study_memory(options_for(kept, tmp_path / "out"))
    for folder in kept.iterdir():
        shutil.rmtree(folder / "actors")  # nothing is left to fly
    assert study_memory(options_for(kept, tmp_path / "out")) == first
    with pytest.raises(ValueError, match="actors"):
        study_memory(options_for(kept, tmp_path / "out", validation_episodes=4))


def test_missing_and_unfinished_runs_are_listed(root, tmp_path, capsys):
    kept = tmp_path / "runs"
    shutil.copytree(root / "td3-paper-0", kept / "td3-paper-0")
    shutil.copytree(root / "td3-paper-1", kept / "td3-paper-1")
    log = kept / "td3-paper-1" / "validation.csv"
    log.write_text("".join(log.read_text().splitlines(keepends=True)[:-1]))
    options = options_for(kept, tmp_path / "out", train="list")
    assert [run.finished for run in planned_runs(options)] == [True, False, False, False]
    assert study_memory(options) == ()
    lines = capsys.readouterr().out.split("\n")
    assert lines[0].startswith("python -m rl.train td3 --seed 1 --preset paper --out ")
    assert lines[0].endswith("--resume")
    assert [line.split()[3] for line in lines[:3]] == ["td3", "td3-lstm", "td3-lstm"]
    assert not (tmp_path / "out").exists()


def test_the_commands_are_those_of_the_training(tmp_path):
    import tyro

    from rl.train import Command, TrainRecurrentAgent

    run = PlannedRun("td3-lstm-plus", "partial", 2, tmp_path / "a b")
    parsed = tyro.cli(Command, args=run.command[3:])  # type: ignore[call-overload]
    assert isinstance(parsed, TrainRecurrentAgent)
    assert (parsed.seed, parsed.preset, parsed.out) == (2, "partial", tmp_path / "a b")
    assert parsed.settings == RECIPES["td3-lstm-plus"]


def test_bad_options_are_named(tmp_path):
    for changes, message in (
        ({"agents": ("td3", "td4")}, "agent 'td4'"),
        ({"agents": ("td3",)}, "at least one more"),
        ({"presets": ("papr",)}, "preset"),
        ({"seeds": 0}, "seeds"),
        ({"runs": (tmp_path / "none",)}, "not a run"),
        ({"agents": ("ddpg", "tqc")}, "no run of the plan"),
    ):
        with pytest.raises(ValueError, match=message):
            study_memory(options_for(tmp_path / "empty", tmp_path / "out", **changes))
