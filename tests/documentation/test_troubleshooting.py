"""Every message that the page on troubleshooting shows is one that the software can give."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "troubleshooting.md"
SOURCES = [
    path for package in ("guidance", "hda", "rl", "studies") for path in (ROOT / package).rglob("*.py")
]


def said_words() -> str:
    """All text of the sources and the Makefile; a message is often split over lines, and names constants."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in [*SOURCES, ROOT / "Makefile"])
    text = re.sub(r'"\s*\n\s*f?"', "", text)
    for name, value in {"TILE_SIZE": "1000", "COARSEST_PIXEL:g": "10", "MOST_UNKNOWN:.0%": "10%"}.items():
        text = text.replace("{" + name + "}", value)
    return text


def messages() -> list[str]:
    """Messages in the first column of the tables, without those of other packages."""
    rows = re.findall(r"^\| (.+?) \| ", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    cells = [cell for cell in rows if "(Gymnasium)" not in cell]
    return [message for cell in cells for message in re.findall(r"`([^`]+)`", cell)]


def test_the_page_shows_many_messages() -> None:
    assert len(messages()) > 50


@pytest.mark.parametrize("message", messages())
def test_a_message_stands_in_the_sources(message: str) -> None:
    """Between its dots a message is that of the source, word for word."""
    text = said_words()
    parts = [part.strip(" :,;'") for part in message.split("...")]
    for part in parts:
        assert part in text, f"{part!r} of {message!r}"
