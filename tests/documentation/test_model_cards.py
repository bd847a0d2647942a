"""The page of model cards says what the cards beside the weights say."""

import json
from pathlib import Path

from rl.model_cards import describe_models

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference" / "model-cards.md"


def test_the_page_is_what_the_command_writes() -> None:
    assert PAGE.read_text(encoding="utf-8") == describe_models(), (
        "run: python -m rl.model_cards --out docs/reference/model-cards.md"
    )


def test_every_shipped_agent_stands_on_it_with_its_scores() -> None:
    text = PAGE.read_text(encoding="utf-8")
    held = {path: json.loads(path.read_text()) for path in (ROOT / "rl" / "weights").glob("*.json")}
    actors = {path: card["training"] for path, card in held.items() if card["kind"] == "actor"}
    assert len(actors) >= 8
    for path, training in actors.items():
        (section,) = [part for part in text.split("\n## ") if part.startswith(f"{path.stem}\n")]
        assert f"`{training['command']}`" in section
        for seed in training["seeds"]:
            safe = seed["validation"]["safe_site_percent"]
            success = seed["validation"]["success_percent"]
            assert f"| {safe:.1f} | {success:.1f} |" in section
