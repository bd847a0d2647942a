"""The figure of all agents: its dots are the cards' seeds, its intervals those of the tables."""

from __future__ import annotations

import json
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rl.figures import AgentsFigure, draw_agents
from rl.figures.agent_scores import Estimate, SeedScore, find_cards, read_seeds, read_tables
from rl.inference.artefacts import WEIGHTS_FOLDER, load_artefact, read_card, save_artefact
from rl.policies.actor import weights_name
from tests.drawing import bar_ends, legend_words, line_data

HEAD = (
    "policy,preset,episodes,safe_site_percent,touchdown_speed_mps,success_percent,success_tile_low,"
    "success_tile_high,propellant_percent,propellant_percent_tile_low,propellant_percent_tile_high\n"
)


@pytest.fixture
def results(tmp_path: Path) -> tuple[Path, Path]:
    paper, real = tmp_path / "paper", tmp_path / "real"
    paper.mkdir()
    real.mkdir()
    (paper / "table.csv").write_text(
        f"{HEAD}nearest-safe,paper,9,99.5,0.31,97,96,98,67,66,68\n"
        "oracle *,paper,9,99.5,0.31,99,98,100,60,59,61\n"
        "td3,paper,9,99.5,0.31,98,97,99,68,67,69\n"
    )
    (real / "table.csv").write_text(
        f"{HEAD}td3,lidar,9,99.5,0.31,76,72,80,68,67,69\ntd3-lidar,lidar,9,99.5,0.31,91,88,94,67,66,68\n"
        "hazard-aware,lidar,9,99.5,0.31,99,98,100,57,56,58\n"
    )
    return paper, real


def test_each_preset_has_its_seeds_its_rows_and_its_lines(results: tuple[Path, Path]) -> None:
    figure = draw_agents(AgentsFigure(results, presets=("paper", "lidar")))
    paper, lidar, *below = figure.axes
    assert [paper.get_title(), lidar.get_title()] == ["paper", "lidar"]
    assert [paper.get_ylabel(), below[0].get_ylabel()] == ["success [%]", "propellant burnt [%]"]
    agents = [text.get_text() for text in below[0].get_xticklabels()]
    place = agents.index("td3")
    seeds = read_card(WEIGHTS_FOLDER / "td3-lidar.json", "actor")["training"]["seeds"]
    for axes, measure in ((lidar, "success_percent"), (below[1], "propellant_percent")):
        x, y = line_data(axes, "a seed, validation tiles")
        np.testing.assert_allclose(x, place - 0.15)
        assert sorted(y) == sorted(seed["validation"][measure] for seed in seeds)
    bars = {one.get_label(): one for one in lidar.containers}
    learnt, elsewhere = bars["weights learnt there, and 95 % interval"], bars["weights learnt on paper"]
    assert np.array_equal(np.stack(bar_ends(learnt)), [[[place + 0.1, 88.0]], [[place + 0.1, 94.0]]])
    assert np.array_equal(np.stack(bar_ends(elsewhere)), [[[place + 0.25, 72.0]], [[place + 0.25, 80.0]]])
    assert line_data(lidar, "hazard-aware")[1].tolist() == [99.0, 99.0]
    assert line_data(paper, "nearest-safe")[1].tolist() == [97.0, 97.0]
    assert "nearest-safe" not in [line.get_label() for line in lidar.get_lines()]
    assert {"nearest-safe", "hazard-aware"} <= set(legend_words(figure.legends[0]))


def test_a_run_is_a_hollow_dot_until_its_seed_has_a_card(tmp_path: Path) -> None:
    for seed in (1, 7):
        folder = tmp_path / str(seed)
        folder.mkdir()
        card = {"preset": "lidar", "recipe": "td3", "seed": seed, "settings": {}, "plan": {}}
        (folder / "run.json").write_text(json.dumps(card))
        (folder / "validation.csv").write_text(
            "step,episodes,safe_site_percent,success_percent,propellant_percent,touchdown_speed_mps\n"
            "10,200.0,41,40,70,1\n20,200.0,51,50,69,2\n"
        )
    cards = [WEIGHTS_FOLDER / "td3-lidar.json"]
    found = {score.seed: score for score in read_seeds(cards, [tmp_path / "1", tmp_path / "7"])}
    assert (found[1].judged, found[7].judged) == ("validation", "tuning")
    assert found[7] == SeedScore("lidar", "td3", 7, "tuning", 200, False, 50.0, 69.0, 51.0, 2.0)
    figure = draw_agents(AgentsFigure(runs=(tmp_path / "7",), presets=("lidar",)))
    (dot,) = [line for line in figure.axes[0].get_lines() if line.get_label() == "a seed, tuning tiles"]
    assert dot.get_markerfacecolor() == "none"
    assert np.array_equal(dot.get_ydata(), [50.0])


