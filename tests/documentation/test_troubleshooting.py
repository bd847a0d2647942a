"""The page on troubleshooting shows messages that exist, and each that is raised has a form there."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "troubleshooting.md"
SOURCES = [
    path for package in ("guidance", "hda", "rl", "studies") for path in (ROOT / package).rglob("*.py")
]

CONSTANTS = {"TILE_SIZE": "1000", "COARSEST_PIXEL:g": "10", "MOST_UNKNOWN:.0%": "10%"}
"""What messages name, and what the page says for it."""


def said_words() -> str:
    """All text of the sources and the Makefile; a message is often split over lines, and names constants."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in [*SOURCES, ROOT / "Makefile"])
    text = re.sub(r'"\s*\n\s*f?"', "", text)
    for name, value in CONSTANTS.items():
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


RAISED_FOR_USERS = ("ValueError", "ImportError", "FileExistsError", "RuntimeError")


def template(node: ast.expr) -> str:
    """A message with dots for what differs."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(template(value) for value in node.values)
    if isinstance(node, ast.FormattedValue):
        name = re.search(r"\{(.+)\}", ast.unparse(node))
        return CONSTANTS.get(name.group(1), "...") if name else "..."
    if isinstance(node, ast.BinOp):
        return template(node.left) + template(node.right)
    return "..."


def raised() -> list[str]:
    """Messages of every `raise`, each with words of its own."""
    found = []
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args):
                continue
            kind = ast.unparse(node.exc.func)
            text = template(node.exc.args[0])
            if (kind in RAISED_FOR_USERS or kind.endswith("Error")) and re.search("[a-z]{3}", text):
                found.append(text)
    return sorted(set(found))


def test_there_are_many_messages() -> None:
    assert len(raised()) > 200


ANY_ARGUMENT = re.compile(r"\.\.\. must( \w+)+ \.\.\.(, got \.\.\.)?")
"""Forms that fit any argument; of a card, which nobody typed, "give such a one" is no advice."""


@pytest.mark.parametrize("message", raised())
def test_a_message_has_a_form_on_the_page(message: str) -> None:
    known = [form for form in messages() if "card" not in message or not ANY_ARGUMENT.fullmatch(form)]
    forms = [".*".join(re.escape(part.strip(" :,;'")) for part in form.split("...")) for form in known]
    assert any(re.search(form, message, re.DOTALL) for form in forms), "say on the page what to do"
