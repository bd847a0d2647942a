"""The shipped weights as a page: for whom, from what data, by which command, how good.

python -m rl.model_cards                                          # prints the page
python -m rl.model_cards --out docs/reference/model-cards.md      # writes it
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from guidance.console import one_line_errors, tolerate_encoding
from rl.inference.artefacts import ENCODER, WEIGHTS_FOLDER, read_card
from rl.inference.latent import encoder_names
from rl.policies.catalogue import entries

_HEAD = """# Model cards

`python -m rl.model_cards --out docs/reference/model-cards.md` writes this page from the cards that lie beside
the weights in `rl/weights/`. A test holds the two equal.

- **Meant for:** research on landing-site selection, as reference agents of this benchmark.
- **Not meant for:** flight, or ground and sensors unlike those that they were trained on.
  [Robustness](../results/robustness.md) shows how they fail there.
- **Data:** all learnt on the `train` tiles. Seed, steps and averages were chosen on the `tuning` tiles. The
  `validation` tiles were flown for the last columns alone ([data card](data-card.md)).
- **Form:** numbers in safetensors with a JSON card; reading them runs no code.
- **Licence:** Apache-2.0, as the package.
"""
_SEED_HEAD = (
    "| seed | tuning: safe site % | success % | validation: safe site % | success %"
    " | propellant % | touchdown m/s |"
)


@dataclass(frozen=True)
class ModelCards:
    """Make the page of the shipped weights.

    Attributes:
        out: file to write; printed by default.
    """

    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None


def describe_models() -> str:
    """The page, in Markdown.

    Raises:
        ArtefactError: a card is damaged.
    """
    summaries = {entry.name: entry.summary for entry in entries()}
    shipped = {name: text for name, text in summaries.items() if (WEIGHTS_FOLDER / f"{name}.json").exists()}
    parts = [_HEAD, *(_describe_agent(name, text) for name, text in shipped.items())]
    parts += [_describe_encoder(name) for name in encoder_names()]
    return "\n".join(parts)


def _describe_agent(name: str, summary: str) -> str:
    card = read_card(WEIGHTS_FOLDER / f"{name}.json", "actor")
    training = card["training"]
    memory = f", LSTM of {card['memory']}" if "memory" in card else ""
    steps = training["steps"]
    actor = f"its actor at {steps[0]} steps"
    if len(steps) > 1:
        actor = f"the mean of its {len(steps)} actors at {steps[0]} to {steps[-1]} steps"
    choice = training["choice"]
    lines = [
        f"## {name}\n",
        f"{summary[0].upper()}{summary[1:]}.\n",
        "| | |",
        "|---|---|",
        f"| trained by | `{training['command']}` |",
        f"| network | hidden: {' and '.join(map(str, card['hidden']))}{memory}; vector `{card['layout']}` |",
        f"| weights | seed {training['seed']}, {actor}; best of {choice['candidates']} candidates a seed,"
        f" {choice['episodes']} tuning episodes each |",
        f"| software | {_name_versions(training['versions'])} |\n",
        _SEED_HEAD,
        "|---:|---:|---:|---:|---:|---:|---:|",
        *(_describe_seed(seed) for seed in training["seeds"]),
        "",
    ]
    return "\n".join(lines)


def _describe_seed(seed: dict[str, Any]) -> str:
    tuning, validation = seed["tuning"], seed["validation"]
    ratios = [
        f"{score[measure]:.1f}"
        for score in (tuning, validation)
        for measure in ("safe_site_percent", "success_percent")
    ]
    cost = [f"{validation['propellant_percent']:.1f}", f"{validation['touchdown_speed_mps']:.2f}"]
    return f"| {' | '.join([str(seed['seed']), *ratios, *cost])} |"


def _describe_encoder(name: str) -> str:
    card = read_card(WEIGHTS_FOLDER / f"{name}.json", ENCODER)
    left = {split: 100.0 * error["variance_left"] for split, error in card["reconstruction_error"].items()}
    lines = [
        f"## {name}\n",
        f"What agents see a look through: {card['latent_size']} numbers of 64 x 64 pixels,"
        f" learnt on looks of `{card['preset']}`.\n",
        "| | |",
        "|---|---|",
        f"| trained by | `{card['command']}` |",
        f"| data | {card['maps']} looks of random rollouts on the `train` tiles |",
        f"| variance left | {left['train']:.1f} % (train), {left['validation']:.1f} % (validation) |",
        f"| software | {_name_versions(card['versions'])} |",
        "",
    ]
    return "\n".join(lines)


def _name_versions(versions: dict[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in versions.items())


def main() -> None:
    """Run the command."""
    tolerate_encoding()
    options = tyro.cli(ModelCards, description=__doc__)
    page = describe_models()
    if options.out is None:
        sys.stdout.write(page)
        return
    with one_line_errors():
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(page, encoding="utf-8")
    sys.stdout.write(f"wrote {options.out}\n")


if __name__ == "__main__":
    main()