def test_a_card_is_of_the_agent_that_its_name_says() -> None:
    names = ("td3", "td3-lidar", "td3-lstm", "td3-lstm-partial", "td3-paper")
    scores = read_seeds([WEIGHTS_FOLDER / f"{name}.json" for name in names], [])
    own = [("paper", "td3"), ("lidar", "td3"), ("paper", "td3-lstm"), ("partial", "td3-lstm")]
    assert [(s.preset, s.agent) for s in scores[::3]] == [*own, ("paper", "td3-paper")]
    assert len(scores) == 13
    for (preset, agent), seeds in groupby(scores, lambda score: (score.preset, score.agent)):
        card = read_card(WEIGHTS_FOLDER / f"{weights_name(agent, preset)}.json", "actor")["training"]
        assert [score.seed for score in seeds if score.shipped] == [card["seed"]]


def test_the_table_has_every_seed_every_line_and_what_learnt_elsewhere(
    results: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the figure; presets stand in the order in which they are defined, whatever the order of folders."""
    draw_agents(AgentsFigure(tuple(reversed(results)), presets=("lidar", "paper")))
    head, rule, *rows = capsys.readouterr().out.splitlines()
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    assert {len(row) for row in (*cells, head.strip("|").split("|"), rule.strip("|").split("|"))} == {8}
    assert [row[0] for row in cells] == sorted((row[0] for row in cells), key=["paper", "lidar"].index)
    seeds = read_seeds(find_cards(WEIGHTS_FOLDER), [])
    kept = [score for score in seeds if score.preset in ("paper", "lidar")]
    assert len([row for row in cells if row[2]]) == len(kept)
    for score in kept:
        (row,) = [
            row
            for row in cells
            if row[:2] == [score.preset, f"`{score.agent}`"] and seed_of(row) == score.seed
        ]
        assert ("shipped" in row[2]) == score.shipped
        numbers = score.safe_site, score.success, score.propellant, score.touchdown_speed
        assert [float(cell) for cell in row[4:]] == pytest.approx(numbers, abs=0.051)
    assert ["paper", "`nearest-safe`", "", "9", "99.5", "97.0 (96.0-98.0)", "67.0", "0.31"] in cells
    assert ["lidar", "`td3`, learnt on `paper`", "", "9", "99.5", "76.0 (72.0-80.0)", "68.0", "0.31"] in cells
    assert not any("oracle" in row[1] for row in cells)


def seed_of(row: list[str]) -> int | None:
    return int(row[2].split(",")[0]) if row[2] else None


def test_a_later_table_replaces_and_marks_are_dropped(results: tuple[Path, Path], tmp_path: Path) -> None:
    newer = tmp_path / "newer"
    newer.mkdir()
    (newer / "table.csv").write_text(f"{HEAD}td3,paper,9,99.5,0.31,50,40,60,68,67,69\n")
    rows = {(row.preset, row.policy): row for row in read_tables((*results, newer))}
    assert rows["paper", "td3"].success == Estimate(50.0, 40.0, 60.0)
    assert rows["paper", "oracle"].propellant == Estimate(60.0, 59.0, 61.0)


def test_what_cannot_be_drawn_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="holds no table of policies on presets"):
        draw_agents(AgentsFigure((tmp_path,)))
    with pytest.raises(ValueError, match="nothing to draw"):
        draw_agents(AgentsFigure(weights=tmp_path))
    (tmp_path / "table.csv").write_text("policy,preset\na,b\n")
    with pytest.raises(ValueError, match="holds no table of policies on presets"):
        draw_agents(AgentsFigure((tmp_path,)))


def without(card: dict[str, Any], place: list[Any]) -> dict[str, Any]:
    """A card that lacks what stands at a place."""
    cut = json.loads(json.dumps(card))
    *way, last = place
    part = cut
    for step in way:
        part = part[step]
    del part[last]
    return cut


@pytest.mark.parametrize(
    "place",
    [
        ["training"],
        ["training", "preset"],
        ["training", "seeds"],
        ["training", "seeds", 0, "seed"],
        ["training", "seeds", 0, "validation"],
        ["training", "seeds", 0, "validation", "propellant_percent"],
    ],
    ids=str,
)
def test_a_card_that_lacks_something_is_named(tmp_path: Path, place: list[Any]) -> None:
    own = load_artefact(WEIGHTS_FOLDER / "td3", "actor")
    path = tmp_path / "td3.json"
    save_artefact(path.with_suffix(""), "actor", own.tensors, own.card)
    assert read_seeds([path], [])
    save_artefact(path.with_suffix(""), "actor", own.tensors, without(own.card, place))
    with pytest.raises(ValueError, match=r"td3\.json is not a card of exported weights"):
        read_seeds([path], [])


def test_a_run_whose_log_lacks_a_column_is_named(tmp_path: Path) -> None:
    card = {"preset": "lidar", "recipe": "td3", "seed": 1, "settings": {}, "plan": {}}
    (tmp_path / "run.json").write_text(json.dumps(card))
    (tmp_path / "validation.csv").write_text("step,success_percent\n10,40\n")
    with pytest.raises(ValueError, match=f"{tmp_path.name} has no validated actor"):
        read_seeds([], [tmp_path])
